// `sightline bench` against daemons that work, stall, refuse sessions or do not exist.
#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "client/bench/command.h"
#include "client/bench/protocol.h"
#include "sightline/v1/camera_control.grpc.pb.h"
#include "tests/bench/echo_server.h"
#include "tests/support/daemon_process.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using Json = nlohmann::json;

BenchOptions quick_options() {
  BenchOptions options;
  options.scene = "hall";
  options.program = SIGHTLINE_PATH;
  options.daemon = SIGHTLINED_PATH;
  options.daemon_flags = "--sampler embree";
  options.warm_up_s = 0.0;
  options.window_s = 0.5;
  options.max_duration_s = 1.5;
  return options;
}

// --- a server that answers every tick at once, but sleeps before one of them

class StallingStream final : public grpc::ServerBidiReactor<v1::ControlRequest, v1::ControlResponse> {
 public:
  StallingStream(uint64_t stalls_at, std::chrono::milliseconds stall) : stalls_at_(stalls_at), stall_(stall) {
    StartRead(&request_);
  }

 private:
  void OnReadDone(bool ok) override {
    if (!ok) return Finish(grpc::Status::OK);
    reply_.Clear();
    if (request_.has_open()) {
      reply_.mutable_opened()->set_sampler("none");
    } else {
      if (request_.tick().sequence() == stalls_at_) std::this_thread::sleep_for(stall_);
      reply_.mutable_camera()->set_sequence(request_.tick().sequence());
    }
    StartWrite(&reply_);
  }
  void OnWriteDone(bool ok) override { ok ? StartRead(&request_) : Finish(grpc::Status::OK); }
  void OnDone() override { delete this; }

  const uint64_t stalls_at_;
  const std::chrono::milliseconds stall_;
  v1::ControlRequest request_;
  v1::ControlResponse reply_;
};

class StallingService final
    : public v1::CameraControlService::WithCallbackMethod_Control<v1::CameraControlService::Service> {
 public:
  StallingService(uint64_t stalls_at, std::chrono::milliseconds stall) : stalls_at_(stalls_at), stall_(stall) {}
  grpc::ServerBidiReactor<v1::ControlRequest, v1::ControlResponse>* Control(grpc::CallbackServerContext*) override {
    return new StallingStream(stalls_at_, stall_);
  }
  grpc::Status UploadScene(grpc::ServerContext*, grpc::ServerReader<v1::UploadSceneRequest>* reader,
                           v1::UploadSceneResponse* reply) override {
    v1::UploadSceneRequest chunk;
    while (reader->Read(&chunk)) {
    }
    reply->set_hash("scene");
    return grpc::Status::OK;
  }

 private:
  const uint64_t stalls_at_;
  const std::chrono::milliseconds stall_;
};

// A load of 50 Hz for three windows of one second, against a server that sleeps once for half a second.
Result<BenchJson> stalled_load() {
  constexpr uint64_t kFirstTicks = 30;  // before the load begins
  StallingService service(kFirstTicks + 60, 500ms);
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&service);
  const auto server = builder.BuildAndStart();
  BenchOptions options = quick_options();
  options.address = "127.0.0.1:" + std::to_string(port);
  options.world.rate_hz = 50.0;
  options.window_s = 1.0;
  options.max_duration_s = 3.0;
  options.all_windows = true;
  std::ostringstream err;
  auto result = run_bench(options, err);
  server->Shutdown(std::chrono::system_clock::now() + 1s);
  return result;
}

// A generator that waited for answers would send nothing during the stall and would count one slow tick.
TEST(BenchLoad, AServerThatStallsIsSeenByEveryTickThatWasDueMeanwhile) {
  const auto result = stalled_load();
  ASSERT_TRUE(result) << to_string(result.error());
  EXPECT_EQ(result->at("windows").at("reported"), 3);
  EXPECT_EQ(result->at("stable"), false);
  EXPECT_EQ(result->at("ticks").at("sent"), result->at("ticks").at("answered"));
  const BenchJson& round_trip = result->at("latency_us").at("round_trip");
  EXPECT_EQ(round_trip.at("count"), 150) << "no tick was left out";
  EXPECT_GE(result->at("service").at("late_share").get<double>(), 22 / 150.0)
      << "24 ticks were due in the half second, and waited longer than one interval";
  EXPECT_GE(round_trip.at("max").at("max").get<double>(), 500e3);
  EXPECT_GE(round_trip.at("p90").at("max").get<double>(), 400e3)
      << "of the 50 ticks of that second five waited 420 ms and more";
}

// --- the echo

