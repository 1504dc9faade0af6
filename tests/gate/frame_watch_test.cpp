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
using test::message;
using test::window_update;

std::optional<std::string_view> read(FrameWatch& watch, const std::string& bytes, double now_s = 1.0) {
  return watch.read(std::as_bytes(std::span(bytes)), now_s);
}
void answer(FrameWatch& watch, const std::string& bytes, double now_s = 1.0) {
  watch.read_answers(std::as_bytes(std::span(bytes)), now_s);
}

// A client that has greeted.
FrameWatch greeted(const FrameLimits& limits = {}) {
  FrameWatch watch(limits);
  EXPECT_FALSE(read(watch, test::greeting()));
  return watch;
}

// gRPC reads every field before it refuses headers that are too long.
TEST(FrameWatch, LongHeadersCountAsSeveralCallsForThePace) {
  FrameLimits limits;
  limits.paced_burst = 8, limits.bytes_of_paced = 1000;
  FrameWatch watch = greeted(limits);
  const auto counts = [&](const std::string& bytes) {
    EXPECT_EQ(watch.read_until_call(std::as_bytes(std::span(bytes)), 1.0), bytes.size());
    return watch.paced_calls();
  };
  EXPECT_EQ(counts(call(0, 100)), 1);
  EXPECT_EQ(counts(call(1, 1000)), 1);
  EXPECT_EQ(counts(call(2, 3500)), 3.5);
  EXPECT_EQ(counts(call(3, 12'000)), 8) << "a whole burst at most";
  EXPECT_EQ(counts(frame(1, 0, 9, 500)), 1) << "headers without their end";
  EXPECT_EQ(counts(frame(9, 0, 9, 2000)), 2) << "that go on";
  EXPECT_EQ(counts(frame(9, 4, 9, 0)), 0);
  EXPECT_EQ(counts(frame(1, 5, 9, 500)), 0) << "trailers";
  EXPECT_EQ(counts(frame(0, 0, 9, 5000)), 0) << "no headers";
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

// Whatever its type, its flags and its stream: it counts as soon as it carries no part of a call.
TEST(FrameWatch, EveryFrameThatCarriesNothingCutsTheConnectionInTime) {
  for (int type = 0; type < 256; ++type)
    for (const int flags : {0, 1, 4, 5, 8, 255})
      for (const uint32_t stream : {0u, 1u, 2u, 99u}) {
        FrameWatch watch = greeted({.overhead_burst = 12, .overhead_per_s = 1, .max_header_block_bytes = 1 << 20});
        ASSERT_FALSE(read(watch, call(0) + call(50)));  // 1 and 101
        bool cut = false;
        for (int i = 0; i < 14 && !cut; ++i)
          cut = read(watch, frame(static_cast<uint8_t>(type), static_cast<uint8_t>(flags), stream, 1)).has_value();
        EXPECT_TRUE(cut && watch.flooded()) << type << ' ' << flags << ' ' << stream;
      }
}

TEST(FrameWatch, BytesThatBelongToNoMessageCountToo) {
  for (const uint8_t type : {0, 1, 4, 7, 77}) {
    FrameWatch watch = greeted({.overhead_burst = 10, .overhead_per_s = 0, .bytes_of_overhead = 100});
    EXPECT_FALSE(read(watch, frame(type, 4, 0, 600))) << int{type};
    EXPECT_TRUE(read(watch, frame(type, 4, 0, 600))) << int{type};
  }
}

TEST(FrameWatch, MessagesAndTheEndOfACallAreFree) {
  FrameWatch watch = greeted({.overhead_burst = 6, .overhead_per_s = 0});
  for (uint32_t n = 0; n < 100; ++n)
    ASSERT_FALSE(
        read(watch, call(n) + frame(0, 0, 2 * n + 1, message(20)) + frame(8, 0, 0, 4) + frame(0, 1, 2 * n + 1, 0)));
}

TEST(FrameWatch, AMessageOfManyFramesIsFreeWhenTheyAreNotTiny) {
  for (const size_t piece : {1, 100, 1024, 16384}) {
    FrameWatch watch = greeted();
    ASSERT_FALSE(read(watch, call(0) + frame(0, 0, 1, message(3'000'000, 0))));
    bool cut = false;
    for (size_t sent = 0; sent < 3'000'000 && !cut; sent += piece) cut = read(watch, frame(0, 0, 1, piece)).has_value();
    EXPECT_EQ(cut, piece < 1000) << piece;
  }
}

TEST(FrameWatch, TheAnswersOfTheServerMakeRoomForPingsAndWindows) {
  for (const bool answered : {false, true}) {
    FrameWatch watch = greeted({.overhead_burst = 20, .overhead_per_s = 0});
    ASSERT_FALSE(read(watch, call(0)));
    bool cut = false;
    for (int i = 0; i < 100 && !cut; ++i) {
      if (answered) answer(watch, frame(0, 0, 1, 200));
      cut = read(watch, frame(8, 0, 0, 4) + frame(8, 0, 1, 4) + frame(6, 0, 0, 8)).has_value();
    }
    EXPECT_EQ(cut, !answered);
  }
}

// Otherwise each ping would pay for the next ones.
TEST(FrameWatch, TheServersAcknowledgementsMakeRoomForNothing) {
  FrameWatch watch = greeted({.overhead_burst = 20, .overhead_per_s = 0});
  bool cut = false;
  for (int i = 0; i < 30 && !cut; ++i) {
    cut = read(watch, frame(6, 0, 0, 8)).has_value();
    answer(watch, frame(6, 1, 0, 8) + frame(4, 1, 0, 0) + frame(3, 0, 1, 4));
  }
  EXPECT_TRUE(cut);
}

TEST(FrameWatch, FramesAreUnderWayForAWhileWhenTheServerEndsACall) {
  const FrameLimits limits{.overhead_burst = 3, .overhead_per_s = 0};
  FrameWatch watch = greeted(limits);
  ASSERT_FALSE(read(watch, call(0) + frame(0, 0, 1, message(20))));
  answer(watch, frame(1, 5, 1, 10));
  for (int i = 0; i < limits.frames_after_end; ++i) ASSERT_FALSE(read(watch, frame(0, 0, 1, message(20)))) << i;
  bool cut = false;
  for (int i = 0; i < 10 && !cut; ++i) cut = read(watch, frame(0, 0, 1, message(20))).has_value();
  EXPECT_TRUE(cut);
}

TEST(FrameWatch, NoMoreCallsAreKnownThanAllowed) {
  FrameWatch watch = greeted({.calls_burst = 1e6, .max_streams = 50});
  for (uint32_t n = 0; n < 50; ++n) ASSERT_FALSE(read(watch, call(n)));
  EXPECT_EQ(read(watch, call(50)), "it has too many calls at once");
  FrameWatch tidy = greeted({.calls_burst = 1e6, .overhead_burst = 1e6, .max_streams = 1100});
  for (uint32_t n = 0; n < 5000; ++n) {
    ASSERT_FALSE(read(tidy, call(n))) << n;  // the client never ends its side
    answer(tidy, frame(1, 5, 2 * n + 1, 10));
  }
}

// Otherwise a frame of thousands of them would pay for thousands of others.
TEST(FrameWatch, EmptyMessagesMakeRoomForNothing) {
  std::string messages;
  for (int i = 0; i < 200; ++i) messages += message(0);
  FrameWatch watch = greeted({.overhead_burst = 20, .overhead_per_s = 0});
  ASSERT_FALSE(read(watch, call(0)));
  bool cut = false;
  for (int i = 0; i < 30 && !cut; ++i) cut = read(watch, frame(7, 0, 0, 8) + frame(0, 0, 1, messages)).has_value();
  EXPECT_TRUE(cut);
}

// --- what gRPC holds

TEST(FrameWatch, AStreamOnWhichTheServerLagsBehindHoldsNoMoreAndMore) {
  FrameWatch watch = greeted();
  ASSERT_FALSE(read(watch, call(0) + frame(0, 0, 1, message(100))));
  for (int i = 0; i < 100'000; ++i) {
    ASSERT_FALSE(read(watch, frame(0, 0, 1, message(100))));
    answer(watch, window_update(1, 105));
  }
  EXPECT_LT(watch.held_bytes(), 4 * (105 + StreamMessages::kBytesOfFrame));
  EXPECT_GE(watch.held_bytes(), 105u);
}

TEST(FrameWatch, AMessageThatIsNotCompleteIsHeldWithAllItsFrames) {
  FrameWatch watch = greeted({.overhead_burst = 1e6});
  ASSERT_FALSE(read(watch, call(0) + frame(0, 0, 1, message(1000, 0))));
  for (int i = 0; i < 999; ++i) ASSERT_FALSE(read(watch, frame(0, 0, 1, 1)));
  EXPECT_EQ(watch.held_bytes(), 5u + 999 + 1000 * StreamMessages::kBytesOfFrame);
  answer(watch, window_update(1, 1005));  // the server has asked for the message
  EXPECT_GE(watch.held_bytes(), 1004u) << "it is not complete, so it is held all the same";
  ASSERT_FALSE(read(watch, frame(0, 0, 1, 1)));
  EXPECT_EQ(watch.held_bytes(), 0u);
}

TEST(FrameWatch, AMessageIsHeldUntilTheServerLetsTheClientSendOn) {
  FrameWatch watch = greeted();
  ASSERT_FALSE(read(watch, call(0) + frame(0, 0, 1, message(100)) + frame(0, 0, 1, message(200))));
  EXPECT_EQ(watch.held_bytes(), 310u + 2 * StreamMessages::kBytesOfFrame);
  answer(watch, window_update(1, 110) + window_update(0, 1000));
  EXPECT_EQ(watch.held_bytes(), 200u + StreamMessages::kBytesOfFrame);
  answer(watch, window_update(1, 200));
  EXPECT_EQ(watch.held_bytes(), 0u);
}

TEST(FrameWatch, NothingIsHeldForACallThatHasEnded) {
  for (const bool by_client : {true, false}) {
    FrameWatch watch = greeted();
    ASSERT_FALSE(
        read(watch, call(0) + call(1) + frame(0, 0, 1, message(1000, 100)) + frame(0, 0, 3, message(1000, 50))));
    const size_t held = watch.held_bytes();
    if (by_client)
      ASSERT_FALSE(read(watch, frame(3, 0, 1, 4)));
    else
      answer(watch, frame(1, 5, 1, 10));
    EXPECT_EQ(held - watch.held_bytes(), 105 + StreamMessages::kBytesOfFrame);
    ASSERT_FALSE(read(watch, frame(0, 0, 1, 10)));
    EXPECT_EQ(watch.held_bytes(), 55 + StreamMessages::kBytesOfFrame);
  }
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
