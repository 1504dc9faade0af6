// Looking places up in depth maps: does a place see the point from which a map was taken? For one place exactly as said
// (`look_up`), and for many at once with the very same answers (`LookUp`).
//
// Many at once are looked up in single precision: one division a place and map instead of four and a root, eight or sixteen
// places an instruction. Every number goes with a bound of its rounding error; where an answer could hang on it (a place within
// that of a texel's edge, of the eye's plane, or of the texel's distance: some in 10,000) the place is looked up again by
// `look_up`. This is the floating-point filter of exact geometric predicates (Fortune & Van Wyk, "Static analysis yields
// efficient exact integer arithmetic for computational geometry", 1996; Shewchuk, "Adaptive precision floating-point
// arithmetic", 1997).
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/sample/depth_map.h"

namespace sightline {

// Where one map shows a point: its texel, or nothing.
struct Sight {
  bool known = false;               // the point lies in the window of one of the maps
  bool visible = false;             // and nothing stands between
  uint32_t occluder = kNoOccluder;  // what does, when not visible
};

// Whether `point_m` sees the point from which the maps were taken: its distance is compared with the texel's. At
// equality it is visible; an unknown point is not.
Sight look_up(std::span<const DepthMap> maps, const glm::dvec3& point_m, double relative_bias);

// What a place sees of a point.
enum PlaceSight : int32_t {
  kUnknownSight = 0,  // in no map's window
  kVisibleSight = 1,
  kHiddenSight = 2,
  kPassingSight = 3,  // hidden, by an occluder that may be gone at once
};

// Places, looked up in one point's maps after the other's. Memory is kept from call to call. Not thread-safe. Deterministic; the
// same on every machine.
class LookUp {
 public:
  // The places of the calls to come; the span must outlive them.
  void set_places(std::span<const glm::dvec3> place_m);
  size_t size() const { return place_m_.size(); }

  // A PlaceSight by place: what `look_up` says of it in these maps, all of one point, relative_bias in [0, 0.1]. `passes` has an
  // entry for each mirror slot: 1 for occluders that may be gone at once; empty: none. Valid until the next call.
  std::span<const int32_t> operator()(std::span<const DepthMap> maps, double relative_bias,
                                      std::span<const uint8_t> passes = {});
  // Whether the last call may have found a kPassingSight.
  bool any_passing() const { return any_passing_; }
  // How many places the last call looked up singly.
  size_t exact_count() const { return exact_count_; }

 private:
  void list_limits(const DepthMap& map, double relative_bias);
  bool list_passing(const DepthMap& map, std::span<const uint8_t> passes);
  void settle(std::span<const DepthMap> maps, double relative_bias, std::span<const uint8_t> passes);

  std::span<const glm::dvec3> place_m_;
  glm::dvec3 origin_m_{0.0}, reach_m_{0.0};  // the places lie in origin_m +- reach_m
  std::vector<float> x_m_, y_m_, z_m_;       // from the origin
  std::vector<int32_t> sights_;
  std::vector<float> limit_m2_;    // by texel: the greatest squared distance that sees
  std::vector<int32_t> passing_;   // by texel: 1 when its occluder passes
  bool any_passing_ = false;
  size_t exact_count_ = 0;
};

}  // namespace sightline
