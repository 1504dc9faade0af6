// A real daemon records sessions: which ones, the contents of the files, and that a replay of their steps gives the
// same bits.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "client/scenario/scenario.h"
#include "client/scenario/scenario_session.h"
#include "scenes/hall.h"
#include "server/gl/software_renderer.h"
#include "server/sample/sampler_choice.h"
#include "tests/service/recorded_session.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using std::chrono::steady_clock;
using test::Heard;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr int kBoxes = 6;

v1::OpenSession boxes(v1::RecordingRequest::Mode mode = v1::RecordingRequest::MODE_UNSPECIFIED) {
  v1::OpenSession open = open_with_boxes(kBoxes);
  open.set_label("recorded");
  if (mode != v1::RecordingRequest::MODE_UNSPECIFIED) open.mutable_recording()->set_mode(mode);
  return open;
}

v1::Tick box_tick(uint64_t sequence) {
  return move_tick(sequence, 1 + sequence % kBoxes, 0.02 * static_cast<double>(sequence));
}

// A running daemon that is ready.
class Host {
 public:
  explicit Host(std::vector<std::string> arguments)
      : daemon([&arguments] {
          arguments.insert(arguments.end(), {"--listen", "127.0.0.1:0"});
          return arguments;
        }()) {
    EXPECT_TRUE(daemon.wait_until_ready()) << daemon.errors();
  }
  std::string address() const { return daemon.addresses().front(); }

  Daemon daemon;
};

// A few ticks, each answered before the next.
Heard talk(const Host& host, const v1::OpenSession& open, uint64_t ticks = 20) {
  Heard heard(host.address(), open);
  for (uint64_t i = 1; i <= ticks; ++i) EXPECT_TRUE(heard.ask(box_tick(i)));
  EXPECT_TRUE(heard.finish().ok());
  return heard;
}

class RecordingDaemon : public testing::Test {
 protected:
  const test::TemporaryFolder scratch_;
  const std::string folder_ = scratch_ / "recordings";
};

TEST_F(RecordingDaemon, ASessionIsInTheFileThatItsOpeningNames) {
  Host host({"--record-dir", folder_});
  const Heard heard = talk(host, boxes());
  test::stop(host.daemon);
  const std::filesystem::path file = test::only_recording(folder_);
  EXPECT_EQ(file.filename(), heard.opened.recording_file());
  EXPECT_THAT(host.daemon.errors(), HasSubstr("recording=" + heard.opened.recording_file()));

  const Recording recording = test::open_recording(file);
  EXPECT_TRUE(recording.container().finished);
  EXPECT_EQ(recording.open_session().SerializeAsString(), heard.open.SerializeAsString());
  EXPECT_EQ(recording.opened().SerializeAsString(), heard.opened.SerializeAsString());
  EXPECT_EQ(recording.info().session_id(), heard.opened.session_id());
  EXPECT_EQ(recording.info().seed(), heard.open.seed());
  EXPECT_EQ(recording.info().sampler(), "embree");
  EXPECT_EQ(recording.info().label(), "recorded");
  EXPECT_FALSE(recording.info().server_version().empty());
  EXPECT_FALSE(recording.info().build().empty());
  EXPECT_EQ(recording.info().part(), 1u);
  test::expect_same(test::read_all(recording), heard);
}

TEST_F(RecordingDaemon, WhoIsRecordedIsSaidByTheClientAndElseByTheFlags) {
  struct Case {
    std::vector<std::string> flags;
    v1::RecordingRequest::Mode mode;
    bool recorded;
  };
  const std::vector<std::string> all{"--record-dir", folder_}, asked{"--record-dir", folder_, "--record", "asked"};
  for (const Case& c :
       {Case{all, v1::RecordingRequest::MODE_UNSPECIFIED, true}, Case{all, v1::RecordingRequest::MODE_ON, true},
        Case{all, v1::RecordingRequest::MODE_OFF, false}, Case{asked, v1::RecordingRequest::MODE_UNSPECIFIED, false},
        Case{asked, v1::RecordingRequest::MODE_ON, true}, Case{asked, v1::RecordingRequest::MODE_OFF, false}}) {
    std::filesystem::remove_all(folder_);
    Host host(c.flags);
    const Heard heard = talk(host, boxes(c.mode));
    test::stop(host.daemon);
    EXPECT_EQ(!heard.opened.recording_file().empty(), c.recorded);
    EXPECT_EQ(heard.opened.warnings_size(), 0);
    EXPECT_EQ(
        std::filesystem::exists(folder_ + "/" + heard.opened.recording_file()) && !std::filesystem::is_empty(folder_),
        c.recorded);
  }
}

