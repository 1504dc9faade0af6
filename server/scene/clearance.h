// How far a point is from what the camera body may not touch. `move` sweeps the camera with it.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/scene/mirror.h"

namespace sightline {

// The colliders near one place, gathered once a step, then asked many times. Those that stand are gathered somewhat farther, and
// again only once the place has left that or the mirror's static version has changed. Exact: distances are to
// triangles, both sides alike, see-through ones too; a point inside a solid is as far from it as from its
// surface. Not thread-safe; keep one per session and call gather again, it reuses its memory. The mirror must
// outlive the queries and not change between gather and them.
class ClearanceField {
 public:
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

  // How far a sphere of `radius_m` (>= 0) can move from `from_m` straight towards `to_m` before it touches
  // anything: a fraction in [0, 1], never too large; too small by at most 1 mm of path. 0 when it already
  // overlaps. Pressing in by less than 1e-9 m counts as touching: a sphere that touches may slide along and
  // leave. The path plus `radius_m` must lie inside the gathered ball. Conservative advancement per triangle
  // (Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996), which does not stall on a path
  // that grazes a wall as advancement by the bare distance would.
  double free_fraction(const glm::dvec3& from_m, const glm::dvec3& to_m, double radius_m) const;
  // Whether that is 1, for less. `blocker`: what is tested first, and then what is in the way, if anything; of ways from one place mostly
  // the same is. Any number will do at first.
  bool is_free(const glm::dvec3& from_m, const glm::dvec3& to_m, double radius_m, size_t& blocker) const;

  // How many come within the reach that was asked for.
  size_t collider_count() const;

 private:
  struct Collider {
    const Geometry* geometry;
    Affine world_from_instance, instance_from_world;
    glm::dvec3 center_m;  // of the bounding sphere
    double radius_m;
    double min_stretch;  // lower bound of world_from_instance's, for pruning in the instance's own frame
  };
  // What standing_ holds: all of this mirror's colliders that stand and come within reach_m of center_m, but those ignored.
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
  void list_spheres(const glm::dvec3& center_m, double reach_m);
  // A sphere's, or of no length and any direction.
  struct Way {
    Way(const glm::dvec3& from, const glm::dvec3& to, double radius);
    glm::dvec3 from_m, to_m;
    double length_m;
    glm::dvec3 direction;
    double radius_m;
  };
  // Calls take(index) for those that the sphere may touch, and maybe for some that it does not, until it says false; and says it then.
  template <typename Take>
  bool for_each_beside(const Way& way, Take take) const;
  template <typename Limit, typename Visit>
  void sweep(const Collider& collider, const Way& way, Limit limit, Visit visit) const;
  bool meets(const Collider& collider, const Way& way) const;
  const Collider& at(size_t index) const {
    return index < standing_.size() ? standing_[index] : moving_[index - standing_.size()];
  }

  Gathered gathered_;
  std::vector<Collider> standing_, moving_;
  // The bounding spheres of standing_, then of moving_, by coordinate: most are passed by, and many at once can be asked for that.
  std::vector<double> x_m_, y_m_, z_m_, radius_m_;
  bool stands_listed_ = false;  // those of standing_ are there
  glm::dvec3 center_m_{0.0};  // what was asked for
  double reach_m_ = 0.0;
};

// Distance from `p` to the triangle (a, b, c), and the closest point on it (Ericson, Real-Time Collision
// Detection, 5.1.5).
glm::dvec3 closest_on_triangle(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b,
                               const glm::dvec3& c);

}  // namespace sightline
