// Ground truth: what a camera really sees and touches, found by rays, pixel by pixel (design 9).
//
// A picture has `size` x `size` samples, spread evenly over the lens's picture at any aspect ratio. Sample (x, y), with
// y counted from the bottom, is the ray through this point of the plane z = -1:
//   ((2 (x + 0.5) / size - 1) aspect tan(fov / 2), (2 (y + 0.5) / size - 1) tan(fov / 2))
// It sees what lies beyond the near plane. Below, a "pixel" is one such sample. Each target has two counts:
//   Alone pixels    pixels that the target would cover if nothing else were drawn.
//   Visible pixels  those alone pixels at which no occluder is nearer than the target.
// The pixels of a target with parts (Target::part_ids) are those of its whole body. Only pixels inside the picture
// count. A target that is wholly outside has no pixels and a visible share of 0; the visible share of a target that the
// picture's edge cuts is of the part inside. add_outlines finds how much of its outline lies inside. A target is shown
// whole if both shares are at least 95 %. Other targets occlude. A target that does not occlude (Instance::occludes) is
// never drawn and has no pixels.
//
// A frame is classified as in the paper:
//   r_N  fully hidden: no pixel of any target is visible.
//   r_P  partly hidden: not r_N, and some target has a hidden pixel or no pixel at all. With a tolerance of 5 %, some
//   target has
//        more than 5 % of its pixels hidden, or no pixel.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "client/truth/outline.h"
#include "server/base/camera.h"
#include "server/sample/embree_scene.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"

namespace sightline {

inline constexpr int kTruthSize = 512;
inline constexpr double kPartialTolerance = 0.05;
inline constexpr double kLeastOfWhole = 0.95;

struct TargetTruth {
  uint64_t id = 0;
  uint32_t alone_pixels = 0;
  uint32_t visible_pixels = 0;
  bool in_frame = false;  // the centre of its bounding sphere projects into the picture
  Outline outline = {};   // of its whole body; all 0 before add_outlines, and for a target without a pixel

  // visible / alone; 0 when there is no pixel.
  double visible_share() const { return alone_pixels == 0 ? 0.0 : static_cast<double>(visible_pixels) / alone_pixels; }
  // After add_outlines: the share of its whole body that the picture shows, neither hidden nor cut off at the edge.
  double whole_share() const { return visible_share() * outline.in_picture_share; }
  bool shown_whole() const { return visible_share() >= kLeastOfWhole && outline.in_picture_share >= kLeastOfWhole; }
};

struct PictureTruth {
  std::vector<TargetTruth> targets;  // in the order asked for

  bool fully_hidden() const;                         // r_N; false without targets
  bool partly_hidden(double tolerance = 0.0) const;  // r_P
  // Every target has a visible pixel.
  bool all_seen() const;
  // After add_outlines: every target is shown whole.
  bool all_whole() const;
  // After add_outlines: the whole_share of the target that is shown least; 1 without targets.
  double least_whole_share() const;
};

// Takes a picture of `size` x `size` samples. `occluders` must have taken in `mirror` and have
// EmbreeScene::Content::kOccluders. Several threads may use one scene.
PictureTruth measure_picture(const EmbreeScene& occluders, const SceneMirror& mirror, std::span<const Target> targets,
                             const Pose& world_from_camera, const Lens& lens, int size = kTruthSize);

// Sets the outlines of the picture's targets, which must be `targets` in their order, seen from the same camera. It
// takes kOutlineRays rays for each part of a target.
void add_outlines(const EmbreeScene& occluders, const SceneMirror& mirror, std::span<const Target> targets,
                  const Pose& world_from_camera, const Lens& lens, PictureTruth& picture);

// The world direction through sample (x, y) of `columns` x `rows`, scaled to one unit of depth.
glm::dvec3 sample_direction(const Pose& world_from_camera, const Lens& lens, double x, double y, int columns, int rows);

// The rectangle of samples that a sphere can cover; empty (x0 == x1) when the sphere is outside the picture.
struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // [x0, x1) x [y0, y1)
};
PixelBox sphere_pixels(const Pose& world_from_camera, const Lens& lens, const glm::dvec3& center_m, double radius_m,
                       int columns, int rows);

// The camera body against the colliders.
struct BodyTruth {
  static constexpr float kReachM = 10.0f;
  float clearance_m = kReachM;  // distance to the nearest collider, at most kReachM
  // a collider lies across the straight line from the last position: the body passed through it
  bool crossed = false;
  bool touches(double body_radius_m) const { return crossed || clearance_m < body_radius_m; }
};
// `colliders` must have EmbreeScene::Content::kColliders.
BodyTruth measure_body(const EmbreeScene& colliders, const glm::dvec3& before_m, const glm::dvec3& now_m);

}  // namespace sightline
