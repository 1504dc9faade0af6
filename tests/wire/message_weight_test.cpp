// The memory of a message, estimated from its bytes.
#include "server/wire/message_weight.h"

#include <gtest/gtest.h>

#include <string>

#include "sightline/v1/camera_control.pb.h"

namespace sightline::test {
namespace {

constexpr size_t kAll = size_t{1} << 40;

size_t weight(const std::string& bytes, size_t enough = kAll) {
  return message_weight(*v1::ControlRequest::descriptor(), std::as_bytes(std::span(bytes)), enough);
}

// Two bytes each on the wire.
std::string empty_instances(int count) {
  v1::ControlRequest request;
  for (int i = 0; i < count; ++i) request.mutable_open()->add_instances();
  return request.SerializeAsString();
}

TEST(MessageWeight, AnEmptyPartCountsAsTheObjectThatItBecomes) {
  const std::string bytes = empty_instances(1000);
  EXPECT_LT(bytes.size(), 2'100u);
  EXPECT_GE(weight(bytes), 1000 * sizeof(v1::NewInstance) / 2);
  EXPECT_LE(weight(bytes), 1000 * (sizeof(v1::NewInstance) + 100));
}

TEST(MessageWeight, NumbersAndNamesCountAsTheirBytesInMemory) {
  v1::ControlRequest numbers;
  for (uint64_t i = 0; i < 1000; ++i) numbers.mutable_tick()->mutable_transforms()->add_ids(i % 100);
  EXPECT_GE(weight(numbers.SerializeAsString()), 1000 * sizeof(uint64_t));
  v1::ControlRequest name;
  name.mutable_open()->set_label(std::string(5000, 'x'));
  EXPECT_GE(weight(name.SerializeAsString()), 5000u);
  EXPECT_LE(weight(name.SerializeAsString()), 6000u);
}

TEST(MessageWeight, CountsNoFartherThanEnough) {
  const std::string bytes = empty_instances(1000);
  const size_t all = weight(bytes);
  EXPECT_GE(weight(bytes, all / 4), all / 4);
  EXPECT_LE(weight(bytes, all / 4), all / 4 + 500);
}

TEST(MessageWeight, BytesThatEndEarlyCountAsFarAsTheyGo) {
  const std::string bytes = empty_instances(1000);
  const size_t half = weight(bytes.substr(0, bytes.size() / 2));
  EXPECT_GT(half, weight(bytes) / 3);
  EXPECT_LT(half, weight(bytes) * 2 / 3);
  EXPECT_EQ(weight(""), 0u);
}

}  // namespace
}  // namespace sightline::test
