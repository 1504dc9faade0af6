#include "server/base/hash.h"

#include <xxhash.h>

#include <charconv>
#include <cstdio>

namespace sightline {

ContentHash hash_bytes(std::span<const std::byte> bytes) {
  const XXH128_hash_t h = XXH3_128bits(bytes.data(), bytes.size());
  return {h.high64, h.low64};
}

uint64_t hash64_bytes(std::span<const std::byte> bytes, uint64_t seed) {
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), seed);
}

std::string to_hex(const ContentHash& hash) {
  char text[33];
  std::snprintf(text, sizeof text, "%016llx%016llx", static_cast<unsigned long long>(hash.high),
                static_cast<unsigned long long>(hash.low));
  return text;
}

bool from_hex(const std::string& text, ContentHash& hash) {
  if (text.size() != 32) return false;
  ContentHash parsed;
  const char* begin = text.data();
  const auto high = std::from_chars(begin, begin + 16, parsed.high, 16);
  const auto low = std::from_chars(begin + 16, begin + 32, parsed.low, 16);
  if (high.ptr != begin + 16 || low.ptr != begin + 32) return false;
  hash = parsed;
  return true;
}

}  // namespace sightline
