// The replies of a session depend only on its messages: not on the daemon's number of threads, not on its other
// sessions, not on the run.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "scenes/hall.h"
#include "scenes/rooms.h"
#include "server/base/hash.h"
#include "tests/drive/drive_support.h"
#include "tests/support/daemon_process.h"

namespace sightline {
namespace {

// Every bit of every reply except the stage times.
uint64_t hash_of(const std::vector<PlayedFrame>& frames) {
  std::string bytes;
  for (const PlayedFrame& frame : frames) {
    v1::CameraReply reply = frame.reply;
    reply.clear_stage_times();
    bytes += reply.SerializeAsString();
  }
  return hash64_bytes(std::as_bytes(std::span(bytes)));
}

v1::Settings preset(v1::Settings::Preset name) {
  v1::Settings settings;
  settings.set_preset(name);
  return settings;
}

// Another session on the same daemon; it runs for as long as this object lives.
class Neighbour {
 public:
  Neighbour(const std::string& address, std::vector<std::byte> glb, v1::Settings::Preset name)
      : glb_(std::move(glb)), thread_([this, address, name] {
          while (!enough_)
            frames_ += test::play_only(address, glb_, {.duration_s = 0.5, .settings = preset(name)}).size();
        }) {}
  ~Neighbour() { stop(); }
  size_t stop() {
    enough_ = true;
    if (thread_.joinable()) thread_.join();
    return frames_;
  }

 private:
  const std::vector<std::byte> glb_;
  std::atomic<bool> enough_{false};
  size_t frames_ = 0;
  std::thread thread_;
};

class Determinism : public testing::TestWithParam<v1::Settings::Preset> {};

TEST_P(Determinism, ThreadsNeighboursAndRunsChangeNoBitOfTheReplies) {
  const auto hall = scenes::make_hall({.seed = 1, .duration_s = 6.0});
  const test::DriveTestOptions five_seconds{.duration_s = 5.0, .settings = preset(GetParam())};
  std::vector<uint64_t> hashes;
  for (const char* threads : {"1", "2"}) {
    const test::DaemonProcess daemon({"--sampler", "embree", "--threads", threads});
    Neighbour rooms(daemon.address(), scenes::make_rooms({.seed = 2}), v1::Settings::PRESET_SIGHTLINE);
    Neighbour other_hall(daemon.address(), scenes::make_hall({.seed = 3}), v1::Settings::PRESET_PAPER);
    for (int run = 0; run < 2; ++run) {
      const auto frames = test::play_only(daemon.address(), hall, five_seconds);
      ASSERT_EQ(frames.size(), 301u);
      hashes.push_back(hash_of(frames));
    }
    EXPECT_GT(rooms.stop(), 0u);
    EXPECT_GT(other_hall.stop(), 0u);
  }
  for (const uint64_t hash : hashes) EXPECT_EQ(hash, hashes[0]);
}

std::string name_of_preset(const testing::TestParamInfo<v1::Settings::Preset>& info) {
  return v1::Settings::Preset_Name(info.param);
}
INSTANTIATE_TEST_SUITE_P(Presets, Determinism,
                         testing::Values(v1::Settings::PRESET_SIGHTLINE, v1::Settings::PRESET_PAPER), name_of_preset);

// The hash must differ between two different runs.
TEST(Determinism, AnotherPresetIsAnotherTrace) {
  const auto hall = scenes::make_hall({.seed = 1, .duration_s = 2.0});
  const test::DaemonProcess daemon;
  const auto trace = [&](v1::Settings::Preset name) {
    return hash_of(test::play_only(daemon.address(), hall, {.duration_s = 1.0, .settings = preset(name)}));
  };
  EXPECT_NE(trace(v1::Settings::PRESET_SIGHTLINE), trace(v1::Settings::PRESET_PAPER));
}

}  // namespace
}  // namespace sightline