TEST(BenchEcho, AnswersWithTheSequenceAndAsManyBytesAsAsked) {
  const auto echo = EchoServer::start("127.0.0.1:0");
  ASSERT_TRUE(echo) << to_string(echo.error());
  grpc::GenericStub stub(grpc::CreateChannel((*echo)->address(), grpc::InsecureChannelCredentials()));
  for (const uint32_t asked : {0u, 8u, 500u, 100'000u}) {
    grpc::ClientContext context;
    grpc::CompletionQueue queue;
    const auto call = stub.PrepareCall(&context, kEchoMethod, &queue);
    const auto wait = [&] {
      void* tag = nullptr;
      bool ok = false;
      return queue.Next(&tag, &ok) && ok;
    };
    call->StartCall(nullptr);
    ASSERT_TRUE(wait());
    grpc::ByteBuffer message;
    write_echo({0x0102030405060708, asked}, 40, message);
    EXPECT_EQ(message.Length(), 40u);
    call->Write(message, nullptr);
    ASSERT_TRUE(wait());
    grpc::ByteBuffer reply;
    call->Read(&reply, nullptr);
    ASSERT_TRUE(wait());
    EXPECT_EQ(reply.Length(), std::max<size_t>(asked, sizeof(EchoHeader)));
    const auto header = read_echo(reply);
    ASSERT_TRUE(header);
    EXPECT_EQ(header->sequence, 0x0102030405060708u);
    context.TryCancel();
    grpc::Status status;
    call->Finish(&status, nullptr);
    wait();
  }
}

// --- the command, with a daemon of its own

class BenchCommandTest : public testing::Test {
 protected:
  BenchCommandTest() : options_(quick_options()) { options_.json = folder_ / "bench.json"; }
  int run() { return run_bench_command(options_, out_, err_); }
  Json json() const { return Json::parse(std::ifstream(options_.json)); }
  void expect_error(const std::string& part) {
    EXPECT_EQ(run(), 1) << out_.str();
    EXPECT_THAT(err_.str(), HasSubstr("sightline bench: "));
    EXPECT_THAT(err_.str(), HasSubstr(part));
    err_.str("");
  }

  test::TemporaryFolder folder_;
  BenchOptions options_;
  std::ostringstream out_, err_;
};

void expect_ticks_add_up(const Json& ticks) {
  const auto count = [&](const char* name) { return ticks.at(name).get<uint64_t>(); };
  EXPECT_GT(count("answered"), 0u);
  EXPECT_EQ(count("rejected"), 0u);
  EXPECT_EQ(count("lost"), 0u);
  EXPECT_EQ(count("sent"), count("answered") + count("merged") + count("lost"));
}

TEST_F(BenchCommandTest, EveryTickIsAccountedForAndEveryStageHasItsFigures) {
  options_.world.sessions = 3;
  options_.world.moving = 4;
  options_.world.instances = 6;
  options_.sessions_per_channel = 2;
  ASSERT_EQ(run(), 0) << err_.str();
  const Json result = json();
  expect_ticks_add_up(result.at("ticks"));
  EXPECT_EQ(result.at("load").at("sessions"), 3);
  EXPECT_EQ(result.at("load").at("channels"), 2);
  EXPECT_EQ(result.at("load").at("sampler"), "embree");
  // Three sessions for some windows of half a second, and the ticks that the first one had sent before.
  const double ticks = 3 * 60 * 0.5 * result.at("windows").at("seen").get<double>();
  EXPECT_GE(result.at("ticks").at("sent").get<double>(), ticks);
  EXPECT_EQ(result.at("latency_us").at("round_trip").at("count").get<double>(),
            3 * 60 * 0.5 * result.at("windows").at("reported").get<double>());
  for (const char* stage :
       {"round_trip", "transport", "queue", "scene", "bound", "sample", "aggregate", "move", "step"})
    EXPECT_GT(result.at("latency_us").at(stage).at("max").at("max").get<double>(), 0.0) << stage;
  EXPECT_GT(result.at("service").at("least_served_hz").get<double>(), 0.0);
  EXPECT_GT(result.at("cpu_us_per_tick").at("daemon").at("median").get<double>(), 0.0);
  EXPECT_GT(result.at("cpu_us_per_tick").at("generator").at("median").get<double>(), 0.0);
  EXPECT_GT(result.at("daemon_memory").at("start_bytes").get<double>(), 1e6);
  // A tick of this scene has some poses, and a reply a pose and two targets.
  for (const char* message : {"tick", "reply"}) {
    EXPECT_GT(result.at("message_bytes").at(message).get<double>(), 30.0) << message;
    EXPECT_LT(result.at("message_bytes").at(message).get<double>(), 5000.0) << message;
  }
  EXPECT_TRUE(result.at("echo").is_null());
  for (const char* part : {"3 sessions at 60 Hz", "round_trip", "p99.9", "merged", "daemon memory"})
    EXPECT_THAT(out_.str(), HasSubstr(part));
}

TEST_F(BenchCommandTest, TheEchoIsLoadedInTurnsWithMessagesOfTheSameSize) {
  options_.world.sessions = 2;
  const test::TemporaryFolder sockets;
  const auto echo_server = EchoServer::start("unix:" + (sockets / "echo.sock").string());
  ASSERT_TRUE(echo_server) << to_string(echo_server.error());
  options_.echo = (*echo_server)->address();
  options_.max_duration_s = 2.0;
  ASSERT_EQ(run(), 0) << err_.str();
  const Json result = json(), echo = result.at("echo");
  expect_ticks_add_up(result.at("ticks"));
  EXPECT_EQ(echo.at("round_trip_us").at("count").get<double>(),
            2 * 60 * 0.5 * result.at("windows").at("reported").get<double>());
  EXPECT_GT(echo.at("floor_us").at("median").get<double>(), 0.0);
  EXPECT_GT(echo.at("share").at("median").get<double>(), 0.0);
  EXPECT_THAT(out_.str(), HasSubstr("against echo"));
}

TEST_F(BenchCommandTest, AnOverloadedServerMergesAndNothingIsLost) {
  options_.world.sessions = 4;
  options_.world.rate_hz = 1000.0;
  options_.tcp = true;
  options_.daemon_flags.append(" --threads 1");
  options_.settings = R"({"tuning": {"sample": {"points": 16, "resolution": 24}, "aggregate": {"candidates": 4096}}})";
  ASSERT_EQ(run(), 0) << err_.str();
  const Json result = json();
  expect_ticks_add_up(result.at("ticks"));
  EXPECT_GT(result.at("ticks").at("merged").get<uint64_t>(), 0u);
  EXPECT_LT(result.at("service").at("achieved_hz").get<double>(), 1000.0);
  EXPECT_THAT(result.at("load").at("address").get<std::string>(), testing::StartsWith("127.0.0.1:"));
}

TEST_F(BenchCommandTest, ADaemonThatRunsAlreadyIsLoadedAndLeftRunning) {
  test::DaemonProcess daemon;
  options_.address = daemon.address();
  ASSERT_EQ(run(), 0) << err_.str();
  EXPECT_TRUE(json().at("daemon_memory").is_null()) << "nobody said which process it is";
  ASSERT_EQ(run(), 0) << err_.str();
  EXPECT_EQ(daemon.stop(), 0);
}

TEST_F(BenchCommandTest, ADaemonThatDiesUnderTheLoadIsAnErrorAndNotAFigure) {
  test::DaemonProcess daemon;
  options_.address = daemon.address();
  options_.max_duration_s = 600.0;
  options_.all_windows = true;
  std::thread killer([&] {
    std::this_thread::sleep_for(2s);
    daemon.kill_now();
  });
  expect_error("unavailable");
  killer.join();
}

TEST_F(BenchCommandTest, WhatCannotBeLoadedIsAnErrorThatSaysWhy) {
  options_.scene = "atlantis";
  expect_error("not found: scene: \"atlantis\"");
  options_ = quick_options();
  options_.daemon = "/nowhere/sightlined";
  expect_error("not found: /nowhere/sightlined");
  options_ = quick_options();
  options_.daemon_flags = "--warp 9";
  expect_error("--warp");
  options_ = quick_options();
  options_.address = "unix:/nowhere.sock";
  expect_error("/nowhere.sock");
  options_ = quick_options();
  options_.settings = "{\"tuning\": {\"sample\": {\"resolution\": 1}}}";
  expect_error("tuning.sample.resolution");
  options_.settings = "no JSON";
  expect_error("invalid argument: settings");
  options_ = quick_options();
  options_.preset = "magic";
  expect_error("magic");
  options_ = quick_options();
  options_.echo = "unix:/nowhere/echo.sock";
  expect_error("unavailable: address: no server answers at unix:/nowhere/echo.sock");
  options_ = quick_options();
  options_.json = "/nowhere/bench.json";
  expect_error("/nowhere/bench.json");
}

// The file is opened before the load begins, and stays empty.
TEST_F(BenchCommandTest, AFailedRunWritesNoResult) {
  const test::TemporaryFolder folder;
  options_.json = folder / "bench.json";
  options_.preset = "magic";
  expect_error("magic");
  std::ifstream file(options_.json);
  ASSERT_TRUE(file.is_open());
  EXPECT_EQ(file.peek(), std::ifstream::traits_type::eof());
}

// By default a daemon lets one client open fewer. They tick seldom, so that a busy machine answers them all.
TEST_F(BenchCommandTest, TheStartedDaemonHasRoomForAllSessions) {
  options_.world.sessions = 100, options_.world.rate_hz = 5.0;
  ASSERT_EQ(run(), 0) << err_.str();
  const Json result = json();
  EXPECT_EQ(result.at("load").at("sessions"), 100);
  expect_ticks_add_up(result.at("ticks"));
}

TEST_F(BenchCommandTest, SessionsThatAreRefusedForWantOfRoomAreNamed) {
  options_.world.sessions = 3;
  options_.daemon_flags.append(" --max-sessions 2");
  expect_error("resource exhausted: sessions: session 3 of 3 was refused");
}

}  // namespace
}  // namespace sightline
