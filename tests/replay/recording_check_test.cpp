// What verify says of a session: of what goes together, of what does not, and of every part by itself.
#include <functional>

#include "client/recording_check.h"
#include "server/base/random.h"
#include "server/record/recorder.h"
#include "tests/record/pretended_files.h"
#include "tests/replay/recording_verbs.h"

namespace sightline {
namespace {

using nlohmann::json;
using test::kRecordedStartNs;
using test::Said;
using test::StringSink;
using test::Told;
using test::Verbs;
using ::testing::HasSubstr;

TEST_F(Verbs, ASoundRecordingIsSound) {
  const Said done = verify(put("hall.mcap", hall()));
  EXPECT_EQ(done.status, 0) << done.out;
  EXPECT_THAT(done.out, HasSubstr("verdict     sound"));
  EXPECT_EQ(json::parse(verify(path("hall.mcap"), true).out)["session"]["ticks"], 90);
}

TEST_F(Verbs, WhatDoesNotGoTogetherIsSaid) {
  struct Case {
    const char* why;
    std::function<void(Told&)> tell;
    const char* said;  // null: sound
  };
  const std::vector<Case> cases = {
      {"one to one", [](Told& t) { t.tick(1), t.reply(1), t.tick(2), t.reply(2); }, nullptr},
      {"merged", [](Told& t) { t.tick(1), t.tick(5), t.reply(5, 1); }, nullptr},
      {"refused", [](Told& t) { t.tick(1), t.tick(2), t.refuse(2), t.tick(2), t.reply(2, 1); }, nullptr},
      {"refused again", [](Told& t) { t.tick(1), t.reply(1), t.tick(1), t.refuse(1, "tick.sequence"); },
       nullptr},
      {"a step that failed", [](Told& t) { t.tick(1), t.refuse(1, ""), t.tick(2), t.reply(2, 1); }, nullptr},
      {"the end", [](Told& t) { t.tick(1), t.reply(1), t.tick(2); }, nullptr},
      {"no tick", [](Told& t) { t.tick(1), t.reply(1), t.reply(2); }, "no tick since the former reply"},
      {"another tick", [](Told& t) { t.tick(1), t.tick(2), t.reply(1); }, "but the newest is tick 2"},
      {"merged more", [](Told& t) { t.tick(1), t.tick(2), t.reply(2, 3); }, "merged 3 ticks, the file has 1"},
      {"backwards", [](Told& t) { t.tick(2), t.reply(2), t.tick(1), t.reply(1); }, "applied after tick 2"},
      {"refused nothing", [](Told& t) { t.tick(1), t.refuse(7), t.reply(1); }, "refuses tick 7"},
  };
  for (const Case& one : cases) {
    Told told;
    one.tell(told);
    const std::string file = put(std::string(one.why) + ".mcap", told.finish());
    const Said done = verify(file);
    EXPECT_EQ(done.status, one.said ? 1 : 0) << one.why << '\n' << done.out;
    EXPECT_THAT(done.out, HasSubstr(one.said ? one.said : "sound"));
    const json first = json::parse(verify(file, true).out)["session"]["first"];
    EXPECT_EQ(first.empty(), one.said == nullptr) << one.why;
  }
}

TEST_F(Verbs, MissingNumbersNeedAGap) {
  int files = 0;
  const auto told = [&](uint64_t gap_messages, uint32_t part = 1, uint64_t head_gap_messages = 0) {
    std::string bytes;
    v1::RecordingInfo info;
    info.set_version(1);
    info.set_part(part);
    SessionFile file(std::make_unique<StringSink>(bytes), info, 1, {});
    const auto put_one = [&](RecordTopic topic, uint32_t number,
                             const google::protobuf::MessageLite& message) {
      EXPECT_TRUE(
          file.write({topic, number, number, number, message.SerializeAsString()}, number).has_value());
    };
    const auto put_gap = [&](uint64_t messages) {
      v1::Gap gap;
      gap.set_messages(messages);
      if (messages > 0) put_one(RecordTopic::kGap, 1, gap);
    };
    put_one(RecordTopic::kOpen, 1, v1::OpenSession());
    put_gap(head_gap_messages);
    v1::Tick tick;
    for (const uint32_t number : {1, 2, 6}) {
      if (number == 6) put_gap(gap_messages);
      tick.set_sequence(number);
      put_one(RecordTopic::kTick, number, tick);
    }
    EXPECT_TRUE(file.finish().has_value());
    return verify(put("gap" + std::to_string(++files) + ".mcap", bytes));
  };
  EXPECT_EQ(told(3).status, 0);
  EXPECT_EQ(told(2).status, 1);
  const Said none = told(0);
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.out, HasSubstr("3 messages are missing by their numbers, Gaps tell of 0"));
  // What was lost before a later part began excuses nothing in it.
  EXPECT_EQ(told(3, 2, 9).status, 0);
  EXPECT_EQ(told(0, 2, 9).status, 1);
}

// Through the recorder, in parts so small that boundaries fall everywhere.
TEST_F(Verbs, EveryPartOfASessionIsSoundByItself) {
  test::PretendedFiles disk;
  disk.now_ns = kRecordedStartNs;
  CounterRandom dice(3, 0, RandomPurpose::kTest);
  {
    RecordWriter writer(
        {.limits = {.max_file_bytes = 200'000, .free_reserve_bytes = 0}, .chunk_bytes = 1000}, disk,
        [&] { return disk.now_ns; }, [](const RecordWarning&) {});
    const auto recorder = writer.open_session({});
    const auto put_one = [&](RecordTopic topic, const google::protobuf::MessageLite& message) {
      disk.now_ns += 1'000'000;
      recorder->record(topic, {disk.now_ns, disk.now_ns}, message);
      if (dice.next_below(3) == 0) writer.run_once();
    };
    put_one(RecordTopic::kOpen, v1::OpenSession());
    put_one(RecordTopic::kOpened, v1::SessionOpened());
    for (uint64_t sequence = 1; sequence < 3000;) {
      uint32_t applied = 0;
      for (uint32_t n = 1 + dice.next_below(4); n > 0; --n, ++sequence) {
        v1::Tick tick;
        tick.set_sequence(sequence);
        tick.set_time_s(static_cast<double>(sequence) / 60);
        put_one(RecordTopic::kTick, tick);
        if (n == 1 || dice.next_below(4) > 0) {
          ++applied;
          continue;
        }
        v1::Rejection refused;
        refused.set_sequence(sequence);
        refused.add_field_violations()->set_field("tick.dt_s");
        put_one(RecordTopic::kRejection, refused);
      }
      v1::CameraReply reply;
      reply.set_sequence(sequence - 1);
      reply.set_merged_ticks(applied - 1);
      put_one(RecordTopic::kReply, reply);
    }
  }
  EXPECT_GT(disk.files.size(), 5u);
  size_t began_waiting = 0;
  for (const auto& [name, file] : disk.files) {
    const std::string part = put(name, *file.bytes);
    EXPECT_EQ(verify(part).status, 0) << verify(part).out;
    const json told = json::parse(info({part}, true).out)["session"];
    EXPECT_EQ(told["folded_ticks"] == 0, told["part"] == 1);
    const Recording recording = recording_of(*file.bytes);
    size_t before_reply = 0;
    recording.read({}, [&](RecordedEvent& event) {
      before_reply += event.topic == RecordTopic::kTick;
      return event.topic != RecordTopic::kReply;
    });
    began_waiting += told["part"] != 1 && before_reply > 2;
    if (told["part"] == 2) {
      EXPECT_EQ(cut(part, path("x.mcap"), 0.1).status, 0);
      EXPECT_EQ(verify(path("x.mcap")).status, 0);
      EXPECT_GT(recording_of(bytes_of(path("x.mcap"))).info().folded_ticks(),
                told["folded_ticks"].get<uint64_t>());
    }
  }
  EXPECT_GT(began_waiting, 0u);
}

}  // namespace
}  // namespace sightline
