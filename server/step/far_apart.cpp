#include "server/step/far_apart.h"

#include <algorithm>
#include <bit>
#include <functional>
#include <utility>

#include "server/move/framing.h"
#include "server/move/keep_together.h"
#include "server/move/line_up.h"
#include "server/move/shot.h"

namespace sightline {
namespace {

// The targets count as hidden from an end of the line when more than this share of them is: less than one of two.
constexpr double kHidden = 0.45;
// When they are hidden from both ends, the camera does not turn for so long. Meanwhile the viewpoint search looks round
// the targets that are kept, and learns nothing of the ends.
constexpr double kClosedS = 10.0;
// The shot counts as lined up until the targets fill no more than this share of the picture from the side. So it does
// not change to and fro.
constexpr double kRoomToLeave = 0.6;

// Returns whether the camera may leave the side of the targets that the client's shot shows.
bool may_turn(const StepInput& input) {
  const MoveSettings& move = input.settings.move;
  return move.strategy == Strategy::kMinCost && move.search_viewpoints && move.follow == Follow::kOffset;
}

bool holds_all(const TargetsNow& targets, std::span<const TrackedTarget> kept) {
  return std::ranges::count_if(kept, &TrackedTarget::steered) == std::popcount(targets.weighted);
}

}  // namespace

void give_up_targets(const StepInput& input, const CarriedState& carried, bool has_shot, TargetsNow& targets,
                     TargetIds& given_up) {
  given_up.clear();
  const MoveSettings& settings = input.settings.move;
  if (settings.follow != Follow::kOffset) return;
  const Lens lens = widest(input.lens, framing_of(input));
  const glm::dvec3 camera_m = carried.camera.pose.position_m;
  const bool lines_up = may_turn(input) && (!has_shot || carried.shot.line_closed_s <= 0);
  const auto fit = [&](std::span<const TrackedTarget> kept, double room) {
    const FarShot shot{kept, has_shot ? carried.shot.offset_m : camera_m - weighted_center_m(kept), camera_m, lens,
                       settings};
    return fits_from_side(shot, room) || (lines_up && holds_all(targets, kept) && fits_in_line(shot, room));
  };
  const auto keep = [&](uint32_t former) {
    return keep_together(targets.tracked_targets, camera_m, former, std::cref(fit));
  };
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
  if (step.move_s <= 0) return;
  const std::optional<glm::dvec3> former_m = std::exchange(shot.in_line_m, std::nullopt);
  shot.line_closed_s = std::max(0.0, shot.line_closed_s - step.decision_s);
  const TargetsNow& targets = step.targets;
  const bool several = std::popcount(targets.steered) >= 2 && targets.steered == targets.weighted;
  shot.all_kept_s = several ? shot.all_kept_s + step.decision_s : 0.0;
  if (!may_turn(step.input) || !several || shot.line_closed_s > 0) return;
  const Lens lens = widest(step.input.lens, framing_of(step.input));
  const FarShot far{targets.tracked_targets,     shot.offset_m,
                    step.camera.pose.position_m, lens,
                    step.input.settings.move,    former_m ? shot.line_end_m : glm::dvec3(0.0)};
  const bool knows = shot.all_kept_s > step.input.settings.move.viewpoint_search.memory_s &&
                     knows_viewpoints(step, viewpoints);
  const auto is_seen_from = [&](const glm::dvec3& offset_m) {
    return !knows ||
           hidden_round_about(viewpoints, targets.tracked_targets, viewpoints.nearest_viewpoint(offset_m)) < kHidden;
  };
  if (const std::optional<LinedUp> lined_up = line_up(far, std::cref(is_seen_from))) {
    shot.in_line_m = lined_up->offset_m, shot.line_end_m = lined_up->end_m;
    return;
  }
  if (former_m && !fits_from_side(far, kRoomToLeave)) shot.in_line_m = shot.offset_m;
  if (!fits_from_side(far, 1.0) && fits_in_line(far, 1.0)) shot.in_line_m.reset(), shot.line_closed_s = kClosedS;
}

}  // namespace sightline
