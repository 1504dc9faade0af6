// Hashes that identify data (XXH3, 128 bits: https://xxhash.com). They are no defence against forgery.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace sightline {

struct ContentHash {
  uint64_t high = 0;
  uint64_t low = 0;
  auto operator<=>(const ContentHash&) const = default;
};

ContentHash hash_bytes(std::span<const std::byte> bytes);
uint64_t hash64_bytes(std::span<const std::byte> bytes, uint64_t seed = 0);

// 32 lower-case hexadecimal digits, high half first.
std::string to_hex(const ContentHash& hash);
// False when `text` is not exactly 32 hexadecimal digits; `hash` is then untouched.
bool from_hex(const std::string& text, ContentHash& hash);

}  // namespace sightline

template <>
struct std::hash<sightline::ContentHash> {
  size_t operator()(const sightline::ContentHash& h) const noexcept { return h.high ^ h.low; }
};
