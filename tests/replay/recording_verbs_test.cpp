// The verbs on recordings, as the command runs them: on sound, unfinished, damaged, foreign and empty files.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "client/cut_command.h"
#include "client/dump_command.h"
#include "client/info_command.h"
#include "client/recording_check.h"
#include "client/recording_summary.h"
#include "client/recover_command.h"
#include "client/verify_command.h"
#include "server/base/random.h"
#include "server/record/recorder.h"
#include "server/sample/embree_sampler.h"
#include "tests/record/pretended_files.h"
#include "tests/record/small_file.h"
#include "tests/replay/recorded_hall.h"
#include "tests/replay/string_sink.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using nlohmann::json;
using test::kRecordedStartNs;
using test::PlainMessage;
using test::StringSink;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

struct Said {
  int status = -1;
  std::string out, err;
};

class Verbs : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string put(const std::string& name, const std::string& bytes) const {
    std::ofstream(path(name), std::ios::binary) << bytes;
    return path(name);
  }
  static std::string bytes_of(const std::string& file) {
    std::ostringstream all;
    all << std::ifstream(file, std::ios::binary).rdbuf();
    return all.str();
  }
  // Once for all tests: half a minute at 60 Hz would be as good.
  static const std::string& hall() {
    static const std::string bytes = [] {
      const auto sampler = make_embree_sampler_device();
      return test::record_hall(*sampler, {.ticks = 90, .merge_every = 3}).bytes;
    }();
    return bytes;
  }

  template <typename Options, typename Run>
  static Said said(const Options& options, Run run) {
    std::ostringstream out, err;
    Said done;
    done.status = run(options, out, err);
    done.out = out.str();
    done.err = err.str();
    return done;
  }
  static Said info(std::vector<std::string> files, bool as_json = false) {
    return said(InfoOptions{.files = std::move(files), .json = as_json}, run_info_command);
  }
  static Said verify(const std::string& file, bool as_json = false) {
    return said(VerifyOptions{.files = {file}, .json = as_json}, run_verify_command);
  }
  static Said recover(const std::string& file, const std::string& out) {
    return said(RecoverOptions{.file = file, .out = out}, run_recover_command);
  }
  static Said dump(const DumpOptions& options) { return said(options, run_dump_command); }
  static Said cut(const std::string& file, const std::string& out, double start_s,
                  double end_s = std::numeric_limits<double>::infinity()) {
    return said(CutOptions{.file = file, .out = out, .start_s = start_s, .end_s = end_s}, run_cut_command);
  }

  static std::vector<PlainMessage> messages_of(const std::string& bytes, const McapQuery& query = {}) {
    const MemorySource source(bytes);
    return test::read_all(McapReader::open(source, {}).value(), query);
  }
  static Recording recording_of(const std::string& bytes) {
    return Recording::open(std::make_shared<MemorySource>(bytes), "memory").value();
  }
  static std::vector<json> lines_of(const std::string& text) {
    std::vector<json> lines;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines.push_back(json::parse(line));
    return lines;
  }

  const test::TemporaryFolder folder_;
};

// A session that is told message by message.
struct Told {
  explicit Told(v1::RecordingInfo info = {}) {
    if (info.part() == 0) info.set_part(1);
    info.set_start_time_ns(kRecordedStartNs);
    writer.emplace(std::make_unique<StringSink>(bytes), info);
    put(v1::OpenSession());
    put(v1::SessionOpened());
  }
  template <typename Message>
  void put(const Message& message) {
    log_ns += 5'000'000;
    EXPECT_TRUE(writer->write(message, log_ns).has_value());
  }
  void tick(uint64_t sequence) {
    v1::Tick tick;
    tick.set_sequence(sequence);
    put(tick);
  }
  void reply(uint64_t sequence, uint32_t merged = 0) {
    v1::CameraReply reply;
    reply.set_sequence(sequence);
    reply.set_merged_ticks(merged);
    put(reply);
  }
  void refuse(uint64_t sequence, const char* field = "tick.delta.remove[0]") {
    v1::Rejection rejection;
    rejection.set_sequence(sequence);
    if (*field) rejection.add_field_violations()->set_field(field);
    put(rejection);
  }
  std::string finish() {
    EXPECT_TRUE(writer->finish().has_value());
    return bytes;
  }

