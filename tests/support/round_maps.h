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
      for (float& distance : map.distance_m) distance = static_cast<float>(random.next_in(nearest_m, farthest_m));
  }

  // The texel that shows a position, found by the largest of the three coordinates without the view's projection.
  struct Texel {
    const DepthMap* map = nullptr;  // null when the position is the eye itself
    size_t index = 0;
    double place_depth_m = 0.0;  // of the position, along the face's axis
    double ray_length = 1.0;     // for one unit of depth
  };
  Texel texel(const glm::dvec3& place_m) const {
    const glm::dvec3 out = place_m - maps[0].view.eye_m;
    for (const DepthMap& map : maps) {
      const glm::dmat3& frame = map.view.world_from_view;
      const double depth = -glm::dot(frame[2], out), x = glm::dot(frame[0], out), y = glm::dot(frame[1], out);
      if (!(depth > 0) || std::max(std::abs(x), std::abs(y)) > depth * (1 + 1e-12)) continue;
      const auto at = [&](double v) {
        return std::min(static_cast<int>((v / depth + 1) / 2 * map.view.width), map.view.width - 1);
      };
      const auto middle = [&](int k) { return 2 * (k + 0.5) / map.view.width - 1; };
      return {&map, static_cast<size_t>(at(y) * map.view.width + at(x)), depth,
              std::hypot(1.0, middle(at(x)), middle(at(y)))};
    }
    return {};
  }
  bool sees(const glm::dvec3& place_m, double relative_bias = 0.0) const {
    const Texel at = texel(place_m);
    return at.map && at.place_depth_m * at.ray_length <= at.map->distance_m[at.index] * (1.0 + relative_bias);
  }
  // Puts a surface before a position, so that it and what is farther out in the same direction is hidden.
  void hide(const glm::dvec3& place_m, double before_m) {
    const Texel at = texel(place_m);
    const double share = 1 - before_m / glm::distance(place_m, maps[0].view.eye_m);
    maps[static_cast<size_t>(at.map - maps.data())].distance_m[at.index] = static_cast<float>(share * at.place_depth_m *
                                                                                              at.ray_length);
  }
  uint32_t occluder(const glm::dvec3& place_m) const {
    const Texel at = texel(place_m);
    return at.map ? at.map->occluder[at.index] : kNoOccluder;
  }

  std::vector<DepthMap> maps;
};

}  // namespace sightline::test
