#include "server/record/record_ring.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace sightline {
namespace {

// A size that marks the rest of the ring, up to its end, as unused.
constexpr uint32_t kWrap = ~uint32_t{0};

uint64_t padded(uint64_t size) {
  return (size + 7) & ~uint64_t{7};
}

}  // namespace

RecordRing::RecordRing(size_t capacity_bytes)
    : capacity_(std::bit_ceil(std::max<size_t>(capacity_bytes, 4096))), bytes_(new char[capacity_]) {}

char* RecordRing::reserve(size_t size) {
  if (size > max_message()) return nullptr;
  const uint64_t needed = sizeof(RecordHead) + padded(size);
  uint64_t at = written_.load(std::memory_order_relaxed);
  const uint64_t to_end = capacity_ - (at & (capacity_ - 1));
  const uint64_t skipped = needed <= to_end ? 0 : to_end;
  if (at + skipped + needed - known_read_ > capacity_) known_read_ = read_.load(std::memory_order_acquire);
  if (at + skipped + needed - known_read_ > capacity_) return nullptr;
  if (skipped > 0) std::memcpy(bytes_.get() + (at & (capacity_ - 1)), &kWrap, sizeof kWrap);
  reserved_at_ = at + skipped;
  return bytes_.get() + (reserved_at_ & (capacity_ - 1)) + sizeof(RecordHead);
}

void RecordRing::commit(const RecordHead& head) {
  std::memcpy(bytes_.get() + (reserved_at_ & (capacity_ - 1)), &head, sizeof head);
  written_.store(reserved_at_ + sizeof head + padded(head.size), std::memory_order_release);
}

bool RecordRing::front(RecordEntry& out) {
  uint64_t at = read_.load(std::memory_order_relaxed);
  if (at == known_written_) known_written_ = written_.load(std::memory_order_acquire);
  if (at == known_written_) return false;
  const char* start = bytes_.get() + (at & (capacity_ - 1));
  uint32_t size = 0;
  std::memcpy(&size, start, sizeof size);
  if (size == kWrap) {
    at += capacity_ - (at & (capacity_ - 1));
    start = bytes_.get();
  }
  std::memcpy(&out.head, start, sizeof out.head);
  out.message = {start + sizeof out.head, out.head.size};
  front_end_ = at + sizeof out.head + padded(out.head.size);
  return true;
}

void RecordRing::pop() {
  read_.store(front_end_, std::memory_order_release);
}

bool RecordRing::half_full() {
  // The consumer's cache line is read only when the last known value does not already prove that the ring is less than
  // half full.
  const uint64_t written = written_.load(std::memory_order_relaxed);
  if (written - known_read_ > capacity_ / 2) known_read_ = read_.load(std::memory_order_acquire);
  return written - known_read_ > capacity_ / 2;
}

}  // namespace sightline
