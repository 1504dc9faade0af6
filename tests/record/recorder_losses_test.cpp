// When a lost file is tried again, and what the file after it says about the messages that were lost meanwhile.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/record/studio.h"

namespace sightline {
namespace {

using test::kSecondNs;
using test::PretendedFiles;
using test::Studio;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr uint64_t kStartNs = 1000 * kSecondNs;  // as in the studio

// A session of replies only, so that no part repeats any of them at its head.
class RecorderLosses : public testing::Test {
 protected:
  // The clock and the reply are at this time. The writer then looks once.
  void reply_at(uint64_t ns) {
    studio.files.now_ns = ns;
    recorder->record(RecordTopic::kReply, {ns, ns}, v1::CameraReply());
    studio.writer->run_once();
  }
  void end() {
    recorder.reset();
    studio.writer->run_once();
  }
  std::vector<v1::Gap> gaps_in(const std::string& file) const {
    std::vector<v1::Gap> gaps;
    const MemorySource source(*studio.files.files.at(file).bytes);
    McapReader::open(source, {}).value().read({.topics = {"/sightline/gap"}}, [&](const McapMessage& m) {
      EXPECT_TRUE(gaps.emplace_back().ParseFromString(std::string(m.message.data)));
      return true;
    });
    return gaps;
  }
  // Returns the gaps of all files, in the order of the files' names.
  std::vector<v1::Gap> gaps() const {
    std::vector<v1::Gap> all;
    for (const auto& [name, file] : studio.files.files)
      for (const v1::Gap& gap : gaps_in(name)) all.push_back(gap);
    return all;
  }

  Studio studio{{.limits = {.free_reserve_bytes = 0}, .for_viewers = false}};
  std::unique_ptr<SessionRecorder> recorder = studio.open();
};

class FileThatCannotBeMade : public RecorderLosses, public testing::WithParamInterface<bool PretendedFiles::*> {};

TEST_P(FileThatCannotBeMade, IsTriedAgainAfterASecondAndNotBefore) {
  bool& forbidden = studio.files.*GetParam();
  forbidden = true;
  reply_at(kStartNs + 1);
  forbidden = false;
  reply_at(kStartNs + kSecondNs);
  EXPECT_THAT(studio.files.files, IsEmpty());
  reply_at(kStartNs + 1 + kSecondNs);
  ASSERT_THAT(studio.files.files, SizeIs(1));
  EXPECT_TRUE(studio.files.files.begin()->first.ends_with("-p001.mcap"));
  end();
  EXPECT_EQ(studio.writer->counts().write_failures, 1u);
  EXPECT_EQ(studio.writer->counts().files, 1u);
  EXPECT_EQ(studio.writer->counts().messages, 1u);
}

INSTANTIATE_TEST_SUITE_P(ForWantOf, FileThatCannotBeMade,
                         testing::Values(&PretendedFiles::folder_forbidden, &PretendedFiles::files_forbidden),
                         [](const auto& param) { return param.index == 0 ? "AFolder" : "Permission"; });

TEST_F(RecorderLosses, AFolderThatStaysUnusableIsTriedOnceASecond) {
  studio.files.folder_forbidden = true;
  for (uint64_t i = 0; i < 100; ++i) reply_at(kStartNs + i * kSecondNs / 10);
  EXPECT_EQ(studio.writer->counts().write_failures, 10u);
  EXPECT_EQ(studio.writer->counts().dropped_messages, 100u);
}

TEST_F(RecorderLosses, AGapSaysHowManyMessagesAreMissingSinceWhenAndWhy) {
  studio.files.folder_forbidden = true;
  for (const uint64_t at : {10, 20, 30}) reply_at(kStartNs + at);
  studio.files.folder_forbidden = false;
  reply_at(kStartNs + 2 * kSecondNs);
  end();
  const std::vector<v1::Gap> found = gaps();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].messages(), 3u);
  EXPECT_EQ(found[0].first_time_ns(), kStartNs + 10);
  EXPECT_EQ(found[0].last_time_ns(), kStartNs + 30);
  EXPECT_EQ(found[0].reason(), v1::Gap::REASON_WRITE_FAILED);
  EXPECT_THAT(found[0].text(), HasSubstr("no such folder"));
}

