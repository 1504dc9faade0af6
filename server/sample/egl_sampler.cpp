#include "server/sample/egl_sampler.h"

#include <algorithm>
#include <mutex>

#include "server/gl/egl_context.h"
#include "server/sample/draw_list.h"
#include "server/sample/map_renderer.h"
#include "server/sample/seen_triangle.h"

namespace sightline {
namespace {

// Takes between two looks for dead geometry on a device to which nothing is added.
constexpr uint64_t kSweepEveryTakes = 256;

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

// Fills one map from its tile of the atlas.
void resolve(const SceneMirror& mirror, const MapView& view, const TexelSource* tile, size_t stride, DepthMap& map) {
  map.view = view;
  map.distance_m.resize(static_cast<size_t>(view.width) * view.height);
  map.occluder.resize(map.distance_m.size());
  SeenTriangle seen;
  TexelSource last;
  size_t texel = 0;
  for (int y = 0; y < view.height; ++y)
    for (int x = 0; x < view.width; ++x, ++texel) {
      const TexelSource& source = tile[static_cast<size_t>(y) * stride + x];
      map.occluder[texel] = source.slot_plus_one - 1;  // 0 wraps to kNoOccluder
      map.distance_m[texel] = std::numeric_limits<float>::infinity();
      if (source.slot_plus_one == 0) continue;
      // Neighbours often show the same triangle.
      if (source.slot_plus_one != last.slot_plus_one || source.vertex / 3 != last.vertex / 3)
        seen = SeenTriangle(view, mirror.instances()[source.slot_plus_one - 1], source.vertex);
      last = source;
      const glm::dvec3 direction = texel_direction(view, x, y);
      map.distance_m[texel] = static_cast<float>(seen.depth_along(direction) * glm::length(direction));
    }
}

class SharedEglDevice final : public EglSamplerDevice {
 public:
  static Result<std::unique_ptr<EglSamplerDevice>> create(const EglOptions& options);
  ~SharedEglDevice() override { drop_renderer(); }

  std::unique_ptr<Sampler> make_sampler() override;
  std::string kind() const override { return "egl"; }
  std::string description() const override;
  size_t geometry_bytes() const override;
  void simulate_context_loss() override;
  uint64_t context_rebuilds() const override;

  // Any thread. When the context is lost, makes another and tries once more.
  Status render(const DrawList& list, std::span<const MapRequest> requests, AtlasLayout& layout,
                std::vector<TexelSource>& texels);

 private:
  explicit SharedEglDevice(const EglOptions& options) : options_(options) {}
  Status build();
  void drop_renderer();
  Status render_once(const DrawList& list, std::span<const MapRequest> requests, AtlasLayout& layout,
                     std::vector<TexelSource>& texels);

  const EglOptions options_;
  mutable std::mutex mutex_;
  std::unique_ptr<EglContext> context_;      // guarded by mutex_; null after a rebuild failed
  std::unique_ptr<MapRenderer> renderer_;    // guarded by mutex_; dies before context_, with it current
  std::string description_ = "no context";   // guarded by mutex_
  bool loss_simulated_ = false;              // guarded by mutex_
  uint64_t rebuilds_ = 0, takes_ = 0;        // guarded by mutex_
};

class EglSampler final : public Sampler {
 public:
  explicit EglSampler(SharedEglDevice& device) : device_(device) {}
  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override;

 private:
  Status take_some(const SceneMirror& mirror, std::span<const MapRequest> requests, std::span<DepthMap> maps);

  SharedEglDevice& device_;
  OccluderTable occluders_;
  DrawList list_;                    // scratch, as the next two
  AtlasLayout layout_;
  std::vector<TexelSource> texels_;
};

Result<std::unique_ptr<EglSamplerDevice>> SharedEglDevice::create(const EglOptions& options) {
  std::unique_ptr<SharedEglDevice> device(new SharedEglDevice(options));
  if (Status built = device->build(); !built) return tl::unexpected(built.error());
  return device;
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

std::string SharedEglDevice::description() const {
  const std::lock_guard lock(mutex_);
  return description_;
}

size_t SharedEglDevice::geometry_bytes() const {
  const std::lock_guard lock(mutex_);
  return renderer_ ? renderer_->geometry_bytes() : 0;
}

void SharedEglDevice::simulate_context_loss() {
  const std::lock_guard lock(mutex_);
  loss_simulated_ = true;
}

uint64_t SharedEglDevice::context_rebuilds() const {
  const std::lock_guard lock(mutex_);
  return rebuilds_;
}

Status SharedEglDevice::render(const DrawList& list, std::span<const MapRequest> requests, AtlasLayout& layout,
                               std::vector<TexelSource>& texels) {
  const std::lock_guard lock(mutex_);
  Status done = render_once(list, requests, layout, texels);
  if (done || done.error().code != ErrorCode::kUnavailable) return done;
  // Geometry is uploaded again as it is drawn: the mirrors still hold it.
  drop_renderer();
  context_.reset();
  ++rebuilds_;
  if (Status built = build(); !built) return built;
  return render_once(list, requests, layout, texels);
}

Status SharedEglDevice::render_once(const DrawList& list, std::span<const MapRequest> requests, AtlasLayout& layout,
                                    std::vector<TexelSource>& texels) {
  if (!renderer_) return fail(ErrorCode::kUnavailable, "", "there is no OpenGL context");
  const CurrentContext current(*context_);
  if (!current) return fail(ErrorCode::kUnavailable, "", "EGL refuses to make the context current");
  if (++takes_ % kSweepEveryTakes == 0) renderer_->sweep();
  Status done = renderer_->render(list, requests, layout, texels);
  if (context_->was_reset() || std::exchange(loss_simulated_, false))
    return fail(ErrorCode::kUnavailable, "", "the OpenGL context was lost");
  return done;
}

Status EglSampler::take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) {
  occluders_.take_in(mirror);
  maps.resize(requests.size());
  for (size_t first = 0; first < requests.size(); first += MapRenderer::kMaxMaps) {
    const size_t count = std::min(MapRenderer::kMaxMaps, requests.size() - first);
    const Status done = take_some(mirror, requests.subspan(first, count), std::span(maps).subspan(first, count));
    if (!done) return done;
  }
  maps_taken_ += requests.size();
  return {};
}

Status EglSampler::take_some(const SceneMirror& mirror, std::span<const MapRequest> requests,
                             std::span<DepthMap> maps) {
  list_.clear();
  for (const MapRequest& request : requests) occluders_.append_map(mirror, request, list_);
  if (Status rendered = device_.render(list_, requests, layout_, texels_); !rendered) return rendered;
  for (size_t i = 0; i < requests.size(); ++i) {
    const AtlasTile& tile = layout_.tiles[i];
    const size_t stride = static_cast<size_t>(layout_.width);
    resolve(mirror, requests[i].view, texels_.data() + static_cast<size_t>(tile.y) * stride + tile.x, stride, maps[i]);
  }
  return {};
}

EglDeviceInfo describe(int index, const ContextResult& context) {
  EglDeviceInfo out;
  out.index = index;
  out.platform = index == kSurfacelessIndex ? "surfaceless" : "device";
  out.drm_node = egl_drm_node(index);
  if (!context) {
    out.trouble = context.error().message;
    return out;
  }
  const EglContextInfo& info = (*context)->info();
  out.renderer = info.renderer;
  out.gl_version = info.gl_version;
  out.software = info.software;
  out.robust = info.robust;
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

Result<std::unique_ptr<EglSamplerDevice>> make_egl_sampler_device(const EglOptions& options) {
  return SharedEglDevice::create(options);
}

}  // namespace sightline
