// Child processes, with the system's shell as the program.
#include "client/base/process.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <ctime>
#include <filesystem>
#include <fstream>

#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;

class ChildProcessTest : public testing::Test {
 protected:
  Result<std::unique_ptr<ChildProcess>> run(const std::string& script) {
    return ChildProcess::start("/bin/sh", {"-c", script}, folder_ / "log");
  }
  std::string ready() const { return folder_ / "ready"; }

  test::TemporaryFolder folder_;
};

TEST_F(ChildProcessTest, ALineIsWaitedForUntilItIsWhole) {
  const auto child = run("printf 127.0.0 > " + ready() + "; sleep 0.1; printf '.1:5\\nmore\\n' >> " + ready() +
                         "; exec sleep 60");
  ASSERT_TRUE(child.has_value());
  const auto line = (*child)->wait_for_line(ready(), 20s);
  ASSERT_TRUE(line.has_value()) << to_string(line.error());
  EXPECT_EQ(*line, "127.0.0.1:5");
}

TEST_F(ChildProcessTest, OneThatEndsIsAnErrorWithTheEndOfItsLog) {
  const auto child = run("printf 'no %s\\n\\n' port; printf half > " + ready() + "; printf 'at all\\n' >&2");
  ASSERT_TRUE(child.has_value());
  const auto line = (*child)->wait_for_line(ready(), 20s);
  ASSERT_FALSE(line.has_value());
  EXPECT_EQ(line.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(line.error().field, "/bin/sh");
  EXPECT_EQ(line.error().message, "ended at once: no port\n\nat all");
}

TEST_F(ChildProcessTest, OnlyTheEndOfALongLogIsQuoted) {
  const auto child = run("for k in 1 2 3 4 5 6 7 8 9 10; do printf '%0200d' $k; done");
  ASSERT_TRUE(child.has_value());
  const auto line = (*child)->wait_for_line(ready(), 20s);
  ASSERT_FALSE(line.has_value());
  EXPECT_TRUE(line.error().message.starts_with("ended at once: 0000")) << line.error().message;
  EXPECT_TRUE(line.error().message.ends_with("0010")) << line.error().message;
  EXPECT_LT(line.error().message.size(), 1000u);
}

TEST_F(ChildProcessTest, OneThatIsTooSlowIsAnErrorOfItsOwn) {
  const auto child = run("echo starting; exec sleep 60");
  ASSERT_TRUE(child.has_value());
  const auto line = (*child)->wait_for_line(ready(), 100ms);
  ASSERT_FALSE(line.has_value());
  EXPECT_NE(line.error().message.find("did not come up in time"), std::string::npos) << line.error().message;
}

TEST_F(ChildProcessTest, AProgramThatIsNotThereIsNotStarted) {
  const auto child = ChildProcess::start(folder_ / "nothing", {}, folder_ / "log");
  ASSERT_FALSE(child.has_value());
  EXPECT_EQ(child.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(child.error().field, (folder_ / "nothing").string());
  const auto no_log = ChildProcess::start("/bin/sh", {"-c", "true"}, folder_ / "no" / "such" / "log");
  ASSERT_FALSE(no_log.has_value());
  EXPECT_EQ(no_log.error().code, ErrorCode::kUnavailable);
}

TEST_F(ChildProcessTest, IsToldToEndAndIsReaped) {
  auto child = run("trap 'echo told > " + (folder_ / "told").string() + "; exit' TERM; echo up > " + ready() +
                   "; while :; do sleep 0.02; done");
  ASSERT_TRUE(child.has_value());
  ASSERT_TRUE((*child)->wait_for_line(ready(), 20s).has_value());
  const pid_t pid = (*child)->pid();
  EXPECT_EQ(kill(pid, 0), 0);
  child->reset();
  EXPECT_EQ(kill(pid, 0), -1) << "it is gone";
  EXPECT_TRUE(std::filesystem::exists(folder_ / "told")) << "it had the time to clean up";
}

TEST(ProcessUsage, IsThatOfTheProcess) {
  const auto own = usage_of(getpid());
  ASSERT_TRUE(own.has_value());
  timespec used{};
  ASSERT_EQ(clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used), 0);
  EXPECT_GT(own->cpu_ns, 0);
  EXPECT_LE(own->cpu_ns, used.tv_sec * int64_t{1'000'000'000} + used.tv_nsec);
  EXPECT_GT(own->resident_bytes, size_t{1} << 20);
  EXPECT_LT(own->resident_bytes, size_t{1} << 34);
  EXPECT_FALSE(usage_of(999'999'999).has_value());
}

TEST(Scratch, IsAFolderThatGoesWithItsContents) {
  std::string path;
  {
    const ScratchFolder folder;
    path = folder.path();
    std::ofstream(path + "/file") << "x";
    EXPECT_TRUE(std::filesystem::exists(path + "/file"));
    EXPECT_NE(ScratchFolder().path(), path);
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace sightline
