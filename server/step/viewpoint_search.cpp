// The viewpoint search. Each step takes maps in all directions from one target (sample). They show which viewpoints
// around the targets see it (aggregate). Every few steps the search chooses the wanted shot from that.
#include <algorithm>
#include <cmath>
#include <functional>

#include "server/base/random.h"
#include "server/move/sight_weight.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// A shot is chosen no more often, seconds, because it is meant to hold for seconds.
constexpr double kChoiceEveryS = 4.0 / 60;
// The results are used once the search has run for this share of its memory time.
constexpr double kKnownShare = 0.5;
// While the targets move, the client's shot is taken again when at most this share of them has been hidden there for so
// long. Without it, the camera would stay for good at any viewpoint that sees as much. Where others keep passing before
// the targets, the shot is not free for long.
constexpr double kAskedIsGoodBelow = 0.05, kAskedIsGoodS = 1.5;
// The eyes of the maps lie within this share of the target's box, since the corners of a box are mostly outside the
// shape.
constexpr double kBoxShare = 0.7;
bool searches(const StepContext& step) {
  const MoveSettings& settings = step.input.settings.move;
  return settings.strategy == Strategy::kMinCost && settings.search_viewpoints && settings.follow == Follow::kOffset &&
         step.targets.steered != 0;
}

// The area of the instance's box, up to a factor: about what it shows from all sides together.
double box_area(const Instance& instance) {
  const glm::dvec3 half_m(instance.geometry->bounds.half_extent());
  const Affine& map = instance.world_from_instance;
  const double x = half_m.x * glm::length(map[0]), y = half_m.y * glm::length(map[1]),
               z = half_m.z * glm::length(map[2]);
  return x * y + y * z + z * x;
}

// A piece of the target by chance, in proportion to box_area.
const Instance& looking_piece(const SceneMirror& scene, std::span<const TargetPiece> pieces, CounterRandom& random) {
  const auto instance_of = [&](const TargetPiece& piece) -> const Instance& { return scene.instances()[piece.slot]; };
  if (pieces.size() == 1) return instance_of(pieces[0]);
  double all = 0;
  for (const TargetPiece& piece : pieces) all += box_area(instance_of(piece));
  double left = random.next_unit() * all;
  for (const TargetPiece& piece : pieces)
    if ((left -= box_area(instance_of(piece))) < 0) return instance_of(piece);
  return instance_of(pieces.back());
}

glm::dvec3 looking_point_m(const Instance& instance, CounterRandom& random) {
  const Aabb& box = instance.geometry->bounds;
  const double x = random.next_unit(), y = random.next_unit(), z = random.next_unit();
  const glm::dvec3 from_center = (glm::dvec3(x, y, z) - 0.5) * glm::dvec3(box.half_extent()) * 2.0 * kBoxShare;
  return transform_point(instance.world_from_instance, glm::dvec3(box.center()) + from_center);
}

bool is_due(const StepContext& step) {
  return std::floor(step.clock_s / kChoiceEveryS) > std::floor((step.clock_s - step.decision_s) / kChoiceEveryS);
}

void choose_viewpoint(const StepContext& step, const ViewpointMap& viewpoints, WantedShot& shot) {
  MoveSettings settings = step.input.settings.move;
  const bool stand = targets_stand(step);
  double& keep_shot_below = settings.viewpoint_search.keep_shot_below;
  keep_shot_below = stand ? good_enough_share(keep_shot_below, effective_count(step.targets.sight_weights)) : 0.0;
  const glm::dvec3 center_m = step.center_m(), present_m = step.camera.pose.position_m - center_m;
  if (glm::length(present_m) < 1e-6 || glm::length(shot.asked_offset_m) < 1e-6) return;
  ShotWish wish{.asked_m = framed_offset_m(step, shot.asked_offset_m),
                .present_m = present_m,
                .subjects_m = shot.subjects_m,
                .weight = shot.weight,
                .tolerance = shot.tolerance};
  const auto allowed = [&](const glm::dvec3& offset_m) {
    return within_limits(center_m + offset_m, step.targets.tracked_targets, settings) && shows_group(step, offset_m);
  };
  wish.asked_place = shot.asked_viewpoint = viewpoints.nearest_viewpoint(wish.asked_m);
  wish.former_place = shot.viewpoint.value_or(shot.asked_viewpoint);
  const bool is_seen = hidden_round_about(viewpoints, step.targets.tracked_targets, shot.asked_viewpoint) <=
                       kAskedIsGoodBelow;
  shot.asked_seen_s = is_seen ? shot.asked_seen_s + kChoiceEveryS : 0.0;
  const bool is_good = !stand && shot.asked_seen_s >= kAskedIsGoodS;
  wish.take_asked_below = is_good ? kAskedIsGoodBelow : keep_shot_below;
  shot.viewpoint = choose_shot(viewpoints, step.targets.tracked_targets, wish, settings, std::cref(allowed));
}

// Drops the results, which would be outdated when the search is switched on again, and returns to the client's shot.
void stop_search(ViewpointMap& viewpoints, WantedShot& shot) {
  viewpoints.forget();
  if (shot.viewpoint) shot.offset_m = shot.asked_offset_m;
  shot.viewpoint.reset();
  shot.asked_seen_s = 0.0;
}

// How far the targets' centre will have moved at a slice.
glm::dvec3 center_moves_m(const StepContext& step, const SampledSlice& slice) {
  glm::dvec3 sum_m(0.0);
  double weight = 0;
  for (size_t i = 0; i < step.target_count(); ++i) {
    const TrackedTarget& target = step.targets.tracked_targets[i];
    if (target.steered()) sum_m += target.weight * (slice.aim_m[i] - target.aim_m), weight += target.weight;
  }
  return sum_m / weight;
}

