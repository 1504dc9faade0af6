// Calls and the threads that serve them: all threads of gRPC in use, several loops, and a server that stops during
// calls.
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <deque>
#include <future>
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

// A call of a synchronous RPC that is answered once and then left open: it holds one of gRPC's threads until it ends.
class HeldCall final : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  explicit HeldCall(grpc::GenericStub& stub) {
    stub.PrepareBidiStreamingCall(&context_, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
                                  {}, this);
    StartWrite(&question_);
    StartRead(&answer_);
    StartCall();
  }
  ~HeldCall() override {
    context_.TryCancel();
    over_.get_future().wait();
  }

  // To be asked once. False: the server refused the call, so no thread serves it.
  bool has_its_thread() {
    auto answered = answered_.get_future();
    return answered.wait_for(seconds(20)) == std::future_status::ready && answered.get();
  }

 private:
  void OnReadDone(bool ok) override { answered_.set_value(ok); }
  void OnDone(const grpc::Status&) override { over_.set_value(); }

  grpc::ClientContext context_;
  grpc::Slice bytes_{"\x3a\0", 2};  // list_services
  grpc::ByteBuffer question_{&bytes_, 1}, answer_;
  std::promise<bool> answered_;
  std::promise<void> over_;
};

// The status of a call that needs one of gRPC's threads.
grpc::StatusCode call_of_a_thread(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  context.set_deadline(system_clock::now() + seconds(20));
  v1::GetServerInfoResponse info;
  return v1::CameraControlService::NewStub(channel)->GetServerInfo(&context, {}, &info).error_code();
}

// Calls are made one after another. Among many at once, one could be refused while a thread is on its way from one call
// to the next.
TEST(Calls, HealthIsAnsweredWhileAllThreadsAreHeld) {
  constexpr size_t kMost = 100;
  const ServiceWorld world;
  grpc::GenericStub stub(world.channel());
  std::deque<HeldCall> calls;
  while (calls.emplace_back(stub).has_its_thread()) ASSERT_LT(calls.size(), kMost) << "threads are left";
  EXPECT_GT(calls.size(), 1u);
  const auto other = world.channel();
  EXPECT_EQ(call_of_a_thread(other), grpc::StatusCode::RESOURCE_EXHAUSTED);
  for (const char* service : {"", "sightline.v1.CameraControlService"})
    EXPECT_EQ(health_of(world.channel(), service), 1) << service;
  EXPECT_EQ(call_of_a_thread(other), grpc::StatusCode::RESOURCE_EXHAUSTED)
      << "or it was answered when nothing was held any more";
}

// Sends the next tick on `stream`; true when it is answered.
bool is_answered(Stream& stream, uint64_t sequence) {
  stream.send(move_tick(sequence, 1, 0.01 * static_cast<double>(sequence)));
  const auto reply = stream.read();
  return reply && reply->has_camera() && reply->camera().sequence() == sequence;
}

// gRPC chooses a queue at random for each connection, and a loop that is late hands its steps to the scheduler. The test
// therefore opens more sessions, and sends more ticks, until each loop has stepped.
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

void call_until(const std::atomic<bool>& stopped, const std::shared_ptr<grpc::Channel>& channel,
                bool sessions) {
  while (!stopped) {
    if (sessions) {
      Stream stream(channel);
      stream.send(open_with_boxes(1));
      stream.read();
    } else {
      const int health = health_of(channel, "");
      EXPECT_TRUE(health == 1 || health == -1) << health;
    }
  }
}

// There are more loops than the clients need, and a loop without another call ends first.
TEST(Calls, AServerStopsWhileClientsKeepCalling) {
  CounterRandom random(5, 0, RandomPurpose::kTest);
  for (int round = 0; round < 20; ++round) {
    ServiceWorld world({.loops = 4});
    std::atomic<bool> stopped{false};
    std::vector<std::thread> clients;
    for (int c = 0; c < 4; ++c) clients.emplace_back([&, c] { call_until(stopped, world.channel(), c > 0); });
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
