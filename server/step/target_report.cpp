// Describes a target besides its shares: the instances that hide it, its part inside the picture, and its expected
// visibility.
#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "server/step/report.h"

namespace sightline {
namespace {

// ---- occluders ----

struct SlotCount {
  uint32_t slot = 0, points = 0;
};
// Instances that hide points of one target; no target has more sights than this.
using SlotCounts = InlineVector<SlotCount, 64>;

void count_hidden_point(uint32_t slot, SlotCounts& counts) {
  const auto known = std::find_if(counts.begin(), counts.end(), [&](const SlotCount& c) { return c.slot == slot; });
  if (known != counts.end()) return void(++known->points);
  counts.push_back({slot, 1});
}

// ---- the picture ----

// Distance from a sphere's centre to the nearest side of the picture's frustum, in radii, positive inside. From 1 on
// the whole sphere is inside; at -1 and below it is outside.
double inside_radii(const Pose& pose, const Lens& lens, const glm::dvec3& center_m, double radius_m) {
  const glm::dvec3 p = inverse_transform_point(pose, center_m);
  const auto inside_m = [&](double aside, double half_rad) {
    return -p.z * std::sin(half_rad) - std::abs(aside) * std::cos(half_rad);
  };
  const double least_m = std::min(inside_m(p.x, half_horizontal_fov_rad(lens)),
                                  inside_m(p.y, lens.vertical_fov_rad / 2));
  return least_m / std::max(radius_m, 1e-9);
}

// The part of an instance's image that lies inside the picture.
double share_inside(const Pose& pose, const Lens& lens, const Instance& instance, const ExtentTable& table) {
  const double inside = inside_radii(pose, lens, instance.center_m, instance.radius_m);
  if (std::abs(inside) >= 1) return inside > 0 ? 1.0 : 0.0;
  const auto points = table.points(transform_point(inverse(instance.world_from_instance), pose.position_m));
  const auto shown = std::count_if(points.begin(), points.end(), [&](const glm::vec3& p) {
    return in_picture(pose, lens, transform_point(instance.world_from_instance, glm::dvec3(p)));
  });
  return static_cast<double>(shown) / static_cast<double>(points.size());
}

// ---- the forecast ----

bool sees_point(const TakenMaps& taken, const Sampled& sampled, uint32_t point, const glm::dvec3& position_m) {
  const MapRange& maps = sampled.maps_of_point[point];
  return look_up(taken.maps.subspan(maps.first, maps.count), position_m, taken.settings.relative_bias).visible;
}

// The share of the target's points in one list of predicted poses that are visible from the position.
double share_of(const TakenMaps& taken, const Sampled& sampled, size_t target, const glm::dvec3& position_m) {
  const MapRange& points = sampled.points_of_target[target];
  uint32_t seen = 0;
  for (uint32_t k = points.first; k < points.first + points.count; ++k)
    seen += sees_point(taken, sampled, k, position_m);
  return points.count > 0 ? static_cast<double>(seen) / points.count : 0.0;
}

// The time until the share falls below the threshold, if it changes evenly from the present share to the expected one.
std::optional<double> time_of_loss_s(double present, double expected, double threshold, double ahead_s) {
  if (present < threshold || expected >= threshold) return std::nullopt;
  return ahead_s * (present - threshold) / (present - expected);
}

}  // namespace

void list_occlusions(const ReportInput& step, size_t target, TargetSight& sight) {
  const Sampled& now = step.taken.plan.now;
  const MapRange& sights = now.sights_of_target[target];
  SlotCounts counts;
  for (uint32_t k = sights.first; k < sights.first + sights.count; ++k)
    if (step.taken.falls_short_m(k, step.dump.decision.camera.pose.position_m) > 0)
      count_hidden_point(step.taken.maps[now.first_sight + k].occluder_at(0, 0), counts);
  std::sort(counts.begin(), counts.end(), [](const SlotCount& a, const SlotCount& b) {
    return std::tie(b.points, a.slot) < std::tie(a.points, b.slot);
  });
  for (size_t i = 0; i < std::min(counts.size(), kMaxOcclusions); ++i)
    sight.occlusions.push_back(
        {step.input.scene.instances()[counts[i].slot].id, static_cast<double>(counts[i].points) / sights.count});
}

double picture_share(const ReportInput& step, size_t target, const Lens& lens) {
  const Pose& pose = step.dump.decision.camera.pose;
  const std::vector<TargetPiece>& pieces = step.dump.targets.pieces[target];
  const size_t sampled = sampled_pieces(pieces);
  if (sampled == 0) return in_picture(pose, lens, step.dump.targets.tracked_targets[target].aim_m) ? 1.0 : 0.0;
  double all = 0, inside = 0;
  for (const auto& [slot, table] : pieces) {
    if (!table) continue;
    const Instance& instance = step.input.scene.instances()[slot];
    const double share = share_inside(pose, lens, instance, *table);
    if (sampled == 1) return share;
    const glm::dvec3 viewer_mesh_m = transform_point(inverse(instance.world_from_instance), pose.position_m);
    const double area = shown_area(instance, *table, viewer_mesh_m);
    all += area, inside += area * share;
  }
  return all > 0 ? std::min(inside / all, 1.0) : 0.0;
}

std::optional<SightForecast> forecast_sight(const ReportInput& step, size_t target, double present_share) {
  const double ahead_s = step.dump.plan.ahead_s;
  if (ahead_s <= 0) return std::nullopt;
  SightForecast forecast;
  forecast.ahead_s = ahead_s;
  forecast.share = share_of(step.taken, step.taken.plan.ahead, target, step.taken.plan.camera_ahead_m);
  forecast.confidence = past_of(step.pasts, step.dump.targets.ids[target]).predictor.confidence(ahead_s);
  forecast.loss_s = time_of_loss_s(present_share, forecast.share, step.taken.settings.visibility_threshold, ahead_s);
  return forecast;
}

}  // namespace sightline
