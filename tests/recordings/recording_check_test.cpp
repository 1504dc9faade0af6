// The verdict of verify on sessions: consistent ones, inconsistent ones, and every part by itself.
#include <functional>
#include <optional>

#include "client/recordings/check.h"
#include "foxglove/frames.pb.h"
#include "foxglove/scene.pb.h"
#include "server/base/random.h"
#include "server/record/mcap_verify.h"
#include "server/record/recorder.h"
#include "tests/record/pretended_files.h"
#include "tests/recordings/recording_verbs.h"

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
      {"refused again", [](Told& t) { t.tick(1), t.reply(1), t.tick(1), t.refuse(1, "tick.sequence"); }, nullptr},
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

TEST_F(Verbs, ManyTroublesAreCountedAndTheFirstSixteenAreTold) {
  for (const uint64_t troubles : {16u, 17u, 20u}) {
    Told told;
    told.tick(1), told.reply(1);
    for (uint64_t i = 1; i <= troubles; ++i) told.reply(1 + i);
    const std::string said = verify(put("many.mcap", told.finish())).out;
    // The first message is the opening; every message comes 5 ms after the one before.
    EXPECT_THAT(said, HasSubstr("  at 0.020 s: reply to tick 2, and no tick since the former reply\n"));
    EXPECT_THAT(said, HasSubstr("reply to tick 17, and"));
    EXPECT_THAT(said, ::testing::Not(HasSubstr("reply to tick 18, and")));
    if (troubles == 16)
      EXPECT_THAT(said, ::testing::Not(HasSubstr(" more\n")));
    else
      EXPECT_THAT(said, HasSubstr("  ... and " + std::to_string(troubles - 16) + " more\n"));
  }
}

// A part whose messages have the numbers that are asked for.
struct Numbered {
  explicit Numbered(uint32_t part = 1, uint64_t snapshot_ticks = 0) {
    v1::RecordingInfo info;
    info.set_layout_version(1);
    info.set_part(part);
    info.set_snapshot_ticks(snapshot_ticks);
    file.emplace(std::make_unique<StringSink>(bytes), info, McapWriterOptions{});
    put(RecordTopic::kOpen, 1, v1::OpenSession());
  }
  void put(RecordTopic topic, uint32_t number, const google::protobuf::MessageLite& message) {
    ++now_ns;
    EXPECT_TRUE(file->write({topic, number, now_ns, now_ns, message.SerializeAsString()}, now_ns));
  }
  void stills(uint32_t number) {
    put(RecordTopic::kStaticFrames, number, foxglove::FrameTransforms());
    put(RecordTopic::kShapes, number, foxglove::SceneUpdate());
  }
  void tick(uint32_t number) {
    v1::Tick tick;
    tick.set_sequence(number);
    put(RecordTopic::kTick, number, tick);
  }
  void reply(uint32_t number, uint64_t to_tick) {
    v1::CameraReply reply;
    reply.set_sequence(to_tick);
    put(RecordTopic::kReply, number, reply);
  }
  void gap(uint64_t messages, v1::Gap::Reason reason = v1::Gap::REASON_NO_SPACE) {
    v1::Gap gap;
    gap.set_messages(messages);
    gap.set_reason(reason);
    put(RecordTopic::kGap, 1, gap);
  }
  std::string finish() {
    EXPECT_TRUE(file->finish().has_value());
    return bytes;
  }

  std::string bytes;
  std::optional<SessionFile> file;
  uint64_t now_ns = 1;
};

TEST_F(Verbs, MissingNumbersNeedAGap) {
  int files = 0;
  const auto told = [&](uint64_t gap_messages, uint32_t part = 1, uint64_t head_gap_messages = 0) {
    Numbered file(part);
    if (head_gap_messages > 0) file.gap(head_gap_messages);
    file.tick(1), file.tick(2);
    if (gap_messages > 0) file.gap(gap_messages);
    file.tick(6);
    return verify(put("gap" + std::to_string(++files) + ".mcap", file.finish()));
  };
  EXPECT_EQ(told(3).status, 0);
  EXPECT_EQ(told(2).status, 1);
  const Said none = told(0);
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.out, HasSubstr("3 messages are missing by their numbers, Gaps report 0"));
  // Losses before a later part do not excuse losses in it.
  EXPECT_EQ(told(3, 2, 9).status, 0);
  EXPECT_EQ(told(0, 2, 9).status, 1);
}