  std::string bytes;
  std::optional<RecordingWriter> writer;
  uint64_t log_ns = kRecordedStartNs;
};

TEST_F(Verbs, InfoSaysWhatASessionWas) {
  const std::string file = put("hall.mcap", hall());
  const Said text = info({file});
  EXPECT_EQ(text.status, 0) << text.err;
  for (const char* part : {"recorded-hall, part 1", "embree", "2023-11-14 22:13:20 UTC", "finished    yes",
                           "with the session", "/sightline/tick", "/tf", "attachments (1)"})
    EXPECT_THAT(text.out, HasSubstr(part));

  const json told = json::parse(info({file}, true).out);
  const json& session = told["session"];
  EXPECT_EQ(session["ticks"], 90);
  EXPECT_EQ(session["replies"], 60);
  EXPECT_EQ(session["merged"], 30);
  EXPECT_EQ(session["rejections"], 0);
  EXPECT_NEAR(told["duration_s"].get<double>(), 90 / 60.0 + 0.001, 1e-6);
  EXPECT_EQ(told["finished"], true);
  // Counted message by message instead.
  std::map<std::string, uint64_t> counts;
  for (const PlainMessage& m : messages_of(hall())) ++counts[m.topic];
  EXPECT_EQ(told["topics"].size(), counts.size());
  for (const json& topic : told["topics"]) EXPECT_EQ(topic["messages"], counts.at(topic["topic"]));
}

TEST_F(Verbs, InfoTellsWhatIsMissingAndWhy) {
  Told told;
  told.tick(1), told.reply(1);
  for (const v1::Gap::Reason reason : {v1::Gap::QUEUE_FULL, v1::Gap::NO_SPACE, v1::Gap::QUEUE_FULL}) {
    v1::Gap gap;
    gap.set_reason(reason);
    gap.set_messages(7);
    told.put(gap);
  }
  const std::string file = put("gaps.mcap", told.finish());
  EXPECT_THAT(info({file}).out, HasSubstr("21 messages in 3 gaps: no space 7, queue full 14"));
  EXPECT_EQ(json::parse(info({file}, true).out)["session"]["missing"]["QUEUE_FULL"], 14);
}

