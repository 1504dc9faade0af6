// Recorded sessions replayed in this process: equal to the bit where they can be, and reported where they differ.
#include "client/replay/replay.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>

#include "client/recordings/check.h"
#include "client/recordings/cut.h"
#include "client/recordings/summary.h"
#include "client/replay/replay_command.h"
#include "server/record/recorder.h"
#include "tests/record/pretended_files.h"
#include "tests/replay/recorded_hall.h"
#include "tests/replay/replayed.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using test::open_recording;
using test::record_hall;
using test::RecordedHall;
using test::replay_here;
using test::Replayed;
using test::rewritten;
using testing::HasSubstr;
using testing::Not;

// An observed camera that the player moves freely: its path does not depend on the session's replies.
void put_camera(v1::Tick& tick, double x, bool cut) {
  v1::ObservedCamera& observed = *tick.mutable_observed_camera();
  observed.mutable_pose()->mutable_position()->set_x(x);
  observed.mutable_pose()->mutable_position()->set_y(2.0);
  observed.mutable_pose()->mutable_rotation()->set_w(1.0);
  observed.set_cut(cut);
}

class ReplayHere : public testing::Test {
 protected:
  const std::unique_ptr<SamplerDevice> sampler_ = make_embree_sampler_device();
};

TEST_F(ReplayHere, EveryReplyIsEqualWithMergesAndEconomyToo) {
  for (const test::RecordedHallOptions& options :
       {test::RecordedHallOptions{.ticks = 90}, test::RecordedHallOptions{.merge_every = 2},
        test::RecordedHallOptions{.quality_level = 5}}) {
    const RecordedHall hall = record_hall(*sampler_, options);
    const Replayed replayed = replay_here(hall.bytes);
    EXPECT_EQ(replayed.replies, hall.replies);
    EXPECT_EQ(replayed.equal, hall.replies);
    EXPECT_EQ(replayed.hash, hall.hash);
    EXPECT_EQ(replayed.verdict, ReplayVerdict::kEqual);
  }
}

TEST_F(ReplayHere, AnyNumberOfThreadsAnswersAlike) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 120});
  for (const size_t threads : {1, 2, 3}) {
    const Replayed replayed = replay_here(hall.bytes, {}, {}, {}, threads);
    EXPECT_EQ(replayed.hash, hall.hash) << threads;
    EXPECT_EQ(replayed.verdict, ReplayVerdict::kEqual) << threads;
  }
}

TEST_F(ReplayHere, RefusedTicksAreRefusedAgainWhereverTheyStand) {
  const auto wrong_now_and_then = [](int i, const v1::CameraReply&, v1::Tick& tick) {
    if (i == 5 || i == 6 || i == 20 || i == 59) tick.mutable_transforms()->add_ids(77);  // without a position
    if (i == 30) tick.set_sequence(30);  // the tick before has this number too
  };
  for (const int merge_every : {0, 2, 3}) {
    const RecordedHall hall = record_hall(*sampler_, {.merge_every = merge_every, .change = wrong_now_and_then});
    const Replayed replayed = replay_here(hall.bytes);
    EXPECT_EQ(replayed.hash, hall.hash);
    EXPECT_EQ(replayed.verdict, ReplayVerdict::kEqual) << replayed.text;
    EXPECT_THAT(replayed.text, HasSubstr("5 ticks as recorded, 0 only in the recording, 0 only now"));
  }
}

// It was not applied where it was recorded. It need not take long here, so the replay leaves it out.
TEST_F(ReplayHere, ATickThatTookTooLongToLoadIsLeftOut) {
  const RecordedHall hall = record_hall(*sampler_);
  uint64_t sequence = 0;
  const std::string with_refused = rewritten(hall.bytes, [&](RecordedEvent& event, RecordingWriter& writer) {
    if (event.topic == RecordTopic::kReply && ++sequence == 30) {
      v1::Tick late;
      late.set_sequence(1'000'000);
      late.set_time_s(std::get<v1::CameraReply>(event.message).time_s());
      late.mutable_settings()->set_preset(v1::Settings::PRESET_PAPER);
      EXPECT_TRUE(writer.write(late, event.log_ns));
      v1::TickError refused;
      refused.set_sequence(late.sequence());
      refused.set_message("tick.targets: takes more processor time to load than is allowed (--max-load-s)");
      refused.add_field_violations()->set_field("tick.targets");
      EXPECT_TRUE(writer.write(refused, event.log_ns));
    }
    return true;
  });
  const Replayed replayed = replay_here(with_refused);
  EXPECT_EQ(replayed.hash, hall.hash);
  EXPECT_EQ(replayed.verdict, ReplayVerdict::kEqual) << replayed.text;
}

