// Cuts of recordings: from the start, from the middle, from another cut, and with an empty range.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "server/record/record_topics.h"
#include "tests/recordings/recording_verbs.h"

namespace sightline {
namespace {

using test::kRecordedStartNs;
using test::PlainMessage;
using test::Said;
using test::Told;
using test::Verbs;
using ::testing::HasSubstr;

TEST_F(Verbs, ACutFromTheStartIsTheBeginningMessageForMessage) {
  const std::string file = put("hall.mcap", hall());
  const Said done = cut(file, path("part.mcap"), 0, 0.8);
  EXPECT_EQ(done.status, 0) << done.err;
  const auto all = messages_of(hall()), part = messages_of(bytes_of(path("part.mcap")));
  EXPECT_TRUE(std::equal(part.begin(), part.end(), all.begin()));
  ASSERT_LT(part.size(), all.size());
  EXPECT_LT(part.back().log_time_ns, kRecordedStartNs + 800'000'000);
  EXPECT_GE(all[part.size()].log_time_ns, kRecordedStartNs + 800'000'000);
  EXPECT_EQ(verify(path("part.mcap")).status, 0) << verify(path("part.mcap")).out;
  EXPECT_THAT(info({path("part.mcap")}).out, HasSubstr("0.000 s to 0.800 s of hall.mcap"));
  EXPECT_EQ(recording_of(hall()).files()->front().bytes,
            recording_of(bytes_of(path("part.mcap"))).files()->front().bytes);

  EXPECT_THAT(done.out, ::testing::Not(HasSubstr("lead ")));
  EXPECT_EQ(cut(file, path("all.mcap"), 0).status, 0);
  EXPECT_EQ(messages_of(bytes_of(path("all.mcap"))), all);
}

TEST_F(Verbs, ACutFromWithinStandsAlone) {
  const std::string file = put("hall.mcap", hall());
  const Said done = cut(file, path("part.mcap"), 0.7, 1.2);
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_EQ(verify(path("part.mcap")).status, 0) << verify(path("part.mcap")).out;
  const std::string bytes = bytes_of(path("part.mcap"));
  const Recording part = recording_of(bytes), whole = recording_of(hall());
  EXPECT_EQ(part.info().part(), 1u);
  ASSERT_GT(part.info().snapshot_ticks(), 30u);
  uint64_t memory_ns = 0;  // the newest before the range, with which the lead begins
  for (const PlainMessage& m :
       messages_of(hall(), {.end_ns = kRecordedStartNs + 700'000'000, .topics = {"/sightline/memory"}}))
    memory_ns = m.log_time_ns;
  ASSERT_GT(memory_ns, kRecordedStartNs);
  char lead[64];
  std::snprintf(lead, sizeof lead, "lead        %.3f s before the range",
                0.7 - static_cast<double>(memory_ns - kRecordedStartNs) * 1e-9);
  EXPECT_THAT(done.out, HasSubstr(lead));
  EXPECT_EQ(part.open_session().SerializeAsString(), whole.open_session().SerializeAsString());
  EXPECT_EQ(part.opened().SerializeAsString(), whole.opened().SerializeAsString());

  // Messages of all topics in the range are unchanged.
  std::vector<PlainMessage> expected = messages_of(hall()), got = messages_of(bytes);
  const auto replies_in_cut = std::count_if(got.begin(), got.end(),
                                            [](const PlainMessage& m) { return m.topic == "/sightline/reply"; });
  const auto outside = [](const PlainMessage& m) {
    return m.log_time_ns < kRecordedStartNs + 700'000'000 || m.log_time_ns >= kRecordedStartNs + 1'200'000'000;
  };
  std::erase_if(expected, outside);
  std::erase_if(got, outside);
  EXPECT_EQ(got, expected);

  // Replaying the cut takes the same steps as replaying the whole.
  const auto sampler = make_embree_sampler_device();
  LocalWorld world("", *sampler);
  const auto files = part.files().value();
  const auto scene = *world.scenes.add_uploaded(std::as_bytes(std::span(files.at(0).bytes)));
  const auto session = LocalSession::open(part.open_session(), world).value();
  StepAssembler steps;
  size_t replies = 0;
  part.read({}, [&](RecordedEvent& event) {
    if (!steps.add(event)) return true;
    const RecordedStep step = steps.take();
    v1::TickError rejection;
    for (const v1::Tick& tick : step.ticks) EXPECT_TRUE(session->apply(tick, rejection)) << rejection.message();
    v1::CameraReply reply;
    EXPECT_TRUE(session->step(0, reply).has_value());
    EXPECT_EQ(reply.sequence(), step.reply.sequence());
    const auto &a = reply.pose().position(), &b = step.reply.pose().position();
    // The recorded step had a history, which the memory holds and which is not taken over here, so the replies are
    // alike but not equal.
    const double apart_m = std::hypot(a.x() - b.x(), a.y() - b.y(), a.z() - b.z());
    EXPECT_LT(apart_m, replies == 0 ? 0.1 : 5.0);
    EXPECT_EQ(reply.mirror_hash(), step.reply.mirror_hash()) << "the same scene";
    ++replies;
    return true;
  });
  EXPECT_EQ(replies, replies_in_cut) << "with those of the lead";
}

// Messages lie exactly at both ends of the range. The one at its start is in it, the one at its end is not.
TEST_F(Verbs, ACutBeginsAndEndsAtExactlyItsTimes) {
  Told told;
  for (uint64_t i = 1; i <= 40; ++i) told.tick(i), told.reply(i);  // 10 i and 10 i + 5 ms after the first message
  const std::string bytes = told.finish(), file = put("told.mcap", bytes);
  const uint64_t first_ns = recording_of(bytes).start_ns();
  const auto in_range = [first_ns](std::vector<PlainMessage> messages, uint64_t start_ms, uint64_t end_ms) {
    std::erase_if(messages, [&](const PlainMessage& m) {
      return m.log_time_ns < first_ns + start_ms * 1'000'000 || m.log_time_ns >= first_ns + end_ms * 1'000'000;
    });
    return messages;
  };
  for (const auto& [start_ms, end_ms] : {std::pair<uint64_t, uint64_t>(100, 200), {105, 205}, {0, 200}, {0, 205}}) {
    SCOPED_TRACE(start_ms);
    ASSERT_EQ(
        cut(file, path("part.mcap"), static_cast<double>(start_ms) / 1e3, static_cast<double>(end_ms) / 1e3).status, 0);
    const auto got = messages_of(bytes_of(path("part.mcap")));
    EXPECT_EQ(in_range(got, start_ms, 1'000'000), in_range(messages_of(bytes), start_ms, end_ms));
    std::filesystem::remove(path("part.mcap"));
  }
}

// Every tick adds an instance, so that the still frames and shapes change in the lead, which viewers do not see.
TEST_F(Verbs, ACutShowsViewersWhatStoodStillWhenItsRangeBegins) {
  Told told;
  for (uint64_t i = 1; i <= 20; ++i) {
    v1::Tick tick;
    tick.set_sequence(i);
    v1::NewInstance& added = *tick.mutable_delta()->add_added_instances();
    added.set_id(100 + i);
    added.mutable_shape()->mutable_sphere()->set_radius(1);
    told.put(tick), told.reply(i);
  }
  const std::string bytes = told.finish();
  ASSERT_EQ(cut(put("adds.mcap", bytes), path("part.mcap"), 0.1).status, 0);
  const uint64_t start_ns = recording_of(bytes).start_ns() + 100'000'000;
  std::vector<std::string> topics;
  for (const RecordTopic topic : {RecordTopic::kStaticFrames, RecordTopic::kShapes})
    topics.emplace_back(all_record_topics()[static_cast<size_t>(topic)].topic);
  std::map<std::string, PlainMessage> newest;
  for (const PlainMessage& m : messages_of(bytes, {.end_ns = start_ns, .topics = topics})) newest[m.topic] = m;
  ASSERT_EQ(newest.size(), 2u);
  const auto before_range = messages_of(bytes_of(path("part.mcap")), {.end_ns = start_ns, .topics = topics});
  ASSERT_EQ(before_range.size(), 2u) << "one of each";
  for (const PlainMessage& m : before_range) {
    EXPECT_EQ(m.log_time_ns, start_ns - 1) << m.topic;
    EXPECT_EQ(m.sequence, newest[m.topic].sequence) << m.topic;
    EXPECT_EQ(m.data, newest[m.topic].data) << m.topic;
  }
}

// The text names the end of the recording, not the time that was asked for.
TEST_F(Verbs, ACutBeyondTheEndSaysHowFarTheRecordingGoes) {
  const std::string file = put("hall.mcap", hall());
  EXPECT_EQ(cut(file, path("part.mcap"), 0.5, 77).status, 0);
  const double duration_s = recording_of(hall()).duration_s();
  char expected[64];
  std::snprintf(expected, sizeof expected, "0.500 s to %.3f s of hall.mcap", duration_s);
  EXPECT_THAT(info({path("part.mcap")}).out, HasSubstr(expected));
}

TEST_F(Verbs, ACutOfACutIsTheCut) {
  const std::string file = put("hall.mcap", hall());
  EXPECT_EQ(cut(file, path("a.mcap"), 0.4).status, 0);
  const std::string a_bytes = bytes_of(path("a.mcap"));
  const Recording a = recording_of(a_bytes);
  const double later_s = 1.0 - static_cast<double>(a.start_ns() - kRecordedStartNs) * 1e-9;
  EXPECT_EQ(cut(path("a.mcap"), path("b.mcap"), later_s).status, 0);
  EXPECT_EQ(cut(file, path("c.mcap"), 1.0).status, 0);
  const std::string b = bytes_of(path("b.mcap")), c = bytes_of(path("c.mcap"));
  EXPECT_EQ(messages_of(b), messages_of(c));
}

// The numbers do not begin at 1, although the cut has no snapshot tick.
TEST_F(Verbs, ACutFromWithinBeforeTheFirstReplyIsSound) {
  Told told;
  for (uint64_t i = 1; i <= 20; ++i) told.tick(i), told.refuse(i);
  told.tick(21), told.reply(21);
  const std::string file = put("refused.mcap", told.finish());
  EXPECT_EQ(verify(file).status, 0) << verify(file).out;
  EXPECT_EQ(cut(file, path("part.mcap"), 0.1).status, 0);
  EXPECT_EQ(recording_of(bytes_of(path("part.mcap"))).info().snapshot_ticks(), 0u);
  EXPECT_EQ(verify(path("part.mcap")).status, 0) << verify(path("part.mcap")).out;
}

TEST_F(Verbs, ARangeWithNothingInItIsNoCut) {
  const std::string file = put("hall.mcap", hall());
  EXPECT_EQ(cut(file, path("part.mcap"), 50).status, 1);
  EXPECT_EQ(cut(file, path("part.mcap"), 0.5, 0.5).status, 2);
  EXPECT_EQ(cut(file, path("part.mcap"), 0.5, 0.2).status, 2);
  EXPECT_FALSE(std::filesystem::exists(path("part.mcap")));
  EXPECT_EQ(cut(file, file, 0.5).status, 1);
  EXPECT_EQ(bytes_of(file), hall()) << "nothing is overwritten";
}

}  // namespace
}  // namespace sightline