TEST_F(Verbs, InfoReadsTheSummaryAndTheFirstChunkAlone) {
  Told told;
  for (uint64_t i = 1; i <= 20'000; ++i) told.tick(i), told.reply(i);
  const std::string bytes = told.finish();
  const auto source = std::make_shared<test::CountedSource>(bytes);
  const auto summary = summarise_recording(source, "long");
  ASSERT_TRUE(summary.has_value());
  EXPECT_EQ(summary->ticks, 20'000u);
  const std::vector<mcap::ChunkIndex> chunks = recording_of(bytes).container().chunks;
  const uint64_t behind_data = bytes.size() - chunks.back().chunk_start;
  EXPECT_LE(source->take_count(), chunks.front().chunk_length + behind_data + 4096);
  EXPECT_GT(summary->chunks, 100u);
}

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

TEST_F(Verbs, AnUnfinishedFileIsRecovered) {
  const mcap::ChunkIndex last = recording_of(hall()).container().chunks.back();
  const std::string file = put("cut off.mcap", hall().substr(0, last.chunk_start + last.chunk_length / 2));
  EXPECT_EQ(info({file}).status, 0);
  EXPECT_EQ(json::parse(info({file}, true).out)["finished"], false);
  EXPECT_EQ(verify(file).status, 1);

  const Said done = recover(file, path("copy.mcap"));
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_EQ(verify(path("copy.mcap")).status, 0) << verify(path("copy.mcap")).out;
  EXPECT_THAT(info({path("copy.mcap")}).out, HasSubstr("recovered"));
  const auto all = messages_of(hall()), copied = messages_of(bytes_of(path("copy.mcap")));
  EXPECT_GT(copied.size(), all.size() / 4);
  EXPECT_TRUE(std::equal(copied.begin(), copied.end(), all.begin())) << "the beginning, message for message";

  EXPECT_EQ(recover(file, path("copy.mcap")).status, 1) << "nothing is overwritten";
}

TEST_F(Verbs, ADamagedChunkIsNamedAndLeftOut) {
  const Recording whole = recording_of(hall());
  ASSERT_GT(whole.container().chunks.size(), 2u);
  const mcap::ChunkIndex& hit = whole.container().chunks[1];
  std::string bytes = hall();
  bytes[hit.chunk_start + hit.chunk_length / 2] ^= 0x10;
  const std::string file = put("damaged.mcap", bytes);
  const Said checked = verify(file);
  EXPECT_EQ(checked.status, 1);
  EXPECT_THAT(checked.out, HasSubstr("1 chunk"));

  const Said done = recover(file, path("copy.mcap"));
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_THAT(done.out, HasSubstr("1 chunk"));
  EXPECT_EQ(verify(path("copy.mcap")).status, 0) << verify(path("copy.mcap")).out;
  std::vector<PlainMessage> expected = messages_of(hall());
  std::erase_if(expected, [&](const PlainMessage& m) {
    return m.log_time_ns >= hit.start_time_ns && m.log_time_ns <= hit.end_time_ns;
  });
  EXPECT_EQ(messages_of(bytes_of(path("copy.mcap"))), expected);
  EXPECT_EQ(dump({.file = file}).status, 1);
  EXPECT_THAT(dump({.file = file}).err, HasSubstr("1 chunk"));
  const Said part = cut(file, path("part.mcap"), 1.0);
  EXPECT_EQ(part.status, 1);
  EXPECT_THAT(part.err, HasSubstr("lost"));
}

TEST_F(Verbs, DumpGivesEveryMessageAsItIs) {
  const std::string file = put("hall.mcap", hall());
  const Said done = dump({.file = file});
  EXPECT_EQ(done.status, 0) << done.err;
  const std::vector<json> lines = lines_of(done.out);
  const std::vector<PlainMessage> all = messages_of(hall());
  ASSERT_EQ(lines.size(), all.size());
  size_t ticks = 0;
  for (size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(lines[i]["topic"], all[i].topic);
    EXPECT_EQ(lines[i]["sequence"], all[i].sequence);
    EXPECT_EQ(lines[i]["log_time_ns"], all[i].log_time_ns);
    EXPECT_EQ(lines[i]["publish_time_ns"], all[i].publish_time_ns);
    ASSERT_TRUE(lines[i].contains("message"));
    if (all[i].topic != "/sightline/tick") continue;
    v1::Tick back, told;
    ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(lines[i]["message"].dump(), &back).ok());
    ASSERT_TRUE(told.ParseFromString(all[i].data));
    EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(back, told));
    ++ticks;
  }
  EXPECT_EQ(ticks, 90u);
}

TEST_F(Verbs, DumpGivesWhatIsAskedFor) {
  const std::string file = put("hall.mcap", hall());
  const std::vector<json> some =
      lines_of(dump({.file = file, .topics = {"/sightline/tick"}, .start_s = 0.5, .end_s = 0.75}).out);
  ASSERT_THAT(some, SizeIs(15));
  EXPECT_EQ(some.front()["message"]["sequence"], "30");
  EXPECT_THAT(lines_of(dump({.file = file, .topics = {"/tf", "/camera/pose"}, .limit = 7}).out), SizeIs(7));
  EXPECT_THAT(lines_of(dump({.file = file, .limit = 0}).out), IsEmpty());
  const Said none = dump({.file = file, .topics = {"/sightline/tock"}});
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.err, HasSubstr("/sightline/tock"));
  EXPECT_THAT(none.err, HasSubstr("/sightline/tick"));

  EXPECT_EQ(dump({.file = file, .out = path("lines.json")}).status, 0);
  EXPECT_EQ(bytes_of(path("lines.json")), dump({.file = file}).out);
  EXPECT_EQ(dump({.file = file, .out = path("lines.json")}).status, 1) << "nothing is overwritten";
}

