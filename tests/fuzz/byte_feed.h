// The bytes of a fuzzer's input as values, one after another. Beyond the end every value is 0.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>

namespace sightline::test {

class ByteFeed {
 public:
  ByteFeed(const uint8_t* data, size_t size) : left_(data, size) {}

  bool empty() const { return left_.empty(); }
  uint8_t byte() { return take<uint8_t>(); }
  // Any bits, those of numbers that are not finite as well.
  template <typename T>
  T take() {
    T value{};
    const auto bytes = this->bytes(sizeof value);
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), bytes.size());
    return value;
  }
  // The next `count` bytes, or fewer at the end.
  std::span<const uint8_t> bytes(size_t count) {
    const auto taken = left_.first(std::min(count, left_.size()));
    left_ = left_.subspan(taken.size());
    return taken;
  }

 private:
  std::span<const uint8_t> left_;
};

}  // namespace sightline::test
