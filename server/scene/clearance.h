// Distances to the surfaces that the camera body must not touch. `move` sweeps the camera with it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/scene/mirror.h"

namespace sightline {

// The colliders near one point, gathered once in a step and queried many times. Static colliders are gathered with a
// margin and kept until the point leaves it or the mirror's static version changes. Distances are exact, to both sides
// of all triangles, including see-through ones; inside a solid they are to its surface. Not thread-safe: keep one per
// session and call gather again, which reuses its memory. The mirror must outlive the queries and must not change
// between gather and a query.
//
// The work of queries is counted, and can be bounded, so that very many triangles at one place cannot make a step long.
// It is counted in tests of a box or a triangle, not in time. So a query gives the same answer on every machine. The
// count depends on the mirror and on the queries alone, not on what was gathered before. Where the allowance is used
// up, further queries give the careful answer: a surface at the point itself, a path that is not free, a point that is
// not inside.
class ClearanceField {
 public:
  // Allows so many tests until the next gather, which allows any number. Like the queries that use them up, it does not
  // change the field.
  void allow(uint64_t tests) const;
  // The number of tests since the last gather or `allow`; what was allowed when it was not enough.
  uint64_t tests() const { return allowed_ - left_; }
  bool exhausted() const { return left_ == 0; }

  // Collects colliding instances whose bounding sphere comes within `reach_m` of `center_m`, except those in
  // `ignored_slots` (ascending).
  void gather(const SceneMirror& mirror, const glm::dvec3& center_m, double reach_m,
              std::span<const uint32_t> ignored_slots);

  // The same, but only of moving colliders, placed where their velocities take them in `ahead_s` seconds.
  void gather_movers(const SceneMirror& mirror, const glm::dvec3& center_m, double reach_m,
                     std::span<const uint32_t> ignored_slots, double ahead_s);

  // Distance in metres from `point_m` to the nearest collider surface, or `reach_m` when nothing is nearer.
  // `point_m` plus `reach_m` must lie inside the gathered ball for the answer to be complete.
  double clearance_m(const glm::dvec3& point_m, double reach_m) const;
  // The same with the nearest surface point; false when nothing is within reach.
  bool nearest(const glm::dvec3& point_m, double reach_m, glm::dvec3& surface_m) const;

  // The fraction in [0, 1] of the straight path from `from_m` to `to_m` that a sphere of `radius_m` (> 0; a point
  // touches nothing) can move before it touches a collider. Never too large, and too small by at most 1 mm of path. 0
  // when the sphere overlaps a collider already. An overlap of less than 1e-9 m counts as touching: such a sphere may
  // slide along the surface or leave it. The path plus `radius_m` must lie inside the gathered ball. Uses conservative
  // advancement for each triangle (Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996). On a path
  // along a wall it does not stall, as advancement by plain distance would.
  double free_fraction(const glm::dvec3& from_m, const glm::dvec3& to_m, double radius_m) const;
  // True when free_fraction is 1, at lower cost. `blocker` is the index of the collider that is tested first; on
  // return, of the collider in the way, if any. Paths from one point are mostly blocked by the same collider.
  // kNoBlocker is valid at first.
  static constexpr size_t kNoBlocker = SIZE_MAX;
  bool is_free(const glm::dvec3& from_m, const glm::dvec3& to_m, double radius_m, size_t& blocker) const;

  // The mirror slot of the collider that the sphere touches first on that path; empty when the path is free. Not as
  // fast as is_free.
  std::optional<uint32_t> first_in_way(const glm::dvec3& from_m, const glm::dvec3& to_m, double radius_m) const;

  // True if the point is inside a solid. 14 rays start from it. At least 12 of them must leave more surfaces than they
  // enter, or first meet the back of one. The first kind also finds the solids that overlap others, the second the
  // space between rooms that are modelled from inside. The back of an open surface, such as a roof or a leaf, does not
  // count. Which side is the front follows from the winding, as in glTF. Only solids whose bounding sphere reaches into
  // the gathered ball count.
  bool is_inside(const glm::dvec3& point_m) const;

  // The radius of the ball that was gathered.
  double reach_m() const { return reach_m_; }

  // The number of colliders within the requested reach.
  size_t collider_count() const;

 private:
  struct Collider {
    const Geometry* geometry;
    Affine world_from_instance, instance_from_world;
    glm::dvec3 center_m;  // of the bounding sphere
    double radius_m;
    double min_stretch;  // lower bound of world_from_instance's, for pruning in the instance's own frame
    uint32_t slot;       // in the mirror
  };
  // Describes standing_: the mirror's static colliders within reach_m of center_m, without ignored ones.
  struct Gathered {
    uint64_t identity = 0, static_version = 0;
    glm::dvec3 center_m{0.0};
    double reach_m = -1.0;
    bool all = false;  // nothing was ignored
  };
  void gather_standing(const SceneMirror& mirror, const glm::dvec3& center_m, double reach_m,
                       std::span<const uint32_t> ignored_slots);
  static void add_if_near(const SceneMirror& mirror, uint32_t slot, const glm::dvec3& center_m, double reach_m,
                          std::span<const uint32_t> ignored_slots, double ahead_s, std::vector<Collider>& into);
  void add_movers(const SceneMirror& mirror, const glm::dvec3& center_m, double reach_m,
                  std::span<const uint32_t> ignored_slots, double ahead_s);
  void list_spheres(const glm::dvec3& center_m, double reach_m);
  // Counts tests; false when none is left.
  bool take(uint64_t tests) const {
    left_ -= std::min(left_, tests);
    return left_ > 0;
  }
  // The straight path of a sphere; its length may be 0, with any direction.
  struct Way {
    Way(const glm::dvec3& from, const glm::dvec3& to, double radius);
    glm::dvec3 from_m, to_m;
    double length_m;
    glm::dvec3 direction;
    double radius_m;
  };
  // Calls take(index) for at least the colliders that the sphere may touch, until take returns false; then returns
  // false.
  template <typename Take>
  bool for_each_beside(const Way& way, Take take) const;
  template <typename Bound, typename Limit, typename Visit>
  void search(const Collider& collider, Bound bound, Limit limit, Visit visit) const;
  template <typename Limit, typename Visit>
  void sweep(const Collider& collider, const Way& way, Limit limit, Visit visit) const;
  bool meets(const Collider& collider, const Way& way) const;
  bool leaves_solid(const glm::dvec3& from_m, const glm::dvec3& direction) const;
  const Collider& at(size_t index) const {
    return index < standing_.size() ? standing_[index] : moving_[index - standing_.size()];
  }

  Gathered gathered_;
  std::vector<Collider> standing_, moving_;
  // The bounding spheres of standing_, then of moving_, by coordinate, so that many are tested at once; most are
  // missed.
  std::vector<double> x_m_, y_m_, z_m_, radius_m_;
  bool stands_listed_ = false;  // the spheres of standing_ are in the lists
  glm::dvec3 center_m_{0.0};    // of the last gather
  double reach_m_ = 0.0;
  uint64_t tests_of_query_ = 0;  // for the bounding spheres alone
  static constexpr uint64_t kAnyNumber = UINT64_MAX;
  mutable uint64_t allowed_ = kAnyNumber, left_ = kAnyNumber;
};

// Distance from `p` to the triangle (a, b, c), and the closest point on it (Ericson, Real-Time Collision
// Detection, 5.1.5).
glm::dvec3 closest_on_triangle(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c);

}  // namespace sightline