// A head as the recorder writes it: messages for viewers, the snapshot tick or the Gap that replaces it, the waiting
// ticks, and a Gap for losses.
TEST_F(Verbs, AGapAtAHeadExcusesNothingBehindIt) {
  using Tell = std::function<void(Numbered&)>;
  const auto nothing = [](Numbered&) {};
  const auto after_loss = [](Numbered& f) { f.tick(14), f.reply(8, 14), f.tick(15), f.reply(9, 15); };
  const Tell heads[] = {
      [](Numbered& f) { f.stills(3), f.tick(5), f.gap(9); },
      [](Numbered& f) { f.stills(3), f.tick(5), f.tick(6), f.tick(8), f.gap(9); },
      [](Numbered& f) { f.stills(3), f.gap(5, v1::Gap::REASON_TOO_LARGE), f.tick(6), f.tick(8), f.gap(9); },
      [](Numbered& f) { f.stills(3), f.gap(5, v1::Gap::REASON_TOO_LARGE), f.gap(9); },
  };
  const auto said = [&](const Tell& head, const Tell& later) {
    Numbered file(2, &head < heads + 2 ? 5 : 0);
    head(file);
    after_loss(file);
    later(file);
    return check_session(recording_of(file.finish()));
  };
  for (const Tell& head : heads) {
    EXPECT_TRUE(said(head, nothing).sound());
    EXPECT_EQ(said(head, nothing).missing, 0u);
    EXPECT_TRUE(said(head, [](Numbered& f) { f.gap(2), f.tick(17), f.reply(11, 17); }).sound());
    for (const Tell& lost : {Tell([](Numbered& f) { f.tick(17); }), Tell([](Numbered& f) { f.reply(11, 17); }),
                             Tell([](Numbered& f) { f.stills(5); })})
      EXPECT_FALSE(said(head, lost).sound());
    EXPECT_EQ(said(head, [](Numbered& f) { f.gap(1), f.tick(17), f.reply(11, 17); }).missing, 2u);
    EXPECT_FALSE(said(head, [](Numbered& f) { f.gap(1), f.tick(17), f.reply(11, 17); }).sound());
  }
}

// The rejection is in the earlier part, and the reply to the tick before it in this one.
TEST_F(Verbs, NumbersOfRefusedTicksAreNotMissedBehindAHead) {
  const auto told = [&](uint32_t last_tick) {
    Numbered file(2, 5);
    file.tick(5), file.tick(6), file.reply(6, 6);
    file.tick(8), file.reply(7, 8);
    file.tick(last_tick), file.reply(8, last_tick);
    return check_session(recording_of(file.finish()));
  };
  EXPECT_TRUE(told(9).sound());
  EXPECT_FALSE(told(10).sound());
}

// A session through the recorder: steps of several ticks, some of which are refused.
void record_session(test::PretendedFiles& disk, const RecordSettings& settings, uint64_t ticks) {
  disk.now_ns = kRecordedStartNs;
  CounterRandom dice(3, 0, RandomPurpose::kTest);
  RecordWriter writer(
      settings, disk, [&] { return disk.now_ns; }, [](const RecordWarning&) {});
  const auto recorder = writer.open_session({});
  const auto put_one = [&](RecordTopic topic, const google::protobuf::MessageLite& message) {
    disk.now_ns += 1'000'000;
    recorder->record(topic, {disk.now_ns, disk.now_ns}, message);
    if (dice.next_below(3) == 0) writer.run_once();
  };
  put_one(RecordTopic::kOpen, v1::OpenSession());
  put_one(RecordTopic::kOpened, v1::SessionOpened());
  for (uint64_t sequence = 1; sequence < ticks;) {
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
      v1::TickError refused;
      refused.set_sequence(sequence);
      refused.add_field_violations()->set_field("tick.dt_s");
      put_one(RecordTopic::kTickError, refused);
    }
    v1::CameraReply reply;
    reply.set_sequence(sequence - 1);
    reply.set_merged_ticks(applied - 1);
    put_one(RecordTopic::kReply, reply);
  }
}

TEST_F(Verbs, EveryPartOfASessionIsSoundByItself) {
  test::PretendedFiles disk;
  record_session(disk, {.limits = {.max_file_bytes = 200'000, .free_reserve_bytes = 0}, .chunk_bytes = 1000}, 3000);
  EXPECT_GT(disk.files.size(), 5u);
  size_t began_waiting = 0;
  for (const auto& [name, file] : disk.files) {
    const std::string part = put(name, *file.bytes);
    EXPECT_EQ(verify(part).status, 0) << verify(part).out;
    const json told = json::parse(info({part}, true).out)["session"];
    EXPECT_EQ(told["snapshot_ticks"] == 0, told["part"] == 1);
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
      EXPECT_GT(recording_of(bytes_of(path("x.mcap"))).info().snapshot_ticks(), told["snapshot_ticks"].get<uint64_t>());
    }
  }
  EXPECT_GT(began_waiting, 0u);
}

// Refused ticks have numbers, but only the part in which they were refused holds them.
TEST_F(Verbs, APartMayBeginAnywhereAmongRefusedTicks) {
  test::PretendedFiles disk;
  record_session(
      disk, {.limits = {.max_file_bytes = 1, .free_reserve_bytes = 0}, .chunk_bytes = 1, .for_viewers = false}, 300);
  size_t begin_behind_one = 0;
  for (const auto& [name, file] : disk.files) {
    const SessionVerdict verdict = check_session(recording_of(*file.bytes));
    EXPECT_TRUE(verdict.sound()) << name << ": " << verdict.first_troubles.front().text;
    const MemorySource source(*file.bytes);
    const auto topics = verify_mcap(source, {}).value().topics;
    const auto tick = topics.find("/sightline/tick");
    begin_behind_one += tick != topics.end() && tick->second.missing > 0;
  }
  EXPECT_GT(begin_behind_one, 10u);
}

}  // namespace
}  // namespace sightline
