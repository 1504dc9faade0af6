#include "server/service/message_memory.h"

#include <gtest/gtest.h>

#include "server/service/inbox.h"

namespace sightline {
namespace {

v1::ControlRequest large_tick() {
  v1::ControlRequest request;
  for (uint64_t id = 0; id < 1000; ++id) request.mutable_tick()->mutable_delta()->add_removed_ids(id);
  return request;
}

TEST(MessageMemory, OneClientHasAtMostHalf) {
  MessageMemory memory(100);
  const auto many = memory.of("many"), other = memory.of("other"), third = memory.of("third");
  memory.of("many")->add(40);  // another stream of the same client
  EXPECT_EQ(many->room(), 10u);
  EXPECT_EQ(other->room(), 50u);
  third->add(50);
  EXPECT_EQ(other->room(), 10u);
  many->remove(40);
  EXPECT_EQ(many->room(), 50u);
}

TEST(MessageMemory, AnInboxWithAMessageIsFullWhenAllTakeTooMuch) {
  MessageMemory memory(1);
  Inbox one(100, 1 << 30, memory.of("one")), empty(100, 1 << 30, memory.of("other"));
  EXPECT_FALSE(one.full());
  one.push(large_tick(), 0);
  EXPECT_TRUE(one.full());
  EXPECT_FALSE(empty.full());
  (void)one.take_one();
  EXPECT_FALSE(memory.over());
}

TEST(MessageMemory, AnInboxThatEndsTakesNothing) {
  MessageMemory memory(1 << 30);
  const auto share = memory.of("one");
  const size_t room = share->room();
  {
    Inbox inbox(100, 1 << 30, share);
    inbox.push(large_tick(), 0);
    EXPECT_LT(share->room(), room);
  }
  EXPECT_EQ(share->room(), room);
}

}  // namespace
}  // namespace sightline
