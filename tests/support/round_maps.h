// Hand-made maps of every direction from one point: a near surface hides what is behind it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

#include "server/base/random.h"
#include "server/sample/depth_map.h"
#include "server/sample/plan.h"

namespace sightline::test {

// The six faces of a cube around the eye, empty at first.
class RoundMaps {
 public:
  RoundMaps(const glm::dvec3& eye_m, int resolution) {
    std::vector<MapView> views;
    plan_round(eye_m, resolution, {0.5, 0.5}, views);
    const size_t texels = static_cast<size_t>(resolution) * static_cast<size_t>(resolution);
    for (const MapView& view : views)
      maps.push_back({view, std::vector<float>(texels, std::numeric_limits<float>::infinity()),
                      std::vector<uint32_t>(texels, kNoOccluder)});
  }

  void fill_at_random(CounterRandom& random, double nearest_m, double farthest_m) {
    for (DepthMap& map : maps)
      for (float& distance : map.distance_m)
        distance = static_cast<float>(random.next_in(nearest_m, farthest_m));
  }

  // The texel that shows a position, found by the largest of the three coordinates without the view's projection. Null
  // when the position is the eye itself.
  float* texel(const glm::dvec3& place_m) {
    const glm::dvec3 out = place_m - maps[0].view.eye_m;
    for (DepthMap& map : maps) {
      const glm::dmat3& frame = map.view.world_from_view;
      const double depth = -glm::dot(frame[2], out), x = glm::dot(frame[0], out), y = glm::dot(frame[1], out);
      if (!(depth > 0) || std::max(std::abs(x), std::abs(y)) > depth * (1 + 1e-12)) continue;
      const auto at = [&](double v) {
        return std::min(static_cast<int>((v / depth + 1) / 2 * map.view.width), map.view.width - 1);
      };
      return &map.distance_m[static_cast<size_t>(at(y) * map.view.width + at(x))];
    }
    return nullptr;
  }
  bool sees(const glm::dvec3& place_m, double relative_bias = 0.0) {
    const float* distance_m = texel(place_m);
    return distance_m && glm::distance(place_m, maps[0].view.eye_m) <= *distance_m * (1.0 + relative_bias);
  }

  uint32_t occluder(const glm::dvec3& place_m) {
    const float* at = texel(place_m);
    for (const DepthMap& map : maps)
      for (size_t k = 0; k < map.distance_m.size(); ++k)
        if (&map.distance_m[k] == at) return map.occluder[k];
    return kNoOccluder;
  }

  std::vector<DepthMap> maps;
};

}  // namespace sightline::test
