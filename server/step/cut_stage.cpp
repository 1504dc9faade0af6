// Cuts. They become due when no required target has been seen for a set time and no short way leads to a view of one.
// Every step then examines some places round the targets, best first. The camera takes the first place that sees all
// required targets. If there is none, it takes the place that sees most of them. Sight lines are exact, because each
// examined place has maps of its own in this very step.
#include <algorithm>
#include <cmath>
#include <limits>

#include "server/move/body.h"
#include "server/move/framing.h"
#include "server/step/shot_in_force.h"

namespace sightline {
namespace {

// Two cuts within this time confuse the viewer.
constexpr double kLeastBetweenS = 2.0;
// Places of the ranking that are tested for room in one step, at most. This bounds the cost of a step.
constexpr size_t kRanksAtOnce = 40;
// One radian away from the wanted shot counts like this share of a target's visibility.
constexpr double kApartWeight = 0.2;
// The index of the wanted shot in the list of viewpoints.
constexpr size_t kWantedShot = ViewpointMap::kViewpoints;

bool is_required(const StepContext& step, size_t target) {
  return step.is_steered(target) && step.targets.tracked_targets[target].required;
}

uint32_t required_mask(const StepContext& step) {
  uint32_t mask = 0;
  for (size_t i = 0; i < step.target_count(); ++i) mask |= is_required(step, i) ? 1u << i : 0u;
  return mask;
}

bool is_due(const StepContext& step, const CutState& state, bool target_jumped, bool is_asked) {
  const double after_s = step.input.settings.move.cut_after_s;
  if (is_asked)
    return step.move_s > 0 && step.targets.steered != 0 && step.input.settings.move.follow == Follow::kOffset;
  return after_s > 0 && step.move_s > 0 && required_mask(step) != 0 && state.since_s >= kLeastBetweenS &&
         (target_jumped || state.unseen_s >= after_s);
}

// How much of the required targets was seen from a viewpoint lately: of the target that is seen least, [0, 1].
double share_seen(const StepContext& step, const ViewpointMap& viewpoints, size_t place) {
  double least = 1.0;
  for (size_t i = 0; i < step.target_count(); ++i)
    if (is_required(step, i))
      least = std::min(least, 0.5 * (viewpoints.share(i, place) + viewpoints.share_beside(i, place)));
  return least;
}

double apart(const glm::dvec3& a_m, const glm::dvec3& b_m) {
  const double length_a = glm::length(a_m), length_b = glm::length(b_m);
  if (length_a < 1e-6 || length_b < 1e-6) return 0.0;
  return std::acos(std::clamp(glm::dot(a_m, b_m) / (length_a * length_b), -1.0, 1.0)) +
         std::abs(std::log(length_a / length_b));
}

// The wanted shot first, then the viewpoints: best seen lately, and nearest to the wanted shot.
void rank_places(const SampleInput& in, const ViewpointMap& viewpoints, CutScratch& scratch) {
  const glm::dvec3 wanted_m = framed_offset_m(in.step, in.shot.shown_offset_m());
  const bool knows = viewpoints.target_count() == in.step.target_count();
  scratch.pattern.follow({}, viewpoint_distance_m(in.step, in.shot));
  scratch.ranked.clear();
  scratch.ranked.push_back({std::numeric_limits<double>::infinity(), kWantedShot});
  for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place)
    scratch.ranked.push_back({(knows ? share_seen(in.step, viewpoints, place) : 1.0) -
                                  kApartWeight * apart(scratch.pattern.offset_m(place), wanted_m),
                              place});
  std::sort(scratch.ranked.begin(), scratch.ranked.end(),
            [](const auto& a, const auto& b) { return a.score != b.score ? a.score > b.score : a.place < b.place; });
}

glm::dvec3 offset_of(const SampleInput& in, const CutScratch& scratch, size_t place) {
  return place == kWantedShot ? framed_offset_m(in.step, in.shot.shown_offset_m()) : scratch.pattern.offset_m(place);
}

// The camera has room there, and keeps the limits of distance and elevation.
bool is_fit(const SampleInput& in, const CutScratch& scratch, const glm::dvec3& offset_m) {
  const StepContext& step = in.step;
  const glm::dvec3 place_m = step.center_m() + offset_m;
  const BrokenLimits broken = broken_limits(place_m, step.targets.tracked_targets, step.input.settings.move);
  if (broken.distance || broken.elevation || !shows_group(step, offset_m)) return false;
  const double room_m = swept_radius_m(step.input.limits, step.lens) + kBodySkinM;
  return scratch.colliders.clearance_m(place_m, room_m) >= room_m && !scratch.colliders.is_inside(place_m);
}

void gather_round(const SampleInput& in, CutScratch& scratch) {
  const StepContext& step = in.step;
  const double farthest_m = std::max(ViewpointMap::kFarthestShare * viewpoint_distance_m(step, in.shot),
                                     glm::length(framed_offset_m(step, in.shot.shown_offset_m())));
  scratch.colliders.gather(step.input.scene, step.center_m(),
                           farthest_m + 2 * (swept_radius_m(step.input.limits, step.lens) + kBodySkinM), {});
  scratch.colliders.allow(kMostTests);
}

void pick_sights(const SampleInput& in, TargetPicker& picker, CutPlace& place) {
  const StepInput& input = in.step.input;
  place.sights_m.clear();
  place.sights_of_target.clear();
  for (size_t i = 0; i < in.step.target_count(); ++i) {
    const auto first = static_cast<uint32_t>(place.sights_m.size());
    const TargetView view{
        .viewer_m = place.position_m, .round = input.tick, .count = static_cast<size_t>(input.settings.sample.points)};
    if (samples_surface(in.step, i)) {
      for (const TargetPoint& p : picker.pick(input.scene, in.step.targets.pieces[i], view))
        place.sights_m.push_back(
            transform_point(input.scene.instances()[p.slot].world_from_instance, glm::dvec3(p.at_m)));
    } else {
      place.sights_m.push_back(in.step.targets.tracked_targets[i].aim_m);
    }
    place.sights_of_target.push_back({first, static_cast<uint32_t>(place.sights_m.size()) - first});
  }
}

void request_sights(const SampleInput& in, CutPlace& place, SamplePlan& plan) {
  place.first_sight = static_cast<uint32_t>(plan.views.size());
  for (size_t i = 0; i < in.step.target_count(); ++i)
    for (uint32_t k = 0; k < place.sights_of_target[i].count; ++k) {
      const glm::dvec3& eye_m = place.sights_m[place.sights_of_target[i].first + k];
      plan.views.push_back(plan_sight(eye_m, place.position_m));
      plan.requests.push_back({.view = plan.views.back(),
                               .layer_mask = in.step.input.targets[i].layer_mask,
                               .far_m = beyond_all_m(glm::distance(eye_m, place.position_m)),
                               .ignored_slots = in.step.targets.ignored_slots[i]});
    }
}

// The targets that are seen from a place, one bit each.
uint32_t seen_from(const StepContext& step, const TakenMaps& taken, const CutPlace& place) {
  uint32_t seen = 0;
  for (size_t i = 0; i < step.target_count(); ++i) {
    const MapRange& sights = place.sights_of_target[i];
    uint32_t points = 0;
    for (uint32_t k = sights.first; k < sights.first + sights.count; ++k)
      points += glm::distance(place.position_m, place.sights_m[k]) <=
                taken.maps[place.first_sight + k].distance_at(0, 0) * (1.0 + taken.settings.relative_bias);
    if (is_enough(points, sights.count, taken.settings.visibility_threshold)) seen |= 1u << i;
  }
  return seen;
}

// The required targets, or all if none is required.
uint32_t wanted_mask(const StepContext& step) {
  const uint32_t required = required_mask(step);
  return required != 0 ? required : step.targets.steered;
}

double wanted_weight(const StepContext& step, uint32_t seen) {
  double weight = 0;
  for (size_t i = 0; i < step.target_count(); ++i)
    if (wanted_mask(step) & seen & 1u << i) weight += step.targets.tracked_targets[i].weight;
  return weight;
}

// The length of the way that the decision takes, if it leads to a view of a required target; else infinity.
double way_m(const MoveInput& in, const Decision& decision, const MoveScratch& scratch) {
  if (decision.chosen_candidate < 0) return std::numeric_limits<double>::infinity();
  const auto chosen = static_cast<uint32_t>(decision.chosen_candidate);
  if ((in.sights.candidates.visible_targets[chosen] & required_mask(in.step)) == 0)
    return std::numeric_limits<double>::infinity();
  return scratch.way_m;
}

// Called when all places were examined. The next round takes the place that sees most. The round after it begins
// afresh.
void begin_next_round(CutState& state) {
  state.takes_partial = !state.takes_partial && state.most_seen > 0;
  if (!state.takes_partial) state.most_seen = 0;
  state.next_rank = 0;
}

// The velocity of the targets, if the limits allow it and the way ahead is free; else 0.
glm::dvec3 first_velocity_mps(const MoveInput& in, const Pose& pose, ClearanceField& field) {
  const StepInput& input = in.step.input;
  const glm::dvec3 along_mps = group_velocity_mps(in.step);
  if (!(glm::length(along_mps) <= input.limits.max_speed_mps)) return glm::dvec3(0.0);
  const double reach_m = glm::length(along_mps) * in.step.move_s + braking_distance_m(along_mps, input.limits) +
                         2 * (swept_radius_m(input.limits, in.step.lens) + kBodySkinM);
  field.gather(input.scene, pose.position_m, reach_m, {});
  field.allow(kMostTests);
  const CameraState camera{pose, along_mps, glm::dvec3(0.0)};
  const SafeMove safe = make_safe(camera, along_mps, input.limits, in.step.lens, field, in.step.move_s);
  return safe.velocity_mps == along_mps && !safe.overlap ? along_mps : glm::dvec3(0.0);
}

}  // namespace

