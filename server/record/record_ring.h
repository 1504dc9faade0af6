// A lock-free queue of serialised messages from one thread to another, in a ring of bytes. The producer never waits. A
// message is serialised straight into the ring.
//
//   producer: char* at = ring.reserve(size);  if (at) { fill; ring.commit(head); }
//   consumer: while (const RecordEntry* e = ring.front()) { ...; ring.pop(); }
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string_view>

namespace sightline {

struct RecordHead {
  uint32_t size = 0;  // of the message, bytes
  uint16_t topic = 0;
  uint16_t beside = 0;  // 1: the message is in LargeMessages (record_session.h)
  uint32_t sequence = 0;
  uint32_t unused2 = 0;
  uint64_t log_time_ns = 0;
  uint64_t publish_time_ns = 0;
};
static_assert(sizeof(RecordHead) == 32);

struct RecordEntry {
  RecordHead head;
  std::string_view message;  // until pop()
};

// One producer at a time and one consumer at a time; each side may change threads when something else orders the calls.
class RecordRing {
 public:
  // Rounded up to a power of two, at least 4096. Pages are touched only as they are first used.
  explicit RecordRing(size_t capacity_bytes);

  // Room for a message of `size` bytes, in one piece; null when there is none now. A message over max_message() never
  // fits.
  char* reserve(size_t size);
  // Hands over what was reserved last; `head.size` may be less than was reserved.
  void commit(const RecordHead& head);

  // The oldest message; false: none now.
  bool front(RecordEntry& out);
  void pop();

  size_t capacity() const { return capacity_; }
  size_t max_message() const { return capacity_ / 2 - sizeof(RecordHead); }
  // By the producer: more than half of it is taken.
  bool half_full();

 private:
  const size_t capacity_;
  const std::unique_ptr<char[]> bytes_;

  // Both count bytes since the start. Each is in its own cache line.
  alignas(64) std::atomic<uint64_t> written_{0};
  uint64_t known_read_ = 0;   // producer's
  uint64_t reserved_at_ = 0;  // producer's
  alignas(64) std::atomic<uint64_t> read_{0};
  uint64_t known_written_ = 0;  // consumer's
  uint64_t front_end_ = 0;      // consumer's
};

}  // namespace sightline
