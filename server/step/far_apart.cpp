#include "server/step/far_apart.h"

#include <algorithm>
#include <bit>
#include <functional>

#include "server/move/framing.h"
#include "server/move/keep_together.h"
#include "server/move/line_up.h"
#include "server/move/shot.h"

namespace sightline {
namespace {

// The line is taken to be closed when more than this share of the targets is hidden from its end, and open again from this share on.
constexpr double kClosedHidden = 0.7, kOpenHidden = 0.3;

// The shot counts as lined up until the targets fill no more than this share of the picture from the side, so that it does not change to and fro.
constexpr double kRoomToLeave = 0.6;

// The camera may choose another side of the targets than that of the client's shot.
bool may_turn(const StepInput& input) {
  const MoveSettings& move = input.settings.move;
  return move.strategy == Strategy::kMinCost && move.search_viewpoints && move.follow == Follow::kOffset;
}

bool holds_all(const TargetsNow& targets, std::span<const TrackedTarget> kept) {
  return std::ranges::count_if(kept, &TrackedTarget::steered) == std::popcount(targets.weighted);
}

}  // namespace

void give_up_targets(const StepInput& input, const CarriedState& carried, bool has_shot, TargetsNow& targets, TargetIds& given_up) {
  given_up.clear();
  const MoveSettings& settings = input.settings.move;
  if (settings.follow != Follow::kOffset) return;
  const Lens lens = widest(input.lens, input.settings.framing);
  const glm::dvec3 camera_m = carried.camera.pose.position_m;
  const bool lines_up = has_shot && may_turn(input) && carried.shot.line_is_open;
  const auto fit = [&](std::span<const TrackedTarget> kept, double room) {
    const FarShot shot{kept, has_shot ? carried.shot.offset_m : camera_m - weighted_center_m(kept), camera_m, lens, settings};
    return fits_from_side(shot, room) || (lines_up && holds_all(targets, kept) && in_line_offset_m(shot, room));
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

void line_up_shot(const StepContext& step, const ViewpointMap& viewpoints, WantedShot& shot) {
  const bool was_in_line = shot.in_line_m.has_value();
  shot.in_line_m.reset();
  const TargetsNow& targets = step.targets;
  if (!may_turn(step.input) || std::popcount(targets.steered) < 2 || targets.steered != targets.weighted) return;
  const Lens lens = widest(step.input.lens, step.input.settings.framing);
  const FarShot far{targets.tracked_targets, shot.offset_m, step.camera.pose.position_m, lens, step.input.settings.move};
  const glm::dvec3 offset_m = line_up(far);
  if (offset_m == shot.offset_m && !(was_in_line && !fits_from_side(far, kRoomToLeave))) return;
  const std::optional<glm::dvec3> end_m = in_line_offset_m(far, 1.0);
  if (end_m && knows_viewpoints(step, viewpoints)) {
    const double hidden = hidden_round_about(viewpoints, targets.tracked_targets, viewpoints.nearest_viewpoint(*end_m));
    shot.line_is_open = hidden < (shot.line_is_open ? kClosedHidden : kOpenHidden);
  }
  if (shot.line_is_open) shot.in_line_m = offset_m;
}

}  // namespace sightline