// Messages that wait in an open chunk are lost with the chunk.
TEST_F(RecorderLosses, AGapCountsTheMessagesOfAChunkThatCouldNotBeWritten) {
  reply_at(kStartNs + 10);
  reply_at(kStartNs + 20);
  studio.files.disk_full = true;
  reply_at(kStartNs + 10 + kSecondNs);  // the chunk has waited for a second
  reply_at(kStartNs + 30 + kSecondNs);
  studio.files.disk_full = false;
  reply_at(kStartNs + 3 * kSecondNs);
  end();
  const std::vector<v1::Gap> found = gaps();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].messages(), 4u);
  EXPECT_EQ(found[0].first_time_ns(), kStartNs + 10);
  EXPECT_EQ(found[0].last_time_ns(), kStartNs + 30 + kSecondNs);
  EXPECT_EQ(found[0].reason(), v1::Gap::REASON_NO_SPACE);
  EXPECT_THAT(found[0].text(), HasSubstr("is full"));
  EXPECT_EQ(studio.writer->counts().dropped_messages, 4u);
  EXPECT_EQ(studio.writer->counts().messages, 3u) << "two were taken before the chunk was lost, and the last one";
}

TEST_F(RecorderLosses, AFileWithoutAMessageIsRemovedAndItsNumberUsedAgain) {
  reply_at(kStartNs + 10);
  studio.files.disk_full = true;
  reply_at(kStartNs + 10 + kSecondNs);
  EXPECT_THAT(studio.files.files, IsEmpty());
  studio.files.disk_full = false;
  reply_at(kStartNs + 3 * kSecondNs);
  ASSERT_THAT(studio.files.files, SizeIs(1));
  EXPECT_TRUE(studio.files.files.begin()->first.ends_with("-p001.mcap"));
}

TEST_F(RecorderLosses, AFileWithAMessageStaysAndTheNextPartHasTheNextNumber) {
  reply_at(kStartNs + 10);
  reply_at(kStartNs + 10 + kSecondNs);  // ends the chunk
  studio.files.disk_full = true;
  reply_at(kStartNs + 20 + 2 * kSecondNs);
  reply_at(kStartNs + 30 + 3 * kSecondNs);
  studio.files.disk_full = false;
  reply_at(kStartNs + 5 * kSecondNs);
  ASSERT_THAT(studio.files.files, SizeIs(2));
  EXPECT_TRUE(studio.files.files.begin()->first.ends_with("-p001.mcap"));
  EXPECT_TRUE(studio.files.files.rbegin()->first.ends_with("-p002.mcap"));
}

// A gap whose part is lost again stays known. Once it is on the disk, later parts do not repeat it.
TEST_F(RecorderLosses, AGapIsWrittenUntilItIsOnTheDiskAndThenNoMore) {
  studio.files.folder_forbidden = true;
  reply_at(kStartNs + 10);
  studio.files.folder_forbidden = false;
  reply_at(kStartNs + 2 * kSecondNs);
  studio.files.files.clear();  // the first file that has the gap
  reply_at(kStartNs + 4 * kSecondNs);
  EXPECT_THAT(studio.files.files, IsEmpty());
  reply_at(kStartNs + 6 * kSecondNs);
  reply_at(kStartNs + 8 * kSecondNs);  // ends the chunk of the gap
  ASSERT_THAT(gaps(), SizeIs(1));
  EXPECT_EQ(gaps()[0].messages(), 3u) << "the first reply, the one in the removed file, and the one after it";
  EXPECT_EQ(gaps()[0].first_time_ns(), kStartNs + 10);
  EXPECT_EQ(gaps()[0].last_time_ns(), kStartNs + 4 * kSecondNs);
  studio.files.files.clear();
  reply_at(kStartNs + 10 * kSecondNs);
  reply_at(kStartNs + 12 * kSecondNs);
  end();
  ASSERT_THAT(gaps(), SizeIs(1));
  EXPECT_GE(gaps()[0].first_time_ns(), kStartNs + 8 * kSecondNs) << "what was lost since then";
}

}  // namespace
}  // namespace sightline
