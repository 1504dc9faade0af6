// Replays at real daemons: in another process, with other numbers of threads, and across a daemon that is killed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "tests/replay/recorded_hall.h"
#include "tests/replay/replayed.h"
#include "tests/support/daemon_process.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::DaemonProcess;
using test::open_recording;
using test::record_hall;
using test::RecordedHall;
using test::Replayed;

// The tuning is light, because the result does not depend on how much work a step does.
tuning::v1alpha1::Tuning light() {
  tuning::v1alpha1::Tuning tuning;
  tuning.mutable_sample()->set_points(1);
  return tuning;
}

Replayed replay_at(const std::string& address, const RecordedHall& hall,
                   const std::function<void(uint64_t)>& before_step = {}) {
  auto place = connect_backend(address, 20s);
  EXPECT_TRUE(place.has_value()) << to_string(place.error());
  return test::replay_on(**place, open_recording(hall.bytes), {}, {}, {}, before_step);
}

TEST(ReplayAtDaemon, ThreadsChangeNoBit) {
  const RecordedHall hall = record_hall(*make_embree_sampler_device(), {.ticks = 240, .tuning = light()});
  for (const char* threads : {"1", "2"}) {
    const DaemonProcess daemon({"--sampler", "embree", "--threads", threads});
    const Replayed replayed = replay_at(daemon.address(), hall);
    EXPECT_EQ(replayed.equal, hall.replies) << replayed.text;
    EXPECT_EQ(replayed.hash, hall.hash);
    EXPECT_EQ(replayed.verdict, ReplayVerdict::kEqual);
  }
}

// Tick.step repeats what the recording's daemon decided by its clock.
TEST(ReplayAtDaemon, MergesAndEconomyAreThoseOfTheRecording) {
  for (const test::RecordedHallOptions& options : {test::RecordedHallOptions{.ticks = 120, .merge_every = 2},
                                                   test::RecordedHallOptions{.ticks = 120, .merge_every = 3},
                                                   test::RecordedHallOptions{.ticks = 60, .quality_level = 4}}) {
    const RecordedHall hall = record_hall(*make_embree_sampler_device(), options);
    for (const char* threads : {"1", "2"}) {
      const DaemonProcess daemon({"--sampler", "embree", "--threads", threads});
      const Replayed replayed = replay_at(daemon.address(), hall);
      EXPECT_EQ(replayed.hash, hall.hash) << replayed.text;
      EXPECT_EQ(replayed.verdict, ReplayVerdict::kEqual);
    }
  }
}

TEST(ReplayAtDaemon, RefusedTicksAreRefusedThereToo) {
  const RecordedHall hall = record_hall(
      *make_embree_sampler_device(),
      {.ticks = 60, .tuning = light(), .change = [](int i, const v1::CameraReply&, v1::Tick& tick) {
         if (i % 10 == 5) tick.mutable_transforms()->add_ids(77);
       }});
  const DaemonProcess daemon;
  const Replayed replayed = replay_at(daemon.address(), hall);
  EXPECT_EQ(replayed.hash, hall.hash);
  EXPECT_EQ(replayed.verdict, ReplayVerdict::kEqual) << replayed.text;
}

// The replies of the killed daemon and of its successor form one chain.
TEST(ReplayAtDaemon, KilledInTheMiddleItGoesOnWhereItWas) {
  const RecordedHall hall = record_hall(*make_embree_sampler_device(), {.ticks = 240, .tuning = light()});
  test::TemporaryFolder folder;
  const std::string socket = folder / "daemon.sock";
  const auto start = [&] {
    return std::make_unique<DaemonProcess>(std::vector<std::string>{"--sampler", "embree", "--listen-unix", socket});
  };
  auto daemon = start();
  std::jthread starter;
  const Replayed replayed = replay_at("unix:" + socket, hall, [&](uint64_t step) {
    if (step != 120) return;
    daemon->kill_now();
    starter = std::jthread([&] {
      std::this_thread::sleep_for(300ms);  // so that the replay first finds no daemon
      daemon = start();
    });
  });
  starter.join();
  EXPECT_EQ(replayed.replies, 240u);
  EXPECT_EQ(replayed.equal, hall.replies) << replayed.text;
  EXPECT_EQ(replayed.hash, hall.hash);
  EXPECT_TRUE(replayed.restarts_equal) << "the new daemon repeats what the killed one has answered";
}

TEST(ReplayAtDaemon, ThatStaysAwayIsAnErrorThatSaysSo) {
  const RecordedHall hall = record_hall(*make_embree_sampler_device(), {.ticks = 20, .tuning = light()});
  const Recording recording = open_recording(hall.bytes);
  DaemonProcess daemon;
  auto place = connect_backend(daemon.address(), 1s);
  ASSERT_TRUE(place.has_value());
  SceneFiles scenes(recording, {});
  Replay replay(recording, **place, scenes, {});
  ASSERT_TRUE(replay.open().has_value());
  ReplayedStep step;
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(replay.next(step).value());
  daemon.kill_now();
  const auto gone = replay.next(step);
  ASSERT_FALSE(gone.has_value());
  EXPECT_EQ(gone.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace sightline
