// Truth: what a camera really sees and touches, by rays, pixel by pixel (design 9).
//
// A picture is `size` x `size` samples spread evenly over the lens's picture, whatever its aspect: sample (x,
// y), y from the bottom, is the ray through the window point
//   ((2 (x + 0.5) / size - 1) aspect tan(fov / 2), (2 (y + 0.5) / size - 1) tan(fov / 2)) on the plane z =
//   -1,
// and sees what lies beyond the near plane. A "pixel" below is one such sample. For each target
//   alone pixels    those whose ray meets the target when nothing else is drawn: what it would cover alone;
//   visible pixels  those of them where nothing that occludes the target is nearer.
// Pixels are counted within the picture: a target that is wholly outside has neither, and counts as not
// visible (share 0); one that the picture's edge cuts is judged by the part inside. Other targets occlude. A
// target that does not occlude (Instance::occludes) is never drawn and has no pixels.
//
// A frame then is
//   r_N  fully hidden: no pixel of any target is visible;
//   r_P  partly hidden: not r_N, and some target has a hidden pixel or no pixel at all; with tolerance 5 %:
//   some
//        target has more than 5 % of its pixels hidden, or none.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/base/camera.h"
#include "server/sample/embree_scene.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"

namespace sightline {

inline constexpr int kTruthSize = 512;
inline constexpr double kPartialTolerance = 0.05;

struct TargetTruth {
  uint64_t id = 0;
  uint32_t alone_pixels = 0;
  uint32_t visible_pixels = 0;
  bool in_frame = false;  // the centre of its bounding sphere projects into the picture

  // visible / alone; 0 when there is no pixel.
  double visible_share() const {
    return alone_pixels == 0 ? 0.0 : static_cast<double>(visible_pixels) / alone_pixels;
  }
};

struct PictureTruth {
  std::vector<TargetTruth> targets;  // in the order asked for

  bool fully_hidden() const;                         // r_N; false without targets
  bool partly_hidden(double tolerance = 0.0) const;  // r_P
  // Every target has a visible pixel.
  bool all_seen() const;
};

// `occluders` must have taken in `mirror` and be of EmbreeScene::Content::kOccluders. Thread-safe on one
// scene.
PictureTruth measure_picture(const EmbreeScene& occluders, const SceneMirror& mirror, std::span<const Target> targets,
                  const Pose& world_from_camera, const Lens& lens, int size = kTruthSize);

// World direction, one unit of depth long, through sample (x, y) of `columns` x `rows`.
glm::dvec3 sample_direction(const Pose& world_from_camera, const Lens& lens, double x, double y, int columns,
                            int rows);

// The samples that a sphere can cover: a rectangle, empty (x0 == x1) when it is outside the picture.
struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // [x0, x1) x [y0, y1)
};
PixelBox sphere_pixels(const Pose& world_from_camera, const Lens& lens, const glm::dvec3& center_m,
                       double radius_m, int columns, int rows);

// Where the body stands: the distance to the nearest collider (kReachM when none is nearer) and whether a
// collider lies across the straight way from `before_m`, so that passing through a wall is seen even from
// outside to outside.
struct BodyTruth {
  static constexpr float kReachM = 10.0f;
  float clearance_m = kReachM;
  bool crossed = false;
  bool touches(double body_radius_m) const { return crossed || clearance_m < body_radius_m; }
};
// `colliders` of EmbreeScene::Content::kColliders.
BodyTruth measure_body(const EmbreeScene& colliders, const glm::dvec3& before_m, const glm::dvec3& now_m);

}  // namespace sightline
