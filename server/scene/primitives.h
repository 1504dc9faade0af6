// Shapes without a mesh: box, sphere, capsule, cylinder, and bodies of several of them. They become ordinary triangle
// geometry, so that both samplers, the clearance query and the truth renderer see the same surface.
//
// Every shape is centred on the origin of its own frame; the long axis of capsule and cylinder is +Y. Round shapes are
// inscribed polyhedra with vertices on the true surface (32 segments around). The distance between the true and the
// tessellated surface is under 1 % of the radius.
#pragma once

#include <span>
#include <variant>

#include "server/base/transform.h"
#include "server/scene/geometry.h"

namespace sightline {

struct BoxShape {
  glm::vec3 half_extent_m{0.5f};
};
struct SphereShape {
  float radius_m = 0.5f;
};
// Total height is 2 * (half_height_m + radius_m): half_height_m reaches from the centre to a cap's centre.
struct CapsuleShape {
  float radius_m = 0.5f;
  float half_height_m = 0.5f;
};
struct CylinderShape {
  float radius_m = 0.5f;
  float half_height_m = 0.5f;
};
using Shape = std::variant<BoxShape, SphereShape, CapsuleShape, CylinderShape>;

// Tessellates `shape`, outward facing counter-clockwise. Fails (kInvalidArgument, field = the parameter's
// name) on a size that is not finite or outside [1e-4, 1e5] m (half_height_m of a capsule may also be 0).
Result<MeshData> tessellate(const Shape& shape);

// A shape and its place in a body.
struct PlacedShape {
  Shape shape;
  Pose body_from_shape;
};

// The shapes as one mesh, in the frame of the body. Shapes that overlap keep their inner surfaces. Fails as above for
// the first wrong shape, field = "[i].radius_m" and so on.
Result<MeshData> tessellate(std::span<const PlacedShape> shapes);

}  // namespace sightline
