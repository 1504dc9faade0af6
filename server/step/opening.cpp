#include "server/step/opening.h"

#include <algorithm>
#include <cmath>

#include "server/move/framing.h"
#include "server/step/far_apart.h"
#include "server/step/shot_in_force.h"

namespace sightline {
namespace {

// A change of the lens takes effect at once. When a zoom range ends, the field of view returns to that of the lens at
// the pace of the zoom (see `turn`).
ZoomState zoom_of(const StepInput& input, const ZoomState& before) {
  ZoomState zoom = before;
  const FramingSettings framing = framing_of(input);
  const double lens_rad = input.lens.vertical_fov_rad;
  const bool lens_changed = before.lens_fov_rad != lens_rad;
  if (before.vertical_fov_rad == 0.0 || (lens_changed && !zooms(framing))) zoom.vertical_fov_rad = lens_rad;
  zoom.lens_fov_rad = lens_rad;
  return zoom;
}

// A target that moves more than this far, and faster than this, has jumped.
constexpr double kJumpM = 3.0, kJumpMps = 100.0;

bool target_jumped(const StepInput& input, const std::vector<TargetPast>& before) {
  for (const Target& target : input.targets) {
    if (!target.required || !(target.weight > 0)) continue;
    const auto known = std::ranges::find(before, target.instance_id, &TargetPast::id);
    if (known == before.end()) continue;
    const glm::dvec3 now_m = believed_pose(*input.scene.find(target.instance_id)).position_m;
    const double moved_m = glm::distance(known->predictor.at(0.0).pose.position_m, now_m);
    if (moved_m > std::max(kJumpM, kJumpMps * input.dt_s)) return true;
  }
  return false;
}

uint64_t number_of_decision(const StepInput& input, double clock_s) {
  const double every_s = input.settings.move.decide_every_s;
  return every_s > 0 && !follows_paper(input) ? static_cast<uint64_t>(clock_s / every_s) : input.tick;
}

// True where the last decision is old, or did not know what has changed since.
bool decides(const StepInput& input, const CarriedState& carried, const TargetsNow& targets, const Opening& opening) {
  const DecisionInForce& last = carried.in_force;
  if (follows_paper(input) || last.is_due || opening.move_s <= 0 || targets.steered == 0) return true;
  const bool asked_anew = !carried.shot.is_set || opening.shot.frame.number != carried.shot.frame.number ||
                          opening.shot.target_set != carried.shot.target_set;
  if (!std::ranges::equal(targets.ids, last.target_ids)) return true;
  if (asked_anew || opening.target_jumped || opening.shot.cut_s > 0 ||
      !std::ranges::equal(opening.given_up, carried.given_up))
    return true;
  // At multiples of the time on the session's own clock, so that what was decided before does not matter.
  const double every_s = input.settings.move.decide_every_s;
  return every_s <= 0 || std::floor((last.clock_s + opening.move_s) / every_s) > std::floor(last.clock_s / every_s);
}

}  // namespace

void open_step(const StepInput& input, const CarriedState& carried, TargetsNow& targets, Opening& opening) {
  look_at_targets(input, targets);
  const bool same_targets = keeps_shot(targets, carried.shot);
  give_up_targets(input, carried, same_targets, targets, opening.given_up);
  set_sight_weights(targets);
  opening.target_jumped = (same_targets && carried.cut.target_jumped) || target_jumped(input, carried.pasts);
  observe_targets(input, carried.pasts, opening.pasts);
  opening.move_s = std::min(input.dt_s, kMaxStepS);
  opening.zoom = zoom_of(input, carried.zoom);
  opening.shot = shot_in_force(input, targets, carried);
  opening.decides = decides(input, carried, targets, opening);
  opening.decision = number_of_decision(input, carried.in_force.clock_s + opening.move_s);
  opening.decision_s = opening.move_s > 0 ? carried.in_force.age_s + opening.move_s : 0.0;
  place_in_picture(input, opening.shot, carried.turn.angles.yaw_rad, targets);
}

}  // namespace sightline
