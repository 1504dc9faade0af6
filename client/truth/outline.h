// How much of a body's outline a picture holds, whether anything hides it or not. A picture that cuts a body off at its
// edge shows only a part of it. truth.h counts how much of that part is hidden; the outline counts how much of the body
// is left out.
#pragma once

#include <cstdint>
#include <span>

#include "server/base/camera.h"
#include "server/sample/embree_scene.h"
#include "server/scene/mirror.h"

namespace sightline {

struct Outline {
  // The share of the outline, in solid angle as seen from the eye, that lies in the picture and beyond the near plane.
  // [0, 1]
  double in_picture_share = 0.0;
  // From the lowest to the highest point of the outline, in picture heights, also outside of the picture. Parts behind
  // the eye do not count.
  double height_pictures = 0.0;
};

// `body_slots`: the mirror slots of the instances that make up the body, at least one. The outline is found by
// kOutlineRays rays, evenly spread over the cone that holds the body's bounding spheres. Thread-safe. The scene must
// have taken in the mirror of `instances`.
inline constexpr int kOutlineRays = 1500;
Outline measure_outline(const EmbreeScene& scene, std::span<const Instance> instances,
                        std::span<const uint32_t> body_slots, const Pose& world_from_camera, const Lens& lens);

}  // namespace sightline
