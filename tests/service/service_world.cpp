#include "tests/service/service_world.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <latch>
#include <memory>
#include <stdexcept>
#include <thread>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace sightline {

// --- the gate
// ----------------------------------------------------------------------------------------------------

class GatedSampler final : public Sampler {
 public:
  GatedSampler(GatedDevice& device, std::unique_ptr<Sampler> inner) : device_(device), inner_(std::move(inner)) {}
  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    if (const Status passed = device_.pass(); !passed) return passed;
    std::this_thread::sleep_for(std::chrono::microseconds(device_.map_cost_us_) * requests.size());
    return inner_->take(mirror, requests, maps);
  }

 private:
  GatedDevice& device_;
  const std::unique_ptr<Sampler> inner_;
};

std::unique_ptr<Sampler> GatedDevice::make_sampler() {
  ++samplers_made_;
  return std::make_unique<GatedSampler>(*this, inner_->make_sampler());
}

void GatedDevice::throw_next() {
  const std::lock_guard lock(mutex_);
  throws_ = true;
}

void GatedDevice::close_gate() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
}

void GatedDevice::open_gate() {
  const std::lock_guard lock(mutex_);
  closed_ = false;
  changed_.notify_all();
}

void GatedDevice::wait_until_held(size_t steps) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return held_ >= steps; });
}

void GatedDevice::fail_next(const Error& error) {
  const std::lock_guard lock(mutex_);
  failure_ = error;
}

size_t GatedDevice::stepping_threads() const {
  const std::lock_guard lock(mutex_);
  return threads_.size();
}

Status GatedDevice::pass() {
  std::unique_lock lock(mutex_);
  threads_.insert(std::this_thread::get_id());
  ++held_;
  changed_.notify_all();
  changed_.wait(lock, [&] { return !closed_; });
  --held_;
  if (std::exchange(throws_, false)) throw std::runtime_error("thrown by a test");
  if (!failure_) return {};
  const Error error = *std::exchange(failure_, std::nullopt);
  return tl::unexpected(error);
}

namespace {

ServiceLimits limits_of(const WorldOptions& options) {
  ServiceLimits limits = options.limits;
  limits.max_message_bytes = options.max_message_bytes;
  return limits;
}

}  // namespace

// --- the service
// -------------------------------------------------------------------------------------------------

ServiceWorld::ServiceWorld(const WorldOptions& options)
    : real_time_(options.real_time),
      scenes_(options.scene_dir, GltfLimits{}, geometry_),
      streams(options.max_sessions),
      steppers_(
          options.threads, device, [this] { return real_or(clock_calls_); }, [] { return int64_t{0}; }),
      shares_(options.threads * options.budget.largest_share),
      service_(
          ServiceParts{scenes_, geometry_, extents_, device, steppers_, loaders, uploaders, streams, shares_, stats_,
                       sessions_, log_, [this] { return real_or(++clock_calls_); }, "test", "", options.budget},
          limits_of(options)) {
  ListenOptions listen;
  listen.tcp = "127.0.0.1:0";
  listen.unix_path = options.unix_path;
  listen.max_message_bytes = options.max_message_bytes;
  listen.loops = options.loops;
  listen.keepalive_time = options.keepalive_time;
  listen.keepalive_timeout = options.keepalive_timeout;
  auto started = Listener::start(listen, service_);
  EXPECT_TRUE(started) << to_string(started.error());
  listener = std::move(*started);
}

int64_t ServiceWorld::real_or(uint64_t fake) const {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return real_time_ ? std::chrono::nanoseconds(now).count() : static_cast<int64_t>(fake);
}

ServiceWorld::~ServiceWorld() {
  device.open_gate();
  listener.reset();
}

std::shared_ptr<grpc::Channel> ServiceWorld::channel() const {
  return connect(address());
}
v1::GetServerInfoResponse ServiceWorld::info() const {
  return server_info(channel());
}
v1::GetServerStatsResponse ServiceWorld::stats() const {
  return server_stats(channel());
}

std::shared_ptr<grpc::Channel> connect(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);  // a reader that stops takes 64 KiB, not megabytes
  arguments.SetMaxReceiveMessageSize(-1);
  auto channel = grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
  // gRPC 1.51 may overwrite the errno of connect() on a new thread, and then fails the first try for no reason (gRPC's
  // pull request 35064). This waits for its next try.
  channel->WaitForConnected(std::chrono::system_clock::now() + std::chrono::seconds(20));
  return channel;
}

v1::GetServerInfoResponse server_info(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
  v1::GetServerInfoResponse info;
  const grpc::Status status = v1::CameraControlService::NewStub(channel)->GetServerInfo(&context, {}, &info);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return info;
}

