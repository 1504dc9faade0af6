// info, recover and dump, and what every verb does with unfinished, damaged, foreign and empty files.
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "client/recordings/summary.h"
#include "server/base/random.h"
#include "tests/recordings/recording_verbs.h"

namespace sightline {
namespace {

using nlohmann::json;
using test::kRecordedStartNs;
using test::PlainMessage;
using test::Said;
using test::Told;
using test::Verbs;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

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
  EXPECT_NEAR(told["duration_s"].get<double>(), 90 / 60.0 + 0.002, 1e-6);
  EXPECT_EQ(told["finished"], true);
  // The messages are counted one by one instead.
  std::map<std::string, uint64_t> counts;
  for (const PlainMessage& m : messages_of(hall())) ++counts[m.topic];
  EXPECT_EQ(told["topics"].size(), counts.size());
  for (const json& topic : told["topics"]) EXPECT_EQ(topic["messages"], counts.at(topic["topic"]));
}

// The game's clock runs ten times as fast as the wall clock, and the last reply comes long after the last tick.
TEST_F(Verbs, InfoTellsTheGamesTimeBesideTheWallClocks) {
  Told told;
  for (uint64_t i = 0; i <= 70; ++i) {
    v1::Tick tick;
    tick.set_sequence(i + 1);
    tick.set_time_s(100.0 + 0.05 * static_cast<double>(i));
    told.put(tick);
  }
  told.log_ns += 6'000'000'000;
  told.reply(71, 70);
  const std::string file = put("slow.mcap", told.finish());
  EXPECT_THAT(info({file}).out, HasSubstr("game time   3.500 s, from 100.000 s to 103.500 s\n"));
  const json game = json::parse(info({file}, true).out)["game_time"];
  EXPECT_DOUBLE_EQ(game["start_s"].get<double>(), 100.0);
  EXPECT_DOUBLE_EQ(game["end_s"].get<double>(), 103.5);
  EXPECT_DOUBLE_EQ(game["duration_s"].get<double>(), 3.5);
}

TEST_F(Verbs, InfoOfASessionWithoutATickHasNoGameTime) {
  const std::string file = put("opened.mcap", Told().finish());
  EXPECT_THAT(info({file}).out, Not(HasSubstr("game time")));
  EXPECT_TRUE(json::parse(info({file}, true).out)["game_time"].is_null());
}

TEST_F(Verbs, InfoTellsTheGamesTimeOfASessionWhoseClockBeginsAtZero) {
  std::string bytes;
  RecordingWriter writer(std::make_unique<test::StringSink>(bytes), v1::RecordingInfo());
  EXPECT_TRUE(writer.write(v1::OpenSession(), 0) && writer.write(v1::SessionOpened(), 0));
  for (const uint64_t sequence : {1u, 2u}) {
    v1::Tick tick;
    tick.set_sequence(sequence);
    tick.set_time_s(4.0 + static_cast<double>(sequence));
    EXPECT_TRUE(writer.write(tick, (sequence - 1) * 1'000'000));
  }
  EXPECT_TRUE(writer.finish());
  EXPECT_THAT(info({put("zero.mcap", bytes)}).out, HasSubstr("game time   1.000 s, from 5.000 s to 6.000 s\n"));
}

TEST_F(Verbs, InfoTellsHowLongARecordingLasted) {
  const std::pair<uint64_t, const char*> cases[] = {{59'999, "duration    59.999 s by"},
                                                    {60'000, "duration    0:01:00.000 by"},
                                                    {3'723'500, "duration    1:02:03.500 by"}};
  for (const auto& [ms, text] : cases) {
    Told told;  // its first message comes 5 ms after this time
    told.log_ns = kRecordedStartNs + ms * 1'000'000;
    told.tick(1);
    EXPECT_THAT(info({put("lasted.mcap", told.finish())}).out, HasSubstr(text));
  }
}

TEST_F(Verbs, InfoListsATopicWithoutMessages) {
  std::string bytes(mcap::kMagic);
  mcap::append_record(bytes, mcap::Header{});
  mcap::append_record(bytes, mcap::Channel{1, 0, "/quiet", "x-plain", {}});
  const json topics = json::parse(info({put("quiet.mcap", bytes)}, true).out)["topics"];
  ASSERT_THAT(topics, SizeIs(1));
  EXPECT_EQ(topics[0]["topic"], "/quiet");
  EXPECT_EQ(topics[0]["messages"], 0);
}

TEST_F(Verbs, InfoTellsWhatIsMissingAndWhy) {
  Told told;
  told.tick(1), told.reply(1);
  for (const v1::Gap::Reason reason :
       {v1::Gap::REASON_QUEUE_FULL, v1::Gap::REASON_NO_SPACE, v1::Gap::REASON_QUEUE_FULL}) {
    v1::Gap gap;
    gap.set_reason(reason);
    gap.set_messages(7);
    told.put(gap);
  }
  const std::string file = put("gaps.mcap", told.finish());
  EXPECT_THAT(info({file}).out, HasSubstr("21 messages in 3 gaps: no space 7, queue full 14"));
  EXPECT_EQ(json::parse(info({file}, true).out)["session"]["missing"]["QUEUE_FULL"], 14);
}

TEST_F(Verbs, InfoReadsTheSummaryAndTheFirstAndTheLastChunksAlone) {
  Told told;
  for (uint64_t i = 1; i <= 20'000; ++i) told.tick(i), told.reply(i);
  const std::string bytes = told.finish();
  const auto source = std::make_shared<test::CountedSource>(bytes);
  const auto summary = summarise_recording(source, "long");
  ASSERT_TRUE(summary.has_value());
  EXPECT_EQ(summary->ticks, 20'000u);
  const std::vector<mcap::ChunkIndex> chunks = recording_of(bytes).container().chunks;
  // The head and the first tick; the ticks of the last second; the tail.
  const uint64_t from_last = bytes.size() - chunks.at(chunks.size() - 4).chunk_start;
  EXPECT_LE(source->take_count(), 2 * chunks.front().chunk_length + from_last + 4096);
  EXPECT_GT(summary->chunks, 100u);
}

TEST_F(Verbs, AnUnfinishedFileIsRecovered) {
  const mcap::ChunkIndex last = recording_of(hall()).container().chunks.back();
  const std::string file = put("cut off.mcap", hall().substr(0, last.chunk_start + last.chunk_length / 2));
  EXPECT_EQ(info({file}).status, 0);
  EXPECT_EQ(json::parse(info({file}, true).out)["finished"], false);
  EXPECT_EQ(verify(file).status, 1);

  const Said done = recover(file, path("copy.mcap"));
  EXPECT_EQ(done.status, 1) << "half a chunk is lost";
  EXPECT_EQ(verify(path("copy.mcap")).status, 0) << verify(path("copy.mcap")).out;
  EXPECT_THAT(info({path("copy.mcap")}).out, HasSubstr("recovered"));
  const json note = json::parse(info({path("copy.mcap")}, true).out)["recovered"];
  EXPECT_EQ(note["was_finished"], "false");
  EXPECT_TRUE(note["lost"].get<std::string>().ends_with("; its end was missing")) << note;
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
  EXPECT_EQ(done.status, 1) << "a chunk is lost";
  EXPECT_THAT(done.out, HasSubstr("1 chunk"));
  EXPECT_EQ(verify(path("copy.mcap")).status, 0) << verify(path("copy.mcap")).out;
  const json note = json::parse(info({path("copy.mcap")}, true).out)["recovered"];
  EXPECT_EQ(note["was_finished"], "true");
  EXPECT_EQ(note["chunks"], "1");
  EXPECT_THAT(note["lost"].get<std::string>(), Not(HasSubstr("its end")));
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
  const std::vector<json> some = lines_of(
      dump({.file = file, .topics = {"/sightline/tick"}, .start_s = 0.5, .end_s = 0.75}).out);
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

// Only proto2 has such fields.
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
  EXPECT_THAT(dump({.file = file, .topics = {"/tock"}}).err, HasSubstr("no topic /tock; it has /tick, /reply"));
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
    const std::vector<Said> all = {info({file}), verify(file), dump({.file = file}), recover(file, path("x.mcap")),
                                   cut(file, path("x.mcap"), 0)};
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
      bytes[dice.next_below(static_cast<uint32_t>(bytes.size()))] ^= static_cast<char>(1 + dice.next_below(255));
    const std::string file = put("d.mcap", bytes);
    for (const Said& one : {info({file}), verify(file), dump({.file = file}), cut(file, path("x.mcap"), 0.05)})
      EXPECT_TRUE(one.status == 0 || one.status == 1);
    std::filesystem::remove(path("x.mcap"));
    if (recover(file, path("x.mcap")).status == 0) {
      EXPECT_EQ(verify(path("x.mcap")).status, 0) << verify(path("x.mcap")).out;
    }
    std::filesystem::remove(path("x.mcap"));
  }
}

}  // namespace
}  // namespace sightline
