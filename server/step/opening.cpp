#include "server/step/opening.h"

#include <algorithm>
#include <functional>

#include "server/base/hash.h"
#include "server/move/framing.h"
#include "server/move/keep_together.h"

namespace sightline {
namespace {

// A change of the lens takes effect at once. When a zoom range ends, the field of view returns to that of the lens at
// the pace of the zoom (see `turn`).
ZoomState zoom_of(const StepInput& input, const ZoomState& before) {
  ZoomState zoom = before;
  const FramingSettings& framing = input.settings.framing;
  const double lens_rad = input.lens.vertical_fov_rad;
  const bool lens_changed = before.lens_fov_rad != lens_rad;
  if (before.vertical_fov_rad == 0.0 || (lens_changed && !zooms(framing))) zoom.vertical_fov_rad = lens_rad;
  zoom.lens_fov_rad = lens_rad;
  return zoom;
}

bool keeps_shot(const TargetsNow& targets, const WantedShot& before) {
  return before.is_set && before.target_set == hash_of(targets, targets.weighted);
}

// The shot belongs to one set of targets. When the set changes, the camera's present position defines a new shot. So
// the camera does not jump when a target is added, removed or switched off. A target that is given up still belongs to
// the set, and the others are shown from the same side and distance.
WantedShot shot_of(const TargetsNow& targets, const glm::dvec3& camera_m, const WantedShot& before) {
  if (targets.steered == 0 || keeps_shot(targets, before)) return before;
  WantedShot shot = before;
  shot.offset_m = shot.asked_offset_m = camera_m - weighted_center_m(targets.tracked_targets);
  shot.viewpoint.reset();
  shot.asked_seen_s = 0.0;
  shot.target_set = hash_of(targets, targets.weighted);
  shot.is_set = true;
  return shot;
}

// Gives up the least important targets if the picture cannot hold all of them even from the greatest distance allowed.
// Otherwise the camera would aim between targets that are far apart, and show none.
void give_up_targets(const StepInput& input, const CarriedState& carried, TargetsNow& targets, TargetIds& given_up) {
  given_up.clear();
  const MoveSettings& settings = input.settings.move;
  if (settings.follow != Follow::kOffset) return;
  const Lens lens = widest(input.lens, input.settings.framing);
  const glm::dvec3 camera_m = carried.camera.pose.position_m;
  const bool has_shot = keeps_shot(targets, carried.shot);
  const auto fit = [&](std::span<const TrackedTarget> kept, double room) {
    const glm::dvec3 offset_m = has_shot ? carried.shot.offset_m : camera_m - weighted_center_m(kept);
    return fits_picture(farthest_place_m(kept, offset_m, settings), kept, {}, lens, room, false);
  };
  const auto keep = [&](uint32_t former) { return keep_together(targets.tracked_targets, camera_m, former, std::cref(fit)); };
  uint32_t kept = keep(kept_before(targets, carried.given_up));
  if (kept == targets.steered) return;
  // Among targets of equal weight, the camera keeps the one that it looks at already.
  if (carried.given_up.empty()) kept = keep(kept_before(targets, carried.not_aimed_at));
  given_up = dropped_ids(targets, kept);
  for (size_t i = 0; i < targets.ids.size(); ++i)
    if (!(kept >> i & 1u)) targets.tracked_targets[i].weight = 0;
  targets.steered = kept;
}

// A target that moves more than this far, and faster than this, has jumped.
constexpr double kJumpM = 3.0, kJumpMps = 100.0;

bool target_jumped(const StepInput& input, const std::vector<TargetPast>& before) {
  for (const Target& target : input.targets) {
    if (!target.required || !(target.weight > 0)) continue;
    const auto known = std::ranges::find(before, target.instance_id, &TargetPast::id);
    if (known == before.end()) continue;
    const glm::dvec3 now_m = input.scene.find(target.instance_id)->pose.position_m;
    const double moved_m = glm::distance(known->predictor.at(0.0).pose.position_m, now_m);
    if (moved_m > std::max(kJumpM, kJumpMps * input.dt_s)) return true;
  }
  return false;
}

}  // namespace

void open_step(const StepInput& input, const CarriedState& carried, TargetsNow& targets, Opening& opening) {
  look_at_targets(input, targets);
  give_up_targets(input, carried, targets, opening.given_up);
  set_sight_weights(targets);
  opening.target_jumped = target_jumped(input, carried.pasts);
  observe_targets(input, carried.pasts, opening.pasts);
  opening.move_s = std::min(input.dt_s, kMaxStepS);
  opening.zoom = zoom_of(input, carried.zoom);
  opening.shot = shot_of(targets, carried.camera.pose.position_m, carried.shot);
}

}  // namespace sightline
