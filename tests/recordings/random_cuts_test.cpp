// Cuts at random places of several recordings, each computed again: every reply must have the bits of the recorded one.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>

#include "client/recordings/cut.h"
#include "scenes/rooms.h"
#include "server/record/recorder.h"
#include "tests/record/pretended_files.h"
#include "tests/replay/recorded_hall.h"
#include "tests/replay/replayed.h"
#include "tests/report/recorded_yard.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

constexpr int kMemoryEvery = 50;
// The daemon's interval of 10 s (SessionRecording::kMemoryEveryS), in ticks at 60 Hz.
constexpr int kDaemonsMemoryEvery = 600;

std::string cut_of(const Recording& recording, const RecordedRange& range, RecordingCut* told = nullptr) {
  MemorySink sink;
  const auto done = cut_recording(recording, range, sink);
  EXPECT_TRUE(done.has_value()) << to_string(done.error());
  if (done && told) *told = *done;
  return sink.bytes();
}

class RandomCuts : public testing::Test {
 protected:
  // Cuts `count` times and computes each cut again.
  void cut_and_replay(const std::string& bytes, int count, uint32_t seed) {
    const Recording recording = test::open_recording(bytes);
    std::mt19937 dice(seed);
    std::uniform_real_distribution<double> start(0.0, recording.duration_s() - 0.1), length(0.05, 0.6);
    for (int i = 0; i < count; ++i) {
      const double start_s = start(dice), end_s = start_s + length(dice);
      const std::string cut = cut_of(recording, {start_s, end_s});
      const test::Replayed replayed = test::replay_here(cut);
      ASSERT_GT(replayed.replies, 0u) << start_s;
      ASSERT_EQ(replayed.verdict, ReplayVerdict::kEqual) << "from " << start_s << " s to " << end_s << " s\n"
                                                         << replayed.text;
    }
  }

  const std::unique_ptr<SamplerDevice> sampler_ = make_embree_sampler_device();
};

TEST_F(RandomCuts, OfTheHallWithTheDefaultSettingsReplayToTheBit) {
  cut_and_replay(test::record_hall(*sampler_, {.ticks = 400, .merge_every = 7, .memory_every = kMemoryEvery}).bytes,
                 300, 1);
}

// The recording is 22 s long, so that cuts begin in front of the first memory, between two, and behind the last.
TEST_F(RandomCuts, OfTheHallWithTheDaemonsMemoriesReplayToTheBit) {
  cut_and_replay(test::record_hall(*sampler_, {.ticks = 1320, .memory_every = kDaemonsMemoryEvery}).bytes, 34, 4);
}

TEST_F(RandomCuts, OfRoomsReplayToTheBit) {
  const auto rooms = [](double duration_s) { return scenes::make_rooms({.seed = 3, .duration_s = duration_s}); };
  cut_and_replay(test::record_hall(*sampler_, {.ticks = 400, .memory_every = kMemoryEvery, .scene = rooms}).bytes, 333,
                 2);
}

TEST_F(RandomCuts, OfAYardWithManyEventsReplayToTheBit) {
  cut_and_replay(test::record_yard(*sampler_, {.ticks = 300, .memory_every = kMemoryEvery}).bytes, 333, 3);
}

// A body of several instances: an arm swings, is removed, is added again in another shape, and the target leaves it
// behind.
TEST_F(RandomCuts, OfABodyWithMovingPartsReplayToTheBit) {
  constexpr uint64_t kArm = 5001, kHead = 5002;
  uint64_t target = 0;
  const auto add = [](auto* instance, uint64_t id, double half_height) {
    instance->set_id(id);
    instance->mutable_shape()->mutable_capsule()->set_radius(0.1);
    instance->mutable_shape()->mutable_capsule()->set_half_height(half_height);
  };
  const auto change = [&](int i, const v1::CameraReply&, v1::Tick& tick) {
    const bool there = i < 150 || i >= 200;
    if (i == 150) tick.mutable_delta()->add_removed_ids(kArm);
    if (i == 200) add(tick.mutable_delta()->add_added_instances(), kArm, 0.4);
    v1::Transforms& moved = *tick.mutable_transforms();
    const int at = 3 *
                   static_cast<int>(std::find(moved.ids().begin(), moved.ids().end(), target) - moved.ids().begin());
    const double x = moved.positions(at), y = moved.positions(at + 1), z = moved.positions(at + 2);
    const auto place = [&](uint64_t id, const glm::dvec3& aside) {
      moved.add_ids(id);
      for (const double coordinate : {x + aside.x, y + aside.y, z + aside.z}) moved.add_positions(coordinate);
      if (moved.rotations_size() > 0)
        for (const float turn : {0.0f, 0.0f, 0.0f, 1.0f}) moved.add_rotations(turn);
      if (moved.velocities_size() > 0)
        for (int axis = 0; axis < 3; ++axis) moved.add_velocities(moved.velocities(at + axis));
    };
    place(kHead, {0, 0.8, 0});
    if (there) place(kArm, {0.4 * std::sin(i / 10.0), 0.2, 0.4 * std::cos(i / 10.0)});
  };
  const auto open = [&](v1::OpenSession& request) {
    add(request.add_instances(), kArm, 0.2), add(request.add_instances(), kHead, 0.1);
    target = request.targets(0).id();
    request.mutable_targets(0)->add_part_ids(kArm), request.mutable_targets(0)->add_part_ids(kHead);
  };
  const test::RecordedHall hall = test::record_hall(
      *sampler_, {.ticks = 300, .memory_every = kMemoryEvery, .change_open = open, .change = change});
  const test::Replayed whole = test::replay_here(hall.bytes);
  EXPECT_EQ(whole.verdict, ReplayVerdict::kEqual) << whole.text;
  EXPECT_EQ(whole.hash, hall.hash);
  EXPECT_NE(hall.hash, test::record_hall(*sampler_, {.ticks = 300, .memory_every = kMemoryEvery}).hash);
  cut_and_replay(hall.bytes, 150, 5);
}

