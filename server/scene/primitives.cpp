#include "server/scene/primitives.h"

#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr int kSegments = 32;                    // around the axis
constexpr int kRingsPerQuarter = kSegments / 4;  // from pole to equator: facets about as high as wide

// A point of a profile in the half-plane through the axis. Radius 0 is a pole: one vertex.
struct ProfilePoint {
  double radius_m;
  double y_m;
};

Status check_size(const char* field, float value_m) {
  if (value_m >= 1e-4f && value_m <= 1e5f) return {};  // false for NaN too
  return invalid(field, "must lie in [1e-4, 1e5] m");
}

// Appends the ring (or pole) of one profile point.
void add_ring(const ProfilePoint& point, std::vector<glm::vec3>& positions) {
  const int count = point.radius_m > 0 ? kSegments : 1;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / kSegments;
    positions.emplace_back(point.radius_m * std::cos(angle), point.y_m, -point.radius_m * std::sin(angle));
  }
}

// Triangles between two consecutive rings; either may be a pole.
void add_band(uint32_t low, bool low_is_pole, uint32_t high, bool high_is_pole, std::vector<uint32_t>& indices) {
  for (uint32_t i = 0; i < kSegments; ++i) {
    const uint32_t j = (i + 1) % kSegments;
    if (!low_is_pole) indices.insert(indices.end(), {low + i, low + j, high_is_pole ? high : high + j});
    if (!high_is_pole) indices.insert(indices.end(), {low_is_pole ? low : low + i, high + j, high + i});
  }
}

// The surface swept by turning `profile` (bottom to top, both ends poles) about the y axis.
MeshData revolve(const std::vector<ProfilePoint>& profile) {
  MeshData mesh;
  uint32_t previous = 0;
  for (size_t k = 0; k < profile.size(); ++k) {
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    add_ring(profile[k], mesh.positions);
    if (k > 0) add_band(previous, profile[k - 1].radius_m == 0, first, profile[k].radius_m == 0, mesh.indices);
    previous = first;
  }
  return mesh;
}

// Two quarter circles, `half_height_m` above and below the origin; one equator when that is 0.
MeshData revolve_capsule(double radius_m, double half_height_m) {
  std::vector<ProfilePoint> profile;
  for (int side : {-1, 1})
    for (int k = 0; k <= kRingsPerQuarter; ++k) {
      if (side == 1 && k == 0 && half_height_m == 0) continue;
      const int from_equator = side < 0 ? kRingsPerQuarter - k : k;
      const double latitude = std::numbers::pi / 2 * from_equator / kRingsPerQuarter;
      const double ring = from_equator == kRingsPerQuarter ? 0.0 : radius_m * std::cos(latitude);
      profile.push_back({ring, side * (half_height_m + radius_m * std::sin(latitude))});
    }
  return revolve(profile);
}

Result<MeshData> make(const BoxShape& box) {
  for (int axis = 0; axis < 3; ++axis)
    if (Status ok = check_size("half_extent_m", box.half_extent_m[axis]); !ok) return tl::unexpected(ok.error());
  MeshData mesh;
  // Corner number: bit 0 = +x, bit 1 = +y, bit 2 = +z.
  for (int i = 0; i < 8; ++i)
    mesh.positions.push_back(box.half_extent_m * glm::vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
  mesh.indices = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5,   // -x, +x
                  0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3,   // -y, +y
                  0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};  // -z, +z
  return mesh;
}

Result<MeshData> make(const SphereShape& sphere) {
  if (Status ok = check_size("radius_m", sphere.radius_m); !ok) return tl::unexpected(ok.error());
  return revolve_capsule(sphere.radius_m, 0.0);
}

Result<MeshData> make(const CapsuleShape& capsule) {
  if (Status ok = check_size("radius_m", capsule.radius_m); !ok) return tl::unexpected(ok.error());
  if (capsule.half_height_m != 0)
    if (Status ok = check_size("half_height_m", capsule.half_height_m); !ok) return tl::unexpected(ok.error());
  return revolve_capsule(capsule.radius_m, capsule.half_height_m);
}

Result<MeshData> make(const CylinderShape& cylinder) {
  if (Status ok = check_size("radius_m", cylinder.radius_m); !ok) return tl::unexpected(ok.error());
  if (Status ok = check_size("half_height_m", cylinder.half_height_m); !ok) return tl::unexpected(ok.error());
  const double r = cylinder.radius_m, h = cylinder.half_height_m;
  return revolve({{0, -h}, {r, -h}, {r, h}, {0, h}});
}

}  // namespace

Result<MeshData> tessellate(const Shape& shape) {
  return std::visit([](const auto& s) { return make(s); }, shape);
}

Result<MeshData> tessellate(std::span<const PlacedShape> shapes) {
  MeshData body;
  for (size_t i = 0; i < shapes.size(); ++i) {
    const auto part = tessellate(shapes[i].shape);
    if (!part) return fail(part.error().code, indexed("", i) + '.' + part.error().field, part.error().message);
    const auto first = static_cast<uint32_t>(body.positions.size());
    const Pose& place = shapes[i].body_from_shape;
    for (const glm::vec3& p : part->positions)
      body.positions.emplace_back(place.position_m + place.rotation * glm::dvec3(p));
    for (const uint32_t index : part->indices) body.indices.push_back(first + index);
  }
  return body;
}

}  // namespace sightline
