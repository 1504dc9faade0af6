// A session in several files: the head of each file, and which of them hold its scenes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "server/base/random.h"
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

// One message of a file, as a line: topic, sequence number, log time and publish time in milliseconds since the session
// began.
std::vector<std::string> lines_of(const std::string& bytes, uint64_t start_ns) {
  const auto ms = [&](uint64_t ns) { return std::to_string(static_cast<int64_t>(ns - start_ns) / 1'000'000); };
  std::vector<std::string> lines;
  const MemorySource source(bytes);
  McapReader::open(source, {}).value().read({}, [&](const McapMessage& m) {
    lines.push_back(m.channel.topic.substr(sizeof("/sightline/") - 1) + " " + std::to_string(m.message.sequence) +
                    " at " + ms(m.message.log_time_ns) + ", " + ms(m.message.publish_time_ns));
    return true;
  });
  return lines;
}

// A session whose messages come at given milliseconds, and whose first part is removed so that another one begins.
struct SecondPart {
  SecondPart() {
    record(RecordTopic::kOpen, 1, v1::OpenSession());
    record(RecordTopic::kOpened, 2, v1::SessionOpened());
  }
  template <typename Message>
  void record(RecordTopic topic, uint64_t ms, const Message& message) {
    const uint64_t ns = start_ns + ms * 1'000'000;
    studio.files.now_ns = std::max(studio.files.now_ns, ns);
    EXPECT_TRUE(recorder->record(topic, {ns, ns - 1'000'000}, message));
  }
  void tick(uint64_t ms, uint64_t sequence) {
    v1::Tick tick;
    tick.set_sequence(sequence);
    record(RecordTopic::kTick, ms, tick);
  }
  void reply(uint64_t ms, uint64_t sequence) {
    v1::CameraReply reply;
    reply.set_sequence(sequence);
    record(RecordTopic::kReply, ms, reply);
  }
  // Nothing is lost: all that came is on the disk before the part is removed. Takes six seconds.
  void next_part() {
    studio.later(2);
    studio.later(1);
    studio.files.files.clear();
    studio.later(1);
    studio.later(2);
  }
  std::vector<std::string> lines() {
    recorder.reset();
    studio.writer->run_once();
    EXPECT_THAT(studio.files.files, SizeIs(1));
    return lines_of(*studio.files.files.begin()->second.bytes, start_ns);
  }

  Studio studio{{.limits = {.free_reserve_bytes = 0}, .for_viewers = false}};
  const uint64_t start_ns = studio.files.now_ns;
  std::unique_ptr<SessionRecorder> recorder = studio.open();
};

TEST(RecorderHead, RepeatsTheOpeningTheAnsweredTicksAsOneAndThoseThatWait) {
  SecondPart session;
  session.tick(10, 1), session.reply(11, 1);
  session.tick(20, 2), session.reply(21, 2);
  session.tick(30, 3);
  session.tick(40, 4);
  session.next_part();
  session.reply(9000, 3);
  EXPECT_THAT(session.lines(),
              ::testing::ElementsAre("info 1 at 20, 20", "open 1 at 20, 20", "opened 1 at 20, 20", "tick 2 at 20, 19",
                                     "tick 3 at 30, 29", "tick 4 at 40, 39", "reply 3 at 9000, 8999"))
      << "the head has the times of its ticks, so that times rise";
}

TEST(RecorderHead, WithoutAnsweredTicksItBeginsWithTheFirstThatWaits) {
  SecondPart session;
  session.tick(30, 1);
  session.tick(40, 2);
  session.next_part();
  session.reply(9000, 1);
  session.studio.writer->run_once();
  EXPECT_FALSE(session.recorder->wants_memory()) << "the ticks are all there";
  EXPECT_THAT(session.lines(), ::testing::ElementsAre("info 1 at 30, 30", "open 1 at 30, 30", "opened 1 at 30, 30",
                                                      "tick 1 at 30, 29", "tick 2 at 40, 39", "reply 1 at 9000, 8999"));
}

