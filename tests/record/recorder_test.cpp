// Recording never waits: what a session says is in its file, and what does not fit is left out and counted.
#include "server/record/recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <set>
#include <thread>

#include "tests/record/studio.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using test::Contents;
using test::contents_of;
using test::kSecondNs;
using test::numbers;
using test::Studio;
using ::testing::HasSubstr;
using ::testing::SizeIs;

TEST(Recorder, WhatWasRecordedIsInTheFile) {
  Studio studio;
  auto recorder = studio.open();
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(studio.tick(*recorder));
  v1::CameraReply reply;
  reply.set_reason_text("all seen");
  const uint64_t late_ns = studio.files.now_ns + kSecondNs;
  EXPECT_TRUE(recorder->record(RecordTopic::kReply, {late_ns, 6}, reply));
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
    EXPECT_EQ(m.message.log_time_ns, late_ns);
    EXPECT_EQ(m.message.publish_time_ns, 6u);
    EXPECT_EQ(m.schema->name, "sightline.v1.CameraReply");
    return true;
  });
  EXPECT_EQ(studio.writer->counts().open_sessions, 0u);
  EXPECT_THAT(studio.warnings, SizeIs(0));
}

// A tool that sorts by log time must not change the order.
TEST(Recorder, LogTimesRiseFromMessageToMessageAndTheInfoHasTheFirst) {
  Studio studio;
  auto recorder = studio.open();
  const uint64_t start_ns = studio.files.now_ns;
  v1::Tick tick;
  const auto record_at = [&](RecordTopic topic, uint64_t log_ns) {
    EXPECT_TRUE(recorder->record(topic, {log_ns, log_ns}, tick));
  };
  record_at(RecordTopic::kTick, start_ns + 100);
  record_at(RecordTopic::kReply, start_ns + 900);
  record_at(RecordTopic::kTick, start_ns + 500);  // it arrived during the step
  record_at(RecordTopic::kTick, start_ns + 501);
  studio.files.now_ns += 50 * kSecondNs;  // the writer comes late
  recorder.reset();
  studio.writer->run_once();
  const MemorySource source(*studio.files.files.begin()->second.bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  std::vector<uint64_t> logged, published;
  reader.read({.topics = {"/sightline/info", "/sightline/tick", "/sightline/reply"}}, [&](const McapMessage& m) {
    logged.push_back(m.message.log_time_ns - start_ns);
    published.push_back(m.message.publish_time_ns - start_ns);
    return true;
  });
  EXPECT_THAT(logged, ::testing::ElementsAre(100, 100, 900, 901, 902));
  EXPECT_THAT(published, ::testing::ElementsAre(100, 100, 900, 500, 501));
}

TEST(Recorder, AFullQueueDropsCountsAndSaysSoInTheFile) {
  Studio studio({.queue_bytes = 4096});
  auto recorder = studio.open();
  uint64_t taken = 0, dropped = 0;
  for (int i = 0; i < 500; ++i) (studio.tick(*recorder) ? taken : dropped) += 1;  // the writer does not run
  EXPECT_GT(dropped, 300u);
  EXPECT_TRUE(recorder->degraded());
  EXPECT_EQ(recorder->dropped(), dropped);
  studio.writer->run_once();
  EXPECT_EQ(studio.writer->counts().dropped_messages, dropped);
  ASSERT_THAT(studio.warnings, SizeIs(1));
  EXPECT_EQ(studio.warnings[0].reason, v1::Gap::REASON_QUEUE_FULL);
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
  for (int i = 0; i < 3; ++i) studio.writer->run_once();
  ASSERT_THAT(studio.warnings, SizeIs(2));
  for (const RecordWarning& warning : studio.warnings) EXPECT_EQ(warning.reason, v1::Gap::REASON_TOO_LARGE);
  EXPECT_THAT(studio.warnings[0].text, HasSubstr("larger than a recording can hold"));
  EXPECT_TRUE(studio.warnings[1].over);
  EXPECT_EQ(studio.writer->counts().dropped_messages, 1u);
  recorder.reset();
  studio.writer.reset();
  const Contents found = contents_of(*studio.files.files.begin()->second.bytes);
  EXPECT_EQ(found.ticks, numbers(1, 2));
  EXPECT_EQ(found.gap_messages, 1u);
}

TEST(Recorder, EveryReasonToDropIsWarnedOfByItself) {
  Studio studio({.queue_bytes = 4096, .max_message_bytes = 3000});
  auto recorder = studio.open();
  EXPECT_FALSE(recorder->record(RecordTopic::kReply, {1, 1}, std::string(3001, 'x')));
  for (int i = 0; i < 300; ++i) studio.tick(*recorder);
  studio.writer->run_once();
  std::set<v1::Gap::Reason> reasons;
  for (const RecordWarning& warning : studio.warnings) reasons.insert(warning.reason);
  EXPECT_THAT(studio.warnings, SizeIs(2));
  EXPECT_EQ(reasons, (std::set<v1::Gap::Reason>{v1::Gap::REASON_QUEUE_FULL, v1::Gap::REASON_TOO_LARGE}));
  EXPECT_EQ(studio.writer->counts().dropped_messages, recorder->dropped());
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
    EXPECT_EQ(contents_of(*file.bytes).ticks, first ? (std::vector<uint64_t>{1, 3}) : (std::vector<uint64_t>{2}));
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

// The process is killed while it records, and the test reads what is on the disk then.
TEST(Recorder, AKillLosesLessThanASecond) {
  const test::TemporaryFolder folder;
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  const auto wall_ns = [] {
    return static_cast<uint64_t>(std::chrono::system_clock::now().time_since_epoch().count());
  };
  const pid_t child = fork();
  if (child == 0) {
    const auto files = system_files();
    RecordSettings settings;
    settings.folder = folder.path();
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

  const auto entry = std::filesystem::directory_iterator(folder.path());
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
}

}  // namespace
}  // namespace sightline
