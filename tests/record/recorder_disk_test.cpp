// Recording when the disk fails in any way, and within the limits of its folder.
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
using test::Studio;
using ::testing::HasSubstr;
using ::testing::SizeIs;

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
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::REASON_NO_SPACE);
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
    EXPECT_EQ(found.snapshot_ticks, first ? 0u : found.ticks.front() - 1) << "the lost ones among them";
  }
  EXPECT_EQ(written + missing, 2 * 240u) << "what is not there is told";
  EXPECT_EQ(std::set<uint64_t>(all.begin(), all.end()).size(), all.size());
}

// A process that is killed leaves what was handed to the disk.
TEST(Recorder, TheOpeningIsOnTheDiskAtOnce) {
  Studio studio({.for_viewers = false});
  auto recorder = studio.open();
  recorder->record(RecordTopic::kOpen, {1, 1}, v1::OpenSession());
  studio.writer->run_once();
  recorder->record(RecordTopic::kOpened, {2, 2}, v1::SessionOpened());
  studio.writer->run_once();
  ASSERT_EQ(studio.files.files.size(), 1u);
  const Contents found = contents_of(*studio.files.files.begin()->second.bytes, false);
  EXPECT_THAT(found.topics, ::testing::ElementsAre("/sightline/info", "/sightline/open", "/sightline/opened"));
  // What follows goes into chunks, as ever.
  studio.tick(*recorder);
  studio.writer->run_once();
  EXPECT_THAT(contents_of(*studio.files.files.begin()->second.bytes, false).ticks, SizeIs(0));
  studio.later(1);
  EXPECT_THAT(contents_of(*studio.files.files.begin()->second.bytes, false).ticks, SizeIs(1));
}

TEST(Recorder, TheGapOfAFullDiskHasItsFirstReason) {
  Studio studio({.limits = {.free_reserve_bytes = 1000}, .for_viewers = false});
  auto recorder = studio.open();
  recorder->record(RecordTopic::kOpen, {1, 1}, v1::OpenSession());
  studio.tick(*recorder);
  studio.files.disk_full = true;
  studio.later(1);
  const uint64_t capacity = std::exchange(studio.files.capacity, 0);
  studio.tick(*recorder);
  studio.later(2);
  studio.files.disk_full = false;
  studio.files.capacity = capacity;
  studio.later(2);
  studio.tick(*recorder);
  studio.later(2);
  recorder.reset();
  studio.writer.reset();
  ASSERT_THAT(studio.warnings, SizeIs(2)) << "one reason, and the end of it";
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::REASON_NO_SPACE);
  for (const auto& [name, file] : studio.files.files) {
    if (file.bytes->empty() || name.ends_with("p001.mcap")) continue;
    EXPECT_THAT(contents_of(*file.bytes).gap_reasons, ::testing::ElementsAre(v1::Gap::REASON_NO_SPACE)) << name;
  }
}

// It was taken from the queue while there was no file, or was waiting in a chunk that could not be written.
TEST(Recorder, LossesOfALostGapAreReportedAgain) {
  for (const bool in_a_chunk : {false, true}) {
    Studio studio({.queue_bytes = 4096, .for_viewers = false});
    auto recorder = studio.open();
    const auto ticks = [&](int count) {
      for (int i = 0; i < count; ++i) studio.tick(*recorder);
      studio.writer->run_once();
    };
    studio.files.disk_full = !in_a_chunk;
    ticks(300);
    EXPECT_GT(recorder->dropped(), 200u) << "the queue was full";
    ticks(1);
    studio.files.disk_full = true;
    studio.later(1);
    EXPECT_TRUE(recorder->degraded());
    studio.files.disk_full = false;
    studio.later(2);
    ticks(1);
    studio.later(1);
    EXPECT_FALSE(recorder->degraded());
    const uint64_t dropped = recorder->dropped();
    EXPECT_EQ(studio.writer->counts().dropped_messages, dropped) << "each counted once";
    recorder.reset();
    studio.writer.reset();
    uint64_t told = 0;
    for (const auto& [name, file] : studio.files.files)
      if (!file.bytes->empty()) told += contents_of(*file.bytes, false).gap_messages;
    EXPECT_EQ(told, dropped) << (in_a_chunk ? "in a chunk" : "without a file");
  }
}

// A chunk may be ended by the clock or by a message that is too late for it.
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
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::REASON_WRITE_FAILED);
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
  EXPECT_FALSE(studio.files.files.contains("sightline-20200101T000000.000Z-old-p001.mcap")) << "the oldest went first";
  EXPECT_EQ(studio.writer->counts().removed_files, 2u + studio.files.creations - (studio.files.files.size() - 1));
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
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::REASON_NO_SPACE);
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

TEST(Recorder, AFileThatCannotBeRemovedDoesNotStopTheRecording) {
  Studio studio({.limits = {.max_total_bytes = 8 << 20, .free_reserve_bytes = 0}, .for_viewers = false});
  studio.files.put("sightline-a-p001.mcap", 9 << 20, 850 * kSecondNs);
  studio.files.put("sightline-b-p001.mcap", 9 << 20, 860 * kSecondNs);
  studio.files.stuck = {"sightline-a-p001.mcap"};
  auto recorder = studio.open();
  ASSERT_TRUE(studio.tick(*recorder));
  studio.later(2);
  EXPECT_FALSE(recorder->degraded());
  EXPECT_FALSE(studio.files.files.contains("sightline-b-p001.mcap"));
  ASSERT_THAT(studio.warnings, SizeIs(1));
  EXPECT_THAT(studio.warnings[0].text, HasSubstr("sightline-a-p001.mcap"));
}

TEST(Recorder, AFolderThatCannotBeUsedIsKnownBeforeTheFirstSession) {
  Studio studio;
  studio.files.folder_forbidden = true;
  studio.writer->try_folder();
  EXPECT_TRUE(studio.writer->folder_trouble());
  ASSERT_THAT(studio.warnings, SizeIs(1));
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::REASON_WRITE_FAILED);
  EXPECT_THAT(studio.warnings[0].text, HasSubstr("nothing can be recorded: "));
  EXPECT_THAT(studio.warnings[0].text, HasSubstr("no such folder"));
}

TEST(RecordFolder, ANameHasTheTimeTheSessionAndThePart) {
  EXPECT_EQ(recording_name(1'700'000'000'123'456'789, "a b/\xC3\xBC-Z9", 7),
            "sightline-20231114T221320.123Z-a_b___-Z9-p007.mcap");
  EXPECT_EQ(recording_name(0, std::string(70, 'x'), 1234),
            "sightline-19700101T000000.000Z-" + std::string(64, 'x') + "-p1234.mcap");
}

TEST(RecordFolder, OnlyNamesOfRecordingsAreItsOwn) {
  EXPECT_TRUE(is_recording_name(recording_name(1, "abc", 1)));
  EXPECT_TRUE(is_recording_name("sightline-x.mcap"));
  for (const char* name :
       {"sightline-.mcap", "sightline-x.mca", "other-x.mcap", "sightline-a/b.mcap", "x/sightline-a.mcap", ".mcap", ""})
    EXPECT_FALSE(is_recording_name(name)) << name;
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

}  // namespace
}  // namespace sightline
