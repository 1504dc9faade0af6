// A recording reads as it was written, and repeated steps give the same replies.
#include "client/recordings/recording.h"

#include <gtest/gtest.h>

#include "client/recordings/writer.h"
#include "server/record/mcap_reader.h"
#include "server/sample/embree_sampler.h"
#include "tests/recordings/string_sink.h"
#include "tests/replay/recorded_hall.h"

namespace sightline {
namespace {

using test::record_hall;
using test::RecordedHall;
using test::StringSink;

class Recorded : public testing::Test {
 protected:
  const std::unique_ptr<SamplerDevice> sampler_ = make_embree_sampler_device();

  static Recording read(const std::string& bytes) {
    auto recording = Recording::open(std::make_shared<MemorySource>(bytes), "memory");
    EXPECT_TRUE(recording.has_value());
    return std::move(*recording);
  }

  // Takes every step again, from the file alone.
  std::pair<uint64_t, size_t> step_again(const Recording& recording) {
    LocalWorld world("", *sampler_);
    const auto files = recording.files();
    EXPECT_TRUE(files.has_value());
    std::vector<std::shared_ptr<const SceneAsset>> held;
    for (const RecordedFile& file : *files)
      held.push_back(*world.scenes.add_uploaded(std::as_bytes(std::span(file.bytes))));
    auto session = LocalSession::open(recording.open_session(), world);
    EXPECT_TRUE(session.has_value());
    uint64_t hash = 0;
    size_t replies = 0;
    StepAssembler steps;
    const RecordedReport report = recording.read({}, [&](RecordedEvent& event) {
      if (!steps.add(event)) return true;
      const RecordedStep step = steps.take();
      v1::TickError rejection;
      for (const v1::Tick& tick : step.ticks) EXPECT_TRUE((*session)->apply(tick, rejection));
      v1::CameraReply reply;
      EXPECT_TRUE((*session)->step(step.quality_level(), reply).has_value());
      EXPECT_EQ(reply.sequence(), step.reply.sequence());
      EXPECT_EQ(reply.merged_ticks(), step.reply.merged_ticks());
      hash = reply_hash(reply, hash);
      ++replies;
      return true;
    });
    EXPECT_EQ(report.undecodable, 0u);
    EXPECT_TRUE(report.loss.none());
    return {hash, replies};
  }
};

TEST_F(Recorded, HeadSaysHowTheSessionWasOpened) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 3, .seed = 7});
  const Recording recording = read(hall.bytes);
  EXPECT_EQ(recording.info().session_id(), "recorded-hall");
  EXPECT_EQ(recording.open_session().seed(), 7u);
  EXPECT_EQ(recording.opened().sampler(), "embree");
  EXPECT_EQ(recording.start_ns(), test::kRecordedStartNs);
  EXPECT_NEAR(recording.duration_s(), 3 / 60.0 + 0.001, 1e-6);
}

TEST_F(Recorded, StepsTakenAgainAnswerTheSameBits) {
  for (const test::RecordedHallOptions& options :
       {test::RecordedHallOptions{}, test::RecordedHallOptions{.merge_every = 2},
        test::RecordedHallOptions{.quality_level = 4}}) {
    const RecordedHall hall = record_hall(*sampler_, options);
    EXPECT_EQ(step_again(read(hall.bytes)), std::pair(hall.hash, hall.replies));
  }
}

// The rejection itself fits. The log line that is made from it for viewers is longer, and does not.
TEST(RecordingWriterTest, TooLargeViewerMessagesAreLeftOut) {
  v1::TickError rejection;
  rejection.set_message(std::string(kMaxMessageBytes - 10, 'x'));
  ASSERT_LE(rejection.ByteSizeLong(), kMaxMessageBytes);
  std::string bytes;
  RecordingWriter writer(std::make_unique<StringSink>(bytes), v1::RecordingInfo());
  ASSERT_TRUE(writer.write(v1::OpenSession(), 1));
  ASSERT_TRUE(writer.write(rejection, 1));
  ASSERT_TRUE(writer.write(v1::Fault(), 1));
  ASSERT_TRUE(writer.finish());

  std::vector<std::pair<std::string, uint32_t>> kept;
  const MemorySource source(bytes);
  const std::vector<std::string> topics{"/sightline/tick_error", "/sightline/fault", "/log"};
  McapReader::open(source, {}).value().read({.topics = topics}, [&](const McapMessage& m) {
    kept.emplace_back(m.channel.topic, m.message.sequence);
    return true;
  });
  EXPECT_EQ(kept, (decltype(kept){{"/sightline/tick_error", 1}, {"/sightline/fault", 1}, {"/log", 1}}));
}

TEST_F(Recorded, AnotherSeedOrAnotherLevelIsAnotherHash) {
  const uint64_t hash = record_hall(*sampler_).hash;
  EXPECT_NE(record_hall(*sampler_, {.seed = 2}).hash, hash);
  EXPECT_NE(record_hall(*sampler_, {.quality_level = 4}).hash, hash);
}

TEST_F(Recorded, RangeIsOfSecondsSinceTheStart) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 60});
  std::vector<uint64_t> sequences;
  read(hall.bytes).read({.start_s = 0.5, .end_s = 0.75}, [&](RecordedEvent& event) {
    if (event.topic == RecordTopic::kTick) sequences.push_back(std::get<v1::Tick>(event.message).sequence());
    return true;
  });
  // Tick i was logged i * 16.666667 ms after the start.
  ASSERT_EQ(sequences.size(), 15u);
  EXPECT_EQ(sequences.front(), 30u);
  EXPECT_EQ(sequences.back(), 44u);
}

TEST_F(Recorded, FileWithoutASessionIsRefusedByName) {
  MemorySink sink;
  McapWriter writer(sink, {});
  ASSERT_TRUE(writer.finish().has_value());
  const auto recording = Recording::open(std::make_shared<MemorySource>(sink.bytes()), "strange.mcap");
  ASSERT_FALSE(recording.has_value());
  EXPECT_EQ(recording.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(recording.error().field, "recording");
  EXPECT_NE(recording.error().message.find("strange.mcap"), std::string::npos);
}

}  // namespace
}  // namespace sightline
