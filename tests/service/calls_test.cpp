// Calls and the threads that serve them: all threads of gRPC in use, several loops, and a server that stops during
// calls.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <thread>
#include <vector>

#include "server/base/random.h"
#include "tests/service/raw_call.h"
#include "tests/service/service_world.h"

namespace sightline {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using std::chrono::system_clock;

// An upload whose client is silent: it holds one of gRPC's threads until it ends.
class HeldCall final {
 public:
  explicit HeldCall(v1::CameraControlService::Stub& stub) : call_(stub.UploadScene(&context_, &reply_)) {}
  ~HeldCall() {
    context_.TryCancel();
    call_->Finish();
  }

 private:
  grpc::ClientContext context_;
  v1::UploadSceneResponse reply_;
  const std::unique_ptr<grpc::ClientWriter<v1::UploadSceneRequest>> call_;
};

// The status of a call that needs one of gRPC's threads.
grpc::StatusCode call_of_a_thread(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  context.set_deadline(system_clock::now() + seconds(20));
  v1::GetServerInfoResponse info;
  return v1::CameraControlService::NewStub(channel)->GetServerInfo(&context, {}, &info).error_code();
}

// True when several calls in a row find no thread. A single one can be refused while a thread is on its way from one
// call to the next.
bool no_thread_is_left(const std::shared_ptr<grpc::Channel>& channel) {
  for (int i = 0; i < 5; ++i)
    if (call_of_a_thread(channel) != grpc::StatusCode::RESOURCE_EXHAUSTED) return false;
  return true;
}

TEST(Calls, HealthIsAnsweredWhileAllThreadsAreHeld) {
  constexpr size_t kMost = 300;
  const ServiceWorld world({.limits = {.max_uploads = kMost}});
  const auto uploads = v1::CameraControlService::NewStub(world.channel());
  const auto other = world.channel();
  std::deque<HeldCall> calls;
  for (; !no_thread_is_left(other); calls.emplace_back(*uploads)) ASSERT_LT(calls.size(), kMost) << "threads are left";
  EXPECT_GT(calls.size(), 1u);
  for (const char* service : {"", "sightline.v1.CameraControlService"})
    EXPECT_EQ(health_of(world.channel(), service), 1) << service;
  EXPECT_TRUE(no_thread_is_left(other)) << "or it was answered when nothing was held any more";
}

// Holds the step of this tick at the closed gate. False: the event loop gives no sign of life within `patience`, so it
// is on its thread.
bool loop_goes_on(ServiceWorld& world, Stream& stream, const v1::Tick& tick, milliseconds patience) {
  world.device.close_gate();
  stream.send(tick);
  world.device.wait_until_held(1);
  world.listener->loops_silent();  // asks for the sign
  for (const auto end = std::chrono::steady_clock::now() + patience; std::chrono::steady_clock::now() < end;) {
    std::this_thread::sleep_for(milliseconds(5));
    if (world.listener->loops_silent().count() == 0.0) return true;
  }
  return false;
}

// The loop then has time to learn that the reply is written, without which the next step does not run on it.
void lets_step_end(ServiceWorld& world, Stream& stream) {
  world.device.open_gate();
  const auto reply = stream.read();
  ASSERT_TRUE(reply && reply->has_camera());
  std::this_thread::sleep_for(milliseconds(10));
}

// Nobody else steps, but a loop that lags hands its steps over, so there are several tries.
TEST(Calls, HealthIsAnsweredWhileAStepHoldsTheEventLoop) {
  ServiceWorld world({.threads = 1});
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  bool held = false;
  for (uint64_t sequence = 1; sequence <= 200 && !held; ++sequence) {
    held = !loop_goes_on(world, stream, move_tick(sequence, 1, 0.1), milliseconds(200));
    if (held) {
      for (const char* service : {"", "liveness"}) EXPECT_EQ(health_of(world.channel(), service), 1) << service;
    }
    lets_step_end(world, stream);
  }
  EXPECT_TRUE(held) << "no step ran on the loop";
}

// The last step was short, but this one may be long.
TEST(Calls, AStepForOtherTargetsOrSettingsDoesNotHoldTheEventLoop) {
  ServiceWorld world({.threads = 1});
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  uint64_t sequence = 0;
  const std::vector<void (*)(v1::Tick&)> changes{
      [](v1::Tick& tick) { tick.mutable_targets()->add_targets()->set_id(2); },
      [](v1::Tick& tick) { tick.mutable_settings(); }, [](v1::Tick& tick) { tick.mutable_tuning(); },
      [](v1::Tick& tick) { tick.mutable_delta(); },
      [](v1::Tick& tick) { tick.mutable_step_control()->set_quality_level(0); }};
  for (const auto change : changes) {
    SCOPED_TRACE(sequence);
    for (int i = 0; i < 2; ++i) {
      stream.send(move_tick(++sequence, 1, 0.1));
      lets_step_end(world, stream);
    }
    v1::Tick tick = move_tick(++sequence, 1, 0.2);
    change(tick);
    EXPECT_TRUE(loop_goes_on(world, stream, tick, seconds(20)));
    lets_step_end(world, stream);
  }
}

// Sends the next tick on `stream`; true when it is answered.
bool is_answered(Stream& stream, uint64_t sequence) {
  stream.send(move_tick(sequence, 1, 0.01 * static_cast<double>(sequence)));
  const auto reply = stream.read();
  return reply && reply->has_camera() && reply->camera().sequence() == sequence;
}

// gRPC chooses a queue at random for each connection, and a loop that is late hands its steps to the scheduler. The
// test therefore opens more sessions, and sends more ticks, until each loop has stepped.
TEST(Calls, SessionsOfSeveralLoopsAreAllAnswered) {
  constexpr size_t kLeast = 8, kMost = 48;
  const ServiceWorld world({.threads = 1, .loops = 2});
  constexpr size_t kAll = 1 + 2;  // the thread that steps, and the loops
  std::deque<Stream> streams;
  while (streams.size() < kLeast || (streams.size() < kMost && world.device.stepping_threads() < kAll)) {
    streams.emplace_back(world.channel()).open(open_with_boxes(2));
    for (uint64_t sequence = 1; sequence <= 3; ++sequence) ASSERT_TRUE(is_answered(streams.back(), sequence));
  }
  for (Stream& stream : streams) EXPECT_TRUE(is_answered(stream, 4));
  EXPECT_EQ(world.device.stepping_threads(), kAll);
}

// A client whose call failed waits a moment. Calls that fail at once would be made by the thousand, and
// ThreadSanitizer, which reports on each, takes longer for each.
void call_until(const std::atomic<bool>& stopped, const std::shared_ptr<grpc::Channel>& channel, bool sessions) {
  while (!stopped) {
    bool failed = false;
    if (sessions) {
      Stream stream(channel);
      stream.send(open_with_boxes(1));
      failed = !stream.read();
    } else {
      const int health = health_of(channel, "");
      EXPECT_TRUE(health == 1 || health == -1) << health;
      failed = health == -1;
    }
    if (failed) std::this_thread::sleep_for(milliseconds(1));
  }
}

// There are more loops than the clients need, and a loop without another call ends first.
TEST(Calls, AServerStopsWhileClientsKeepCalling) {
  CounterRandom random(5, 0, RandomPurpose::kTest);
  for (int round = 0; round < 20; ++round) {
    ServiceWorld world({.loops = 4});
    std::atomic<bool> stopped{false};
    // Connected before the server stops: a channel that is not waits for a connection until its time is up.
    std::vector<std::shared_ptr<grpc::Channel>> channels;
    for (int c = 0; c < 4; ++c) channels.push_back(world.channel());
    std::vector<std::thread> clients;
    for (int c = 0; c < 4; ++c) clients.emplace_back([&, c] { call_until(stopped, channels[c], c > 0); });
    std::this_thread::sleep_for(milliseconds(5 + random.next_below(20)));
    world.listener->stop(milliseconds(random.next_below(3)));
    stopped = true;
    for (std::thread& client : clients) client.join();
    EXPECT_EQ(world.streams.size(), 0u);
    EXPECT_EQ(world.geometry_count(), 0u);
  }
}

}  // namespace
}  // namespace sightline
