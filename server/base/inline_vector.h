// A list of at most N values, stored in the object itself: it never allocates, and copying it copies the values.
#pragma once

#include <array>
#include <cassert>
#include <cstddef>

namespace sightline {

template <typename T, size_t N>
class InlineVector {
 public:
  using value_type = T;
  using iterator = T*;
  using const_iterator = const T*;
  static constexpr size_t kMost = N;

  // Precondition: size() < N.
  void push_back(const T& value) {
    assert(size_ < N);
    values_[size_++] = value;
  }
  // Growing again brings back values that shrinking removed, unchanged, so that their memory is reused.
  void resize(size_t size) {
    assert(size <= N);
    size_ = size;
  }
  void clear() { size_ = 0; }

  size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T& operator[](size_t i) { return values_[i]; }
  const T& operator[](size_t i) const { return values_[i]; }
  iterator begin() { return values_.data(); }
  iterator end() { return values_.data() + size_; }
  const_iterator begin() const { return values_.data(); }
  const_iterator end() const { return values_.data() + size_; }

 private:
  std::array<T, N> values_{};
  size_t size_ = 0;
};

}  // namespace sightline