// One bit of a reply in the file is changed. The replay finds it, with its tick, field and both values.
TEST_F(ReplayHere, OneBitIsFound) {
  const RecordedHall hall = record_hall(*sampler_);
  const std::string changed = rewritten(hall.bytes, [](RecordedEvent& event, RecordingWriter&) {
    if (event.topic != RecordTopic::kReply) return true;
    v1::CameraReply& reply = std::get<v1::CameraReply>(event.message);
    if (reply.sequence() == 17)
      reply.mutable_targets(1)->set_distance(std::nextafter(reply.targets(1).distance(), 1e9));
    return true;
  });
  const Replayed replayed = replay_here(changed);
  EXPECT_EQ(replayed.equal + 1, replayed.replies);
  EXPECT_EQ(replayed.verdict, ReplayVerdict::kDiffers);
  EXPECT_THAT(replayed.text, HasSubstr("tick 17 at 0.267 s: targets[1].distance was "));
}

TEST_F(ReplayHere, ReplyThatIsMissingHasItsStepAllTheSame) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 60});
  const std::string gappy = rewritten(hall.bytes, [](RecordedEvent& event, RecordingWriter& writer) {
    if (event.topic != RecordTopic::kReply) return true;
    const uint64_t sequence = std::get<v1::CameraReply>(event.message).sequence();
    if (sequence == 20 || sequence == 21) return false;
    v1::Gap gap;
    gap.set_messages(2);
    gap.set_reason(v1::Gap::REASON_QUEUE_FULL);
    return sequence != 22 || writer.write(gap, event.log_ns).has_value();
  });
  const Replayed replayed = replay_here(gappy);
  EXPECT_EQ(replayed.replies, 58u);
  EXPECT_EQ(replayed.equal, 58u);
  EXPECT_THAT(replayed.text, HasSubstr("2 messages are missing; 19 of 19 replies before the first are equal"));
  EXPECT_THAT(replayed.text, HasSubstr("2 steps were taken whose replies are missing"));
}

TEST_F(ReplayHere, MissingTicksAreAlikeAndNotEqual) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 60});
  const std::string gappy = rewritten(hall.bytes, [](RecordedEvent& event, RecordingWriter& writer) {
    const bool is_tick = event.topic == RecordTopic::kTick, is_reply = event.topic == RecordTopic::kReply;
    const uint64_t sequence = is_tick    ? std::get<v1::Tick>(event.message).sequence()
                              : is_reply ? std::get<v1::CameraReply>(event.message).sequence()
                                         : 0;
    if (sequence >= 30 && sequence < 33) return false;
    v1::Gap gap;
    gap.set_messages(6);
    return !is_tick || sequence != 33 || writer.write(gap, event.log_ns).has_value();
  });
  const Replayed replayed = replay_here(gappy);
  EXPECT_EQ(replayed.verdict, ReplayVerdict::kAlike) << replayed.text;
  EXPECT_LT(replayed.equal, replayed.replies);
  EXPECT_THAT(replayed.text, HasSubstr("29 of 29 replies before the first are equal"));
  EXPECT_THAT(replayed.text, HasSubstr("alike, not equal"));
}

// A chunk that was damaged on disk is a gap that no message in the file reports.
TEST_F(ReplayHere, DamagedChunkIsAGap) {
  std::string bytes = record_hall(*sampler_, {.ticks = 120}).bytes;
  const std::vector<mcap::ChunkIndex> chunks = open_recording(bytes).container().chunks;
  ASSERT_GE(chunks.size(), 4u);
  const mcap::ChunkIndex& third = chunks[2];
  bytes[third.chunk_start + third.chunk_length - 100] ^= 0x55;
  const Replayed replayed = replay_here(bytes);
  EXPECT_LT(replayed.replies, 100u);
  EXPECT_GT(replayed.replies, 60u);
  EXPECT_THAT(replayed.text, HasSubstr("gaps        1, "));
  EXPECT_THAT(replayed.text, HasSubstr("replies before the first are equal"));
  EXPECT_NE(replayed.verdict, ReplayVerdict::kEqual);
}

