#include "server/sample/egl_sampler.h"

#include <algorithm>
#include <utility>

#include "server/base/mutex.h"
#include "server/sample/map_renderer.h"
#include "server/sample/map_taker.h"
#include "server/sample/occluder_tree.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

// Sessions that are worth taking together on a GPU, where every submission is a round trip: enough to fill the
// submissions that may be in flight. On an NVIDIA H100 each of 20 sessions costs half as much in one round as alone, on
// llvmpipe the same (tests/bench/sample_bench, egl_sessions).
constexpr size_t kHardwareBatch = 16;

using ContextResult = Result<std::unique_ptr<EglContext>>;

// The first that renders in hardware, else the first that renders, else the surfaceless platform.
ContextResult create_best_context() {
  std::unique_ptr<EglContext> software;
  for (int index = 0; index < egl_device_count(); ++index) {
    ContextResult context = EglContext::create(index);
    if (context && !(*context)->info().software) return context;
    if (context && !software) software = std::move(*context);
  }
  if (software) return software;
  return EglContext::create(kSurfacelessIndex);
}

ContextResult create_context(const EglOptions& options) {
  ContextResult context = options.device_index < 0 ? create_best_context() : EglContext::create(options.device_index);
  if (!context) return fail(ErrorCode::kUnavailable, "--egl-device", context.error().message);
  const EglContextInfo& info = (*context)->info();
  if (options.require_gpu && info.software)
    return fail(ErrorCode::kUnavailable, "--require-gpu", "only software rendering is available: " + info.renderer);
  return context;
}

class EglSampler;

class SharedEglDevice final : public EglSamplerDevice {
 public:
  static Result<std::unique_ptr<EglSamplerDevice>> create(const EglOptions& options);
  ~SharedEglDevice() override { drop_renderer(); }

  std::unique_ptr<Sampler> make_sampler() override;
  void take_all(std::span<TakeJob> jobs) override;
  size_t best_batch() const override { return software_ ? 1 : kHardwareBatch; }
  std::string kind() const override { return "egl"; }
  std::string renderer() const override;
  size_t geometry_bytes() const override { return 0; }
  void simulate_context_loss() override;
  uint64_t context_rebuilds() const override;

  // Takes what `taker` has prepared; any thread, the renderer is used by one at a time. When the context is lost, makes
  // another and takes once more.
  Status take(MapTaker& taker);

 private:
  explicit SharedEglDevice(const EglOptions& options) : options_(options) {}
  Status build() NEEDS(mutex_);
  Status warm_up();
  void drop_renderer() NEEDS(mutex_);
  Status take_once(MapTaker& taker) NEEDS(mutex_);

  const EglOptions options_;
  bool software_ = false;  // constant after create()

  mutable Mutex mutex_;
  std::unique_ptr<EglContext> context_ GUARDED(mutex_);    // null after a rebuild failed
  std::unique_ptr<MapRenderer> renderer_ GUARDED(mutex_);  // dies before context_, with it current
  std::string description_ GUARDED(mutex_) = "no context";
  bool loss_simulated_ GUARDED(mutex_) = false;
  uint64_t rebuilds_ GUARDED(mutex_) = 0;
};

class EglSampler final : public Sampler {
 public:
  explicit EglSampler(SharedEglDevice& device) : device_(device) {}
  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override;

  // Updates the data derived from the mirror, and sizes `maps`.
  MapJob begin(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps);
  // Takes jobs that samplers of the same device have begun.
  Status take(std::span<const MapJob> jobs);
  void count(size_t maps) { maps_taken_ += maps; }

  std::vector<MapJob> batch;  // scratch of take_all, which is of its first sampler

 private:
  SharedEglDevice& device_;
  OccluderTable occluders_;
  MapTaker taker_;
};

Result<std::unique_ptr<EglSamplerDevice>> SharedEglDevice::create(const EglOptions& options) {
  std::unique_ptr<SharedEglDevice> device(new SharedEglDevice(options));
  {
    const MutexLock lock(device->mutex_);
    if (Status built = device->build(); !built) return tl::unexpected(built.error());
    device->software_ = device->context_->info().software;
  }
  if (Status warm = device->warm_up(); !warm) return tl::unexpected(warm.error());
  return device;
}

// Takes maps of a box, so that the first session does not wait for the driver to compile. llvmpipe compiles for 38 ms
// of CPU time in the first take. It compiles again for 24 ms in the fifth.
Status SharedEglDevice::warm_up() {
  constexpr int kTakes = 6;
  SceneMirror mirror;
  SceneDelta delta;
  delta.add.push_back({.id = 1,
                       .geometry = build_geometry(tessellate(BoxShape{}).value()).value(),
                       .pose = {{0.0, 0.0, -5.0}},
                       .attributes = {}});
  (void)mirror.apply(delta, {});
  const std::vector<MapRequest> requests(1);
  std::vector<DepthMap> maps;
  const auto sampler = make_sampler();
  for (int i = 0; i < kTakes; ++i)
    if (Status taken = sampler->take(mirror, requests, maps); !taken) return taken;
  return {};
}

