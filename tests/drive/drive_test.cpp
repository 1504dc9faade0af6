// End to end: from a scene file to camera poses, through a daemon, judged by Embree.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "client/drive/drive_command.h"
#include "scenes/hall.h"
#include "scenes/rooms.h"
#include "tests/drive/drive_support.h"
#include "tests/support/daemon_process.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using test::DaemonProcess;
using ::testing::HasSubstr;

class DriveTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { daemon_ = std::make_unique<DaemonProcess>(); }
  static void TearDownTestSuite() { daemon_.reset(); }
  static std::unique_ptr<DaemonProcess> daemon_;
};
std::unique_ptr<DaemonProcess> DriveTest::daemon_;

void expect_hard_limits(const test::Driven& driven) {
  EXPECT_EQ(driven.run.body_collisions, 0u);
  EXPECT_EQ(driven.run.limit_violations, 0u);
  EXPECT_GE(driven.run.least_clearance_m, CameraLimits{}.body_radius_m);
}

TEST_F(DriveTest, InTheHallTheCameraIsSafeAndShowsBothTargetsMoreOftenThanFollow) {
  const auto glb = scenes::make_hall({});
  const test::Driven driven = test::drive(daemon_->address(), glb);
  ASSERT_FALSE(driven.frames.empty());
  expect_hard_limits(driven);
  EXPECT_GT(driven.run.all_seen, driven.follow.all_seen);
  EXPECT_GT(driven.run.joint_visible_share(), driven.follow.joint_visible_share());
  test::keep_picture("hall", glb, driven);
}

TEST_F(DriveTest, InTheRoomsTheCameraIsSafeAndShowsBothTargetsMoreOftenThanFollow) {
  const auto glb = scenes::make_rooms({});
  const test::Driven driven = test::drive(daemon_->address(), glb);
  ASSERT_FALSE(driven.frames.empty());
  expect_hard_limits(driven);
  EXPECT_GT(driven.run.all_seen, driven.follow.all_seen);
  test::keep_picture("rooms", glb, driven);
}

TEST_F(DriveTest, TheSameScenarioAndSeedGiveTheSamePathBitForBit) {
  const auto glb = scenes::make_hall({.duration_s = 4.0});
  const test::Driven first = test::drive(daemon_->address(), glb, {.duration_s = 3.0, .picture_every = 0});
  const test::Driven second = test::drive(daemon_->address(), glb, {.duration_s = 3.0, .picture_every = 0});
  ASSERT_EQ(first.frames.size(), 181u);
  ASSERT_EQ(second.frames.size(), 181u);
  for (size_t i = 0; i < first.path.size(); ++i) {
    EXPECT_EQ(first.path[i].camera.position_m, second.path[i].camera.position_m) << i;
    EXPECT_EQ(first.path[i].camera.rotation, second.path[i].camera.rotation) << i;
  }
}

class DriveCommandTest : public DriveTest {
 protected:
  DriveCommandTest() {
    options_.scenario = folder_ / "hall.glb";
    options_.server = daemon_->address();
    options_.duration_s = 2.0;
    options_.rate_hz = 30.0;
    options_.lockstep = true;
    options_.picture_every = 10;
    options_.out = folder_ / "new/out";
    const auto glb = scenes::make_hall({.duration_s = 3.0});
    std::ofstream(options_.scenario, std::ios::binary)
        .write(reinterpret_cast<const char*>(glb.data()), static_cast<std::streamsize>(glb.size()));
  }
  int run() { return run_drive_command(options_, out_, err_); }
  std::vector<std::string> trace_lines() const {
    std::ifstream in(options_.out + "/trace.csv");
    std::vector<std::string> lines;
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
  }

  test::TemporaryFolder folder_;
  DriveOptions options_;
  std::ostringstream out_, err_;
};

TEST_F(DriveCommandTest, PrintsALineASecondAndATableAndWritesItsFiles) {
  ASSERT_EQ(run(), 0) << err_.str();
  const std::string text = out_.str();
  for (const char* part : {"0.0 s  (", "1.0 s  (", "2.0 s  (", "S_V ", "mean visible share", "r_N", "r_P", "d_c", "p99",
                           "follow", "contact.png"})
    EXPECT_THAT(text, HasSubstr(part));
  EXPECT_TRUE(err_.str().empty()) << err_.str();
  EXPECT_GT(std::filesystem::file_size(options_.out + "/contact.png"), 10'000u);
  EXPECT_GT(std::filesystem::file_size(options_.out + "/comparison.png"), 5'000u);
  EXPECT_TRUE(std::filesystem::exists(options_.out + "/metrics.json"));
}

TEST_F(DriveCommandTest, TheTraceHasOneLineATickAndAsManyFieldsInEach) {
  ASSERT_EQ(run(), 0) << err_.str();
  const auto lines = trace_lines();
  ASSERT_EQ(lines.size(), 1 + 61u);
  EXPECT_THAT(lines[0], testing::StartsWith("sequence,time_s,pose_time_s,x_m"));
  const auto commas = [](const std::string& line) { return std::count(line.begin(), line.end(), ','); };
  for (const std::string& line : lines) EXPECT_EQ(commas(line), commas(lines[0]));
}

TEST_F(DriveCommandTest, ThePresetIsWhatTheSessionStartsFrom) {
  options_.truth = false;
  const auto uses_pairs = [&] {
    EXPECT_EQ(run(), 0) << err_.str();
    const auto lines = trace_lines();
    return std::any_of(lines.begin(), lines.end(),
                       [](const std::string& line) { return line.find("PAIR") != std::string::npos; });
  };
  EXPECT_FALSE(uses_pairs());
  options_.preset = "paper";
  EXPECT_TRUE(uses_pairs());
  options_.preset = "magic";
  EXPECT_EQ(run(), 1);
  EXPECT_THAT(err_.str(), HasSubstr("magic"));
}

TEST_F(DriveCommandTest, WithoutTruthThereIsNoBaseline) {
  options_.truth = false;
  ASSERT_EQ(run(), 0) << err_.str();
  EXPECT_THAT(out_.str(), testing::Not(HasSubstr("r_N")));
  EXPECT_THAT(out_.str(), HasSubstr("body collisions"));
}

TEST_F(DriveCommandTest, InRealTimeEveryTickIsAnsweredOrMerged) {
  options_.lockstep = false;
  options_.truth = false;
  const auto began = std::chrono::steady_clock::now();
  ASSERT_EQ(run(), 0) << err_.str();
  EXPECT_GE(std::chrono::steady_clock::now() - began, std::chrono::seconds(2)) << "the last tick is never early";
  const auto lines = trace_lines();
  EXPECT_THAT(lines.back(), testing::StartsWith("61,")) << "the newest tick has its answer";
}

TEST_F(DriveCommandTest, NoServerIsAnErrorAndNotAZero) {
  options_.server = "127.0.0.1:1";
  EXPECT_EQ(run(), 1);
  EXPECT_THAT(err_.str(), HasSubstr("127.0.0.1:1"));
}

TEST_F(DriveCommandTest, AFileThatIsNoScenarioIsAnError) {
  std::ofstream(options_.scenario) << "no glTF";
  EXPECT_EQ(run(), 1);
  EXPECT_THAT(err_.str(), HasSubstr("sightline drive: "));
}

}  // namespace
}  // namespace sightline