TEST_F(ReplayHere, AStartFromASnapshotNeedNotBeEqual) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 30});
  const std::string from_snapshot = rewritten(
      hall.bytes, [](RecordedEvent&, RecordingWriter&) { return true; },
      [](v1::RecordingInfo& info) { info.set_snapshot_ticks(100); });
  // In this case the replies are equal all the same, and the result says so.
  EXPECT_EQ(replay_here(from_snapshot, {}, "from_snapshot").verdict, ReplayVerdict::kEqual);
  const std::string other_seed = rewritten(record_hall(*sampler_, {.ticks = 30, .seed = 2}).bytes,
                                           [](RecordedEvent&, RecordingWriter&) { return true; });
  EXPECT_EQ(replay_here(other_seed, {"seed=3"}, "from_snapshot").verdict, ReplayVerdict::kAlike);
  EXPECT_EQ(replay_here(other_seed, {"seed=3"}).verdict, ReplayVerdict::kDiffers);
}

// A cut from the middle of a recording without memories begins with a snapshot tick that no reply answers.
// The camera keeps its shot in this part. The memory of which shot it was going to is not in the file.
TEST_F(ReplayHere, CutGoesOnWhereTheRecordingWas) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 1140});
  MemorySink sink;
  const auto cut = cut_recording(open_recording(hall.bytes), {.start_s = 18.5}, sink);
  ASSERT_TRUE(cut.has_value()) << to_string(cut.error());
  EXPECT_EQ(cut->snapshot_ticks, 1109u);
  EXPECT_EQ(cut->lead_messages, 0u);
  const Replayed replayed = replay_here(sink.bytes());
  EXPECT_EQ(replayed.replies, 31u);
  EXPECT_EQ(replayed.verdict, ReplayVerdict::kAlike) << replayed.text;
  EXPECT_THAT(replayed.text, HasSubstr("no memory of the camera"));
  EXPECT_THAT(replayed.text, Not(HasSubstr("missing")));
}

// Near the beginning of a session its own messages lead in.
TEST_F(ReplayHere, AnEarlyCutBeginsWithTheSession) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 90});
  MemorySink sink;
  const auto cut = cut_recording(open_recording(hall.bytes), {.start_s = 0.5}, sink);
  ASSERT_TRUE(cut.has_value()) << to_string(cut.error());
  EXPECT_EQ(cut->snapshot_ticks, 0u);
  EXPECT_NEAR(cut->lead_s, 0.5, 1e-6);
  EXPECT_EQ(replay_here(sink.bytes()).verdict, ReplayVerdict::kEqual);
}

TEST_F(ReplayHere, NothingToCompareIsNotCalledEqual) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 10});
  const std::string silent = rewritten(
      hall.bytes, [](RecordedEvent& event, RecordingWriter&) { return event.topic != RecordTopic::kReply; });
  const Replayed replayed = replay_here(silent);
  EXPECT_EQ(replayed.verdict, ReplayVerdict::kNothing);
  EXPECT_THAT(replayed.text, HasSubstr("nothing to compare: the recording has no reply"));
}