void plan_cut(const SampleInput& in, const CarriedState& carried, bool target_jumped, TargetPicker& picker,
              CutScratch& scratch, SamplePlan& plan) {
  CutPlan& cut = plan.cut;
  cut.places.clear();
  cut.due = is_due(in.step, carried.cut, target_jumped, in.shot.cut_s > 0);
  if (!cut.due) return;
  rank_places(in, carried.viewpoints, scratch);
  gather_round(in, scratch);
  size_t rank = in.shot.cut_s == kCutWithinS ? 0 : carried.cut.next_rank;
  const size_t end = std::min(rank + kRanksAtOnce, scratch.ranked.size());
  for (; rank < end && cut.places.size() < kCutPlaces; ++rank) {
    const size_t place = scratch.ranked[rank].place;
    const glm::dvec3 offset_m = offset_of(in, scratch, place);
    if (!is_fit(in, scratch, offset_m)) continue;
    cut.places.resize(cut.places.size() + 1);
    CutPlace& added = cut.places[cut.places.size() - 1];
    added.position_m = in.step.center_m() + offset_m;
    added.viewpoint = place == kWantedShot ? std::nullopt : std::optional(place);
    pick_sights(in, picker, added);
    request_sights(in, added, plan);
  }
  cut.next_rank = rank;
  cut.examined_all = rank == scratch.ranked.size();
}

