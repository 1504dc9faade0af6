#include "server/base/error.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

TEST(Error, TextNamesCodeFieldAndReason) {
  EXPECT_EQ(to_string(Error{ErrorCode::kInvalidArgument, "tick.dt_s", "must be positive, got -1"}),
            "invalid argument: tick.dt_s: must be positive, got -1");
  EXPECT_EQ(to_string(Error{ErrorCode::kUnavailable, "", "no device"}), "unavailable: no device");
}

TEST(Error, AnElementIsNamedByItsIndex) {
  EXPECT_EQ(indexed("poses", 12), "poses[12]");
}

TEST(Error, AFailureConvertsToAnyResult) {
  const Result<int> result = invalid("field", "reason");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(result.error().field, "field");
}

}  // namespace
}  // namespace sightline