// All that the ticks added together is more than one message may hold, so a later part cannot begin in the session's
// state.
TEST_F(ReplayHere, APartWhoseSnapshotWasTooLargeIsNotTakenForTheSession) {
  const auto add_one = [](int i, const v1::CameraReply&, v1::Tick& tick) {
    v1::NewInstance& added = *tick.mutable_delta()->add_added_instances();
    added.set_id(1000 + static_cast<uint64_t>(i));
    added.mutable_shape()->mutable_sphere()->set_radius(0.1);
    added.mutable_pose()->mutable_position()->set_y(100.0);
  };
  const std::string hall = record_hall(*sampler_, {.ticks = 200, .change = add_one}).bytes;
  const Recording recording = open_recording(hall);
  size_t largest = std::max(recording.open_session().ByteSizeLong(), recording.opened().ByteSizeLong());
  recording.read({}, [&](RecordedEvent& event) {
    std::visit([&](const auto& message) { largest = std::max(largest, message.ByteSizeLong()); }, event.message);
    return true;
  });

  test::PretendedFiles disk;
  disk.now_ns = test::kRecordedStartNs;
  {
    RecordWriter writer(
        {.limits = {.max_file_bytes = 100'000, .free_reserve_bytes = 0},
         .chunk_bytes = 1000,
         .max_message_bytes = largest,
         .for_viewers = false},
        disk, [&] { return disk.now_ns; }, [](const RecordWarning&) {});
    v1::RecordingInfo info = recording.info();
    const auto recorder = writer.open_session(info);
    const auto put = [&](RecordTopic topic, const auto& message) {
      disk.now_ns += 1'000'000;
      EXPECT_TRUE(recorder->record(topic, {disk.now_ns, disk.now_ns}, message));
      writer.run_once();
    };
    put(RecordTopic::kOpen, recording.open_session());
    put(RecordTopic::kOpened, recording.opened());
    const auto files = recording.files();
    for (const RecordedFile& file : *files)
      recorder->attach(file.name, "", 1, std::make_shared<std::string>(file.bytes));
    recording.read({}, [&](RecordedEvent& event) {
      std::visit([&](const auto& message) { put(event.topic, message); }, event.message);
      return true;
    });
  }
  const std::string& last = *std::prev(disk.files.end())->second.bytes;
  const Recording part = open_recording(last);
  EXPECT_GT(part.info().part(), 1u);
  EXPECT_EQ(part.info().snapshot_ticks(), 0u);
  EXPECT_GT(check_session(part).gap_messages, 100u);
  const auto summary = summarise_recording(std::make_shared<MemorySource>(last), "part");
  ASSERT_TRUE(summary.has_value());
  EXPECT_THAT(summary->missing, testing::ElementsAre(testing::Key("TOO_LARGE")));
  MemorySink cut;
  const auto done = cut_recording(part, {.start_s = 0.001}, cut);
  ASSERT_TRUE(done) << to_string(done.error());
  EXPECT_EQ(check_session(open_recording(cut.bytes())).gap_messages, check_session(part).gap_messages);
  const Replayed replayed = replay_here(last);
  EXPECT_NE(replayed.verdict, ReplayVerdict::kEqual) << replayed.text;
  EXPECT_THAT(replayed.text, HasSubstr("gaps        1, "));
}

TEST_F(ReplayHere, CamerasThatOnlyFollowedAreLeftOutUnderOtherSettings) {
  const auto follow_and_cut = [](int i, const v1::CameraReply& newest, v1::Tick& tick) {
    if (i > 10 && i < 40) *tick.mutable_observed_camera()->mutable_pose() = newest.pose();
    if (i == 40) put_camera(tick, 3.0, true);
    if (i == 50) put_camera(tick, 3.5, false);
  };
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 60, .change = follow_and_cut});
  const Replayed as_it_was = replay_here(hall.bytes);
  EXPECT_EQ(as_it_was.hash, hall.hash);
  EXPECT_EQ(as_it_was.observed_left_out, 0u);
  const Replayed otherwise = replay_here(hall.bytes, {"limits.max_speed_mps=2"});
  EXPECT_EQ(otherwise.observed_left_out, 29u);
  EXPECT_EQ(otherwise.observed_kept, 2u);
}

TEST_F(ReplayHere, SceneThatIsNotAttachedIsFoundByPathByFolderAndElseNamed) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 10});
  const RecordedHall bare = record_hall(*sampler_, {.ticks = 10, .attach_scene = false});
  const RecordedFile file = open_recording(hall.bytes).files()->front();
  const test::TemporaryFolder scenes_folder;
  const auto folder = scenes_folder / "deep";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "other.glb") << "no scene";
  std::ofstream(folder / "the-hall.glb", std::ios::binary) << file.bytes;

  EXPECT_EQ(replay_here(bare.bytes, {}, {}, {.files = {(folder / "the-hall.glb").string()}}).hash, hall.hash);
  EXPECT_EQ(replay_here(bare.bytes, {}, {}, {.folder = scenes_folder.path()}).hash, hall.hash);

  const Recording recording = open_recording(bare.bytes);
  const auto place = make_local_backend(make_embree_sampler_device());
  SceneFiles scenes(recording, {});
  Replay replay(recording, *place, scenes, {});
  const Status opened = replay.open();
  ASSERT_FALSE(opened.has_value());
  EXPECT_EQ(opened.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(opened.error().message, HasSubstr(file.name.substr(std::string("upload/").size())));
  EXPECT_THAT(opened.error().message, HasSubstr("--scene-dir"));
}

