#include "server/sample/egl_sampler.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <mutex>
#include <utility>

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
  ContextResult context =
      options.device_index < 0 ? create_best_context() : EglContext::create(options.device_index);
  if (!context) return fail(ErrorCode::kUnavailable, "--egl-device", context.error().message);
  const EglContextInfo& info = (*context)->info();
  if (options.require_gpu && info.software)
    return fail(ErrorCode::kUnavailable, "--require-gpu",
                "only software rendering is available: " + info.renderer);
  return context;
}

// Triangles that a software renderer draws for each map before what they hide is dropped; each further pass draws
// twice as many. On hardware one pass draws everything: there a read-back costs more than triangles.
constexpr uint32_t kFirstPassTriangles = 512;

// The maps of one take while passes are drawn, nearest clusters first. What a pass shows hides clusters of the next
// ones, so that a few of many thousand triangles are drawn; the result is that of drawing all.
class FrontToBack {
 public:
  void start(const DrawList& list, std::span<const MapRequest> requests, std::span<DepthMap> maps,
             uint32_t first_pass_triangles);
  // Chooses the clusters of the next pass; false when none is left.
  bool next_pass(const DrawList& list, DrawPass& pass);
  // Takes in what the atlas shows after a pass.
  void take_in(const SceneMirror& mirror, std::span<const TexelSource> texels, const AtlasLayout& layout);

 private:
  // Texels of all maps stand one after another in depth_m_ and sources_.
  struct Progress {
    DepthMap* map;
    size_t first_texel;
    uint32_t next_cluster;
  };
  void select(const DrawList& list, uint32_t end_cluster, Progress& map, DrawPass& pass) const;
  void resolve(const SceneMirror& mirror, const TexelSource* tile, size_t stride, const Progress& map);

  uint32_t triangles_ = 0;  // of the next pass, for each map
  std::vector<Progress> progress_;
  std::vector<float> depth_m_;  // along the view axis
  std::vector<TexelSource> sources_;
};

void FrontToBack::start(const DrawList& list, std::span<const MapRequest> requests, std::span<DepthMap> maps,
                        uint32_t first_pass_triangles) {
  triangles_ = first_pass_triangles;
  progress_.clear();
  size_t texels = 0;
  for (size_t i = 0; i < maps.size(); ++i) {
    const MapView& view = requests[i].view;
    const size_t count = static_cast<size_t>(view.width) * view.height;
    maps[i].view = view;
    maps[i].ahead_s = requests[i].ahead_s;
    maps[i].distance_m.assign(count, std::numeric_limits<float>::infinity());
    maps[i].occluder.assign(count, kNoOccluder);
    progress_.push_back({&maps[i], texels, list.maps[i].first_cluster});
    texels += count;
  }
  depth_m_.assign(texels, std::numeric_limits<float>::infinity());
  sources_.assign(texels, {});
}

bool FrontToBack::next_pass(const DrawList& list, DrawPass& pass) {
  pass.indices.clear();
  pass.parts.clear();
  pass.first_of_map.assign(1, 0);
  for (size_t i = 0; i < progress_.size(); ++i) {
    select(list, list.maps[i].end_cluster, progress_[i], pass);
    pass.first_of_map.push_back(static_cast<uint32_t>(pass.parts.size()));
  }
  triangles_ = triangles_ > UINT32_MAX / 2 ? UINT32_MAX : 2 * triangles_;
  return !pass.parts.empty();
}

void FrontToBack::select(const DrawList& list, uint32_t end_cluster, Progress& map, DrawPass& pass) const {
  const float* depth_m = depth_m_.data() + map.first_texel;
  const size_t first = pass.indices.size(), first_part = pass.parts.size();
  for (; map.next_cluster < end_cluster && pass.indices.size() - first < 3 * size_t{triangles_};
       ++map.next_cluster) {
    const ClusterDraw& draw = list.clusters[map.next_cluster];
    if (is_hidden(draw.cluster, depth_m, map.map->view.width)) continue;
    const InstanceDraw& instance = list.instances[draw.instance];
    const uint32_t begin = static_cast<uint32_t>(pass.indices.size());
    append_visible_triangles(*instance.instance->geometry, draw.cluster, instance.grid, depth_m,
                             pass.indices);
    const uint32_t count = static_cast<uint32_t>(pass.indices.size()) - begin;
    if (count == 0) continue;
    if (pass.parts.size() > first_part && pass.parts.back().instance == draw.instance)
      pass.parts.back().count += count;
    else
      pass.parts.push_back({draw.instance, begin, count});
  }
}

void FrontToBack::take_in(const SceneMirror& mirror, std::span<const TexelSource> texels,
                          const AtlasLayout& layout) {
  const size_t stride = static_cast<size_t>(layout.width);
  for (size_t i = 0; i < progress_.size(); ++i) {
    const AtlasTile& tile = layout.tiles[i];
    resolve(mirror, texels.data() + static_cast<size_t>(tile.y) * stride + tile.x, stride, progress_[i]);
  }
}

