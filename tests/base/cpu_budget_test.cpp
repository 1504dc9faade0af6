// The share of the machine's CPUs that the process may use.
#include "server/base/cpu_budget.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

TEST(CpuBudgetTest, ReadsCpuQuotas) {
  EXPECT_EQ(parse_cpu_max("200000 100000\n"), 2.0);
  EXPECT_EQ(parse_cpu_max("50000 100000"), 0.5);
  for (const char* none : {"max 100000\n", "", "-1 100000", "100000", "100000 0", "x y"})
    EXPECT_FALSE(parse_cpu_max(none)) << none;
  EXPECT_GE(cpu_budget(), 1);
}

}  // namespace
}  // namespace sightline
