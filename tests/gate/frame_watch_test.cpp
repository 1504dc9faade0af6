#include "server/gate/frame_watch.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/gate/frames.h"

namespace sightline {
namespace {

using test::call;
using test::frame;
using test::kPreface;

std::optional<std::string_view> read(FrameWatch& watch, const std::string& bytes, double now_s = 1.0) {
  return watch.read(std::as_bytes(std::span(bytes)), now_s);
}

// A client that has greeted.
FrameWatch greeted(const FrameLimits& limits = {}) {
  FrameWatch watch(limits);
  EXPECT_FALSE(read(watch, test::greeting()));
  return watch;
}

TEST(FrameWatch, CountsCallsHoweverTheBytesAreCut) {
  std::string all = kPreface + frame(4, 0, 0, 12);
  for (uint32_t n = 0; n < 20; ++n) all += call(n) + frame(0, 0, 2 * n + 1, 100 * n) + frame(8, 0, 0, 4);
  for (size_t part = 1; part < 40; ++part) {
    FrameWatch watch;
    for (size_t at = 0; at < all.size(); at += part) ASSERT_FALSE(read(watch, all.substr(at, part)));
    EXPECT_EQ(watch.calls(), 20u);
  }
}

TEST(FrameWatch, AnotherProtocolIsCut) {
  FrameWatch watch;
  EXPECT_EQ(read(watch, "GET / HTTP/1.1\r\n"), "it does not speak HTTP/2");
  EXPECT_FALSE(watch.greeted());
}

TEST(FrameWatch, OnlyAFloodIsOne) {
  FrameWatch other, fast = greeted({.calls_burst = 1, .calls_per_s = 1});
  EXPECT_TRUE(read(other, "GET / HTTP/1.1\r\n"));
  EXPECT_FALSE(other.flooded());
  EXPECT_FALSE(read(fast, call(0)));
  EXPECT_TRUE(read(fast, call(1)));
  EXPECT_TRUE(fast.flooded());
}

TEST(FrameWatch, TheConnectionsOfAClientShareALimit) {
  const FrameLimits limits{.client_burst = 1000, .client_per_s = 100};
  const auto client = std::make_shared<ClientFlow>(limits);
  std::vector<FrameWatch> watches(10, FrameWatch(limits, client));
  for (FrameWatch& watch : watches) ASSERT_FALSE(read(watch, test::greeting()));
  // Each does half of what one connection may do.
  size_t cut = 0;
  for (uint32_t number = 0; number < 500; ++number)
    for (FrameWatch& watch : watches)
      if (!watch.flooded()) cut += read(watch, call(number)).has_value();
  EXPECT_EQ(cut, watches.size());
  // A connection that does little is not cut for what the others did.
  FrameWatch calm(limits, client);
  EXPECT_FALSE(read(calm, test::greeting() + call(0) + frame(3, 0, 1, 4)));
}

TEST(FrameWatch, CallsPassAtTheirRateAndNoFaster) {
  FrameWatch watch = greeted({.calls_burst = 10, .calls_per_s = 5});
  uint32_t number = 0;
  for (int i = 0; i < 10; ++i) ASSERT_FALSE(read(watch, call(number++)));
  for (int second = 2; second < 60; ++second)
    for (int i = 0; i < 5; ++i) ASSERT_FALSE(read(watch, call(number++), second)) << second;
  EXPECT_EQ(read(watch, call(number++), 59.1), "it opens calls too fast");
}

// Trailing headers of a call that is open begin no other one.
TEST(FrameWatch, HeadersOfAnOldCallAreNoNewOne) {
  FrameWatch watch = greeted();
  EXPECT_FALSE(read(watch, call(3) + call(2) + call(3)));
  EXPECT_EQ(watch.calls(), 1u);
}

TEST(FrameWatch, ResetsAndEmptyFramesCutTheConnection) {
  for (const std::string& idle : {frame(3, 0, 1, 4), frame(4, 0, 0, 0), frame(2, 0, 1, 5), frame(0, 0, 1, 0)}) {
    FrameWatch watch = greeted({.idle_frames_burst = 11, .idle_frames_per_s = 1});
    for (int i = 0; i < 10; ++i) ASSERT_FALSE(read(watch, idle));
    EXPECT_TRUE(read(watch, idle));
  }
}

TEST(FrameWatch, FullDataAndTheEndOfACallAreFree) {
  FrameWatch watch = greeted({.idle_frames_burst = 2, .idle_frames_per_s = 0});
  for (int i = 0; i < 100; ++i) ASSERT_FALSE(read(watch, frame(0, 0, 1, 20) + frame(0, 1, 1, 0)));
}

TEST(FrameWatch, AHeaderBlockIsBoundedOverAllItsFrames) {
  FrameWatch watch = greeted({.max_header_block_bytes = 100});
  EXPECT_FALSE(read(watch, frame(1, 0, 1, 60) + frame(9, 4, 1, 40)));
  EXPECT_FALSE(read(watch, frame(1, 4, 3, 100)));
  EXPECT_EQ(read(watch, frame(1, 0, 5, 60) + frame(9, 0, 5, 41)), "the headers of a call are too long");
}

TEST(FrameWatch, AFrameThatWasNeverAskedForIsCut) {
  FrameWatch watch = greeted({.max_frame_bytes = 1000});
  EXPECT_FALSE(read(watch, frame(0, 0, 1, 1000)));
  EXPECT_EQ(read(watch, frame(0, 0, 1, 1001)), "a frame is too long");
}

}  // namespace
}  // namespace sightline
