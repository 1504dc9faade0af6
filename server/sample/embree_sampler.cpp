#include "server/sample/embree_sampler.h"

#include <algorithm>

#include "server/sample/embree_maps.h"

namespace sightline {
namespace {

// The one value besides 0 that the requests have; 0 when there is none.
double common_ahead_s(std::span<const MapRequest> requests) {
  double ahead_s = 0.0;
  for (const MapRequest& request : requests) ahead_s = std::max(ahead_s, request.ahead_s);
  return ahead_s;
}

class EmbreeSampler final : public Sampler {
 public:
  explicit EmbreeSampler(EmbreeDevice& device) : taker_(device) {}

  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    taker_.take_in(mirror, common_ahead_s(requests));
    maps.resize(requests.size());
    for (size_t i = 0; i < requests.size(); ++i) taker_.take(mirror, requests[i], maps[i]);
    maps_taken_ += requests.size();
    return {};
  }

 private:
  EmbreeMaps taker_;
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

std::unique_ptr<SamplerDevice> make_embree_sampler_device() {
  return std::make_unique<EmbreeSamplerDevice>();
}

}  // namespace sightline