Status SharedEglDevice::build() {
  ContextResult context = create_context(options_);
  if (!context) return tl::unexpected(context.error());
  context_ = std::move(*context);
  const EglContextInfo& info = context_->info();
  description_ = info.renderer + ", OpenGL " + info.gl_version + ", EGL " + info.platform +
                 (info.drm_node.empty() ? "" : " " + info.drm_node) + (info.robust ? "" : ", not robust");
  const CurrentContext current(*context_);
  if (!current) return fail(ErrorCode::kUnavailable, "--egl-device", "EGL refuses to make the context current");
  Result<std::unique_ptr<MapRenderer>> renderer = MapRenderer::create();
  if (!renderer) return fail(ErrorCode::kUnavailable, "--egl-device", to_string(renderer.error()));
  renderer_ = std::move(*renderer);
  return {};
}

void SharedEglDevice::drop_renderer() {
  if (!renderer_) return;
  const CurrentContext current(*context_);
  renderer_.reset();
}

std::unique_ptr<Sampler> SharedEglDevice::make_sampler() {
  return std::make_unique<EglSampler>(*this);
}

void SharedEglDevice::take_all(std::span<TakeJob> jobs) {
  if (jobs.empty()) return;
  EglSampler& first = static_cast<EglSampler&>(*jobs.front().sampler);
  first.batch.clear();
  for (TakeJob& job : jobs)
    if (job.taken = check_castable(job.requests); job.taken)
      first.batch.push_back(static_cast<EglSampler&>(*job.sampler).begin(*job.mirror, job.requests, *job.maps));
  if (first.batch.empty()) return;
  const Status taken = first.take(first.batch);
  for (TakeJob& job : jobs) {
    if (!job.taken) continue;
    job.taken = taken;
    if (taken) static_cast<EglSampler&>(*job.sampler).count(job.requests.size());
  }
}

std::string SharedEglDevice::renderer() const {
  const MutexLock lock(mutex_);
  return description_;
}

void SharedEglDevice::simulate_context_loss() {
  const MutexLock lock(mutex_);
  loss_simulated_ = true;
}

uint64_t SharedEglDevice::context_rebuilds() const {
  const MutexLock lock(mutex_);
  return rebuilds_;
}

Status SharedEglDevice::take(MapTaker& taker) {
  const MutexLock lock(mutex_);
  Status done = take_once(taker);
  if (done || done.error().code != ErrorCode::kUnavailable) return done;
  drop_renderer();
  context_.reset();
  ++rebuilds_;
  if (Status built = build(); !built) return built;
  return take_once(taker);
}

Status SharedEglDevice::take_once(MapTaker& taker) {
  if (!renderer_) return fail(ErrorCode::kUnavailable, "", "there is no OpenGL context");
  const CurrentContext current(*context_);
  if (!current) return fail(ErrorCode::kUnavailable, "", "EGL refuses to make the context current");
  Status done = taker.take(*renderer_);
  if (context_->was_reset() || std::exchange(loss_simulated_, false))
    return fail(ErrorCode::kUnavailable, "", "the OpenGL context was lost");
  return done;
}

MapJob EglSampler::begin(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) {
  double ahead_s = 0.0;
  for (const MapRequest& request : requests) ahead_s = std::max(ahead_s, request.ahead_s);
  occluders_.take_in(mirror, ahead_s);
  maps.resize(requests.size());
  return {&occluders_, &mirror, requests, maps};
}

Status EglSampler::take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) {
  if (Status castable = check_castable(requests); !castable) return castable;
  const MapJob job = begin(mirror, requests, maps);
  const Status taken = take({&job, 1});
  if (taken) count(requests.size());
  return taken;
}

Status EglSampler::take(std::span<const MapJob> jobs) {
  taker_.prepare(jobs);
  return device_.take(taker_);
}

EglDeviceInfo describe(int index, const ContextResult& context) {
  if (context) return {(*context)->info(), "", false};
  EglDeviceInfo out;
  out.index = index;
  out.platform = index == kSurfacelessIndex ? "surfaceless" : "device";
  out.drm_node = egl_drm_node(index);
  out.trouble = context.error().message;
  return out;
}

}  // namespace

std::vector<EglDeviceInfo> list_egl_devices(const EglOptions& options) {
  std::vector<EglDeviceInfo> out;
  for (int index = 0; index < egl_device_count(); ++index) out.push_back(describe(index, EglContext::create(index)));
  out.push_back(describe(kSurfacelessIndex, EglContext::create(kSurfacelessIndex)));
  const ContextResult chosen = create_context(options);
  for (EglDeviceInfo& info : out) info.chosen = chosen && (*chosen)->info().index == info.index;
  return out;
}

Result<EglDeviceInfo> choose_egl_device(const EglOptions& options) {
  const ContextResult context = create_context(options);
  if (!context) return tl::unexpected(context.error());
  return EglDeviceInfo{(*context)->info(), "", true};
}

Result<std::unique_ptr<EglSamplerDevice>> make_egl_sampler_device(const EglOptions& options) {
  return SharedEglDevice::create(options);
}

}  // namespace sightline
