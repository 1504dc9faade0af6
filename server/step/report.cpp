#include "server/step/report.h"

#include <algorithm>

namespace sightline {
namespace {

// True if the point of a sight is visible in the picture. Occluders before the near plane are not drawn, so they do not
// hide it.
bool shows(const TakenMaps& taken, uint32_t sight, const Pose& pose, const Lens& lens) {
  const glm::dvec3 to_point = glm::normalize(taken.plan.now.sights_m[sight] - pose.position_m);
  const double along_axis = glm::dot(to_point, pose.rotation * glm::dvec3(0, 0, -1));
  return taken.falls_short_m(sight, pose.position_m) * along_axis < lens.near_m;
}

// Counts only the points inside the picture, because the rest of the target has no pixels there.
void remember_share(const TakenMaps& taken, size_t target, const Pose& pose, const Lens& lens, ShareWindow& shares) {
  const MapRange& sights = taken.plan.now.sights_of_target[target];
  uint32_t seen = 0, inside = 0;
  for (uint32_t k = sights.first; k < sights.first + sights.count; ++k) {
    if (!in_picture(pose, lens, taken.plan.now.sights_m[k])) continue;
    ++inside;
    seen += shows(taken, k, pose, lens);
  }
  shares.add(target, seen, inside);
}

bool contains(const TargetIds& ids, uint64_t id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

TargetSight sight_of(const ReportInput& step, size_t target, const Lens& lens, const ShareWindow& shares) {
  const StepDump& dump = step.dump;
  const Pose& pose = dump.decision.camera.pose;
  const glm::dvec3 aim_m = dump.targets.tracked_targets[target].aim_m;
  const OwnSight own = own_sight(step.taken, target, pose.position_m);
  TargetSight sight;
  sight.id = dump.targets.ids[target];
  sight.visible_share = own.share();
  sight.filtered_share = shares.share(target).value_or(own.share());
  sight.picture_share = picture_share(step, target, lens);
  sight.filtered_visible = dump.decision.cut ? own.seen > 0 : step.seen >> target & 1u;
  sight.in_picture = in_picture(pose, lens, aim_m);
  sight.given_up = contains(step.given_up, sight.id) || contains(dump.decision.not_aimed_at, sight.id);
  sight.distance_m = glm::distance(pose.position_m, aim_m);
  list_occlusions(step, target, sight);
  sight.forecast = forecast_sight(step, target, sight.filtered_share);
  return sight;
}

StepResult result_of(const StepInput& input, const StepDump& dump) {
  StepResult result;
  result.camera = dump.decision.camera;
  result.vertical_fov_rad = dump.decision.vertical_fov_rad;
  result.reason = dump.decision.reason;
  result.courses = dump.decision.courses;
  result.volume = dump.plan.pair.used ? Volume::kPair : Volume::kLattice;
  result.pair_asked = dump.plan.pair.asked;
  result.pair_needs_two = dump.plan.pair.needs_two;
  result.pair_needs_lattice = dump.plan.pair.needs_lattice;
  result.pair_gap = dump.plan.pair.gap;
  result.chosen_candidate = dump.decision.chosen_candidate;
  result.cut = dump.decision.cut;
  const BrokenLimits broken = broken_limits(result.camera.pose.position_m, dump.targets.tracked_targets,
                                            input.settings.move);
  result.flags = {.dt_capped = input.dt_s > kMaxStepS,
                  .used_cube_map = dump.plan.used_cube_map,
                  .body_overlap = dump.decision.body_overlap,
                  .evading = dump.decision.evading,
                  .deflected = dump.decision.deflected,
                  .new_shot = dump.new_shot,
                  .distance_given_up = broken.distance,
                  .elevation_given_up = broken.elevation};
  return result;
}

}  // namespace

StepResult report_step(const ReportInput& step, ShareWindow& shares) {
  static_assert(kShareWindowS <= kMaxStepS, "so that a step that was capped leaves nothing from before it");
  const StepInput& input = step.input;
  StepResult result = result_of(input, step.dump);
  Lens lens = input.lens;
  lens.vertical_fov_rad = result.vertical_fov_rad;
  shares.begin_step(step.dump.targets.ids, std::min(input.dt_s, kMaxStepS));
  for (size_t i = 0; i < input.targets.size(); ++i) remember_share(step.taken, i, result.camera.pose, lens, shares);
  for (size_t i = 0; i < input.targets.size(); ++i) result.targets.push_back(sight_of(step, i, lens, shares));
  set_tracking_status(step, lens, result);
  return result;
}

}  // namespace sightline