void FrontToBack::resolve(const SceneMirror& mirror, const TexelSource* tile, size_t stride,
                          const Progress& progress) {
  DepthMap& map = *progress.map;
  SeenTriangle seen;
  TexelSource last;
  size_t texel = 0;
  for (int y = 0; y < map.view.height; ++y)
    for (int x = 0; x < map.view.width; ++x, ++texel) {
      const TexelSource& source = tile[static_cast<size_t>(y) * stride + x];
      TexelSource& known = sources_[progress.first_texel + texel];
      if (source == known) continue;
      known = source;
      // Neighbours often show the same triangle.
      if (source.slot_plus_one != last.slot_plus_one || source.vertex / 3 != last.vertex / 3)
        seen =
            SeenTriangle(map.view, mirror.instances()[source.slot_plus_one - 1], map.ahead_s, source.vertex);
      last = source;
      const glm::dvec3 direction = texel_direction(map.view, x, y);
      const double depth = seen.depth_along(direction);
      map.occluder[texel] = source.slot_plus_one - 1;
      map.distance_m[texel] = static_cast<float>(depth * glm::length(direction));
      depth_m_[progress.first_texel + texel] = static_cast<float>(depth);
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

  // Calls `work` with the renderer, its context current, nobody else using it. Any thread. When the context is lost,
  // makes another and calls `work` once more, which must therefore start from its inputs.
  using Work = std::function<Status(MapRenderer&, const EglContextInfo&)>;
  Status with_renderer(const Work& work);

 private:
  explicit SharedEglDevice(const EglOptions& options) : options_(options) {}
  Status build();
  void drop_renderer();
  Status work_once(const Work& work);

  const EglOptions options_;
  mutable std::mutex mutex_;
  std::unique_ptr<EglContext> context_;     // guarded by mutex_; null after a rebuild failed
  std::unique_ptr<MapRenderer> renderer_;   // guarded by mutex_; dies before context_, with it current
  std::string description_ = "no context";  // guarded by mutex_
  bool loss_simulated_ = false;             // guarded by mutex_
  uint64_t rebuilds_ = 0, takes_ = 0;       // guarded by mutex_
};

class EglSampler final : public Sampler {
 public:
  explicit EglSampler(SharedEglDevice& device) : device_(device) {}
  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests,
              std::vector<DepthMap>& maps) override;

 private:
  Status take_some(const SceneMirror& mirror, std::span<const MapRequest> requests, std::span<DepthMap> maps);

  SharedEglDevice& device_;
  OccluderTable occluders_;
  // Scratch.
  DrawList list_;
  DrawPass pass_;
  FrontToBack front_to_back_;
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
  if (!current)
    return fail(ErrorCode::kUnavailable, "--egl-device", "EGL refuses to make the context current");
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

Status SharedEglDevice::with_renderer(const Work& work) {
  const std::lock_guard lock(mutex_);
  Status done = work_once(work);
  if (done || done.error().code != ErrorCode::kUnavailable) return done;
  // Geometry is uploaded again as it is drawn: the mirrors still hold it.
  drop_renderer();
  context_.reset();
  ++rebuilds_;
  if (Status built = build(); !built) return built;
  return work_once(work);
}

Status SharedEglDevice::work_once(const Work& work) {
  if (!renderer_) return fail(ErrorCode::kUnavailable, "", "there is no OpenGL context");
  const CurrentContext current(*context_);
  if (!current) return fail(ErrorCode::kUnavailable, "", "EGL refuses to make the context current");
  if (++takes_ % kSweepEveryTakes == 0) renderer_->sweep();
  Status done = work(*renderer_, context_->info());
  if (context_->was_reset() || std::exchange(loss_simulated_, false))
    return fail(ErrorCode::kUnavailable, "", "the OpenGL context was lost");
  return done;
}

Status EglSampler::take(const SceneMirror& mirror, std::span<const MapRequest> requests,
                        std::vector<DepthMap>& maps) {
  occluders_.take_in(mirror);
  maps.resize(requests.size());
  for (size_t first = 0; first < requests.size(); first += MapRenderer::kMaxMaps) {
    const size_t count = std::min(MapRenderer::kMaxMaps, requests.size() - first);
    const Status done =
        take_some(mirror, requests.subspan(first, count), std::span(maps).subspan(first, count));
    if (!done) return done;
  }
  maps_taken_ += requests.size();
  return {};
}

Status EglSampler::take_some(const SceneMirror& mirror, std::span<const MapRequest> requests,
                             std::span<DepthMap> maps) {
  list_.clear();
  for (const MapRequest& request : requests) occluders_.append_map(mirror, request, list_);
  return device_.with_renderer([&](MapRenderer& renderer, const EglContextInfo& info) -> Status {
    front_to_back_.start(list_, requests, maps, info.software ? kFirstPassTriangles : UINT32_MAX);
    if (Status begun = renderer.begin(list_, requests); !begun) return begun;
    while (front_to_back_.next_pass(list_, pass_)) {
      const auto texels = renderer.draw(requests, pass_);
      if (!texels) return tl::unexpected(texels.error());
      front_to_back_.take_in(mirror, *texels, renderer.layout());
    }
    return {};
  });
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
  for (int index = 0; index < egl_device_count(); ++index)
    out.push_back(describe(index, EglContext::create(index)));
  out.push_back(describe(kSurfacelessIndex, EglContext::create(kSurfacelessIndex)));
  const ContextResult chosen = create_context(options);
  for (EglDeviceInfo& info : out) info.chosen = chosen && (*chosen)->info().index == info.index;
  return out;
}

Result<EglDeviceInfo> choose_egl_device(const EglOptions& options) {
  const ContextResult context = create_context(options);
  if (!context) return tl::unexpected(context.error());
  EglDeviceInfo info = describe((*context)->info().index, context);
  info.chosen = true;
  return info;
}

Result<std::unique_ptr<EglSamplerDevice>> make_egl_sampler_device(const EglOptions& options) {
  return SharedEglDevice::create(options);
}

}  // namespace sightline