const CutPlace* choose_cut(const MoveInput& in, const TakenMaps& taken, bool target_jumped, const Decision& decision,
                           MoveScratch& scratch, CutState& state) {
  const CutPlan& plan = in.plan.cut;
  if (!plan.due) return nullptr;
  const bool is_asked = in.carried.shot.cut_s > 0;
  const double to_view_m = target_jumped ? glm::distance(in.step.camera.pose.position_m, in.desired_m)
                                         : way_m(in, decision, scratch);
  if (!is_asked && to_view_m <= in.step.input.settings.move.cut_beyond_m) return nullptr;
  const uint32_t wanted = wanted_mask(in.step);
  const CutPlace* best = nullptr;
  double most_seen = 0;
  for (const CutPlace& place : plan.places) {
    const uint32_t seen = seen_from(in.step, taken, place);
    if ((seen & wanted) == wanted) return &place;
    if (const double weight = wanted_weight(in.step, seen); weight > most_seen) most_seen = weight, best = &place;
  }
  if (best && state.takes_partial && most_seen >= state.most_seen) return best;
  state.most_seen = std::max(state.most_seen, most_seen);
  state.next_rank = plan.next_rank;
  if (plan.examined_all) begin_next_round(state);
  return nullptr;
}

void cut_to(const MoveInput& in, const TakenMaps& taken, const CutPlace& place, MoveScratch& scratch, WantedShot& shot,
            Decision& decision) {
  const StepContext& step = in.step;
  const glm::dvec3 to_center_m = step.center_m() - place.position_m;
  const ViewAngles at_center = angles_from_rotation(look_rotation(to_center_m, {0, 1, 0}, {1, 0, 0}));
  const Aim aim = aim_with_shot(step, shot, place.position_m, at_center);
  decision = {};
  decision.cut = true;
  const bool sees_all = (seen_from(step, taken, place) & step.targets.steered) == step.targets.steered;
  decision.status = sees_all ? MoveStatus::kTracking : MoveStatus::kPartial;
  decision.reason = MoveReason::kCut;
  decision.turn.angles = aim.angles;
  decision.camera.pose = {place.position_m, rotation_from_angles(aim.angles)};
  decision.camera.velocity_mps = first_velocity_mps(in, decision.camera.pose, scratch.cut_colliders);
  const double aim_fov_rad = fov_for_size_rad(step, shot, place.position_m).value_or(aim.vertical_fov_rad);
  decision.vertical_fov_rad = zooms(framing_of(step.input)) ? aim_fov_rad : in.carried.zoom.vertical_fov_rad;
  shot.cut_s = 0.0;
  shot.offset_m = place.viewpoint ? -to_center_m : shot.offset_m;
  if (in.plan.look.searches && place.viewpoint) shot.viewpoint = place.viewpoint;
}

bool jump_waits(const MoveInput& in, bool target_jumped) {
  const MoveSettings& settings = in.step.input.settings.move;
  const bool is_far = glm::distance(in.step.camera.pose.position_m, in.desired_m) > settings.cut_beyond_m;
  return target_jumped && settings.cut_after_s > 0 && is_far && !(in.plan.cut.due && in.plan.cut.examined_all);
}

void note_sights(const StepContext& step, const StepResult& result, bool target_jumped, bool is_asked,
                 CutState& state) {
  bool seen = required_mask(step) == 0;
  for (size_t i = 0; i < step.target_count(); ++i)
    seen |= is_required(step, i) && result.targets[i].visible_share > 0 && result.targets[i].in_picture;
  state.since_s += step.move_s;
  state.unseen_s += step.move_s;
  if (seen) state.unseen_s = 0.0;
  // Places are examined on from where the last step ended, while a cut is asked for.
  if (seen && !is_asked) state.next_rank = 0, state.most_seen = 0.0, state.takes_partial = false;
  // A target that jumped out of sight is lost at once.
  if (!seen && target_jumped) state.unseen_s = std::max(state.unseen_s, step.input.settings.move.cut_after_s);
}

}  // namespace sightline
