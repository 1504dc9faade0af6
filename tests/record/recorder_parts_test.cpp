// A session in several files: the head of each file, and which of them hold its scenes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "tests/record/studio.h"

namespace sightline {
namespace {

using test::Contents;
using test::contents_of;
using test::kSecondNs;
using test::numbers;
using test::Studio;
using ::testing::SizeIs;

TEST(Recorder, PartsFollowEachOtherWithoutLosingAMessage) {
  Studio studio({.limits = {.max_file_bytes = 3000, .free_reserve_bytes = 0}, .chunk_bytes = 500});
  auto recorder = studio.open();
  recorder->record(RecordTopic::kOpen, {1, 1}, v1::OpenSession());
  for (int i = 0; i < 300; ++i) {
    studio.tick(*recorder);
    studio.answer(*recorder);
    studio.writer->run_once();
  }
  recorder.reset();
  studio.writer.reset();
  EXPECT_GT(studio.files.files.size(), 3u);
  std::vector<uint64_t> all;
  for (const auto& [name, file] : studio.files.files) {  // in the order of their names
    const Contents found = contents_of(*file.bytes);
    EXPECT_EQ(found.topics.at(1), "/sightline/open");
    EXPECT_EQ(found.missing, 0u);
    if (found.ticks.empty()) continue;
    // This part has all ticks by itself: one snapshot tick for the earlier ones, then the rest unchanged.
    EXPECT_EQ(found.ticks, numbers(found.snapshot_ticks + 1, found.ticks.back()));
    // A tick that was not answered yet is in both parts.
    const bool again = !all.empty() && found.ticks.front() == all.back();
    all.insert(all.end(), found.ticks.begin() + (again ? 1 : 0), found.ticks.end());
  }
  EXPECT_EQ(all, numbers(1, 300));
}

TEST(Recorder, UnansweredTicksAreAlsoAtTheHeadOfTheNextPart) {
  Studio studio({.limits = {.free_reserve_bytes = 0}});
  auto recorder = studio.open();
  recorder->record(RecordTopic::kOpen, {1, 1}, v1::OpenSession());
  for (int i = 0; i < 5; ++i) studio.tick(*recorder), studio.answer(*recorder);
  for (int i = 0; i < 3; ++i) studio.tick(*recorder);
  v1::TickError refused;
  refused.set_sequence(7);
  refused.add_field_violations()->set_field("tick.dt_s");
  recorder->record(RecordTopic::kTickError, {studio.files.now_ns, studio.files.now_ns}, refused);
  studio.later(1);
  studio.files.files.clear();  // so that the next part begins
  studio.later(2);
  studio.later(2);
  studio.answer(*recorder);
  recorder.reset();
  studio.writer.reset();
  ASSERT_THAT(studio.files.files, SizeIs(1));
  const Contents found = contents_of(*studio.files.files.begin()->second.bytes);
  EXPECT_EQ(found.snapshot_ticks, 5u);
  EXPECT_EQ(found.ticks, (std::vector<uint64_t>{6, 8}));
  EXPECT_EQ(found.replies, 1u);
}

// Every tick is small, but all their changes together are larger than a message may be.
TEST(Recorder, APartWithATooLargeSnapshotReportsAGapInstead) {
  constexpr uint64_t kInstances = 200;
  Studio studio({.limits = {.max_file_bytes = 60'000, .free_reserve_bytes = 0},
                 .chunk_bytes = 500,
                 .max_message_bytes = 3000,
                 .for_viewers = false});
  auto recorder = studio.open();
  v1::OpenSession open;
  for (uint64_t id = 1; id <= kInstances; ++id) open.add_instances()->set_id(id);
  EXPECT_TRUE(recorder->record(RecordTopic::kOpen, {1, 1}, open));
  for (uint64_t id = 1; id <= kInstances; ++id) {
    v1::Tick tick;
    tick.set_sequence(++studio.ticks);
    tick.mutable_transforms()->add_ids(id);
    for (int axis = 0; axis < 3; ++axis) tick.mutable_transforms()->add_positions(1.0);
    studio.files.now_ns += kSecondNs / 60;
    EXPECT_TRUE(recorder->record(RecordTopic::kTick, {studio.files.now_ns, studio.files.now_ns}, tick));
    studio.answer(*recorder);
    studio.writer->run_once();
  }
  recorder.reset();
  studio.writer->run_once();
  EXPECT_EQ(studio.writer->counts().dropped_messages, 0u) << "every tick is in a part";

  size_t with_snapshot = 0, too_large = 0;
  for (const auto& [name, file] : studio.files.files) {
    const Contents found = contents_of(*file.bytes);
    if (found.ticks.empty() || found.ticks.front() == 1) continue;  // from the start
    if (found.snapshot_ticks > 0) {
      EXPECT_EQ(too_large, 0u) << "all that there is only grows";
      EXPECT_EQ(found.gap_messages, 0u);
      ++with_snapshot;
      continue;
    }
    ++too_large;
    EXPECT_EQ(found.topics.at(2), "/sightline/gap");
    EXPECT_EQ(found.gap_messages, found.ticks.front() - 1);
    EXPECT_EQ(found.gap_reasons, std::set{v1::Gap::REASON_TOO_LARGE});
  }
  EXPECT_GT(with_snapshot, 0u);
  EXPECT_GT(too_large, 0u);
}

// A message for viewers can be too large when it is made, and again at the head of a later part.
TEST(Recorder, TooLargeViewerMessagesAreCountedButNotReportedMissing) {
  constexpr uint64_t kMany = 30;
  Studio studio({.limits = {.free_reserve_bytes = 0}, .max_message_bytes = 1000});
  auto recorder = studio.open();
  recorder->record(RecordTopic::kOpen, {1, 1}, v1::OpenSession());
  const auto tell = [&](const v1::SceneDelta& delta) {
    v1::Tick tick;
    tick.set_sequence(++studio.ticks);
    *tick.mutable_delta() = delta;
    EXPECT_TRUE(recorder->record(RecordTopic::kTick, {studio.files.now_ns, studio.files.now_ns}, tick));
    studio.answer(*recorder);
    studio.later(1);
  };
  v1::SceneDelta all_come, all_go;
  for (uint64_t id = 1; id <= kMany; ++id) {
    v1::NewInstance& instance = *all_come.add_added_instances();
    instance.set_id(id);
    instance.mutable_shape()->mutable_sphere()->set_radius(1.0);
    all_go.add_removed_ids(id);
  }
  tell(all_come);
  constexpr uint64_t kShapesAndFrames = 2;
  EXPECT_EQ(studio.writer->counts().dropped_messages, kShapesAndFrames);
  ASSERT_THAT(studio.warnings, SizeIs(1));
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::REASON_TOO_LARGE);
  EXPECT_FALSE(recorder->degraded());

  studio.files.files.clear();  // so that the next part begins
  studio.later(2);
  const uint64_t dropped = studio.writer->counts().dropped_messages;
  studio.later(2);
  tell(all_go);
  EXPECT_EQ(studio.writer->counts().dropped_messages, dropped + kShapesAndFrames);
  recorder.reset();
  studio.writer.reset();
  std::vector<uint32_t> numbers;
  const MemorySource source(*studio.files.files.begin()->second.bytes);
  McapReader::open(source, {}).value().read({.topics = {"/scene/shapes"}}, [&](const McapMessage& m) {
    numbers.push_back(m.message.sequence);
    return true;
  });
  EXPECT_THAT(numbers, ::testing::ElementsAre(2)) << "1 is of the opening";
}

TEST(Recorder, AFirstFileThatComesLateHasTheOpeningAllTheSame) {
  Studio studio;
  studio.files.folder_forbidden = true;
  auto recorder = studio.open();
  recorder->record(RecordTopic::kOpen, {1, 1}, v1::OpenSession());
  studio.tick(*recorder), studio.answer(*recorder);
  studio.writer->run_once();
  studio.files.folder_forbidden = false;
  studio.later(2);
  studio.tick(*recorder);
  recorder.reset();
  studio.writer.reset();
  ASSERT_THAT(studio.files.files, SizeIs(1));
  const Contents found = contents_of(*studio.files.files.begin()->second.bytes);
  EXPECT_EQ(found.topics.at(1), "/sightline/open");
  EXPECT_EQ(found.snapshot_ticks, 1u);
  EXPECT_EQ(found.ticks, numbers(2, 2));
  EXPECT_EQ(found.gap_messages, 3u);
}

std::vector<std::pair<std::string, std::string>> attachments_of(const std::string& bytes) {
  const MemorySource source(bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  std::vector<std::pair<std::string, std::string>> found;
  for (const auto& index : reader.info().attachments)
    found.emplace_back(index.name, reader.attachment(index).value());
  return found;
}

TEST(Recorder, ScenesGoInAsAttachments) {
  Studio studio;
  auto recorder = studio.open();
  const auto scene = std::make_shared<const std::string>(3'000'000, 'g');
  const auto more = std::make_shared<const std::string>("more");
  EXPECT_TRUE(recorder->attach("hall.glb", "model/gltf-binary", 5, scene));
  EXPECT_TRUE(recorder->attach("more.glb", "model/gltf-binary", 5, more));
  studio.tick(*recorder);
  studio.writer->run_once();
  EXPECT_TRUE(recorder->attach("late.glb", "model/gltf-binary", 5, more));
  recorder.reset();
  studio.writer.reset();
  using Pair = std::pair<std::string, std::string>;
  EXPECT_THAT(
      attachments_of(*studio.files.files.begin()->second.bytes),
      ::testing::ElementsAre(Pair("hall.glb", *scene), Pair("more.glb", "more"), Pair("late.glb", "more")));
}

TEST(Recorder, EveryPartHasTheScenesUnlessTheyAreLarge) {
  for (const size_t scene_bytes : {size_t{20'000}, size_t{200'000}}) {
    Studio studio({.limits = {.max_file_bytes = 60'000, .free_reserve_bytes = 0},
                   .chunk_bytes = 500,
                   .for_viewers = false});
    auto recorder = studio.open();
    EXPECT_TRUE(recorder->attach("hall.glb", "", 5, std::make_shared<const std::string>(scene_bytes, 'g')));
    for (int i = 0; i < 6000; ++i) {
      studio.tick(*recorder);
      studio.writer->run_once();
    }
    recorder.reset();
    studio.writer.reset();
    EXPECT_GT(studio.files.files.size(), 3u);
    EXPECT_LT(studio.files.files.size(), 60u) << "a scene does not end a part by itself";
    for (const auto& [name, file] : studio.files.files) {
      const bool has = scene_bytes == 20'000 || name.ends_with("-p001.mcap");
      EXPECT_THAT(attachments_of(*file.bytes), SizeIs(has ? 1 : 0)) << name;
    }
  }
}

TEST(Recorder, AttachmentsOfASessionAreBounded) {
  Studio studio;
  auto recorder = studio.open();
  const auto none = std::make_shared<const std::string>();
  for (size_t i = 0; i < SessionRecorder::kMaxAttachments; ++i)
    ASSERT_TRUE(recorder->attach(std::to_string(i), "", 5, none));
  EXPECT_FALSE(recorder->attach("more", "", 5, none));
}

}  // namespace
}  // namespace sightline