TEST(RecorderHead, WithoutAnyTickItHasTheTimeOfTheNextMessage) {
  SecondPart session;
  session.next_part();
  session.tick(9000, 1);
  EXPECT_THAT(session.lines(), ::testing::ElementsAre("info 1 at 9000, 9000", "open 1 at 9000, 9000",
                                                      "opened 1 at 9000, 9000", "tick 1 at 9000, 8999"));
}

TEST(RecorderHead, AGapFollowsTheTicksThatWait) {
  SecondPart session;
  session.tick(10, 1), session.reply(11, 1);
  session.tick(30, 2);
  session.studio.later(2);
  session.studio.later(1);
  session.studio.files.files.clear();
  session.studio.later(1);
  session.tick(5000, 3);  // lost, because no file is tried within a second of the last one; but it waits for its answer
  session.studio.writer->run_once();
  session.studio.later(2);
  session.reply(9000, 2);
  EXPECT_THAT(session.lines(), ::testing::ElementsAre("info 1 at 10, 10", "open 1 at 10, 10", "opened 1 at 10, 10",
                                                      "tick 1 at 10, 9", "tick 2 at 30, 29", "tick 3 at 5000, 4999",
                                                      "gap 1 at 5000, 5000", "reply 2 at 9000, 8999"));
}

// A memory is of the moment after the newest reply. A message after it makes it old.
TEST(RecorderHead, AMemoryIsRepeatedWhileNothingCameAfterIt) {
  for (const bool old : {false, true}) {
    SecondPart session;
    session.tick(10, 1), session.reply(11, 1);
    session.record(RecordTopic::kMemory, 12, v1::StepMemory());
    if (old) session.tick(20, 2), session.reply(21, 2);
    session.next_part();
    EXPECT_FALSE(session.recorder->wants_memory()) << "there is no file, so none is nearly full";
    session.tick(9000, 9);
    session.studio.writer->run_once();
    EXPECT_EQ(session.recorder->wants_memory(), old) << "a part that begins without a memory asks for one";
    if (old) session.record(RecordTopic::kMemory, 9001, v1::StepMemory());
    session.studio.writer->run_once();
    EXPECT_FALSE(session.recorder->wants_memory());
    const std::vector<std::string> lines = session.lines();
    if (old)
      EXPECT_THAT(lines, ::testing::ElementsAre("info 1 at 20, 20", "open 1 at 20, 20", "opened 1 at 20, 20",
                                                "tick 2 at 20, 19", "tick 3 at 9000, 8999", "memory 2 at 9001, 9000"));
    else
      EXPECT_THAT(lines, ::testing::ElementsAre("info 1 at 10, 10", "open 1 at 10, 10", "opened 1 at 10, 10",
                                                "tick 1 at 10, 9", "memory 1 at 12, 11", "tick 2 at 9000, 8999"));
  }
}

