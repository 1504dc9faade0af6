// A service for tests: real gRPC over loopback TCP, Embree maps, and a clock that the test moves. A test can hold every
// step at a gate.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <atomic>
#include <condition_variable>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/sample/embree_sampler.h"
#include "server/service/listener.h"
#include "server/service/service.h"
#include "sightline/v1/camera_control.grpc.pb.h"

namespace sightline {

// Embree behind a gate: while it is closed, every step waits in its sample stage.
class GatedDevice final : public SamplerDevice {
 public:
  std::unique_ptr<Sampler> make_sampler() override;
  std::string kind() const override { return inner_->kind(); }
  std::string renderer() const override { return inner_->renderer(); }
  size_t geometry_bytes() const override { return inner_->geometry_bytes(); }

  void close_gate();
  void open_gate();
  void wait_until_held(size_t steps);
  // From now on every map takes this long, spent asleep. The cost of a step then does not depend on the machine.
  void make_maps_cost(std::chrono::microseconds each) { map_cost_us_ = each.count(); }
  // The next call for maps fails with this error, once.
  void fail_next(const Error& error);
  // The next call for maps throws, once, which no sampler should do.
  void throw_next();
  size_t samplers_made() const { return samplers_made_; }
  // The number of threads on which maps were taken.
  size_t stepping_threads() const;

 private:
  friend class GatedSampler;
  Status pass();

  const std::unique_ptr<SamplerDevice> inner_ = make_embree_sampler_device();
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool closed_ = false;
  size_t held_ = 0;
  std::optional<Error> failure_;
  bool throws_ = false;
  std::set<std::thread::id> threads_;
  std::atomic<size_t> samplers_made_{0};
  std::atomic<int64_t> map_cost_us_{0};
};

struct WorldOptions {
  size_t max_sessions = 64;
  size_t max_message_bytes = size_t{4} << 20;
  ServiceLimits limits{};
  std::string scene_dir{};
  std::string unix_path{};  // listens here as well; clients that come this way are others than those over TCP
  unsigned threads = 2;
  unsigned loops = 1;
  bool real_time = false;  // the scheduler's clock and the stage clock are the machine's
  BudgetRules budget{};
  std::chrono::milliseconds keepalive_time{10'000};
  std::chrono::milliseconds keepalive_timeout{5'000};
};

class ServiceWorld {
 public:
  explicit ServiceWorld(const WorldOptions& options = {});
  ~ServiceWorld();

  std::string address() const { return listener->addresses().front(); }
  std::shared_ptr<grpc::Channel> channel() const;  // a connection of its own
  v1::GetServerInfoResponse info() const;
  v1::GetServerStatsResponse stats() const;
  // The number of times that the service has read the clock. While all steps are held it reads the clock only when a
  // message arrives.
  uint64_t clock_calls() const { return clock_calls_; }
  uint64_t closed_with(grpc::StatusCode code) const { return stats_.closed[static_cast<size_t>(code)]; }
  size_t geometry_count() const { return geometry_.live_count(); }
  size_t table_count() const { return extents_.count(); }

  GatedDevice device;

 private:
  int64_t real_or(uint64_t fake) const;

  const bool real_time_;
  std::atomic<uint64_t> clock_calls_{0};
  GeometryStore geometry_;
  ExtentCache extents_;
  SceneLibrary scenes_;
  Log log_{LogFormat::kText, LogLevel::kOff};

 public:
  StreamRegistry streams;

 private:
  Scheduler steppers_;
  FairShares shares_;
  StepStats stats_;
  SessionTable sessions_;

 public:
  WorkerPool loaders{2}, uploaders{2};

 private:
  CameraControlService service_;

 public:
  std::unique_ptr<Listener> listener;
};

// Blocks all loaders of a service, from the constructor's return until this object is destroyed. The loaders must not
// be held already.
class HeldLoaders {
 public:
  explicit HeldLoaders(WorkerPool& loaders);
  ~HeldLoaders() { let_go_.set_value(); }

 private:
  std::promise<void> let_go_;
};

// One Control call, in step with the test: every read has a deadline of the whole call.
class Stream {
 public:
  explicit Stream(const std::shared_ptr<grpc::Channel>& channel);
  ~Stream();

  bool send(const v1::OpenSession& open);
  bool send(const v1::ResumeSession& resume);
  bool send(const v1::Tick& tick);
  bool send_empty();
  void half_close() { call_->WritesDone(); }
  void cancel() { context_.TryCancel(); }
  // The next reply; absent when the server has ended the call.
  std::optional<v1::ControlResponse> read();
  // Opens the session and expects success.
  v1::SessionOpened open(const v1::OpenSession& open);
  // Reads all remaining replies, then returns the status.
  grpc::Status finish();

 private:
  const std::unique_ptr<v1::CameraControlService::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::ControlRequest, v1::ControlResponse>> call_;
  std::optional<grpc::Status> status_;
};

std::shared_ptr<grpc::Channel> connect(const std::string& address);
v1::GetServerInfoResponse server_info(const std::shared_ptr<grpc::Channel>& channel);
v1::GetServerStatsResponse server_stats(const std::shared_ptr<grpc::Channel>& channel);

// A session with `boxes` instances (ids 1 ...) in a row, the first two of them targets (or all, when fewer).
v1::OpenSession open_with_boxes(int boxes);
// Moves instance `id` to x; at `sequence` sixtieths of a second.
v1::Tick move_tick(uint64_t sequence, uint64_t id, double x);
// The paths of the BadRequest in the status details.
std::vector<std::string> fields_of(const grpc::Status& status);
// Seconds of the RetryInfo in the status details; 0 without one.
int64_t retry_seconds_of(const grpc::Status& status);

}  // namespace sightline
