// The share of the machine's CPUs that the process may use.
#include "server/base/cpu_budget.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

TEST(CpuBudgetTest, ReadsCpuQuotas) {
  EXPECT_EQ(parse_cpu_max("200000 100000\n"), 2.0);
  EXPECT_EQ(parse_cpu_max("50000 100000"), 0.5);
  for (const char* none : {"max 100000\n", "", "-1 100000", "100000", "100000 0", "x y"})
    EXPECT_FALSE(parse_cpu_max(none)) << none;
  EXPECT_GE(cpu_budget(), 1);
}

// A folder as the kernel shows control groups.
class ControlGroups : public testing::Test {
 protected:
  void write(const std::string& file, const std::string& text) const {
    std::filesystem::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }
  std::optional<double> quota(const std::string& group) const { return cgroup_cpu_quota(root_.path(), group); }

  const test::TemporaryFolder root_;
};

TEST_F(ControlGroups, TheTightestOfAGroupAndItsParentsCounts) {
  write("pod/game/cpu.max", "400000 100000\n");
  EXPECT_EQ(quota("/pod/game"), 4.0);
  write("pod/cpu.max", "150000 100000\n");
  EXPECT_EQ(quota("/pod/game"), 1.5);
  write("cpu.max", "max 100000\n");
  EXPECT_EQ(quota("/pod/game"), 1.5);
  write("pod/game/cpu.max", "50000 100000\n");
  EXPECT_EQ(quota("/pod/game"), 0.5);
  EXPECT_EQ(quota("/pod"), 1.5) << "a child's quota is not the parent's";
  EXPECT_EQ(quota("/other"), std::nullopt);
}

TEST_F(ControlGroups, Version1HasItsQuotaInTwoFiles) {
  write("cpu/cpu.cfs_quota_us", "250000\n");
  write("cpu/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(quota(""), 2.5);
  write("cpu/cpu.cfs_quota_us", "-1\n");
  EXPECT_EQ(quota(""), std::nullopt);
}

}  // namespace
}  // namespace sightline
