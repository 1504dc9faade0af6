#include "server/service/stream_registry.h"

namespace sightline {

std::string to_string(Admission admission) {
  switch (admission) {
    case Admission::kAdmitted:
      return "admitted";
    case Admission::kFull:
      return "full";
    case Admission::kClientFull:
      return "client full";
    case Admission::kDraining:
      break;
  }
  return "draining";
}

Admission StreamRegistry::add(const std::shared_ptr<Drainable>& stream, const std::string& client) {
  const std::lock_guard lock(mutex_);
  if (draining_) return Admission::kDraining;
  if (streams_.size() >= max_streams_) return Admission::kFull;
  const auto own = of_client_.find(client);
  if (own != of_client_.end() && own->second >= max_per_client_) return Admission::kClientFull;
  ++of_client_[client];
  streams_.emplace(stream.get(), Entry{stream, client});
  return Admission::kAdmitted;
}

void StreamRegistry::remove(const Drainable* stream) {
  const std::lock_guard lock(mutex_);
  const auto entry = streams_.find(stream);
  if (entry == streams_.end()) return;
  const auto own = of_client_.find(entry->second.client);
  if (--own->second == 0) of_client_.erase(own);
  streams_.erase(entry);
}

// Returns a copy, so that no stream is called or destroyed under the registry's lock.
std::vector<std::shared_ptr<Drainable>> StreamRegistry::alive() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<Drainable>> streams;
  for (const auto& [address, entry] : streams_) {
    if (std::shared_ptr<Drainable> stream = entry.stream.lock()) streams.push_back(std::move(stream));
  }
  return streams;
}

void StreamRegistry::drain(const std::string& reason) {
  {
    const std::lock_guard lock(mutex_);
    draining_ = true;
  }
  for (const auto& stream : alive()) stream->drain(reason);
}

void StreamRegistry::end_all(const grpc::Status& status) {
  for (const auto& stream : alive()) stream->end(status);
}

size_t StreamRegistry::end_unless(const std::function<bool(const std::string& client)>& may_stay, const grpc::Status& status) {
  std::vector<std::shared_ptr<Drainable>> ended;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [address, entry] : streams_)
      if (!may_stay(entry.client))
        if (std::shared_ptr<Drainable> stream = entry.stream.lock()) ended.push_back(std::move(stream));
  }
  for (const auto& stream : ended) stream->end(status);
  return ended.size();
}

size_t StreamRegistry::size() const {
  const std::lock_guard lock(mutex_);
  return streams_.size();
}

}  // namespace sightline
