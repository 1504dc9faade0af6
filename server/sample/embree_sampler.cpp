#include "server/sample/embree_sampler.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <iterator>

#include "server/base/thread_pool.h"
#include "server/sample/embree_maps.h"

namespace sightline {
namespace {

// The one value besides 0 that the requests have; 0 when there is none.
double common_ahead_s(std::span<const MapRequest> requests) {
  double ahead_s = 0.0;
  for (const MapRequest& request : requests) ahead_s = std::max(ahead_s, request.ahead_s);
  return ahead_s;
}

// For so many maps no helper is called: preset `paper` takes less than 0.03 ms for all of a step's.
constexpr size_t kNotWorthTheCall = 16;

class EmbreeSampler final : public Sampler {
 public:
  EmbreeSampler(EmbreeDevice& device, size_t hands) : crew_(hands) {
    for (size_t hand = 0; hand < crew_.size(); ++hand)
      takers_.push_back(std::make_unique<EmbreeMaps>(device));
  }

  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    const double ahead_s = common_ahead_s(requests);
    maps.resize(requests.size());
    // What is new to the device is built here, once; the others find it.
    takers_[0]->take_in(mirror, ahead_s);
    // A map depends on the mirror and its request alone (embree_maps.h): whoever takes it. The last first: a step's last are those of
    // the survey, of which each costs as much as three others, so that the hands end together.
    std::atomic<ptrdiff_t> left{std::ssize(requests)};
    const auto work = [&](size_t hand) {
      if (hand > 0) takers_[hand]->take_in(mirror, ahead_s);
      for (ptrdiff_t i = --left; i >= 0; i = --left)
        takers_[hand]->take(mirror, requests[static_cast<size_t>(i)], maps[static_cast<size_t>(i)]);
    };
    if (crew_.size() > 1 && requests.size() > kNotWorthTheCall)
      crew_.run(std::cref(work));
    else
      work(0);
    maps_taken_ += requests.size();
    return {};
  }

 private:
  std::vector<std::unique_ptr<EmbreeMaps>> takers_;  // by hand
  ThreadPool crew_;                                        // last: its helpers end first
};

class EmbreeSamplerDevice final : public SamplerDevice {
 public:
  explicit EmbreeSamplerDevice(size_t hands) : hands_(hands) {}
  std::unique_ptr<Sampler> make_sampler() override {
    return std::make_unique<EmbreeSampler>(device_, hands_);
  }
  std::string kind() const override { return "embree"; }
  std::string renderer() const override { return "Embree " + EmbreeDevice::version() + ", CPU rays"; }
  size_t geometry_bytes() const override { return device_.geometry_bytes(); }

 private:
  EmbreeDevice device_;
  const size_t hands_;
};

}  // namespace

std::unique_ptr<SamplerDevice> make_embree_sampler_device(size_t hands) {
  return std::make_unique<EmbreeSamplerDevice>(hands);
}

}  // namespace sightline