v1::GetServerStatsResponse server_stats(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
  v1::GetServerStatsResponse stats;
  const grpc::Status status = v1::CameraControlService::NewStub(channel)->GetServerStats(&context, {}, &stats);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return stats;
}

HeldLoaders::HeldLoaders(WorkerPool& loaders) {
  const std::shared_future<void> released(let_go_.get_future());
  const auto free = std::make_shared<std::latch>(loaders.threads());
  for (unsigned i = 0; i < loaders.threads(); ++i)
    loaders.post(
        [released, free] {
          free->count_down();
          released.wait();
        },
        "holder " + std::to_string(i));  // one client has all but one of them
  free->wait();                          // the pool is fair: another caller's task would go before the second of these
}

// --- one call
// ----------------------------------------------------------------------------------------------------

Stream::Stream(const std::shared_ptr<grpc::Channel>& channel) : stub_(v1::CameraControlService::NewStub(channel)) {
  context_.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(240));  // enough under sanitizers, too
  call_ = stub_->Control(&context_);
}

Stream::~Stream() {
  context_.TryCancel();
  finish();
}

bool Stream::send(const v1::OpenSession& open) {
  v1::ControlRequest request;
  *request.mutable_open() = open;
  return call_->Write(request);
}

bool Stream::send(const v1::ResumeSession& resume) {
  v1::ControlRequest request;
  *request.mutable_resume() = resume;
  return call_->Write(request);
}

bool Stream::send(const v1::Tick& tick) {
  v1::ControlRequest request;
  *request.mutable_tick() = tick;
  return call_->Write(request);
}

bool Stream::send_empty() {
  return call_->Write({});
}

std::optional<v1::ControlResponse> Stream::read() {
  v1::ControlResponse reply;
  if (!call_->Read(&reply)) return std::nullopt;
  return reply;
}

v1::SessionOpened Stream::open(const v1::OpenSession& request) {
  send(request);
  const auto reply = read();
  EXPECT_TRUE(reply && reply->has_opened()) << (reply ? reply->DebugString() : finish().error_message());
  return reply ? reply->opened() : v1::SessionOpened{};
}

grpc::Status Stream::finish() {
  if (status_) return *status_;
  v1::ControlResponse rest;
  while (call_->Read(&rest)) {
  }
  status_ = call_->Finish();
  return *status_;
}

// --- requests and statuses
// ---------------------------------------------------------------------------------------

v1::OpenSession open_with_boxes(int boxes) {
  v1::OpenSession open;
  open.set_seed(7);
  open.mutable_camera()->mutable_position()->set_y(2.0);
  open.mutable_camera()->mutable_position()->set_z(8.0);
  for (int i = 0; i < boxes; ++i) {
    v1::NewInstance& instance = *open.add_instances();
    instance.set_id(static_cast<uint64_t>(i) + 1);
    v1::Vec3& half = *instance.mutable_shape()->mutable_box()->mutable_half_extent();
    half.set_x(0.2), half.set_y(0.5), half.set_z(0.2);
    instance.mutable_pose()->mutable_position()->set_x(1.5 * i);
  }
  for (int i = 0; i < std::min(boxes, 2); ++i) open.add_targets()->set_id(static_cast<uint64_t>(i) + 1);
  return open;
}

v1::Tick move_tick(uint64_t sequence, uint64_t id, double x) {
  v1::Tick tick;
  tick.set_sequence(sequence);
  tick.set_time_s(static_cast<double>(sequence) / 60.0);
  tick.mutable_transforms()->add_ids(id);
  for (const double value : {x, 0.0, 0.0}) tick.mutable_transforms()->add_positions(value);
  return tick;
}

namespace {

google::rpc::Status details_of(const grpc::Status& status) {
  google::rpc::Status details;
  details.ParseFromString(status.error_details());
  return details;
}

}  // namespace

std::vector<std::string> fields_of(const grpc::Status& status) {
  std::vector<std::string> fields;
  const google::rpc::Status details = details_of(status);
  for (const auto& any : details.details()) {
    google::rpc::BadRequest bad;
    if (any.type_url() != "type.googleapis.com/google.rpc.BadRequest" || !bad.ParseFromString(any.value())) continue;
    for (const auto& violation : bad.field_violations()) fields.push_back(violation.field());
  }
  return fields;
}

int64_t retry_seconds_of(const grpc::Status& status) {
  const google::rpc::Status details = details_of(status);
  for (const auto& any : details.details()) {
    google::rpc::RetryInfo retry;
    if (any.type_url() != "type.googleapis.com/google.rpc.RetryInfo" || !retry.ParseFromString(any.value())) continue;
    return retry.retry_delay().seconds();
  }
  return 0;
}

}  // namespace sightline