TEST(RecorderHead, AMemoryEndsAPartThatIsNearlyFull) {
  Studio studio(
      {.limits = {.max_file_bytes = 300'000, .free_reserve_bytes = 0}, .chunk_bytes = 500, .for_viewers = false});
  auto recorder = studio.open();
  recorder->record(RecordTopic::kOpen, {1, 1}, v1::OpenSession());
  const auto parts = [&] { return studio.files.files.size(); };
  const auto memory = [&] {
    recorder->record(RecordTopic::kMemory, {studio.files.now_ns, studio.files.now_ns}, v1::StepMemory());
    studio.writer->run_once();
  };
  memory();
  studio.tick(*recorder), studio.answer(*recorder);
  studio.writer->run_once();
  EXPECT_EQ(parts(), 1u) << "the part has room";
  CounterRandom random(1, 0, RandomPurpose::kTest);
  while (!recorder->wants_memory() && parts() == 1) {
    studio.tick(*recorder), studio.answer(*recorder);
    v1::Fault fault;
    for (int i = 0; i < 1000; ++i) fault.mutable_message()->push_back(static_cast<char>('a' + random.next_below(26)));
    recorder->record(RecordTopic::kFault, {studio.files.now_ns, studio.files.now_ns}, fault);
    studio.writer->run_once();
  }
  ASSERT_EQ(parts(), 1u);
  EXPECT_LT(studio.files.total(), 300'000u) << "it asks before the part is full";
  memory();
  studio.tick(*recorder);
  studio.writer->run_once();
  ASSERT_EQ(parts(), 2u);
  EXPECT_FALSE(recorder->wants_memory());
  recorder.reset();
  studio.writer.reset();
  const Contents second = contents_of(*studio.files.files.rbegin()->second.bytes);
  ASSERT_GE(second.topics.size(), 4u);
  EXPECT_EQ(second.topics[3], "/sightline/memory") << "it begins with the opening, the snapshot and the memory";
}

// A head stands in other parts too, or in Gaps of its own. It is no loss when the disk takes no part of it.
TEST(RecorderHead, ALostHeadCountsNoMessages) {
  SecondPart session;
  session.tick(10, 1), session.reply(11, 1);
  session.tick(20, 2);
  session.next_part();
  session.reply(9000, 2);
  session.studio.files.disk_full = true;
  session.studio.writer->run_once();
  session.studio.later(2);
  EXPECT_EQ(session.studio.writer->counts().dropped_messages, 1u) << "the reply";
}

// Every tick is small, but all their changes together are larger than a message may be.
TEST(Recorder, APartWithATooLargeSnapshotReportsAGapInstead) {
  constexpr uint64_t kInstances = 200;
  Studio studio({.limits = {.max_file_bytes = 20'000, .free_reserve_bytes = 0},
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
  for (const auto& index : reader.info().attachments) found.emplace_back(index.name, reader.attachment(index).value());
  return found;
}

// When each was logged and created, in nanoseconds.
std::vector<std::pair<uint64_t, uint64_t>> attachment_times_of(const std::string& bytes) {
  const MemorySource source(bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  std::vector<std::pair<uint64_t, uint64_t>> found;
  for (const auto& index : reader.info().attachments) found.emplace_back(index.log_time_ns, index.create_time_ns);
  return found;
}

TEST(Recorder, ScenesGoInAsAttachments) {
  Studio studio;
  auto recorder = studio.open();
  const auto scene = std::make_shared<const std::string>(3'000'000, 'g');
  const auto more = std::make_shared<const std::string>("more");
  EXPECT_TRUE(recorder->attach("hall.glb", "model/gltf-binary", 5, scene));
  EXPECT_TRUE(recorder->attach("more.glb", "model/gltf-binary", 6, more));
  studio.tick(*recorder);
  studio.writer->run_once();
  EXPECT_TRUE(recorder->attach("late.glb", "model/gltf-binary", 7, more));
  recorder.reset();
  studio.writer.reset();
  using Pair = std::pair<std::string, std::string>;
  const std::string& bytes = *studio.files.files.begin()->second.bytes;
  EXPECT_THAT(attachments_of(bytes),
              ::testing::ElementsAre(Pair("hall.glb", *scene), Pair("more.glb", "more"), Pair("late.glb", "more")));
  using Times = std::pair<uint64_t, uint64_t>;
  EXPECT_THAT(attachment_times_of(bytes), ::testing::ElementsAre(Times(5, 5), Times(6, 6), Times(7, 7)));
}

TEST(Recorder, EveryPartHasTheScenesUnlessTheyAreLarge) {
  for (const size_t scene_bytes : {size_t{20'000}, size_t{200'000}}) {
    Studio studio(
        {.limits = {.max_file_bytes = 60'000, .free_reserve_bytes = 0}, .chunk_bytes = 500, .for_viewers = false});
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
