// Recording without waiting, through all the ways in which a disk can fail.
#include "server/record/recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <set>

#include "foxglove/camera.pb.h"
#include "server/base/random.h"
#include "server/record/mcap_reader.h"
#include "server/record/mcap_verify.h"
#include "server/record/viewer_channels.h"
#include "tests/record/pretended_files.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr uint64_t kSecondNs = 1'000'000'000;

// A writer over a pretended disk whose clock is moved by hand; nothing runs but what the test calls.
struct Studio {
  explicit Studio(RecordSettings with = {}) : settings(std::move(with)) {
    files.now_ns = 1000 * kSecondNs;
    settings.folder = "recordings";
    make_writer();
  }
  void make_writer() {
    writer = std::make_unique<RecordWriter>(
        settings, files, [this] { return files.now_ns; },
        [this](const RecordWarning& warning) { warnings.push_back(warning); });
  }
  std::unique_ptr<SessionRecorder> open(const std::string& id = "abc") {
    v1::RecordingInfo info;
    info.set_session_id(id);
    info.set_seed(7);
    info.set_sampler("embree");
    return writer->open_session(info);
  }
  // One tick of 1/60 s; true when it was taken.
  bool tick(SessionRecorder& recorder) {
    v1::Tick tick;
    tick.set_sequence(++ticks);
    tick.set_time_s(static_cast<double>(ticks) / 60);
    files.now_ns += kSecondNs / 60;
    return recorder.record(RecordTopic::kTick, {files.now_ns, files.now_ns}, tick);
  }
  // To the newest tick.
  void answer(SessionRecorder& recorder) {
    v1::CameraReply reply;
    reply.set_sequence(ticks);
    recorder.record(RecordTopic::kReply, {files.now_ns, files.now_ns}, reply);
  }
  void later(uint64_t seconds) {
    files.now_ns += seconds * kSecondNs;
    writer->run_once();
  }

  RecordSettings settings;
  test::PretendedFiles files;
  std::vector<RecordWarning> warnings;
  std::unique_ptr<RecordWriter> writer;
  uint64_t ticks = 0;
};

struct Contents {
  std::vector<uint64_t> ticks;  // their own sequence; without one that stands for others
  uint64_t folded_ticks = 0;
  uint64_t replies = 0;
  uint64_t gap_messages = 0;
  std::vector<std::string> topics;  // of every message
  uint64_t missing = 0;             // by the sequence numbers of the tick's topic
};