TEST_F(Verbs, DumpEndsQuietlyWhenNobodyReadsOn) {
  std::ostringstream err;
  std::ofstream closed;
  EXPECT_EQ(run_dump_command({.file = put("hall.mcap", hall())}, closed, err), 0);
  EXPECT_THAT(err.str(), IsEmpty());
}

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
  ASSERT_GT(part.info().folded_ticks(), 30u);
  EXPECT_EQ(part.open_session().SerializeAsString(), whole.open_session().SerializeAsString());
  EXPECT_EQ(part.opened().SerializeAsString(), whole.opened().SerializeAsString());

  // What is in the range is as it was, of every topic.
  std::vector<PlainMessage> expected = messages_of(hall()), got = messages_of(bytes);
  const auto outside = [](const PlainMessage& m) {
    return m.log_time_ns < kRecordedStartNs + 700'000'000 ||
           m.log_time_ns >= kRecordedStartNs + 1'200'000'000;
  };
  std::erase_if(expected, outside);
  std::erase_if(got, outside);
  EXPECT_EQ(got, expected);

  // A session steps through it as through the whole.
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
    v1::Rejection rejection;
    for (const v1::Tick& tick : step.ticks)
      EXPECT_TRUE(session->apply(tick, rejection)) << rejection.message();
    v1::CameraReply reply;
    EXPECT_TRUE(session->step(0, reply).has_value());
    EXPECT_EQ(reply.sequence(), step.reply.sequence());
    const auto &a = reply.pose().position(), &b = step.reply.pose().position();
    // It had a memory once: alike, not equal.
    const double apart_m = std::hypot(a.x() - b.x(), a.y() - b.y(), a.z() - b.z());
    EXPECT_LT(apart_m, replies == 0 ? 0.1 : 5.0);
    EXPECT_EQ(reply.hash(), step.reply.hash()) << "the same scene";
    ++replies;
    return true;
  });
  EXPECT_EQ(replies, std::count_if(expected.begin(), expected.end(),
                                   [](const PlainMessage& m) { return m.topic == "/sightline/reply"; }));
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

TEST_F(Verbs, ARangeWithNothingInItIsNoCut) {
  const std::string file = put("hall.mcap", hall());
  EXPECT_EQ(cut(file, path("part.mcap"), 50).status, 1);
  EXPECT_EQ(cut(file, path("part.mcap"), 0.5, 0.5).status, 2);
  EXPECT_EQ(cut(file, path("part.mcap"), 0.5, 0.2).status, 2);
  EXPECT_FALSE(std::filesystem::exists(path("part.mcap")));
  EXPECT_EQ(cut(file, file, 0.5).status, 1);
  EXPECT_EQ(bytes_of(file), hall()) << "nothing is overwritten";
}

