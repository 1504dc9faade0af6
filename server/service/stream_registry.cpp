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

void StreamRegistry::insert(const std::shared_ptr<Drainable>& stream, const std::string& client, bool waiting) {
  ++of_client_[client].of(waiting);
  places_ += waiting ? 0 : 1;
  streams_.emplace(stream.get(), Entry{stream, client, waiting});
}

void StreamRegistry::erase(Entries::iterator entry) {
  const auto own = of_client_.find(entry->second.client);
  --own->second.of(entry->second.waiting);
  places_ -= entry->second.waiting ? 0 : 1;
  if (own->second.places + own->second.waiting == 0) of_client_.erase(own);
  streams_.erase(entry);
}

Admission StreamRegistry::add(const std::shared_ptr<Drainable>& stream, const std::string& client) {
  const MutexLock lock(mutex_);
  if (draining_) return Admission::kDraining;
  if (places_ >= max_streams_) return Admission::kFull;
  const auto own = of_client_.find(client);
  if (own != of_client_.end() && own->second.places >= max_per_client_) return Admission::kClientFull;
  insert(stream, client, false);
  return Admission::kAdmitted;
}

bool StreamRegistry::add_waiting(const std::shared_ptr<Drainable>& stream, const std::string& client) {
  const MutexLock lock(mutex_);
  const auto own = of_client_.find(client);
  if (draining_ || own == of_client_.end() || own->second.waiting >= own->second.places) return false;
  insert(stream, client, true);
  return true;
}

void StreamRegistry::remove(const Drainable* stream) {
  const MutexLock lock(mutex_);
  if (const auto entry = streams_.find(stream); entry != streams_.end()) erase(entry);
}

bool StreamRegistry::move_place(const Drainable* from, const std::shared_ptr<Drainable>& to) {
  const MutexLock lock(mutex_);
  const auto former = streams_.find(from);
  if (draining_ || former == streams_.end()) return false;
  const std::string client = former->second.client;
  erase(former);
  if (const auto own = streams_.find(to.get()); own != streams_.end()) erase(own);
  insert(to, client, false);
  return true;
}

// Returns a copy, so that no stream is called or destroyed under the registry's lock.
std::vector<std::shared_ptr<Drainable>> StreamRegistry::alive() const {
  const MutexLock lock(mutex_);
  std::vector<std::shared_ptr<Drainable>> streams;
  for (const auto& [address, entry] : streams_) {
    if (std::shared_ptr<Drainable> stream = entry.stream.lock()) streams.push_back(std::move(stream));
  }
  return streams;
}

void StreamRegistry::drain(const std::string& reason) {
  {
    const MutexLock lock(mutex_);
    draining_ = true;
  }
  for (const auto& stream : alive()) stream->drain(reason);
}

void StreamRegistry::end_all(const grpc::Status& status) {
  for (const auto& stream : alive()) stream->end(status);
}

size_t StreamRegistry::end_unless(const std::function<bool(const std::string& client)>& may_stay,
                                  const grpc::Status& status) {
  std::vector<std::shared_ptr<Drainable>> ended;
  {
    const MutexLock lock(mutex_);
    for (const auto& [address, entry] : streams_)
      if (!may_stay(entry.client))
        if (std::shared_ptr<Drainable> stream = entry.stream.lock()) ended.push_back(std::move(stream));
  }
  for (const auto& stream : ended) stream->end(status);
  return ended.size();
}

size_t StreamRegistry::size() const {
  const MutexLock lock(mutex_);
  return places_;
}

}  // namespace sightline