// Runs the whole command on files.
class ReplayCommand : public ReplayHere {
 protected:
  std::string keep(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return (folder_ / name).string();
  }
  int run(ReplayCommandOptions options, const std::string& typed = {}) {
    std::istringstream in(typed);
    out_.str({});
    err_.str({});
    return run_replay_command(options, in, out_, err_);
  }

  const test::TemporaryFolder folder_;
  std::ostringstream out_, err_;
};

TEST_F(ReplayCommand, SaysEqualAndWritesWhatItAnswered) {
  const RecordedHall hall = record_hall(*sampler_);
  const std::string file = keep("hall.mcap", hall.bytes), again = (folder_ / "again.mcap").string();
  ASSERT_EQ(run({.file = file, .out = again}), 0) << err_.str();
  EXPECT_THAT(out_.str(), HasSubstr("60 compared, 60 equal"));
  EXPECT_THAT(out_.str(), testing::Not(HasSubstr(" 0.0 times the wall clock")));
  ASSERT_EQ(run({.file = file, .threads = 3}), 0) << err_.str();
  EXPECT_THAT(out_.str(), HasSubstr("60 compared, 60 equal"));
  ASSERT_EQ(run({.file = again}), 0) << err_.str() << out_.str();
  EXPECT_THAT(out_.str(), HasSubstr("60 compared, 60 equal"));
  EXPECT_EQ(run({.file = file, .out = again}), 1);  // the file exists already
  EXPECT_THAT(err_.str(), HasSubstr("again.mcap"));
}

// The command as it is typed, on a recording whose scene is not attached.
TEST_F(ReplayCommand, FlagsAreTakenAsTheyAreTyped) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 10});
  const std::string bare = keep("bare.mcap", record_hall(*sampler_, {.ticks = 10, .attach_scene = false}).bytes);
  const test::TemporaryFolder scenes;
  const std::string scene = (scenes / "the-hall.glb").string(), other = (scenes / "other.glb").string();
  std::ofstream(scene, std::ios::binary) << open_recording(hall.bytes).files()->front().bytes;
  std::ofstream(other, std::ios::binary) << "no scene";
  struct Typed {
    int status = -1;
    std::string said;
  };
  const auto type = [](const std::string& words) {
    CLI::App app;
    const Verb verb = add_replay_verb(app);
    app.parse("replay " + words);
    testing::internal::CaptureStdout();
    const int status = verb.run();
    return Typed{status, testing::internal::GetCapturedStdout()};
  };
  // Ticks come every 16.7 ms, so five come before 90 ms, and the pictures of the first, the third and the fifth are
  // judged.
  const std::string again = (folder_ / "again.mcap").string();
  const Typed some = type(bare + " --scene-dir " + scenes.path().string() +
                          " --sampler embree --threads 2 --end 0.09 --truth --truth-every 2 --out " + again);
  EXPECT_EQ(some.status, 0);
  EXPECT_THAT(some.said, HasSubstr("5 compared, 5 equal"));
  EXPECT_THAT(some.said, HasSubstr("3 pictures of each"));
  EXPECT_THAT(some.said, HasSubstr("written     " + again));

  const Typed all = type(bare + " --scene " + other + " --scene " + scene + " --start 0.05 --rate 1000");
  EXPECT_EQ(all.status, 0);
  EXPECT_THAT(all.said, HasSubstr("start       at 0.050 s"));
  EXPECT_THAT(all.said, HasSubstr("10 compared, 10 equal"));

  EXPECT_EQ(type(bare).status, 1) << "no scene";
  EXPECT_THROW(type(bare + " --step --rate 2"), CLI::ParseError);
  EXPECT_THROW(type(bare + " --scene-dir " + scene), CLI::ParseError) << "no folder";
}