// The place of the shot goes along with the targets.
void plan_sights_from_shot(const SampleInput& in, SamplePlan& plan, ViewpointLook& look) {
  const glm::dvec3 asked_m = asked_place_m(in.step, in.shot);
  for (const SampledSlice& slice : plan.slices) {
    if (slice.turned) continue;
    const glm::dvec3 then_m = asked_m + center_moves_m(in.step, slice);
    for (size_t i = 0; i < in.step.target_count(); ++i) {
      if (!in.step.is_steered(i)) continue;
      look.ahead.push_back({i, static_cast<uint32_t>(plan.views.size()), slice.due.ahead_s, then_m});
      plan.views.push_back(plan_sight(slice.aim_m[i], then_m));
    }
  }
}

}  // namespace

glm::dvec3 framed_offset_m(const StepContext& step, const glm::dvec3& offset_m) {
  const double margin = step.input.settings.framing.framing_margin;
  return desired_place_m(step.targets.tracked_targets, offset_m, place_lens(step), margin, step.input.settings.move) -
         step.center_m();
}

glm::dvec3 asked_place_m(const StepContext& step, const WantedShot& shot) {
  return step.center_m() + framed_offset_m(step, shot.asked_offset_m);
}

bool shows_group(const StepContext& step, const glm::dvec3& offset_m) {
  constexpr double kFitSlack = 1.05;
  return glm::length(framed_offset_m(step, offset_m)) <= kFitSlack * glm::length(offset_m);
}

bool knows_viewpoints(const StepContext& step, const ViewpointMap& viewpoints) {
  return viewpoints.known_s() >= kKnownShare * step.input.settings.move.viewpoint_search.memory_s;
}

double viewpoint_distance_m(const StepContext& step, const WantedShot& shot) {
  return std::max(glm::length(framed_offset_m(step, shot.asked_offset_m)), 0.1);
}

ViewpointLook plan_look(const SampleInput& in, SamplePlan& plan) {
  const StepInput& input = in.step.input;
  if (!searches(in.step)) return {};
  std::vector<MapView>& views = plan.views;
  ViewpointLook look{
      .searches = true, .target = in.carried.in_force.made % input.targets.size(), .maps = {}, .asked_sight = 0};
  CounterRandom random(input.seed, in.step.decision, RandomPurpose::kViewpointSearch);
  const glm::dvec3 eye_m = looking_point_m(looking_piece(input.scene, in.step.targets.pieces[look.target], random),
                                           random);
  const double x = random.next_unit(), y = random.next_unit();
  look.maps.first = static_cast<uint32_t>(views.size());
  plan_round(eye_m, input.settings.move.viewpoint_search.resolution, {x, y}, views);
  look.maps.count = static_cast<uint32_t>(views.size()) - look.maps.first;
  look.asked_sight = static_cast<uint32_t>(views.size());
  views.push_back(plan_sight(eye_m, asked_place_m(in.step, in.shot)));
  plan_sights_from_shot(in, plan, look);
  return look;
}

void request_look(const SampleInput& in, SamplePlan& plan) {
  const ViewpointLook& look = plan.look;
  if (!look.searches) return;
  const auto request = [&](uint32_t view, double farthest_m, size_t target, double ahead_s = 0.0) {
    plan.requests[view] = {.view = plan.views[view],
                           .layer_mask = in.step.input.targets[target].layer_mask,
                           .ahead_s = ahead_s,
                           .far_m = beyond_all_m(farthest_m),
                           .ignored_slots = in.step.targets.ignored_slots[target]};
  };
  const glm::dvec3 eye_m = plan.views[look.asked_sight].eye_m;
  request(look.asked_sight, glm::distance(eye_m, asked_place_m(in.step, in.shot)), look.target);
  for (const SightAhead& sight : look.ahead)
    request(sight.map, glm::distance(plan.views[sight.map].eye_m, sight.place_m), sight.target, sight.ahead_s);
  const double farthest_m = glm::distance(eye_m, in.step.center_m()) +
                            ViewpointMap::kFarthestShare * viewpoint_distance_m(in.step, in.shot);
  for (uint32_t view = look.maps.first; view < look.maps.first + look.maps.count; ++view)
    request(view, farthest_m, look.target);
}

void search_viewpoints(const StepContext& step, const TakenMaps& taken, ViewpointMap& viewpoints, WantedShot& shot) {
  const ViewpointLook& look = taken.plan.look;
  if (!look.searches) return stop_search(viewpoints, shot);
  if (step.move_s <= 0) return;
  const double memory_s = step.input.settings.move.viewpoint_search.memory_s;
  viewpoints.follow(step.targets.ids, viewpoint_distance_m(step, shot));
  viewpoints.learn(look.target, taken.maps.subspan(look.maps.first, look.maps.count), step.center_m(),
                   taken.settings.relative_bias, step.decision_s * static_cast<double>(step.target_count()), memory_s);
  if (knows_viewpoints(step, viewpoints) && is_due(step)) choose_viewpoint(step, viewpoints, shot);
  if (!shot.viewpoint) return;
  // Viewpoints are coarse. If the client's nearest viewpoint is chosen, the camera takes exactly the client's shot.
  shot.offset_m = *shot.viewpoint == shot.asked_viewpoint ? shot.asked_offset_m : viewpoints.offset_m(*shot.viewpoint);
}

}  // namespace sightline
