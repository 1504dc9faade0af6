// The memory of the messages that wait in the inboxes of all streams.
//
// Each inbox has bounds of its own (inbox.h), but with many streams they allow gigabytes.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <map>
#include <memory>
#include <string>

#include "server/base/mutex.h"

namespace sightline {

// One client has at most half of it, so that others can send large messages too. Thread-safe. Counting takes no lock,
// since it happens for each message.
class MessageMemory {
 public:
  // What the messages of one client take. It belongs to the streams of the client, and must not outlive the
  // MessageMemory.
  class Share {
   public:
    explicit Share(MessageMemory& all) : all_(all) {}
    // Bytes that a message takes from now on, or no longer.
    void add(size_t bytes) { own_ += bytes, all_.bytes_ += bytes; }
    void remove(size_t bytes) { own_ -= bytes, all_.bytes_ -= bytes; }
    // The most bytes that a further message of this client may take.
    size_t room() const {
      const size_t max = all_.max_bytes_;
      return std::min(max - std::min(max, all_.bytes_.load()), max / 2 - std::min(max / 2, own_.load()));
    }
    // More than there should be waits: streams with something to do read nothing more.
    bool all_over() const { return all_.over(); }

   private:
    MessageMemory& all_;
    std::atomic<size_t> own_{0};
  };

  explicit MessageMemory(size_t max_bytes) : max_bytes_(max_bytes) {}

  // The share of a client, by its name; the same one for all its streams.
  std::shared_ptr<Share> of(const std::string& client) {
    const MutexLock lock(mutex_);
    std::erase_if(shares_, [](const auto& entry) { return entry.second.expired(); });
    std::weak_ptr<Share>& known = shares_[client];
    std::shared_ptr<Share> share = known.lock();
    if (!share) known = share = std::make_shared<Share>(*this);
    return share;
  }
  bool over() const { return bytes_.load() >= max_bytes_; }

 private:
  const size_t max_bytes_;
  std::atomic<size_t> bytes_{0};
  Mutex mutex_;
  std::map<std::string, std::weak_ptr<Share>> shares_ GUARDED(mutex_);  // by client
};

}  // namespace sightline