TEST_F(ReplayCommand, SpeedIsToldByTheWallClockAndByTheGames) {
  const auto double_time = [](int i, const v1::CameraReply&, v1::Tick& tick) { tick.set_time_s(i / 30.0); };
  const std::string file = keep("hall.mcap", record_hall(*sampler_, {.change = double_time}).bytes);
  ASSERT_EQ(run({.file = file}), 0) << err_.str();
  const std::string said = out_.str();
  std::smatch speed;
  ASSERT_TRUE(std::regex_search(
      said, speed, std::regex(R"(, ([\d.]+) times the wall clock of the recording, ([\d.]+) times the game's clock)")))
      << said;
  const double wall = std::stod(speed[1]), game = std::stod(speed[2]);
  EXPECT_GT(game, wall);
  EXPECT_NEAR(game, 2 * wall, 0.05 * game + 0.16)
      << "each has one decimal, and the game's clock begins with the first tick";
}

TEST_F(ReplayCommand, StepsByHandFromTheStartThatIsAskedFor) {
  const std::string file = keep("hall.mcap", record_hall(*sampler_).bytes);
  ASSERT_EQ(run({.file = file, .by_hand = true, .start_s = 0.5}, "\nn 3\nwhat\nq\n"), 0);
  EXPECT_THAT(out_.str(), HasSubstr("everything before is stepped"));
  EXPECT_THAT(out_.str(), HasSubstr("33 compared, 33 equal"));  // 29 before 0.5 s, and four by hand
  EXPECT_THAT(out_.str(), HasSubstr("tick 33 "));
  EXPECT_THAT(out_.str(), testing::Not(HasSubstr("tick 29 ")));
  EXPECT_THAT(out_.str(), HasSubstr("n 10: ten steps"));
}

TEST_F(ReplayCommand, EndsWhereItIsTold) {
  const std::string file = keep("hall.mcap", record_hall(*sampler_).bytes);
  ASSERT_EQ(run({.file = file, .end_s = 0.5}), 0);
  EXPECT_THAT(out_.str(), HasSubstr("29 compared, 29 equal"));
}

TEST_F(ReplayCommand, OtherSettingsShowBothRunsAndTheTruth) {
  const std::string file = keep("hall.mcap", record_hall(*sampler_).bytes), again = (folder_ / "slow.mcap").string();
  ASSERT_EQ(run({.file = file, .set = {"limits.max_speed_mps=0.1"}, .truth = true, .truth_every = 30, .out = again}), 0)
      << err_.str();
  EXPECT_THAT(out_.str(), testing::ContainsRegex("recorded +replayed"));
  for (const char* line :
       {"travel", "peak speed", "0.10 m/s", "true: r_N", "true: body collisions", "2 pictures of each"})
    EXPECT_THAT(out_.str(), HasSubstr(line));
  // The recorded camera went faster than the new limit, which did not hold for it.
  EXPECT_THAT(out_.str(), testing::ContainsRegex("motion limit violations \\(frames\\) +0 +0"));
  // The written recording has the changed settings, and replays equal without --set.
  ASSERT_EQ(run({.file = again}), 0) << err_.str();
  EXPECT_THAT(out_.str(), HasSubstr("60 compared, 60 equal"));
}

TEST_F(ReplayCommand, WrongSettingsAndFilesAreNamed) {
  const std::string file = keep("hall.mcap", record_hall(*sampler_, {.ticks = 2}).bytes);
  EXPECT_NE(run({.file = file, .set = {"tuning.aggregate.filter.m=10"}}), 0);
  EXPECT_THAT(err_.str(),
              HasSubstr("tuning.aggregate.filter.m: there is no \"m\" here, only: mode, alpha, n, window_s"));
  EXPECT_NE(run({.file = file, .set = {"tuning.sample.points=99"}}), 0);
  EXPECT_THAT(err_.str(), HasSubstr("sample.points"));
  EXPECT_NE(run({.file = keep("nothing.mcap", "nothing")}), 0);
  EXPECT_THAT(err_.str(), HasSubstr("nothing.mcap"));
  EXPECT_NE(run({.file = file, .server = "127.0.0.1:1", .wait_s = 0.1}), 0);
  EXPECT_THAT(err_.str(), HasSubstr("address"));
}

TEST_F(ReplayCommand, RealTimeIsNeverEarly) {
  const std::string file = keep("hall.mcap", record_hall(*sampler_, {.ticks = 13}).bytes);
  const auto start = std::chrono::steady_clock::now();
  ASSERT_EQ(run({.file = file, .rate = 2.0}), 0);
  // The last tick is due a tenth of a second after the first.
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(99));
}

}  // namespace
}  // namespace sightline
