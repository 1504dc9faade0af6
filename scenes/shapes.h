// Low-polygon meshes, appended to one another so that a column with its plinth is one mesh. Faces are outward
// facing, counter-clockwise; every coordinate is a multiple of 1/1024 m.
#pragma once

#include <glm/glm.hpp>

#include "server/scene/geometry.h"

namespace sightline::scenes {

// 12 triangles.
void append_box(MeshData& mesh, const glm::dvec3& low_m, const glm::dvec3& high_m);
// The four corners in counter-clockwise order seen from the front; 2 triangles.
void append_quad(MeshData& mesh, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d);
// An upright closed cylinder or cone frustum standing on `foot_m`; a radius of 0 at the top makes a cone.
void append_frustum(MeshData& mesh, const glm::dvec3& foot_m, double foot_radius_m, double top_radius_m,
                    double height_m, int segments);
// An upright capsule standing on `foot_m`, `height_m` in all; 2 * rings bands of triangles.
void append_capsule(MeshData& mesh, const glm::dvec3& foot_m, double radius_m, double height_m, int segments,
                    int rings);

// Convenience: a mesh of one box centred on the origin in x and z, standing on y = 0.
MeshData standing_box(double width_x_m, double height_m, double depth_z_m);

}  // namespace sightline::scenes
