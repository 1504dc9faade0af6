// A target: an instance of the mirror that the camera has to keep in view.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

namespace sightline {

inline constexpr size_t kMaxTargets = 32;      // visibility of a candidate is one bit a target in a uint32_t
inline constexpr size_t kMaxTargetParts = 64;  // of one target

struct Target {
  uint64_t instance_id = 0;
  double weight = 1.0;   // >= 0; 0 = switched off: reported, but without influence on the camera
  bool required = true;  // required targets come before optional ones in every fallback, for any weights
  // Where the camera looks and maps are taken from, instance frame, metres. Absent: centre of the bounding box.
  std::optional<glm::dvec3> aim_offset_m;
  uint32_t layer_mask = 0xFFFFFFFF;    // only instances with a layer in this mask occlude the target
  std::vector<uint64_t> attached_ids;  // instances that are part of it (shield, vehicle): never occlude it
  std::vector<uint64_t> ignored_ids;   // instances that never occlude this target, including other targets' own
  // Further instances that its body consists of (capsules on bones): judged like its own instance, and never occlude
  // it. At most kMaxTargetParts. Those that the mirror does not hold, or that are not visible, do not count.
  std::vector<uint64_t> part_ids;
};

// A target as a step uses it: its position and size in the scene of this step, and its weight.
struct TrackedTarget {
  glm::dvec3 aim_m{0.0};  // the point to look at, world
  double radius_m = 0.0;  // of its bounding sphere; with parts, of a sphere around aim_m that encloses them too
  // Its body from aim_m, metres: down to the lowest and up to the highest point, and out to the sides. All 0: only the
  // sphere is known.
  double low_m = 0.0, high_m = 0.0, aside_m = 0.0;
  glm::dvec3 velocity_mps{0.0};  // world
  double weight = 1.0;           // as Target::weight
  bool required = true;          // as Target::required
  // Where its aim point is wanted in the picture (halves of it, right and up of the middle). While some target has such
  // a place, the others do not count for the aim.
  std::optional<glm::dvec2> place = {};
  bool steered() const { return weight > 0; }
  bool has_body() const { return low_m + high_m > 0 || aside_m > 0; }
};

}  // namespace sightline
