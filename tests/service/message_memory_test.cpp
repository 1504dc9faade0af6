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
  memory.add("many", 40);
  EXPECT_EQ(memory.room("many"), 10u);
  EXPECT_EQ(memory.room("other"), 50u);
  memory.add("third", 50);
  EXPECT_EQ(memory.room("other"), 10u);
  memory.remove("many", 40);
  EXPECT_EQ(memory.room("many"), 50u);
}

TEST(MessageMemory, AnInboxWithAMessageIsFullWhenAllTakeTooMuch) {
  MessageMemory memory(1);
  Inbox one(100, 1 << 30, &memory, "one"), empty(100, 1 << 30, &memory, "other");
  EXPECT_FALSE(one.full());
  one.push(large_tick(), 0);
  EXPECT_TRUE(one.full());
  EXPECT_FALSE(empty.full());
  (void)one.take_one();
  EXPECT_FALSE(memory.over());
}

TEST(MessageMemory, AnInboxThatEndsTakesNothing) {
  MessageMemory memory(1);
  { Inbox(100, 1 << 30, &memory, "one").push(large_tick(), 0); }
  EXPECT_FALSE(memory.over());
  EXPECT_EQ(memory.room("one"), 0u);
}

}  // namespace
}  // namespace sightline
