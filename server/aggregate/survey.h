// Survey: from which sides, heights and distances are the targets well seen? The lattice tells which places near the camera are
// good now; the paper's conclusion names the want of a global evaluation, which this is.
//
// Places stand round the targets' centre in a fixed polar pattern (world axes) and travel with it. In each step one target looks all
// round, from another of its points each time, and every place learns whether it sees it. A place remembers each target's
// visible share as a low pass, so that it comes to know which shot is good for long.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/look_up.h"
#include "server/sample/depth_map.h"

namespace sightline {

// Memory grows when targets are added, otherwise no allocation. Not thread-safe. Deterministic.
class Survey {
 public:
  static constexpr size_t kAzimuths = 16, kElevations = 5, kDistances = 4;
  static constexpr size_t kPlaces = kAzimuths * kElevations * kDistances;
  // Of the farthest places, in shares of the distance that `follow` takes.
  static constexpr double kFarthestShare = 1.4;

  Survey();

  // Which targets there are: one that is there again keeps what was learnt of it. `distance_m` > 0: of the third of four distances.
  void follow(std::span<const uint64_t> target_ids, double distance_m);
  void forget() { ids_.clear(), shares_.clear(), known_s_.clear(); }

  // The place that is most like `offset_m`, in direction and distance; not zero.
  size_t nearest_place(const glm::dvec3& offset_m) const;
  // From the targets' centre to a place, world axes.
  glm::dvec3 offset_m(size_t place) const;

  // Target `target` looked round: `maps` together show every direction from one of its points. `since_s`: the time since it last
  // did; `memory_s` > 0: the time constant.
  void learn(size_t target, std::span<const DepthMap> maps, const glm::dvec3& center_m, double relative_bias,
             double since_s, double memory_s);

  // The visible share of a target at a place, [0, 1]; 1 before it first looked round.
  float share(size_t target, size_t place) const { return shares_[target * kPlaces + place]; }
  // The mean over the places beside it at the same distance: what becomes of it when the targets turn a little.
  float share_beside(size_t target, size_t place) const;
  // For how long the target that looked round for the shortest time has; 0 without targets. Before about memory_s little is known.
  double known_s() const;
  size_t target_count() const { return ids_.size(); }

 private:
  std::array<glm::dvec3, kAzimuths * kElevations> directions_;  // azimuth by azimuth
  double distance_m_ = 1.0;
  std::vector<uint64_t> ids_;
  std::vector<float> shares_;    // target by target, place by place
  std::vector<double> known_s_;  // by target: for how long it has looked round
  // Of `learn`: kept for their memory.
  std::vector<glm::dvec3> places_m_;
  LookUp look_up_;
};

}  // namespace sightline
