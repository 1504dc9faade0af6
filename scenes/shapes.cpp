#include "scenes/shapes.h"

#include <vector>

#include "scenes/exact.h"

namespace sightline::scenes {
namespace {

// A circle of the surface around the axis; radius 0 is a single point.
struct Ring {
  double radius_m;
  double y_m;
};

uint32_t append_point(MeshData& mesh, const glm::dvec3& p) {
  mesh.positions.emplace_back(snap(p));
  return static_cast<uint32_t>(mesh.positions.size() - 1);
}

uint32_t append_ring(MeshData& mesh, const glm::dvec3& foot_m, const Ring& ring, int segments) {
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (int i = 0; i < (ring.radius_m > 0 ? segments : 1); ++i) {
    const glm::dvec2 c = circle_point(static_cast<double>(i) / segments);
    append_point(mesh, foot_m + glm::dvec3(ring.radius_m * c.x, ring.y_m, -ring.radius_m * c.y));
  }
  return first;
}

// Sweeps the profile (bottom to top, points on the axis at both ends) around the upright axis through
// `foot_m`.
void append_lathe(MeshData& mesh, const glm::dvec3& foot_m, const std::vector<Ring>& profile, int segments) {
  const auto n = static_cast<uint32_t>(segments);
  uint32_t low = append_ring(mesh, foot_m, profile[0], segments);
  for (size_t k = 1; k < profile.size(); ++k) {
    const uint32_t high = append_ring(mesh, foot_m, profile[k], segments);
    const bool low_is_point = profile[k - 1].radius_m == 0, high_is_point = profile[k].radius_m == 0;
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t j = (i + 1) % n;
      if (!low_is_point) mesh.indices.insert(mesh.indices.end(), {low + i, low + j, high_is_point ? high : high + j});
      if (!high_is_point) mesh.indices.insert(mesh.indices.end(), {low_is_point ? low : low + i, high + j, high + i});
    }
    low = high;
  }
}

}  // namespace

void append_box(MeshData& mesh, const glm::dvec3& low_m, const glm::dvec3& high_m) {
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (int i = 0; i < 8; ++i)
    append_point(mesh, {i & 1 ? high_m.x : low_m.x, i & 2 ? high_m.y : low_m.y, i & 4 ? high_m.z : low_m.z});
  for (uint32_t corner : {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5,   // -x, +x
                          0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3,   // -y, +y
                          0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6})  // -z, +z
    mesh.indices.push_back(first + corner);
}

void append_quad(MeshData& mesh, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
  const uint32_t i = append_point(mesh, a);
  append_point(mesh, b);
  append_point(mesh, c);
  append_point(mesh, d);
  mesh.indices.insert(mesh.indices.end(), {i, i + 1, i + 2, i, i + 2, i + 3});
}

void append_frustum(MeshData& mesh, const glm::dvec3& foot_m, double foot_radius_m, double top_radius_m,
                    double height_m, int segments) {
  std::vector<Ring> profile{{0, 0}, {foot_radius_m, 0}, {top_radius_m, height_m}};
  if (top_radius_m > 0) profile.push_back({0, height_m});
  append_lathe(mesh, foot_m, profile, segments);
}

void append_capsule(MeshData& mesh, const glm::dvec3& foot_m, double radius_m, double height_m, int segments,
                    int rings) {
  std::vector<Ring> profile;
  for (int k = 0; k <= 2 * rings + 1; ++k) {
    const bool upper = k > rings;
    const glm::dvec2 c = circle_point((upper ? k - rings - 1 : k - rings) / (4.0 * rings));
    const double radius = k == 0 || k == 2 * rings + 1 ? 0.0 : radius_m * c.x;
    profile.push_back({radius, (upper ? height_m - radius_m : radius_m) + radius_m * c.y});
  }
  append_lathe(mesh, foot_m, profile, segments);
}

MeshData standing_box(double width_x_m, double height_m, double depth_z_m) {
  MeshData mesh;
  append_box(mesh, {-width_x_m / 2, 0, -depth_z_m / 2}, {width_x_m / 2, height_m, depth_z_m / 2});
  return mesh;
}

}  // namespace sightline::scenes
