#include "client/truth/asked_frames.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace sightline {
namespace {

constexpr double kTravelsMps = 0.3;

// The body as its upright bounding box in the world.
TrackedTarget body_of(const Instance& instance) {
  const Aabb& box = instance.geometry->bounds;
  glm::dvec3 low_m(INFINITY), high_m(-INFINITY);
  for (int k = 0; k < 8; ++k) {
    const glm::dvec3 corner(k & 1 ? box.max.x : box.min.x, k & 2 ? box.max.y : box.min.y,
                            k & 4 ? box.max.z : box.min.z);
    const glm::dvec3 at_m = transform_point(instance.world_from_instance, corner);
    low_m = glm::min(low_m, at_m), high_m = glm::max(high_m, at_m);
  }
  const glm::dvec3 aim_m = aim_point_m(instance), half_m = (high_m - low_m) / 2.0;
  return {.aim_m = aim_m,
          .radius_m = instance.radius_m,
          .low_m = aim_m.y - low_m.y,
          .high_m = high_m.y - aim_m.y,
          .aside_m = std::max(half_m.x, half_m.z)};
}

class AskedFrames {
 public:
  AskedFrames(const AskedShot& shot, ScenarioWorld& world) : shot_(shot), world_(world) {
    if (shot.places.empty()) return;
    for (const PicturePlace& place : shot.places)
      place_ += place.half_pictures / static_cast<double>(shot.places.size());
  }

  FrameShot at(const CameraFrame& frame) {
    world_.set_time(frame.time_s);
    turn(frame.time_s);
    const std::vector<TrackedTarget> subjects = subjects_now();
    const glm::dvec3 middle_m = middle_of(subjects), camera_m = frame.camera.position_m;
    if (!begun_) begun_ = true, first_s_ = frame.time_s, first_place_ = place_in_frame(camera_m - middle_m, yaw_rad_);
    FrameShot shot;
    shot.now = shot_from(camera_m - middle_m, frame.lens.vertical_fov_rad);
    shot.now.place_half_pictures = shot_properties(frame, world_.targets_center_m()).place_half_pictures;
    shot.asked = shot_from(offset_in_frame(place_at(frame, subjects, middle_m), yaw_rad_), frame.lens.vertical_fov_rad);
    shot.asked.place_half_pictures = place_;
    return shot;
  }

 private:
  std::vector<TrackedTarget> subjects_now() const {
    std::vector<TrackedTarget> subjects;
    for (const uint64_t id : shot_.subject_ids)
      if (const Instance* instance = world_.mirror().find(id)) subjects.push_back(body_of(*instance));
    if (!subjects.empty()) return subjects;
    for (const Target& target : world_.targets())
      subjects.push_back(body_of(*world_.mirror().find(target.instance_id)));
    return subjects;
  }
  glm::dvec3 middle_of(std::span<const TrackedTarget> subjects) const {
    const bool named = std::any_of(shot_.subject_ids.begin(), shot_.subject_ids.end(),
                                   [&](uint64_t id) { return world_.mirror().find(id) != nullptr; });
    if (!named) return world_.targets_center_m();
    glm::dvec3 sum_m(0.0);
    for (const TrackedTarget& subject : subjects) sum_m += subject.aim_m / static_cast<double>(subjects.size());
    return sum_m;
  }

  const Instance* frame_instance() const {
    if (shot_.frame_id != 0) return world_.mirror().find(shot_.frame_id);
    for (const uint64_t id : shot_.subject_ids)
      if (const Instance* instance = world_.mirror().find(id)) return instance;
    return world_.mirror().find(world_.targets().front().instance_id);
  }
  // Where nothing gives a direction, the former one stays.
  void turn(double time_s) {
    const std::optional<double> now_rad = direction_now(time_s);
    if (now_rad) yaw_rad_ = *now_rad;
  }
  std::optional<double> direction_now(double time_s) {
    if (shot_.frame == ShotFrame::kWorld) return yaw_of(shot_.front);
    const Instance* instance = frame_instance();
    if (!instance) return std::nullopt;
    if (shot_.frame == ShotFrame::kHeading) return yaw_of(instance->pose.rotation * shot_.front);
    if (shot_.frame == ShotFrame::kTravel) return direction_of_travel(*instance, time_s);
    const Instance* end = world_.mirror().find(shot_.line_to_id);
    return end ? yaw_of(end->center_m - instance->center_m) : std::nullopt;
  }
  std::optional<double> direction_of_travel(const Instance& instance, double time_s) {
    const std::optional<Seen> before = std::exchange(seen_, Seen{time_s, instance.center_m});
    if (!before) return yaw_of(instance.pose.rotation * shot_.front);
    glm::dvec3 way_m = instance.center_m - before->center_m;
    way_m.y = 0;
    return glm::length(way_m) > kTravelsMps * (time_s - before->time_s) ? yaw_of(way_m) : std::nullopt;
  }

  PlaceInFrame place_at(const CameraFrame& frame, std::span<const TrackedTarget> subjects,
                        const glm::dvec3& middle_m) const {
    PlaceInFrame place{first_side_rad(shot_, first_place_.side_rad), shot_.height_rad.value_or(first_place_.height_rad),
                       shot_.distance_m.value_or(first_place_.distance_m)};
    place.side_rad += shot_.orbit_radps * (frame.time_s - first_s_);
    if (shot_.size)
      place.distance_m = distance_for_size_m(*shot_.size, subjects, middle_m, place, yaw_rad_, frame.lens);
    return place;
  }

  const AskedShot& shot_;
  ScenarioWorld& world_;
  glm::dvec2 place_{0.0};
  double yaw_rad_ = 0.0;
  bool begun_ = false;  // the first frame has given the next two
  double first_s_ = 0.0;
  PlaceInFrame first_place_;  // of the camera
  struct Seen {
    double time_s = 0.0;
    glm::dvec3 center_m{0.0};
  };
  std::optional<Seen> seen_;  // the frame's instance at the frame before
};

}  // namespace

std::vector<FrameShot> shots_as_asked(const AskedShot& shot, ScenarioWorld& world,
                                      std::span<const CameraFrame> frames) {
  AskedFrames asked(shot, world);
  std::vector<FrameShot> shots;
  for (const CameraFrame& frame : frames) shots.push_back(asked.at(frame));
  return shots;
}

}  // namespace sightline
