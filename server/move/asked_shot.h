// The shot that a client asks for (contract: Shot in shot.proto), and its place relative to its subjects.
//
// A shot is measured in a frame: a horizontal direction, given by its yaw. Its side is the azimuth of the camera from
// that direction, seen from the middle of the subjects; positive is to the right of somebody who faces along the
// direction.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/base/camera.h"
#include "server/scene/target.h"

namespace sightline {

inline constexpr size_t kMaxShotSubjects = 32, kMaxShotPlaces = 32;

enum class ShotFrame { kWorld, kHeading, kTravel, kLine };

// Where the aim point of a target is wanted: from the middle of the picture, right and up, in halves of the picture.
struct PicturePlace {
  uint64_t id = 0;  // 0: all targets
  glm::dvec2 half_pictures{0.0};
};

// Empty values are taken from the camera's pose when the shot begins. Canonical units.
struct AskedShot {
  uint64_t number = 0;  // grows with every shot that the client sends; 0: it has sent none
  std::vector<uint64_t> subject_ids;
  ShotFrame frame = ShotFrame::kWorld;
  uint64_t frame_id = 0, line_to_id = 0;
  glm::dvec3 front{0, 0, 1};  // of instances and of the world; not vertical
  std::optional<double> side_rad, height_rad;
  bool either_side = false;  // -side_rad is as good: the nearer one to the camera when the shot begins is taken
  double orbit_radps = 0.0;
  std::optional<double> distance_m, size;  // at most one of them
  std::vector<PicturePlace> places;
  std::optional<glm::dvec2> dead_zone;  // half pictures by axis, [0, 0.9]; empty: FramingSettings::dead_zone for both
  glm::dvec2 soft_zone{0.0};            // the same, [0.02, 2] and over dead_zone; 0: none
  double lead_room = 0.0;               // share of half the picture's width, [0, 0.9]
  bool lead_by_heading = false;         // by where the subject faces, not by where it goes
  double roll_rad = 0.0;                // as ViewAngles::roll_rad, within +-pi/4
  double min_vertical_fov_rad = 0.0, max_vertical_fov_rad = 0.0;  // the lens range; 0: the settings give it
  double weight = 1.0;                                            // factor of MoveSettings::keep_shot, [0, 10]
  double tolerance = 1.0;  // how wide the free bands of its properties are (picture_worth.h), [0, 3]
  bool cut = false;
  double blend_s = 0.0;
};

// Yaw of a direction, so that the direction (0, 0, -1) has yaw 0 and (-1, 0, 0) has pi/2; empty for a vertical one.
std::optional<double> yaw_of(const glm::dvec3& direction);

// A camera's place in a frame.
struct PlaceInFrame {
  double side_rad = 0.0, height_rad = 0.0, distance_m = 0.0;
};
// The offset from the middle of the subjects to the camera, world axes, in a frame of this yaw; and back. From right
// above or below, the side is 0.
glm::dvec3 offset_in_frame(const PlaceInFrame& place, double frame_yaw_rad);
PlaceInFrame place_in_frame(const glm::dvec3& offset_m, double frame_yaw_rad);
// The side of a shot that begins while the camera is at the side `now_rad`. It is `now_rad` where the client sent none.
// With either_side it is the sent side or its mirror image, whichever is nearer to `now_rad`.
double first_side_rad(const AskedShot& asked, double now_rad);
// From `from` (share 0) to `to` (share 1) along the shorter way round. The share is eased: the way begins and ends
// gently.
PlaceInFrame blend(const PlaceInFrame& from, const PlaceInFrame& to, double share);

// The distance from `center_m`, at the angles of `place` in a frame of this yaw, from which the bodies of these
// subjects have this size in the picture: the greater of their height and their width, each as a share of the
// picture's. At least one subject.
double distance_for_size_m(double size, std::span<const TrackedTarget> subjects, const glm::dvec3& center_m,
                           const PlaceInFrame& place, double frame_yaw_rad, const Lens& lens);

}  // namespace sightline
