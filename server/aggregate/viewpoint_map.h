// Maps from which sides, heights and distances the targets are well seen. The lattice shows which positions near the
// camera are good now; this is the global evaluation that the paper's conclusion asks for.
//
// The viewpoints are a fixed polar pattern (world axes) round the targets' centre, which moves with it. In each step
// one target takes maps in all directions, from another of its points each time, and every viewpoint learns whether it
// sees that point. Each viewpoint keeps a low-pass of every target's visible share, and so learns which shots stay
// good.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/look_up.h"
#include "server/sample/depth_map.h"

namespace sightline {

// Allocates only when targets are added. Not thread-safe. Deterministic.
class ViewpointMap {
 public:
  static constexpr size_t kAzimuths = 16, kElevations = 6, kDistances = 4;
  static constexpr size_t kViewpoints = kAzimuths * kElevations * kDistances;
  // Distance of the farthest viewpoints as a multiple of the distance given to `follow`.
  static constexpr double kFarthestShare = 1.4;

  ViewpointMap();

  // Sets the targets; a target that was there before keeps what was learnt. `distance_m` > 0 is the third of the four
  // distances.
  void follow(std::span<const uint64_t> target_ids, double distance_m);
  void forget() { ids_.clear(), shares_.clear(), known_s_.clear(); }

  // The viewpoint nearest to `offset_m` (not zero) in direction and distance.
  size_t nearest_viewpoint(const glm::dvec3& offset_m) const;
  // The offset from the targets' centre to a viewpoint, world axes, metres.
  glm::dvec3 offset_m(size_t place) const;

  // Learns from `maps`, which together show every direction from one point of the target. `since_s`: the time since the
  // last call for this target; `memory_s` > 0: the time constant.
  void learn(size_t target, std::span<const DepthMap> maps, const glm::dvec3& center_m, double relative_bias,
             double since_s, double memory_s);

  // The visible share of a target from a viewpoint, [0, 1]; 1 before the first call of `learn`.
  float share(size_t target, size_t place) const { return shares_[target * kViewpoints + place]; }
  // The mean over the neighbouring viewpoints at the same distance, which is what will be seen when the targets turn a
  // little.
  float share_beside(size_t target, size_t place) const;
  // The learning time of the target that has learnt for the shortest time, seconds; 0 without targets. Less than about
  // memory_s means that little is known.
  double known_s() const;
  size_t target_count() const { return ids_.size(); }

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  std::array<glm::dvec3, kAzimuths * kElevations> directions_;  // azimuth by azimuth
  double distance_m_ = 1.0;
  std::vector<uint64_t> ids_;
  std::vector<float> shares_;    // target by target, viewpoint by viewpoint
  std::vector<double> known_s_;  // by target: learning time
  // Working memory of `learn`.
  std::vector<glm::dvec3> places_m_;
  LookUp look_up_;
};

}  // namespace sightline