TEST_F(RecordingDaemon, WithoutAFolderAWishIsAnsweredByAWarning) {
  Host host({});
  const Heard heard = talk(host, boxes(v1::RecordingRequest::MODE_ON));
  EXPECT_EQ(heard.replies.size(), 20u);
  EXPECT_THAT(heard.opened.recording_file(), IsEmpty());
  EXPECT_THAT(heard.opened.warnings(), Contains(HasSubstr("--record-dir")));
  EXPECT_EQ(talk(host, boxes()).opened.warnings_size(), 0);
  EXPECT_FALSE(server_stats(connect(host.address())).has_recording());
}

TEST_F(RecordingDaemon, ARefusedOpeningLeavesNoFile) {
  Host host({"--record-dir", folder_});
  v1::OpenSession wrong = boxes();
  wrong.add_targets()->set_id(4711);
  Stream stream(connect(host.address()));
  stream.send(wrong);
  EXPECT_FALSE(stream.finish().ok());
  EXPECT_EQ(server_stats(connect(host.address())).recording().open_sessions(), 0u);
  test::stop(host.daemon);
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(RecordingDaemon, TheServerCountsWhatItRecords) {
  Host host({"--record-dir", folder_});
  Heard heard(host.address(), boxes());
  ASSERT_TRUE(heard.ask(box_tick(1)));
  const auto counts = [&] { return server_stats(connect(host.address())).recording(); };
  while (counts().bytes() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(counts().open_sessions(), 1u);
  EXPECT_EQ(counts().failing_sessions(), 0u);
  EXPECT_EQ(counts().files(), 1u);
  EXPECT_EQ(counts().dropped_messages(), 0u);
  heard.finish();
  while (counts().open_sessions() > 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(counts().messages(), 4u);  // how it was opened, the tick and the reply
}

// An opening that fills more than half of a session's queue of one megabyte.
TEST_F(RecordingDaemon, AHugeOpeningIsRecordedWhole) {
  Host host({"--record-dir", folder_});
  v1::OpenSession open = open_with_boxes(20'000);
  ASSERT_GT(open.ByteSizeLong(), size_t{1} << 19);
  const Heard heard = talk(host, open, 3);
  test::stop(host.daemon);
  const Recording recording = test::open_recording(test::only_recording(folder_));
  EXPECT_EQ(recording.open_session().SerializeAsString(), open.SerializeAsString());
  test::expect_same(test::read_all(recording), heard);
}

TEST_F(RecordingDaemon, AStopInMidSessionLeavesFinishedFiles) {
  Host host({"--record-dir", folder_, "--drain-s", "0"});
  std::vector<std::unique_ptr<Heard>> sessions;
  for (int s = 0; s < 4; ++s) sessions.push_back(std::make_unique<Heard>(host.address(), boxes()));
  for (uint64_t i = 1; i <= 30; ++i)
    for (const auto& heard : sessions) ASSERT_TRUE(heard->ask(box_tick(i)));
  test::stop(host.daemon);
  for (const auto& heard : sessions) {
    const Recording recording = test::open_recording(folder_ + "/" + heard->opened.recording_file());
    EXPECT_TRUE(recording.container().finished);
    test::expect_same(test::read_all(recording), *heard);
  }
}

TEST_F(RecordingDaemon, AKillLosesAtMostASecond) {
  Host host({"--record-dir", folder_});
  Heard heard(host.address(), boxes());
  const auto start = steady_clock::now();
  for (uint64_t i = 1; i <= 150; ++i) {
    std::this_thread::sleep_until(start + i * std::chrono::microseconds(16'667));
    ASSERT_TRUE(heard.ask(box_tick(i)));
  }
  host.daemon.signal(SIGKILL);
  host.daemon.wait();
  const Recording recording = test::open_recording(test::only_recording(folder_));
  EXPECT_FALSE(recording.container().finished);
  const test::FoundInFile found = test::read_all(recording);
  ASSERT_FALSE(found.replies.empty());
  ASSERT_LE(found.replies.size(), heard.replies.size());
  for (size_t i = 0; i < found.replies.size(); ++i) {
    EXPECT_EQ(found.replies[i].SerializeAsString(), heard.replies[i].SerializeAsString()) << i;
    EXPECT_EQ(found.ticks[i].SerializeAsString(), heard.sent[i].SerializeAsString()) << i;
  }
  EXPECT_GE(found.last_ns + 1'000'000'000, heard.reply_times_ns.back());
}

// --- replay

struct Where {
  const char* sampler;
  const char* threads;
};

class RecordedReplay : public testing::TestWithParam<Where> {
 protected:
  static void SetUpTestSuite() { prepare_software_rendering(); }
  void SetUp() override {
    const bool egl = GetParam().sampler == std::string("egl");
    auto chosen = choose_sampler_device(egl ? SamplerChoice::kEgl : SamplerChoice::kEmbree, {});
    ASSERT_TRUE(chosen || egl) << to_string(chosen.error());
    if (!chosen) GTEST_SKIP() << "no EGL context: " << to_string(chosen.error());
    sampler_ = std::move(chosen->device);
  }
  std::vector<std::string> flags(std::vector<std::string> more = {}) const {
    std::vector<std::string> all{"--record-dir",     folder_,     "--sampler",
                                 GetParam().sampler, "--threads", GetParam().threads};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  const test::TemporaryFolder scratch_;
  const std::string folder_ = scratch_ / "recordings";
  std::unique_ptr<SamplerDevice> sampler_;
};

// Two targets walk through the hall, next to other sessions. The ticks come one by one and in bursts that are merged.
// Some are refused, some ask to be merged, and some set the quality level.
TEST_P(RecordedReplay, EveryStepOfTheHallAgain) {
  const auto glb = scenes::make_hall({.seed = 1, .duration_s = 4.0});
  Host host(flags());
  std::string hash;
  {
    const auto stub = v1::CameraControlService::NewStub(connect(host.address()));
    grpc::ClientContext context;
    v1::UploadSceneResponse answered;
    const auto writer = stub->UploadScene(&context, &answered);
    v1::UploadSceneRequest request;
    request.set_chunk(std::string(reinterpret_cast<const char*>(glb.data()), glb.size()));
    writer->Write(request);
    writer->WritesDone();
    ASSERT_TRUE(writer->Finish().ok());
    hash = answered.hash();
  }
  LocalWorld world("", *sampler_);
  const auto asset = *world.scenes.add_uploaded(glb);
  const Scenario scenario = *Scenario::from_asset(asset);
  const auto play = [&](uint64_t seed) {
    Heard heard(host.address(), open_request(scenario, hash, seed));
    for (uint64_t i = 1; i <= 120; ++i) {
      const double time_s = static_cast<double>(i) / 60;
      v1::Tick tick = tick_at(scenario, i, time_s, 1.0 / 60);
      if (i % 13 == 0) tick.mutable_transforms()->set_ids(0, 4711);  // refused
      if (i % 7 == 0) tick.mutable_step_control()->set_merge_into_next(true);
      if (i % 5 == 0) tick.mutable_step_control()->set_quality_level(static_cast<uint32_t>(i / 5 % 6));
      heard.send(tick);
      const bool answered = i % 13 != 0 && i % 7 != 0;
      if (!answered || i % 20 <= 8) continue;  // it may be merged by the server
      EXPECT_TRUE(heard.read_until(i));
    }
    const uint64_t last = heard.sent.back().sequence();
    EXPECT_TRUE(heard.read_until(last));
    EXPECT_TRUE(heard.finish().ok());
    return heard;
  };
  std::optional<Heard> other;
  std::thread neighbour([&] { other.emplace(play(2)); });
  const Heard heard = play(1);
  neighbour.join();
  test::stop(host.daemon);

  for (const Heard* session : std::initializer_list<const Heard*>{&heard, &*other}) {
    const Recording recording = test::open_recording(folder_ + "/" + session->opened.recording_file());
    EXPECT_EQ(recording.info().sampler(), GetParam().sampler);
    const test::FoundInFile found = test::read_all(recording);
    test::expect_same(found, *session);
    EXPECT_GT(found.rejections.size(), 5u);
    EXPECT_TRUE(std::any_of(found.replies.begin(), found.replies.end(),
                            [](const v1::CameraReply& reply) { return reply.flags().degraded(); }));
    EXPECT_EQ(test::expect_replay(recording, world), session->replies.size());
  }
}

// Under overload the daemon decides by its clock what the steps leave out.
TEST_P(RecordedReplay, EveryStepOfAnOverloadedSessionAgain) {
  Host host(flags({"--step-budget-ms", "0.001"}));
  Heard heard(host.address(), boxes());
  const auto end = steady_clock::now() + std::chrono::nanoseconds(4 * StepBudget::kRaiseAfterNs);
  uint64_t sequence = 0;
  while (steady_clock::now() < end) ASSERT_TRUE(heard.ask(box_tick(++sequence)));
  EXPECT_TRUE(heard.finish().ok());
  test::stop(host.daemon);
  EXPECT_TRUE(heard.replies.back().flags().degraded());
  EXPECT_FALSE(heard.replies.front().flags().degraded());
  const Recording recording = test::open_recording(test::only_recording(folder_));
  test::expect_same(test::read_all(recording), heard);
  LocalWorld world("", *sampler_);
  EXPECT_EQ(test::expect_replay(recording, world), heard.replies.size());
}

INSTANTIATE_TEST_SUITE_P(At, RecordedReplay,
                         testing::Values(Where{"embree", "1"}, Where{"embree", "2"}, Where{"egl", "1"},
                                         Where{"egl", "2"}),
                         [](const auto& param) { return std::string(param.param.sampler) + param.param.threads; });

}  // namespace
}  // namespace sightline
