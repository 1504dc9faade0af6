// The memory of the messages that wait in the inboxes of all streams.
//
// Each inbox has bounds of its own (inbox.h), but with many streams they allow gigabytes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <mutex>
#include <string>

namespace sightline {

// One client has at most half of it, so that others can send large messages too. Thread-safe.
class MessageMemory {
 public:
  explicit MessageMemory(size_t max_bytes) : max_bytes_(max_bytes) {}

  // The most that a further message of this client may take.
  size_t room(const std::string& client) const {
    const std::lock_guard lock(mutex_);
    const auto own = of_client_.find(client);
    const size_t used = own == of_client_.end() ? 0 : own->second;
    return std::min(max_bytes_ - std::min(max_bytes_, bytes_), max_bytes_ / 2 - std::min(max_bytes_ / 2, used));
  }
  // More than there should be waits: streams with something to do read nothing more.
  bool over() const {
    const std::lock_guard lock(mutex_);
    return bytes_ >= max_bytes_;
  }
  void add(const std::string& client, size_t bytes) {
    const std::lock_guard lock(mutex_);
    of_client_[client] += bytes;
    bytes_ += bytes;
  }
  void remove(const std::string& client, size_t bytes) {
    const std::lock_guard lock(mutex_);
    const auto own = of_client_.find(client);
    if (own == of_client_.end()) return;
    bytes_ -= bytes;
    own->second -= bytes;
    if (own->second == 0) of_client_.erase(own);
  }
  size_t max_bytes() const { return max_bytes_; }

 private:
  const size_t max_bytes_;
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  size_t bytes_ = 0;
  std::map<std::string, size_t> of_client_;
};

}  // namespace sightline
