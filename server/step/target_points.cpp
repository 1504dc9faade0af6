#include "server/step/target_points.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "server/scene/ray.h"

namespace sightline {
namespace {

// Points are tried at most this often for each that is wanted. Then they are taken even if they are hidden.
constexpr size_t kTriesPerPoint = 4;

// Point `index` of a sequence that is evenly spread over [0, 1) in every run: multiples of the golden ratio, modulo 1.
double spread_unit(uint64_t index) {
  return static_cast<double>((index * 0x9E3779B97F4A7C15u) >> 11) * 0x1p-53;
}

Affine placed(const Instance& instance, const std::optional<glm::dvec3>& moved_m) {
  Affine world_from_mesh = instance.world_from_instance;
  if (moved_m) world_from_mesh[3] += *moved_m;
  return world_from_mesh;
}

std::span<const glm::vec3> points_for(const ExtentTable& table, const glm::dvec3& viewer_mesh_m,
                                      const TargetView& view) {
  return view.blend ? table.points_blended(viewer_mesh_m, *view.blend) : table.points(viewer_mesh_m);
}

// True if a sphere touches the straight line between two points.
bool touches_line(const glm::dvec3& center_m, double radius_m, const glm::dvec3& from_m, const glm::dvec3& to_m) {
  const glm::dvec3 way_m = to_m - from_m, to_center_m = center_m - from_m;
  const double length_squared = glm::dot(way_m, way_m);
  const double at = length_squared > 0 ? std::clamp(glm::dot(to_center_m, way_m) / length_squared, 0.0, 1.0) : 0.0;
  return glm::distance(to_center_m, at * way_m) <= radius_m;
}

}  // namespace

size_t sampled_pieces(std::span<const TargetPiece> pieces) {
  return static_cast<size_t>(
      std::ranges::count_if(pieces, [](const TargetPiece& piece) { return piece.table != nullptr; }));
}

// An affine map multiplies the area of a parallel image by its determinant over its stretch along the line of sight.
double shown_area(const Instance& instance, const ExtentTable& table, const glm::dvec3& viewer_mesh_m) {
  const Affine& map = instance.world_from_instance;
  const glm::dvec3 along_m = viewer_mesh_m - glm::dvec3(instance.geometry->center);
  const glm::dvec3 away_m = transform_vector(map, along_m);
  const double stretch = glm::length(away_m) / std::max(glm::length(along_m), 1e-9);
  const double distance_m = std::max({glm::length(away_m), instance.radius_m, 1e-9});
  const double volume = std::abs(glm::determinant(glm::dmat3(map[0], map[1], map[2])));
  return table.area_of_view_m2(table.view_index(viewer_mesh_m)) * volume / std::max(stretch, 1e-9) /
         (distance_m * distance_m);
}

std::span<const TargetPoint> TargetPicker::pick(const SceneMirror& scene, std::span<const TargetPiece> pieces,
                                                const TargetView& view) {
  picked_.clear();
  const auto sampled = std::ranges::find_if(pieces, [](const TargetPiece& piece) { return piece.table != nullptr; });
  assert(sampled != pieces.end());
  if (sampled_pieces(pieces) == 1)
    pick_of_one(scene, *sampled, view);
  else
    pick_of_several(scene, pieces, view);
  return picked_;
}

void TargetPicker::pick_of_one(const SceneMirror& scene, const TargetPiece& piece, const TargetView& view) {
  const Affine mesh_from_world = inverse(placed(scene.instances()[piece.slot], view.moved_m));
  pick_points(points_for(*piece.table, transform_point(mesh_from_world, view.viewer_m), view), view.round, view.count,
              run_);
  for (const glm::vec3& at_m : run_) picked_.push_back({piece.slot, at_m});
}

void TargetPicker::pick_of_several(const SceneMirror& scene, std::span<const TargetPiece> pieces,
                                   const TargetView& view) {
  const double all = place(scene, pieces, view);
  for (uint64_t tried = 0; picked_.size() < view.count; ++tried) {
    const double area = spread_unit(view.round * view.count + tried) * all;
    const auto found = std::ranges::upper_bound(placed_, area, {}, &Placed::area_until);
    Placed& piece = found != placed_.end() ? *found : placed_.back();  // no piece shows anything
    const glm::vec3 at_m = piece.points[(piece.first + piece.taken++) % piece.points.size()];
    const bool may_be_hidden = tried < kTriesPerPoint * view.count;
    if (may_be_hidden && is_hidden(piece, transform_point(piece.world_from_mesh, glm::dvec3(at_m)), view.viewer_m))
      continue;
    picked_.push_back({piece.slot, at_m});
  }
}

// Returns the area of all pieces.
double TargetPicker::place(const SceneMirror& scene, std::span<const TargetPiece> pieces, const TargetView& view) {
  placed_.clear();
  double all = 0;
  for (const auto& [slot, table] : pieces) {
    if (!table) continue;
    const Instance& instance = scene.instances()[slot];
    Placed& piece = placed_.emplace_back();
    piece.slot = slot, piece.instance = &instance;
    piece.world_from_mesh = placed(instance, view.moved_m);
    piece.mesh_from_world = inverse(piece.world_from_mesh);
    piece.center_m = transform_point(piece.world_from_mesh, glm::dvec3(instance.geometry->center));
    const glm::dvec3 viewer_mesh_m = transform_point(piece.mesh_from_world, view.viewer_m);
    piece.points = points_for(*table, viewer_mesh_m, view);
    piece.area_until = all += shown_area(instance, *table, viewer_mesh_m);
  }
  // As pick_points: every round begins after the points that the former round took.
  for (double before = 0; Placed & piece : placed_) {
    const double share = all > 0 ? (piece.area_until - before) / all : 0.0;
    before = piece.area_until;
    piece.first = view.round % piece.points.size() *
                  static_cast<size_t>(std::ceil(share * static_cast<double>(view.count)));
  }
  return all;
}

bool TargetPicker::is_hidden(const Placed& by_all_but, const glm::dvec3& point_m, const glm::dvec3& viewer_m) const {
  return std::ranges::any_of(placed_, [&](const Placed& piece) {
    return &piece != &by_all_but && touches_line(piece.center_m, piece.instance->radius_m, viewer_m, point_m) &&
           crosses(*piece.instance->geometry, transform_point(piece.mesh_from_world, viewer_m),
                   transform_point(piece.mesh_from_world, point_m));
  });
}

}  // namespace sightline
