#include "server/base/hash.h"

#include <gtest/gtest.h>

#include <array>
#include <string_view>

namespace sightline {
namespace {

std::span<const std::byte> bytes(std::string_view text) {
  return std::as_bytes(std::span(text));
}

// The value of xxhsum -H2 on no input.
TEST(Hash, EmptyInputHasThePublishedValue) {
  EXPECT_EQ(to_hex(hash_bytes({})), "99aa06d3014798d86001c324468d497f");
  EXPECT_EQ(hash64_bytes({}), 0x2d06800538d394c2u);
}

TEST(Hash, HexIsReadBackUnchanged) {
  for (const std::string_view text : {"", "a", "sightline"}) {
    const ContentHash hash = hash_bytes(bytes(text));
    ContentHash read;
    ASSERT_TRUE(from_hex(to_hex(hash), read));
    EXPECT_EQ(read, hash);
  }
  ContentHash small;
  ASSERT_TRUE(from_hex("00000000000000010000000000000002", small));
  EXPECT_EQ(small, (ContentHash{1, 2}));
  EXPECT_EQ(to_hex(small), "00000000000000010000000000000002");
}

TEST(Hash, AnythingButThirtyTwoDigitsIsRefusedAndLeavesTheValue) {
  for (const char* text :
       {"", "0123456789abcdef0123456789abcde", "0123456789abcdef0123456789abcdef0", "-123456789abcdef0123456789abcdef",
        "0x23456789abcdef0123456789abcdef", "0123456789abcdef 123456789abcdef", "0123456789abcdef0123456789abcdeg"}) {
    ContentHash hash{7, 8};
    EXPECT_FALSE(from_hex(text, hash)) << text;
    EXPECT_EQ(hash, (ContentHash{7, 8}));
  }
}

TEST(Hash, OneBitOrTheSeedChangesIt) {
  std::array<std::byte, 40> data{};
  const uint64_t before = hash64_bytes(data);
  EXPECT_NE(hash64_bytes(data, 1), before);
  data[39] = std::byte{1};
  EXPECT_NE(hash64_bytes(data), before);
}

}  // namespace
}  // namespace sightline
