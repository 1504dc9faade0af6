// Writes objects as bytes and reads them back, field by field. `Fields` lists the fields of every class:
//
//   struct MyFields {
//     template <typename Archive, SameAs<Motion> T>   // Motion or const Motion
//     static void each(Archive& archive, T& motion) {
//       auto& [position, speed] = motion;             // a field that is missing here does not compile
//       archive(position, speed);
//     }
//   };
//   FieldWriter<MyFields>{out}(motion);
//   FieldReader<MyFields> in(bytes);  in(motion);  if (in.failed()) ...
//
// Numbers are stored as they are in memory (little-endian), lists with their length. Bytes may come from anywhere: a
// reader allocates no more than a small multiple of their size, and refuses numbers that are not finite.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "server/base/hash.h"
#include "server/base/inline_vector.h"

namespace sightline {

static_assert(std::endian::native == std::endian::little, "the bytes are defined as little-endian");

template <typename T, typename Named>
concept SameAs = std::same_as<std::remove_const_t<T>, Named>;

namespace field_archive {

template <typename T>
concept Number = std::is_arithmetic_v<T> || std::is_enum_v<T>;
// GLM's vectors and quaternions.
template <typename T>
concept Components = requires(const T& t) {
  typename T::value_type;
  {T::length()};
  { t[0] } -> std::convertible_to<typename T::value_type>;
}
&&std::is_trivially_copyable_v<T>;

template <typename T>
inline constexpr bool kIsVector = false;
template <typename T>
inline constexpr bool kIsVector<std::vector<T>> = true;
template <typename T>
inline constexpr bool kIsOptional = false;
template <typename T>
inline constexpr bool kIsOptional<std::optional<T>> = true;
template <typename T>
inline constexpr bool kIsArray = false;
template <typename T, size_t N>
inline constexpr bool kIsArray<std::array<T, N>> = true;
template <typename T>
inline constexpr bool kIsInlineVector = false;
template <typename T, size_t N>
inline constexpr bool kIsInlineVector<InlineVector<T, N>> = true;

}  // namespace field_archive

// Appends to `out`.
template <typename Fields>
class FieldWriter {
 public:
  explicit FieldWriter(std::string& out) : out_(out) {}

  template <typename... T>
  void operator()(const T&... items) {
    (item(items), ...);
  }

 private:
  template <typename T>
  void item(const T& value) {
    namespace fa = field_archive;
    if constexpr (fa::Number<T>) {
      out_.append(reinterpret_cast<const char*>(&value), sizeof value);
    } else if constexpr (fa::kIsVector<T> || fa::kIsInlineVector<T>) {
      item(uint64_t{value.size()});
      for (size_t i = 0; i < value.size(); ++i) item(value[i]);
    } else if constexpr (fa::kIsOptional<T>) {
      item(value.has_value());
      if (value) item(*value);
    } else if constexpr (fa::kIsArray<T>) {
      for (const auto& element : value) item(element);
    } else if constexpr (fa::Components<T>) {
      for (int i = 0; i < static_cast<int>(T::length()); ++i) item(value[i]);
    } else {
      Fields::each(*this, value);
    }
  }

  std::string& out_;
};

// After a failure the objects that were read are unspecified.
template <typename Fields>
class FieldReader {
 public:
  explicit FieldReader(std::string_view bytes) : rest_(bytes) {}

  template <typename... T>
  void operator()(T&... items) {
    (item(items), ...);
  }
  // Something did not fit; every later read changes nothing.
  bool failed() const { return failed_; }
  void fail() { failed_ = true; }
  bool at_end() const { return rest_.empty(); }

 private:
  template <typename T>
  void item(T& value) {
    namespace fa = field_archive;
    if (failed_) return;
    if constexpr (fa::Number<T>) {
      number(value);
    } else if constexpr (fa::kIsVector<T>) {
      const uint64_t size = list_size(rest_.size());
      value.clear();
      value.resize(size);
      for (size_t i = 0; i < size && !failed_; ++i) item(value[i]);
    } else if constexpr (fa::kIsInlineVector<T>) {
      const uint64_t size = list_size(T::kMost);
      value.resize(size);
      for (size_t i = 0; i < size; ++i) item(value[i]);
    } else if constexpr (fa::kIsOptional<T>) {
      bool has = false;
      item(has);
      value.reset();
      if (has) item(value.emplace());
    } else if constexpr (fa::kIsArray<T>) {
      for (auto& element : value) item(element);
    } else if constexpr (fa::Components<T>) {
      for (int i = 0; i < static_cast<int>(T::length()); ++i) item(value[i]);
    } else {
      Fields::each(*this, value);
    }
  }

  template <typename T>
  void number(T& value) {
    if (rest_.size() < sizeof value) return fail();
    if constexpr (std::same_as<T, bool>) {
      if (static_cast<unsigned char>(rest_.front()) > 1) return fail();
    }
    std::memcpy(&value, rest_.data(), sizeof value);
    if constexpr (std::is_floating_point_v<T>) {
      if (!std::isfinite(value)) return fail();
    }
    rest_.remove_prefix(sizeof value);
  }

  // 0 on failure. Every element takes at least one byte.
  uint64_t list_size(uint64_t most) {
    uint64_t size = 0;
    number(size);
    if (!failed_ && (size > most || size > rest_.size())) fail();
    return failed_ ? 0 : size;
  }

  std::string_view rest_;
  bool failed_ = false;
};

// A number for the kinds and the order of all fields: bytes of another layout cannot be read.
template <typename Fields>
class FieldLayout {
 public:
  template <typename... T>
  void operator()(const T&... items) {
    (item(items), ...);
  }
  uint64_t number() const { return hash64_bytes(std::as_bytes(std::span(kinds_))); }

 private:
  template <typename T>
  void item(const T& value) {
    namespace fa = field_archive;
    if constexpr (fa::Number<T>) {
      note(std::is_floating_point_v<T> ? 'f' : 'i', sizeof value);
    } else if constexpr (fa::kIsVector<T> || fa::kIsOptional<T> || fa::kIsInlineVector<T>) {
      note('n', 0);
      element<typename T::value_type>();
    } else if constexpr (fa::kIsArray<T>) {
      note('a', value.size());
      element<typename T::value_type>();
    } else if constexpr (fa::Components<T>) {
      note('c', static_cast<size_t>(T::length()));
      item(value[0]);
    } else {
      note('(', 0);
      Fields::each(*this, value);
      note(')', 0);
    }
  }
  template <typename T>
  void element() {
    const T value = T();
    item(value);
  }
  void note(char kind, size_t size) {
    kinds_.push_back(kind);
    kinds_.append(std::to_string(size));
  }

  std::string kinds_;
};

}  // namespace sightline
