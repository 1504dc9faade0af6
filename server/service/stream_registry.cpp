#include "server/service/stream_registry.h"

namespace sightline {

Admission StreamRegistry::add(const std::shared_ptr<Drainable>& stream) {
  const std::lock_guard lock(mutex_);
  if (draining_) return Admission::kDraining;
  if (streams_.size() >= max_streams_) return Admission::kFull;
  streams_.emplace(stream.get(), stream);
  return Admission::kAdmitted;
}

void StreamRegistry::remove(const Drainable* stream) {
  const std::lock_guard lock(mutex_);
  streams_.erase(stream);
}

// Returns a copy, so that no stream is called or destroyed under the registry's lock.
std::vector<std::shared_ptr<Drainable>> StreamRegistry::alive() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<Drainable>> streams;
  for (const auto& [address, weak] : streams_) {
    if (std::shared_ptr<Drainable> stream = weak.lock()) streams.push_back(std::move(stream));
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

size_t StreamRegistry::size() const {
  const std::lock_guard lock(mutex_);
  return streams_.size();
}

}  // namespace sightline