// Only the older language has such fields.
TEST_F(Verbs, DumpRefusesAMessageWithoutAFieldThatItsSchemaRequires) {
  google::protobuf::UninterpretedOption::NamePart part;
  MemorySink sink;
  McapWriter writer(sink, {});
  const std::string name(part.GetDescriptor()->full_name());
  const auto schema = writer.add_schema(name, "protobuf", descriptor_set_of(*part.GetDescriptor()));
  const uint16_t channel = writer.add_channel("/part", *schema, "protobuf", {}).value();
  part.set_name_part("lens");
  ASSERT_TRUE(writer.write(channel, 1, 1, part.SerializePartialAsString()));
  part.set_is_extension(true);
  ASSERT_TRUE(writer.write(channel, 2, 2, part.SerializeAsString()));
  ASSERT_TRUE(writer.finish());
  const Said done = dump({.file = put("parts.mcap", sink.bytes())});
  EXPECT_EQ(done.status, 1);
  const std::vector<json> lines = lines_of(done.out);
  ASSERT_THAT(lines, SizeIs(2));
  EXPECT_THAT(lines[0].value("error", ""), HasSubstr("is not what its schema says"));
  EXPECT_EQ(lines[1]["message"], (json{{"name_part", "lens"}, {"is_extension", true}}));
}

TEST_F(Verbs, ForeignFilesAreReadAsFarAsTheyCanBe) {
  const std::string file = put("foreign.mcap", test::make_small_file().bytes);
  const Said told = info({file});
  EXPECT_EQ(told.status, 0);
  EXPECT_THAT(told.out, HasSubstr("holds no session"));
  EXPECT_THAT(told.out, HasSubstr("/reply"));
  EXPECT_EQ(verify(file).status, 0) << verify(file).out;
  const Said dumped = dump({.file = file});
  EXPECT_EQ(dumped.status, 1);
  EXPECT_THAT(lines_of(dumped.out), SizeIs(40));
  EXPECT_THAT(dumped.err, HasSubstr("cannot be decoded"));
  const Said none = cut(file, path("part.mcap"), 0);
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.err, HasSubstr("holds no session"));
  EXPECT_EQ(recover(file, path("copy.mcap")).status, 0);
  EXPECT_THAT(info({path("copy.mcap")}).out, Not(HasSubstr("recovered"))) << "nothing was lost";
}

TEST_F(Verbs, WhatIsNoRecordingIsRefusedByName) {
  const std::vector<std::string> files = {put("empty.mcap", ""), put("words.mcap", "not a recording at all"),
                                          path("nowhere.mcap"), folder_.path().string()};
  for (const std::string& file : files) {
    const std::vector<Said> all = {info({file}), verify(file), dump({.file = file}),
                                   recover(file, path("x.mcap")), cut(file, path("x.mcap"), 0)};
    for (const Said& one : all) {
      EXPECT_EQ(one.status, 1);
      EXPECT_THAT(one.err, HasSubstr(file));
      EXPECT_THAT(one.out, IsEmpty());
    }
    EXPECT_FALSE(std::filesystem::exists(path("x.mcap")));
  }
  const Said both = info({files[0], put("hall.mcap", hall())});
  EXPECT_EQ(both.status, 1);
  EXPECT_THAT(both.out, HasSubstr("recorded-hall")) << "the others are told all the same";
}

TEST_F(Verbs, DamageAnywhereIsSurvived) {
  CounterRandom dice(11, 0, RandomPurpose::kTest);
  const auto small = make_embree_sampler_device();
  const std::string whole = test::record_hall(*small, {.ticks = 6, .attach_scene = false}).bytes;
  for (int i = 0; i < 60; ++i) {
    std::string bytes = whole.substr(0, whole.size() - (i % 3 == 0 ? dice.next_below(2000) : 0));
    for (int k = 0; k < 1 + i % 4; ++k)
      bytes[dice.next_below(static_cast<uint32_t>(bytes.size()))] ^=
          static_cast<char>(1 + dice.next_below(255));
    const std::string file = put("d.mcap", bytes);
    for (const Said& one :
         {info({file}), verify(file), dump({.file = file}), cut(file, path("x.mcap"), 0.05)})
      EXPECT_TRUE(one.status == 0 || one.status == 1);
    std::filesystem::remove(path("x.mcap"));
    if (recover(file, path("x.mcap")).status == 0) {
      EXPECT_EQ(verify(path("x.mcap")).status, 0) << verify(path("x.mcap")).out;
    }
    std::filesystem::remove(path("x.mcap"));
  }
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
