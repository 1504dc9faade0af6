#include "server/sample/embree_sampler.h"

#include <algorithm>

#include "server/sample/embree_scene.h"

namespace sightline {
namespace {

void take_map(const EmbreeScene& scene, const MapRequest& request, DepthMap& map) {
  const MapView& view = request.view;
  const size_t texels = static_cast<size_t>(view.width) * view.height;
  map.view = view;
  map.ahead_s = request.ahead_s;
  map.distance_m.resize(texels);
  map.occluder.resize(texels);
  const RayFilter filter{.layer_mask = request.layer_mask, .ignored_slots = request.ignored_slots, .ahead = request.ahead_s > 0};
  size_t texel = 0;
  for (int y = 0; y < view.height; ++y)
    for (int x = 0; x < view.width; ++x, ++texel) {
      // One unit of depth a unit of ray length, so that near_m is a plane as in a render.
      const glm::vec3 direction(texel_direction(view, x, y));
      const RayHit hit = scene.trace(view.eye_m, direction, static_cast<float>(view.near_m),
                                     std::numeric_limits<float>::infinity(), filter);
      map.distance_m[texel] = hit.distance_m * glm::length(direction);
      map.occluder[texel] = hit.slot;
    }
}

// The one value besides 0 that the requests have; 0 when there is none.
double common_ahead_s(std::span<const MapRequest> requests) {
  double ahead_s = 0.0;
  for (const MapRequest& request : requests) ahead_s = std::max(ahead_s, request.ahead_s);
  return ahead_s;
}

class EmbreeSampler final : public Sampler {
 public:
  explicit EmbreeSampler(EmbreeDevice& device) : scene_(device, EmbreeScene::Content::kOccluders) {}

  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    scene_.take_in(mirror, common_ahead_s(requests));
    maps.resize(requests.size());
    for (size_t i = 0; i < requests.size(); ++i) take_map(scene_, requests[i], maps[i]);
    maps_taken_ += requests.size();
    return {};
  }

 private:
  EmbreeScene scene_;
};

class EmbreeSamplerDevice final : public SamplerDevice {
 public:
  std::unique_ptr<Sampler> make_sampler() override { return std::make_unique<EmbreeSampler>(device_); }
  std::string kind() const override { return "embree"; }
  std::string description() const override { return "Embree " + EmbreeDevice::version() + ", CPU rays"; }
  size_t geometry_bytes() const override { return device_.geometry_bytes(); }

 private:
  EmbreeDevice device_;
};

}  // namespace

static_assert(kNoOccluder == UINT32_MAX, "a ray that hits nothing reports slot UINT32_MAX");

std::unique_ptr<SamplerDevice> make_embree_sampler_device() {
  return std::make_unique<EmbreeSamplerDevice>();
}

}  // namespace sightline
