// The sampled points of a target, which may consist of several pieces: its own instance and its parts. Internal to this
// folder.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/sample/extent.h"
#include "server/scene/mirror.h"
#include "server/step/step_dump.h"

namespace sightline {

// A point on a target, in the frame of the instance on which it lies.
struct TargetPoint {
  uint32_t slot = 0;  // of that instance
  glm::vec3 at_m{0.0f};
};

// The viewer of a target, and how many points to pick.
struct TargetView {
  glm::dvec3 viewer_m{0.0};
  std::optional<glm::dvec2> blend = {};    // `unit` of ExtentTable::points_blended; empty: the nearest view
  std::optional<glm::dvec3> moved_m = {};  // the target stands displaced by this
  uint64_t round = 0;                      // successive rounds take other points, until every point was used
  size_t count = 0;
};

// Picks points of one target after another. Once its memory has grown, it allocates nothing.
//
// A single piece has the points of its table. Points of several pieces are spread over their common image. Each by
// itself is distributed about uniformly over what the viewer would see of the target alone. So a piece has points in
// proportion to the area that it shows, and a point that another piece hides is replaced by another point.
class TargetPicker {
 public:
  // Exactly `count` points; from a single piece no more than its table has. Valid until the next call. At least one
  // piece must have a table; those without one are left out.
  std::span<const TargetPoint> pick(const SceneMirror& scene, std::span<const TargetPiece> pieces,
                                    const TargetView& view);

 private:
  // A piece, placed for the view.
  struct Placed {
    uint32_t slot = 0;
    const Instance* instance = nullptr;
    Affine world_from_mesh = identity_affine(), mesh_from_world = identity_affine();
    glm::dvec3 center_m{0.0};
    std::span<const glm::vec3> points;
    double area_until = 0;  // shown by this and all former pieces (shown_area)
    size_t first = 0;       // the index of its first point
    size_t taken = 0;       // points tried so far
  };
  void pick_of_one(const SceneMirror& scene, const TargetPiece& piece, const TargetView& view);
  void pick_of_several(const SceneMirror& scene, std::span<const TargetPiece> pieces, const TargetView& view);
  double place(const SceneMirror& scene, std::span<const TargetPiece> pieces, const TargetView& view);
  bool is_hidden(const Placed& by_all_but, const glm::dvec3& point_m, const glm::dvec3& viewer_m) const;

  std::vector<Placed> placed_;
  std::vector<glm::vec3> run_;
  std::vector<TargetPoint> picked_;
};

// The number of pieces that have a table.
size_t sampled_pieces(std::span<const TargetPiece> pieces);
// About the solid angle that an instance fills, in steradians. A viewer inside its bounding sphere is taken to be as
// far away as that is large.
double shown_area(const Instance& instance, const ExtentTable& table, const glm::dvec3& viewer_mesh_m);

}  // namespace sightline
