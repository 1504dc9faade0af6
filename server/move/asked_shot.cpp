#include "server/move/asked_shot.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/base/inline_vector.h"

namespace sightline {
namespace {

constexpr double kVertical = 1e-6;
constexpr double kNearestM = 1e-3, kFarthestM = 1e9;
// Of the interval in which the distance for a size is looked for.
constexpr int kHalvings = 50;

glm::dvec3 forward_of(double yaw_rad) {
  return {-std::sin(yaw_rad), 0, -std::cos(yaw_rad)};
}

glm::dvec3 right_of(const glm::dvec3& forward) {
  return {-forward.z, 0, forward.x};
}

// The bodies as a camera sees them: the lower and the upper end of each, as boxes in planes at right angles to its
// view.
class SubjectBoxes {
 public:
  SubjectBoxes(std::span<const TrackedTarget> subjects, const glm::dvec3& center_m, const PlaceInFrame& place,
               double frame_yaw_rad) {
    const glm::dvec3 direction = offset_in_frame({place.side_rad, place.height_rad, 1.0}, frame_yaw_rad);
    const glm::dvec3 right = glm::cross(glm::dvec3(0, 1, 0),
                                        offset_in_frame({place.side_rad, 0.0, 1.0}, frame_yaw_rad));
    const glm::dvec3 up = glm::cross(direction, right);
    const auto add = [&](const glm::dvec3& at_m, double aside_m, double above_m) {
      const double x_m = glm::dot(at_m, right), y_m = glm::dot(at_m, up);
      boxes_.push_back({x_m - aside_m, x_m + aside_m, y_m - above_m, y_m + above_m, glm::dot(at_m, direction)});
    };
    for (const TrackedTarget& subject : subjects) {
      const glm::dvec3 at_m = subject.aim_m - center_m;
      if (!subject.has_body()) {
        add(at_m, subject.radius_m, subject.radius_m);
        continue;
      }
      for (const double end_m : {-subject.low_m, subject.high_m})
        add(at_m + glm::dvec3(0, end_m, 0), subject.aside_m, subject.aside_m * std::abs(direction.y));
    }
  }
  // Of the box nearest to the camera, from the centre towards it.
  double nearest_m() const {
    double nearest_m = -kFarthestM;
    for (const Box& box : boxes_) nearest_m = std::max(nearest_m, box.towards_m);
    return nearest_m;
  }
  double size_from(double distance_m, const Lens& lens) const {
    double left = kFarthestM, right = -kFarthestM, low = kFarthestM, high = -kFarthestM;
    for (const Box& box : boxes_) {
      const double depth_m = distance_m - box.towards_m;
      left = std::min(left, box.left_m / depth_m), right = std::max(right, box.right_m / depth_m);
      low = std::min(low, box.low_m / depth_m), high = std::max(high, box.high_m / depth_m);
    }
    const double top = 2 * std::tan(lens.vertical_fov_rad / 2);
    return std::max((high - low) / top, (right - left) / (top * lens.aspect));
  }

 private:
  struct Box {
    double left_m = 0, right_m = 0, low_m = 0, high_m = 0, towards_m = 0;
  };
  InlineVector<Box, 2 * kMaxTargets> boxes_;
};

}  // namespace

std::optional<double> yaw_of(const glm::dvec3& direction) {
  const double level = std::hypot(direction.x, direction.z);
  if (!(level > kVertical * glm::length(direction)) || !(level > 0)) return std::nullopt;
  return std::atan2(-direction.x, -direction.z);
}

glm::dvec3 offset_in_frame(const PlaceInFrame& place, double frame_yaw_rad) {
  const glm::dvec3 forward = forward_of(frame_yaw_rad);
  const glm::dvec3 level = std::cos(place.side_rad) * forward + std::sin(place.side_rad) * right_of(forward);
  return place.distance_m * (std::cos(place.height_rad) * level + glm::dvec3(0, std::sin(place.height_rad), 0));
}

PlaceInFrame place_in_frame(const glm::dvec3& offset_m, double frame_yaw_rad) {
  const glm::dvec3 forward = forward_of(frame_yaw_rad);
  PlaceInFrame place;
  place.distance_m = glm::length(offset_m);
  place.height_rad = std::atan2(offset_m.y, std::hypot(offset_m.x, offset_m.z));
  if (yaw_of(offset_m)) place.side_rad = std::atan2(glm::dot(offset_m, right_of(forward)), glm::dot(offset_m, forward));
  return place;
}

double first_side_rad(const AskedShot& asked, double now_rad) {
  if (!asked.side_rad) return now_rad;
  const auto away_rad = [&](double side_rad) {
    return std::abs(std::remainder(side_rad - now_rad, 2 * std::numbers::pi));
  };
  return asked.either_side && away_rad(-*asked.side_rad) < away_rad(*asked.side_rad) ? -*asked.side_rad
                                                                                     : *asked.side_rad;
}

PlaceInFrame blend(const PlaceInFrame& from, const PlaceInFrame& to, double share) {
  const double t = std::clamp(share, 0.0, 1.0), eased = t * t * (3 - 2 * t);
  if (t >= 1) return to;
  PlaceInFrame between;
  between.side_rad = from.side_rad + eased * std::remainder(to.side_rad - from.side_rad, 2 * std::numbers::pi);
  between.height_rad = std::lerp(from.height_rad, to.height_rad, eased);
  // In equal steps of size.
  between.distance_m = std::exp(
      std::lerp(std::log(std::max(from.distance_m, kNearestM)), std::log(std::max(to.distance_m, kNearestM)), eased));
  return between;
}

double distance_for_size_m(double size, std::span<const TrackedTarget> subjects, const glm::dvec3& center_m,
                           const PlaceInFrame& place, double frame_yaw_rad, const Lens& lens) {
  const SubjectBoxes boxes(subjects, center_m, place, frame_yaw_rad);
  // The size falls with the distance.
  double near_m = std::max(boxes.nearest_m(), 0.0) + kNearestM, far_m = near_m + 1;
  while (boxes.size_from(far_m, lens) > size && far_m < kFarthestM) far_m *= 2;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle_m = (near_m + far_m) / 2;
    (boxes.size_from(middle_m, lens) > size ? near_m : far_m) = middle_m;
  }
  return far_m;
}

}  // namespace sightline