TEST_F(RandomCuts, ACutOfACutReplaysToTheBit) {
  const std::string hall = test::record_hall(*sampler_, {.ticks = 300, .memory_every = kMemoryEvery}).bytes;
  const std::string cut = cut_of(test::open_recording(hall), {2.0, 4.5});
  RecordingCut told;
  const std::string again = cut_of(test::open_recording(cut), {1.5, 2.0}, &told);
  EXPECT_GT(told.snapshot_ticks, 100u);
  EXPECT_EQ(test::replay_here(again).verdict, ReplayVerdict::kEqual);
}

// The writer asks for a memory when a part is nearly full, and the session answers after its next reply.
TEST_F(RandomCuts, EveryPartOfASessionReplaysToTheBit) {
  const std::string hall = test::record_hall(*sampler_, {.ticks = 2600, .memory_every = 1}).bytes;
  const Recording recording = test::open_recording(hall);
  test::PretendedFiles disk;
  disk.now_ns = test::kRecordedStartNs;
  {
    RecordWriter writer(
        {.limits = {.max_file_bytes = 100'000, .free_reserve_bytes = 0}, .chunk_bytes = 2000, .for_viewers = false},
        disk, [&] { return disk.now_ns; }, [](const RecordWarning&) {});
    const auto recorder = writer.open_session(recording.info());
    const auto put = [&](RecordTopic topic, const auto& message) {
      disk.now_ns += 1'000'000;
      EXPECT_TRUE(recorder->record(topic, {disk.now_ns, disk.now_ns}, message));
      writer.run_once();
    };
    put(RecordTopic::kOpen, recording.open_session());
    put(RecordTopic::kOpened, recording.opened());
    const auto files = recording.files();
    for (const RecordedFile& file : *files)
      recorder->attach(file.name, "", 1, std::make_shared<std::string>(file.bytes));
    recording.read({}, [&](RecordedEvent& event) {
      if (event.topic == RecordTopic::kMemory && !recorder->wants_memory()) return true;
      std::visit([&](const auto& message) { put(event.topic, message); }, event.message);
      return true;
    });
  }
  ASSERT_GT(disk.files.size(), 2u);
  uint64_t replies = 0;
  for (const auto& [name, file] : disk.files) {
    const Recording part = test::open_recording(*file.bytes);
    // Large attachments are only in the first part.
    SceneFileOptions scenes;
    const test::TemporaryFolder folder;
    const auto attached = recording.files();
    std::ofstream(folder / "hall.glb", std::ios::binary) << attached->front().bytes;
    scenes.files = {(folder / "hall.glb").string()};
    const test::Replayed replayed = test::replay_here(*file.bytes, {}, {}, scenes);
    EXPECT_EQ(replayed.verdict, ReplayVerdict::kEqual) << name << '\n' << replayed.text;
    replies += replayed.replies;
  }
  EXPECT_EQ(replies, 2600u);
}

TEST_F(RandomCuts, ADamagedMemoryIsNotTakenOver) {
  const std::string hall = test::record_hall(*sampler_, {.ticks = 200, .memory_every = kMemoryEvery}).bytes;
  const std::string cut = cut_of(test::open_recording(hall), {2.0, 3.0});
  for (const auto& damage : std::vector<std::function<void(v1::StepMemory&)>>{
           [](v1::StepMemory& memory) { memory.mutable_state()->back() ^= 1; },
           [](v1::StepMemory& memory) { memory.set_layout(memory.layout() + 1); }}) {
    const auto change = [&](RecordedEvent& event, RecordingWriter&) {
      if (auto* memory = std::get_if<v1::StepMemory>(&event.message)) damage(*memory);
      return true;
    };
    const test::Replayed replayed = test::replay_here(test::rewritten(cut, change));
    EXPECT_GT(replayed.replies, 0u);
    EXPECT_NE(replayed.verdict, ReplayVerdict::kEqual);
  }
}

}  // namespace
}  // namespace sightline
