// The memory that a control group grants, and what the budgets make of it.
#include "server/base/memory_budget.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

constexpr uint64_t kMib = 1 << 20;

TEST(MemoryBudget, ReadsLimits) {
  EXPECT_EQ(parse_memory_max("536870912\n"), 512 * kMib);
  for (const char* none : {"max\n", "9223372036854771712\n", "0", "", "-1", "x"})
    EXPECT_FALSE(parse_memory_max(none)) << none;
}

TEST(MemoryBudget, FindsTheGroupsOfAProcess) {
  const ControlGroupPaths second = parse_control_groups("0::/pod/game\n");
  EXPECT_EQ(second.unified, "/pod/game");
  EXPECT_EQ(second.memory, "");
  const ControlGroupPaths first = parse_control_groups(
      "9:name=systemd:/x\n4:cpu,memory:/pod:1/game\n3:cpuset:/y\n0::/\n");
  EXPECT_EQ(first.memory, "/pod:1/game");
  EXPECT_EQ(first.unified, "/");
  EXPECT_EQ(parse_control_groups("nonsense\n\n").unified, "");
}

// A folder as the kernel shows control groups.
class MemoryGroups : public testing::Test {
 protected:
  void write(const std::string& file, const std::string& text) const {
    std::filesystem::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }
  std::optional<uint64_t> limit(const ControlGroupPaths& groups) const { return memory_limit(groups, root_.path()); }

  const test::TemporaryFolder root_;
};

TEST_F(MemoryGroups, TheTightestOfAGroupAndItsParentsCounts) {
  write("pod/game/memory.max", "max\n");
  EXPECT_EQ(limit({.unified = "/pod/game", .memory = {}}), std::nullopt);
  write("pod/memory.max", "536870912\n");
  EXPECT_EQ(limit({.unified = "/pod/game", .memory = {}}), 512 * kMib);
  write("pod/game/memory.max", "268435456\n");
  EXPECT_EQ(limit({.unified = "/pod/game", .memory = {}}), 256 * kMib);
  EXPECT_EQ(limit({.unified = "/pod", .memory = {}}), 512 * kMib) << "a child's limit is not the parent's";
  EXPECT_EQ(limit({.unified = "/other", .memory = {}}), std::nullopt);
}

// In a container the group's own path, as the host sees it, is not there; its limit is at the root.
TEST_F(MemoryGroups, Version1HasAFolderForTheController) {
  write("memory/memory.limit_in_bytes", "536870912\n");
  EXPECT_EQ(limit({.unified = "/", .memory = "/docker/abc"}), 512 * kMib);
  write("memory/memory.limit_in_bytes", "9223372036854771712\n");
  write("memory/pod/memory.limit_in_bytes", "268435456\n");
  EXPECT_EQ(limit({.unified = "", .memory = "/pod/game"}), 256 * kMib);
  EXPECT_EQ(limit({.unified = "", .memory = "/"}), std::nullopt);
}

TEST(MemoryBudget, WithoutALimitTheBudgetsAreTheUsualOnes) {
  for (const auto limit : {std::optional<uint64_t>(), std::optional(1200 * kMib), std::optional(uint64_t{1} << 40)}) {
    EXPECT_EQ(memory_budgets(limit).sum(), MemoryBudgets().sum());
    EXPECT_EQ(memory_budgets(limit).transport, 128u);
  }
}

TEST(MemoryBudget, TheBudgetsFitTheLimitTogether) {
  for (uint64_t limit = 224; limit < 1200; limit += 7) {
    const MemoryBudgets budgets = memory_budgets(limit * kMib);
    EXPECT_LE(budgets.sum() + kMemoryBesideBudgets, limit) << limit;
    EXPECT_GE(budgets.messages, 2 * budgets.max_message_memory) << limit;
    EXPECT_LE(budgets.session, budgets.sessions) << limit;
    EXPECT_LE(budgets.kept_uploads, budgets.geometry) << limit;
    const MemoryBudgets larger = memory_budgets((limit + 7) * kMib);
    EXPECT_GE(larger.geometry, budgets.geometry) << limit;
    EXPECT_GE(larger.sessions, budgets.sessions) << limit;
  }
}

TEST(MemoryBudget, InAContainerOf512MibMostOfItIsForScenesAndSessions) {
  const MemoryBudgets budgets = memory_budgets(512 * kMib);
  EXPECT_EQ(budgets.transport, 52u);
  EXPECT_GE(budgets.sum() + kMemoryBesideBudgets, 500u) << "nothing is given away";
  EXPECT_EQ(budgets.geometry, 78u);
  EXPECT_EQ(budgets.sessions, 104u);
  EXPECT_EQ(budgets.session, 64u);
  EXPECT_EQ(budgets.max_message_memory, 17u);
}

TEST(MemoryBudget, EvenATinyLimitLeavesBudgetsThatTheFlagsAllow) {
  const MemoryBudgets budgets = memory_budgets(16 * kMib);
  EXPECT_GE(budgets.geometry, 8u);
  EXPECT_GE(budgets.messages, 16u);
  EXPECT_GE(budgets.max_message_memory, 8u);
  EXPECT_GE(budgets.transport, 16u);
}

}  // namespace
}  // namespace sightline