Contents contents_of(const std::string& bytes, bool sound = true) {
  const MemorySource source(bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  EXPECT_TRUE(!sound || verify_mcap(source, {}).value().sound());
  Contents found;
  bool first_tick = true;
  reader.read({}, [&](const McapMessage& m) {
    found.topics.push_back(m.channel.topic);
    if (m.channel.topic == "/sightline/info") {
      v1::RecordingInfo info;
      EXPECT_TRUE(info.ParseFromString(std::string(m.message.data)));
      found.folded_ticks = info.folded_ticks();
    }
    found.replies += m.channel.topic == "/sightline/reply";
    if (m.channel.topic == "/sightline/tick") {
      v1::Tick tick;
      EXPECT_TRUE(tick.ParseFromString(std::string(m.message.data)));
      if (found.folded_ticks == 0 || !std::exchange(first_tick, false)) found.ticks.push_back(tick.sequence());
    }
    if (m.channel.topic == "/sightline/gap") {
      v1::Gap gap;
      EXPECT_TRUE(gap.ParseFromString(std::string(m.message.data)));
      found.gap_messages += gap.messages();
    }
    return true;
  });
  const auto topics = verify_mcap(source, {}).value().topics;
  if (const auto tick = topics.find("/sightline/tick"); tick != topics.end())
    found.missing = tick->second.missing;
  return found;
}

std::vector<uint64_t> numbers(uint64_t first, uint64_t last) {
  std::vector<uint64_t> out;
  for (uint64_t i = first; i <= last; ++i) out.push_back(i);
  return out;
}

TEST(Recorder, WhatWasRecordedIsInTheFile) {
  Studio studio;
  auto recorder = studio.open();
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(studio.tick(*recorder));
  v1::CameraReply reply;
  reply.set_reason_text("all seen");
  EXPECT_TRUE(recorder->record(RecordTopic::kReply, {5, 6}, reply));
  EXPECT_FALSE(recorder->degraded());
  recorder.reset();
  studio.writer->run_once();

  ASSERT_THAT(studio.files.files, SizeIs(1));
  const std::string& bytes = *studio.files.files.begin()->second.bytes;
  const Contents found = contents_of(bytes);
  EXPECT_EQ(found.topics.front(), "/sightline/info");
  EXPECT_EQ(found.ticks, numbers(1, 100));
  EXPECT_EQ(found.missing, 0u);
  const MemorySource source(bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  EXPECT_EQ(reader.metadata(reader.info().metadata.at(0)).value().values.at("seed"), "7");
  reader.read({.topics = {"/sightline/reply"}}, [&](const McapMessage& m) {
    v1::CameraReply back;
    EXPECT_TRUE(back.ParseFromString(std::string(m.message.data)));
    EXPECT_EQ(back.reason_text(), "all seen");
    EXPECT_EQ(m.message.log_time_ns, 5u);
    EXPECT_EQ(m.message.publish_time_ns, 6u);
    EXPECT_EQ(m.schema->name, "sightline.v1.CameraReply");
    return true;
  });
  EXPECT_EQ(studio.writer->counts().open_sessions, 0u);
  EXPECT_THAT(studio.warnings, SizeIs(0));
}

TEST(Recorder, AFullQueueDropsCountsAndSaysSoInTheFile) {
  Studio studio({.queue_bytes = 4096});
  auto recorder = studio.open();
  uint64_t taken = 0, dropped = 0;
  for (int i = 0; i < 500; ++i) (studio.tick(*recorder) ? taken : dropped) += 1;  // nobody takes them out
  EXPECT_GT(dropped, 300u);
  EXPECT_TRUE(recorder->degraded());
  EXPECT_EQ(recorder->dropped(), dropped);
  studio.writer->run_once();
  EXPECT_EQ(studio.writer->counts().dropped_messages, dropped);
  ASSERT_THAT(studio.warnings, SizeIs(1));
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::QUEUE_FULL);
  EXPECT_TRUE(studio.tick(*recorder)) << "it picks up again";
  EXPECT_FALSE(recorder->degraded());
  recorder.reset();
  studio.writer.reset();

  const Contents found = contents_of(*studio.files.files.begin()->second.bytes);
  EXPECT_EQ(found.ticks.size(), taken + 1);
  EXPECT_EQ(found.gap_messages, dropped);
  EXPECT_EQ(found.missing, dropped);
}

TEST(Recorder, AQueueThatStaysFullIsWarnedOfOnce) {
  Studio studio({.queue_bytes = 4096});
  auto recorder = studio.open();
  const auto overfill = [&] {
    for (int i = 0; i < 300; ++i) studio.tick(*recorder);
    studio.writer->run_once();
  };
  for (int round = 0; round < 5; ++round) overfill();
  EXPECT_THAT(studio.warnings, SizeIs(1));
  studio.writer->run_once();
  ASSERT_THAT(studio.warnings, SizeIs(2));
  EXPECT_TRUE(studio.warnings[1].over);
  overfill();
  ASSERT_THAT(studio.warnings, SizeIs(3)) << "it had recovered in between";
  EXPECT_FALSE(studio.warnings[2].over);
  EXPECT_EQ(studio.writer->counts().dropped_messages, recorder->dropped());
}

TEST(Recorder, AMessageLargerThanTheQueueKeepsItsPlace) {
  Studio studio({.queue_bytes = 8192, .for_viewers = false});
  auto recorder = studio.open();
  v1::OpenSession open;
  for (uint64_t i = 0; i < 10'000; ++i) open.add_instances()->set_id(i + 1);
  EXPECT_TRUE(studio.tick(*recorder));
  EXPECT_TRUE(recorder->record(RecordTopic::kOpen, {1, 1}, open));
  EXPECT_TRUE(studio.tick(*recorder));
  EXPECT_TRUE(recorder->record(RecordTopic::kReply, {1, 1}, std::string(20'000, 'x')));
  EXPECT_TRUE(studio.tick(*recorder));
  recorder.reset();
  studio.writer.reset();
  const std::string& bytes = *studio.files.files.begin()->second.bytes;
  const Contents found = contents_of(bytes);
  EXPECT_THAT(found.topics, ::testing::ElementsAre("/sightline/info", "/sightline/tick", "/sightline/open",
                                                   "/sightline/tick", "/sightline/reply", "/sightline/tick"));
  const MemorySource source(bytes);
  McapReader::open(source, {}).value().read({.topics = {"/sightline/open"}}, [&](const McapMessage& m) {
    EXPECT_EQ(m.message.data, open.SerializeAsString());
    return true;
  });
  EXPECT_THAT(studio.warnings, SizeIs(0));
}

TEST(Recorder, LargeMessagesWaitWithinABound) {
  Studio studio({.queue_bytes = 8192, .for_viewers = false});
  auto recorder = studio.open();
  const std::string third(kMaxMessageBytes / 3, 'x');
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(recorder->record(RecordTopic::kReply, {1, 1}, third)) << i;
  EXPECT_FALSE(recorder->record(RecordTopic::kReply, {1, 1}, third)) << "nobody takes them out";
  studio.writer->run_once();
  EXPECT_TRUE(recorder->record(RecordTopic::kReply, {1, 1}, third));
  recorder.reset();
  studio.writer.reset();
  const Contents found = contents_of(*studio.files.files.begin()->second.bytes);
  EXPECT_EQ(std::count(found.topics.begin(), found.topics.end(), "/sightline/reply"), 4);
  EXPECT_EQ(found.gap_messages, 1u);
}

TEST(Recorder, AMessageLargerThanARecordingHoldsIsDroppedAndTheRestGoesOn) {
  Studio studio;
  auto recorder = studio.open();
  EXPECT_TRUE(studio.tick(*recorder));
  EXPECT_FALSE(recorder->record(RecordTopic::kReply, {1, 1}, std::string(kMaxMessageBytes + 1, 'x')));
  EXPECT_TRUE(studio.tick(*recorder));
  recorder.reset();
  studio.writer.reset();
  const Contents found = contents_of(*studio.files.files.begin()->second.bytes);
  EXPECT_EQ(found.ticks, numbers(1, 2));
  EXPECT_EQ(found.gap_messages, 1u);
}

TEST(Recorder, AFullDiskIsWarnedOfOnceAndWritingGoesOnInANextPart) {
  Studio studio({.for_viewers = false});
  auto recorder = studio.open();
  recorder->record(RecordTopic::kOpen, {1, 1}, v1::OpenSession());
  const auto tick = [&] {
    studio.tick(*recorder);
    studio.answer(*recorder);
  };
  for (int i = 0; i < 60; ++i) tick();
  studio.later(1);
  studio.files.disk_full = true;
  for (int i = 0; i < 120; ++i) {
    tick();
    studio.writer->run_once();
  }
  studio.later(1);
  EXPECT_TRUE(recorder->degraded());
  EXPECT_EQ(studio.writer->counts().failing_sessions, 1u);
  EXPECT_GT(studio.writer->counts().write_failures, 0u);
  ASSERT_THAT(studio.warnings, SizeIs(1));
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::NO_SPACE);
  EXPECT_THAT(studio.warnings[0].text, HasSubstr("full"));

  studio.files.disk_full = false;
  studio.later(2);
  for (int i = 0; i < 60; ++i) tick();
  studio.writer->run_once();
  studio.later(1);
  EXPECT_FALSE(recorder->degraded());
  ASSERT_THAT(studio.warnings, SizeIs(2));
  EXPECT_TRUE(studio.warnings[1].over);
  recorder.reset();
  studio.writer.reset();

  uint64_t written = 0, missing = 0;
  std::vector<uint64_t> all;
  for (const auto& [name, file] : studio.files.files) {
    if (file.bytes->empty()) continue;
    const bool first = name.ends_with("-p001.mcap");
    const Contents found = contents_of(*file.bytes, !first);
    written += found.ticks.size() + found.replies;
    missing += found.gap_messages;
    all.insert(all.end(), found.ticks.begin(), found.ticks.end());
    EXPECT_EQ(found.topics.at(1), "/sightline/open") << "so that each can be read by itself";
    EXPECT_EQ(found.folded_ticks, first ? 0u : found.ticks.front() - 1) << "the lost ones among them";
  }
  EXPECT_EQ(written + missing, 2 * 240u) << "what is not there is told";
  EXPECT_EQ(std::set<uint64_t>(all.begin(), all.end()).size(), all.size());
}

// Whichever way a chunk ends, by the clock or by a message that comes too late for it.
TEST(Recorder, RecoveryIsNoticedWhileMessagesKeepComing) {
  Studio studio;
  auto recorder = studio.open();
  const auto seconds = [&](int count) {
    for (int i = 0; i < 60 * count; ++i) {
      studio.tick(*recorder);
      studio.writer->run_once();
    }
  };
  seconds(1);
  studio.files.disk_full = true;
  seconds(3);
  EXPECT_TRUE(recorder->degraded());
  studio.files.disk_full = false;
  seconds(3);
  EXPECT_FALSE(recorder->degraded());
  ASSERT_THAT(studio.warnings, SizeIs(2));
  EXPECT_TRUE(studio.warnings[1].over);
}

TEST(Recorder, ARemovedFileAndAFolderThatCannotBeMadeAreNoticed) {
  Studio studio;
  auto recorder = studio.open();
  for (int i = 0; i < 60; ++i) studio.tick(*recorder);
  studio.writer->run_once();
  ASSERT_THAT(studio.files.files, SizeIs(1));
  studio.files.files.clear();
  studio.files.folder_forbidden = true;
  studio.later(2);
  EXPECT_TRUE(recorder->degraded());
  ASSERT_THAT(studio.warnings, SizeIs(1));
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::WRITE_FAILED);
  for (int i = 0; i < 600; ++i) {
    studio.tick(*recorder);
    studio.writer->run_once();
  }
  EXPECT_THAT(studio.warnings, SizeIs(1)) << "once, not every second";
  studio.files.folder_forbidden = false;
  studio.later(2);
  studio.tick(*recorder);
  studio.writer->run_once();
  studio.later(1);
  EXPECT_FALSE(recorder->degraded());
  recorder.reset();
  studio.writer.reset();
  ASSERT_THAT(studio.files.files, SizeIs(1));
  EXPECT_THAT(contents_of(*studio.files.files.begin()->second.bytes).gap_messages, ::testing::Ge(600u));
}

TEST(Recorder, TheDisksReserveIsNotTouched) {
  Studio studio({.limits = {.free_reserve_bytes = 10'000'000}});
  studio.files.capacity = 12'000'000;
  studio.files.put("sightline-20200101T000000.000Z-old-p001.mcap", 1'500'000, 1);
  studio.files.put("sightline-20200102T000000.000Z-old-p001.mcap", 400'000, 2);
  studio.files.put("holiday.mcap", 300'000, 0);
  auto recorder = studio.open();
  v1::CameraReply reply;
  CounterRandom random(1, 0, RandomPurpose::kTest);
  std::string noise(50'000, '\0');
  uint64_t most = 0;
  for (int i = 0; i < 400; ++i) {
    for (char& c : noise) c = static_cast<char>('a' + random.next_below(26));
    reply.set_reason_text(noise);
    recorder->record(RecordTopic::kReply, {studio.files.now_ns, studio.files.now_ns}, reply);
    studio.files.now_ns += kSecondNs / 2;
    studio.writer->run_once();
    most = std::max(most, studio.files.total());
  }
  EXPECT_LE(most, 2'000'000u + 300'000u) << "what is written between two looks at the disk";
  EXPECT_FALSE(recorder->degraded()) << "the oldest make room";
  EXPECT_TRUE(studio.files.files.contains("holiday.mcap")) << "not ours";
  EXPECT_FALSE(studio.files.files.contains("sightline-20200101T000000.000Z-old-p001.mcap"))
      << "the oldest went first";
  EXPECT_EQ(studio.writer->counts().removed_files,
            2u + studio.files.creations - (studio.files.files.size() - 1));
}

TEST(Recorder, ADiskThatOthersFilledIsLeftAlone) {
  Studio studio({.limits = {.free_reserve_bytes = 10'000'000}});
  studio.files.capacity = 12'000'000;
  studio.files.put("holiday.mcap", 3'000'000, 0);
  auto recorder = studio.open();
  for (int i = 0; i < 600; ++i) {
    studio.tick(*recorder);
    studio.writer->run_once();
  }
  EXPECT_TRUE(recorder->degraded());
  EXPECT_EQ(recorder->dropped(), 600u);
  EXPECT_THAT(studio.files.files, SizeIs(1)) << "nothing is written, nothing of others removed";
  ASSERT_THAT(studio.warnings, SizeIs(1));
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::NO_SPACE);
  studio.files.files.clear();
  studio.later(2);
  studio.tick(*recorder);
  studio.writer->run_once();
  studio.later(1);
  EXPECT_FALSE(recorder->degraded());
}

TEST(Recorder, TheFolderStaysWithinItsTotalAndTheOldestGo) {
  Studio studio({.limits = {.max_total_bytes = 8 << 20, .free_reserve_bytes = 0}, .for_viewers = false});
  auto recorder = studio.open();
  CounterRandom random(1, 0, RandomPurpose::kTest);
  std::string noise(100'000, '\0');
  for (int i = 0; i < 600; ++i) {
    for (char& c : noise) c = static_cast<char>(random.next_u32());
    ASSERT_TRUE(recorder->record(RecordTopic::kReply, {studio.files.now_ns, studio.files.now_ns}, noise));
    studio.files.now_ns += kSecondNs;
    studio.writer->run_once();
    EXPECT_LE(studio.files.total(), (8u << 20) + 300'000u);
  }
  EXPECT_GT(studio.files.creations, 10u);
  EXPECT_FALSE(recorder->degraded());
  EXPECT_GT(studio.writer->counts().removed_files, 5u);
  for (const auto& [name, _] : studio.files.files) EXPECT_GT(name, "sightline-1970") << "the newest are left";
}

TEST(Recorder, OldFilesGoByTheirAge) {
  Studio studio({.limits = {.max_age_s = 100, .free_reserve_bytes = 0}});
  studio.files.put("sightline-a-p001.mcap", 10, 850 * kSecondNs);
  studio.files.put("sightline-b-p001.mcap", 10, 950 * kSecondNs);
  studio.files.put("other.txt", 10, 1);
  studio.writer->run_once();
  EXPECT_FALSE(studio.files.files.contains("sightline-a-p001.mcap"));
  EXPECT_TRUE(studio.files.files.contains("sightline-b-p001.mcap"));
  EXPECT_TRUE(studio.files.files.contains("other.txt"));
}

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
    // Whoever has only this part has all ticks: those before it in one, the rest as they were.
    EXPECT_EQ(found.ticks, numbers(found.folded_ticks + 1, found.ticks.back()));
    // A tick that was not answered yet stands in both.
    const bool again = !all.empty() && found.ticks.front() == all.back();
    all.insert(all.end(), found.ticks.begin() + (again ? 1 : 0), found.ticks.end());
  }
  EXPECT_EQ(all, numbers(1, 300));
}

TEST(Recorder, TicksThatNobodyAnsweredStandAtTheHeadOfTheNextPartToo) {
  Studio studio({.limits = {.free_reserve_bytes = 0}});
  auto recorder = studio.open();
  recorder->record(RecordTopic::kOpen, {1, 1}, v1::OpenSession());
  for (int i = 0; i < 5; ++i) studio.tick(*recorder), studio.answer(*recorder);
  for (int i = 0; i < 3; ++i) studio.tick(*recorder);
  v1::Rejection refused;
  refused.set_sequence(7);
  refused.add_field_violations()->set_field("tick.dt_s");
  recorder->record(RecordTopic::kRejection, {studio.files.now_ns, studio.files.now_ns}, refused);
  studio.later(1);
  studio.files.files.clear();  // so that the next part begins
  studio.later(2);
  studio.later(2);
  studio.answer(*recorder);
  recorder.reset();
  studio.writer.reset();
  ASSERT_THAT(studio.files.files, SizeIs(1));
  const Contents found = contents_of(*studio.files.files.begin()->second.bytes);
  EXPECT_EQ(found.folded_ticks, 5u);
  EXPECT_EQ(found.ticks, (std::vector<uint64_t>{6, 8}));
  EXPECT_EQ(found.replies, 1u);
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
  EXPECT_EQ(found.folded_ticks, 1u);
  EXPECT_EQ(found.ticks, numbers(2, 2));
  EXPECT_EQ(found.gap_messages, 3u);
}

TEST(Recorder, EverySessionHasItsOwnFile) {
  Studio studio;
  auto one = studio.open("one"), two = studio.open("../two");
  studio.tick(*one);
  studio.tick(*two);
  studio.tick(*one);
  EXPECT_EQ(studio.writer->counts().open_sessions, 2u);
  one.reset(), two.reset();
  studio.writer.reset();
  ASSERT_THAT(studio.files.files, SizeIs(2));
  for (const auto& [name, file] : studio.files.files) {
    EXPECT_TRUE(is_recording_name(name)) << name;
    const bool first = name.find("one") != std::string::npos;
    EXPECT_EQ(contents_of(*file.bytes).ticks,
              first ? (std::vector<uint64_t>{1, 3}) : (std::vector<uint64_t>{2}));
  }
}

TEST(Recorder, SessionsWithOneNameDoNotTakeEachOthersFile) {
  Studio studio;
  auto one = studio.open("same"), two = studio.open("same");
  studio.tick(*one);
  studio.tick(*two);
  one.reset(), two.reset();
  studio.writer.reset();
  std::vector<uint64_t> all;
  for (const auto& [_, file] : studio.files.files)
    for (const uint64_t tick : contents_of(*file.bytes).ticks) all.push_back(tick);
  EXPECT_EQ(all, numbers(1, 2));
  EXPECT_THAT(studio.files.files, SizeIs(2));
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
    EXPECT_TRUE(
        recorder->attach("hall.glb", "", 5, std::make_shared<const std::string>(scene_bytes, 'g')));
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

TEST(Recorder, ChunksCloseByTheClockThoughNothingMoreComes) {
  Studio studio;
  auto recorder = studio.open();
  for (int i = 0; i < 10; ++i) studio.tick(*recorder);
  studio.writer->run_once();
  EXPECT_TRUE(contents_of(*studio.files.files.begin()->second.bytes, false).ticks.empty());
  studio.later(1);
  EXPECT_EQ(contents_of(*studio.files.files.begin()->second.bytes, false).ticks, numbers(1, 10))
      << "on the disk without the file being finished";
}

// The process is killed while it records; what is on the disk then is looked at.
TEST(Recorder, AKillLosesLessThanASecond) {
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) / "recorder_kill";
  std::filesystem::remove_all(folder);
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  const auto wall_ns = [] {
    return static_cast<uint64_t>(std::chrono::system_clock::now().time_since_epoch().count());
  };
  const pid_t child = fork();
  if (child == 0) {
    const auto files = system_files();
    RecordSettings settings;
    settings.folder = folder.string();
    settings.limits.free_reserve_bytes = 0;
    RecordWriter writer(settings, *files, wall_ns, [](const RecordWarning&) {});
    RecordThread thread(writer, std::chrono::milliseconds(50));
    v1::RecordingInfo info;
    info.set_session_id("killed");
    auto recorder = writer.open_session(info);
    for (uint64_t i = 1;; ++i) {
      v1::Tick tick;
      tick.set_sequence(i);
      const uint64_t now_ns = wall_ns();
      recorder->record(RecordTopic::kTick, {now_ns, now_ns}, tick);
      if (write(pipe_ends[1], &now_ns, sizeof now_ns) < 0) _exit(1);
      std::this_thread::sleep_for(std::chrono::milliseconds(4));
    }
  }
  ASSERT_GT(child, 0);
  uint64_t last_ns = 0;
  for (int i = 0; i < 500; ++i)
    ASSERT_EQ(read(pipe_ends[0], &last_ns, sizeof last_ns), static_cast<ssize_t>(sizeof last_ns));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);

  const auto entry = std::filesystem::directory_iterator(folder);
  const auto source = open_file_source(entry->path().string()).value();
  const McapReader reader = McapReader::open(*source, {}).value();
  EXPECT_FALSE(reader.info().finished);
  std::vector<uint64_t> ticks;
  uint64_t newest_ns = 0;
  reader.read({.topics = {"/sightline/tick"}}, [&](const McapMessage& m) {
    v1::Tick tick;
    EXPECT_TRUE(tick.ParseFromString(std::string(m.message.data)));
    ticks.push_back(tick.sequence());
    newest_ns = m.message.log_time_ns;
    return true;
  });
  EXPECT_EQ(ticks, numbers(1, ticks.size()));
  EXPECT_LT(last_ns - std::min(last_ns, newest_ns), kSecondNs);
  close(pipe_ends[0]), close(pipe_ends[1]);
  std::filesystem::remove_all(folder);
}

TEST(ViewerChannels, ALensThatNoSessionTakesChangesNoPicture) {
  std::vector<uint32_t> heights;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic == RecordTopic::kCalibration)
      heights.push_back(dynamic_cast<const foxglove::CameraCalibration&>(made).height());
  };
  ViewerChannels viewers;
  viewers.take_open({}, 1, emit);
  for (const double aspect : {0.0, 2.0, 1e-300, -1.0, std::nan(""), 1e300, 0.0}) {
    v1::Tick tick;
    tick.mutable_lens()->set_aspect(aspect);
    viewers.take_tick(tick, 1, emit);
    viewers.take_reply({}, 1, emit);
  }
  EXPECT_THAT(heights, ::testing::ElementsAre(720, 640, 640, 640, 640, 640, 720));
}

TEST(RecordRing, GivesBackEveryMessageInOrderToAnotherThread) {
  RecordRing ring(8192);
  constexpr uint64_t kMessages = 200'000;
  std::thread producer([&] {
    CounterRandom random(3, 0, RandomPurpose::kTest);
    for (uint64_t i = 0; i < kMessages;) {
      const size_t size = random.next_below(300);
      char* at = ring.reserve(size);
      while (at == nullptr) {
        std::this_thread::yield();
        at = ring.reserve(size);
      }
      std::fill_n(at, size, static_cast<char>(i));
      ring.commit({static_cast<uint32_t>(size), 0, 0, static_cast<uint32_t>(i), 0, i, size});
      ++i;
    }
  });
  uint64_t right = 0;
  for (uint64_t i = 0; i < kMessages;) {
    RecordEntry entry;
    if (!ring.front(entry)) {
      std::this_thread::yield();
      continue;
    }
    const bool filled = std::all_of(entry.message.begin(), entry.message.end(),
                                    [&](char c) { return c == static_cast<char>(i); });
    right += entry.head.sequence == i && entry.head.log_time_ns == i &&
             entry.message.size() == entry.head.publish_time_ns && filled;
    ring.pop();
    ++i;
  }
  producer.join();
  EXPECT_EQ(right, kMessages);
}

TEST(RecordRing, HoldsAMessageOfHalfItsSizeWhereverItStands) {
  RecordRing ring(4096);
  RecordEntry entry;
  for (size_t i = 0; i < 2000; ++i) {
    const size_t size = i % 3 == 0 ? ring.max_message() : i % 100;
    ASSERT_NE(ring.reserve(size), nullptr) << i;
    ring.commit({.size = static_cast<uint32_t>(size), .sequence = static_cast<uint32_t>(i)});
    ASSERT_TRUE(ring.front(entry));
    EXPECT_EQ(entry.message.size(), size);
    ring.pop();
    EXPECT_FALSE(ring.front(entry));
  }
  EXPECT_EQ(ring.reserve(ring.max_message() + 1), nullptr);
}

}  // namespace
}  // namespace sightline
