// The sample stage: it picks the sampled points of the targets and plans the maps from them (paper 3.2, 4; design 4).
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <span>

#include "server/base/random.h"
#include "server/step/sampled_points.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// Points of a predicted target. A prediction is uncertain, so it needs fewer points than the target itself.
constexpr size_t kPointsAhead = 3;
// A shorter prediction would add nothing to the present poses.
constexpr double kLeastAheadS = 0.05;

glm::dvec2 texel_jitter(const StepInput& input, uint64_t decision) {
  if (!input.settings.sample.jitter) return {0.5, 0.5};
  CounterRandom random(input.seed, decision, RandomPurpose::kTexelJitter);
  const double x = random.next_unit(), y = random.next_unit();
  return {x, y};
}

// The camera's position after this step if its velocity does not change. Its visibility must be known exactly.
glm::dvec3 position_on_course_m(const StepContext& step) {
  return step.camera.pose.position_m + step.camera.velocity_mps * step.move_s;
}

// The instance's transform at a predicted pose.
Affine world_from_instance_at(const Pose& pose, const Instance& instance) {
  const glm::dmat3 linear = glm::mat3_cast(pose.rotation) * instance.linear;
  return Affine(linear[0], linear[1], linear[2], pose.position_m);
}

// The camera's position at the time of the prediction: on the way to its goal, else as it goes on with its velocity.
// Maps hold only positions in the bound.
glm::dvec3 camera_ahead_m(const SampleInput& in, double ahead_s) {
  const CameraState& camera = in.step.camera;
  glm::dvec3 way_m = camera.velocity_mps * ahead_s;
  if (in.carried.goal_m) way_m = (*in.carried.goal_m - camera.pose.position_m) * (ahead_s / kGoalS);
  return nearest_in_bound_m(in.bound, camera.pose.position_m + way_m);
}

// The longest time for which every steered target can be predicted, at most MoveSettings::prediction_s and `most_s`.
void decide_ahead(const SampleInput& in, double most_s, SamplePlan& plan) {
  const StepContext& step = in.step;
  double ahead_s = std::min(step.input.settings.move.prediction_s, most_s), confidence = 1.0;
  const auto predictor_of = [&](size_t i) -> const MotionPredictor& {
    return past_of(in.pasts, step.targets.ids[i]).predictor;
  };
  for (size_t i = 0; i < step.target_count(); ++i)
    if (step.is_steered(i)) ahead_s = predictor_of(i).usable_ahead_s(ahead_s);
  for (size_t i = 0; i < step.target_count(); ++i)
    if (step.is_steered(i)) confidence = std::min(confidence, predictor_of(i).confidence(ahead_s));
  const bool usable = step.targets.steered != 0 && ahead_s >= kLeastAheadS;
  plan.ahead_s = usable ? ahead_s : 0.0;
  plan.ahead_confidence = usable ? confidence : 0.0;
  plan.camera_ahead_m = camera_ahead_m(in, plan.ahead_s);
}

// Picks the points of one target at a time.
class PointPicker {
 public:
  // Maps are taken from one in `of_points` of the points, rounded up; from none if that is 0.
  PointPicker(const SampleInput& in, TargetPicker& picker, size_t of_points, SamplePlan& plan)
      : in_(in),
        random_(in.step.input.seed, in.step.input.tick, RandomPurpose::kViewBlend),
        picker_(picker),
        of_points_(of_points),
        now_(plan.now),
        ahead_(plan.ahead),
        ahead_s_(plan.ahead_s) {}

  void pick_target(size_t i) {
    const Instance& instance = *in_.step.input.scene.find(in_.step.targets.ids[i]);
    const size_t first = now_.points_m.size(), first_ahead = ahead_.points_m.size(), first_sight = now_.sights_m.size();
    const Affine later = ahead_s_ > 0 ? world_from_instance_at(
                                            past_of(in_.pasts, instance.id).predictor.at(ahead_s_).pose, instance)
                                      : instance.world_from_instance;
    if (samples_surface(in_.step, i))
      pick_surface_points(in_.step.targets.pieces[i], instance, later);
    else
      pick_aim_point(in_.step.targets.tracked_targets[i].aim_m, instance, later);
    now_.points_of_target.push_back(run_from(first, now_.points_m));
    now_.sights_of_target.push_back(run_from(first_sight, now_.sights_m));
    ahead_.points_of_target.push_back(run_from(first_ahead, ahead_.points_m));
  }

 private:
  void pick_surface_points(std::span<const TargetPiece> pieces, const Instance& instance, const Affine& later) {
    const double x = random_.next_unit(), y = random_.next_unit();
    const auto now = [&](uint32_t slot) { return in_.step.input.scene.instances()[slot].world_from_instance; };
    add_points(
        now_.sights_m,
        pick(pieces,
             {.viewer_m = position_on_course_m(in_.step), .blend = glm::dvec2(x, y), .round = in_.step.input.tick}),
        now);
    const std::span<const TargetPoint> picked = pick(pieces,
                                                     {.viewer_m = in_.bound.center_m, .round = in_.step.decision});
    if (of_points_ > 0) add_points(now_.points_m, picked.first((picked.size() + of_points_ - 1) / of_points_), now);
    if (ahead_s_ <= 0) return;
    // The parts go the way of the target's own instance.
    const Affine way = compose(later, inverse(instance.world_from_instance));
    const auto then = [&](uint32_t slot) {
      return &in_.step.input.scene.instances()[slot] == &instance ? later : compose(way, now(slot));
    };
    add_points(ahead_.points_m, picked.first(std::min(kPointsAhead, picked.size())), then);
  }
  void pick_aim_point(const glm::dvec3& aim_m, const Instance& instance, const Affine& later) {
    if (of_points_ > 0) now_.points_m.push_back(aim_m);
    now_.sights_m.push_back(aim_m);
    if (ahead_s_ <= 0) return;
    ahead_.points_m.push_back(transform_point(later, transform_point(inverse(instance.world_from_instance), aim_m)));
  }
  std::span<const TargetPoint> pick(std::span<const TargetPiece> pieces, TargetView view) {
    const StepInput& input = in_.step.input;
    view.count = static_cast<size_t>(input.settings.sample.points);
    return picker_.pick(input.scene, pieces, view);
  }

  const SampleInput& in_;
  CounterRandom random_;
  TargetPicker& picker_;
  const size_t of_points_;
  Sampled &now_, &ahead_;
  const double ahead_s_;
};

// The greatest depth of any position that is looked up in this map. Candidates lie in the bound, and the camera moves
// by one step at most. Candidates of pair volumes may lie anywhere before their far plane.
double far_m(const SampleInput& in, const SamplePlan& plan, const MapView& view) {
  if (plan.pair.used) return std::numeric_limits<double>::infinity();
  const CameraState& camera = in.step.camera;
  const double speed_mps = std::max(in.step.input.limits.max_speed_mps, glm::length(camera.velocity_mps));
  const double bound_m = glm::dot(view.eye_m - in.bound.center_m, view.world_from_view[2]) + in.bound.radius_m;
  const double camera_m = glm::distance(view.eye_m, camera.pose.position_m) + speed_mps * in.step.move_s;
  return beyond_all_m(std::max(bound_m, camera_m));
}

void request(const SampleInput& in, const Sampled& sampled, double ahead_s, SamplePlan& plan) {
  for (size_t target = 0; target < sampled.points_of_target.size(); ++target) {
    const auto ask = [&](uint32_t view) {
      plan.requests[view] = {.view = plan.views[view],
                             .layer_mask = in.step.input.targets[target].layer_mask,
                             .ahead_s = ahead_s,
                             .far_m = far_m(in, plan, plan.views[view]),
                             .ignored_slots = in.step.targets.ignored_slots[target]};
    };
    const MapRange& points = sampled.points_of_target[target];
    for (uint32_t p = points.first; p < points.first + points.count; ++p) {
      const MapRange& maps = sampled.maps_of_point[p];
      for (uint32_t view = maps.first; view < maps.first + maps.count; ++view) ask(view);
    }
    if (sampled.sights_of_target.empty()) continue;
    const MapRange& sights = sampled.sights_of_target[target];
    for (uint32_t k = sights.first; k < sights.first + sights.count; ++k) ask(sampled.first_sight + k);
  }
}

void request_all(const SampleInput& in, SamplePlan& plan) {
  plan.requests.resize(plan.views.size());
  request(in, plan.now, 0.0, plan);
  request(in, plan.ahead, plan.ahead_s, plan);
  for (const SampledSlice& slice : plan.slices) request(in, slice.sampled, slice.due.ahead_s, plan);
  request_look(in, plan);
}

PairPlan pair_plan(const StepContext& step) {
  PairPlan pair{.asked = step.input.settings.aggregate.volume == Volume::kPair};
  pair.needs_two = pair.asked && step.target_count() < 2;
  // only candidates that keep their places can be planned with
  pair.needs_lattice = pair.asked && !follows_paper(step.input);
  return pair;
}

void clear(SamplePlan& plan) {
  plan.views.clear();
  plan.now.clear();
  plan.ahead.clear();
  plan.slices.resize(0);
  plan.used_cube_map = false;
}

}  // namespace

bool samples_surface(const StepContext& step, size_t target) {
  return step.input.settings.sample.points > 0 && sampled_pieces(step.targets.pieces[target]) > 0;
}

void plan_maps(const SampleInput& in, const glm::dvec2& jitter, Sampled& sampled, SamplePlan& plan) {
  for (const glm::dvec3& point_m : sampled.points_m) {
    const auto first = static_cast<uint32_t>(plan.views.size());
    const int count = plan_views(point_m, in.bound, in.step.input.settings.sample, jitter, plan.views);
    sampled.maps_of_point.push_back({first, static_cast<uint32_t>(count)});
    plan.used_cube_map |= count > 1;
  }
}

void plan_sights(const StepContext& step, SamplePlan& plan) {
  plan.now.first_sight = static_cast<uint32_t>(plan.views.size());
  for (const glm::dvec3& point_m : plan.now.sights_m)
    plan.views.push_back(plan_sight(point_m, position_on_course_m(step)));
}

glm::dvec2 pick_points(const SampleInput& in, double most_ahead_s, size_t of_points, SampleScratch& scratch,
                       SamplePlan& plan) {
  decide_ahead(in, most_ahead_s, plan);
  PointPicker picker(in, scratch.picker, of_points, plan);
  for (size_t i = 0; i < in.step.target_count(); ++i) picker.pick_target(i);
  return texel_jitter(in.step.input, in.step.decision);
}

void plan_sample(const SampleInput& in, SampleScratch& scratch, SamplePlan& plan) {
  clear(plan);
  plan.pair = pair_plan(in.step);
  if (follows_paper(in.step.input))
    plan_paper_maps(in, scratch, plan);
  else
    plan_flight_maps(in, scratch, plan);
  plan.look = plan_look(in, plan);
  request_all(in, plan);
}

void plan_sights_alone(const SampleInput& in, SampleScratch& scratch, SamplePlan& plan) {
  clear(plan);
  plan.pair = pair_plan(in.step), plan.look = {};
  plan.cut.due = false, plan.cut.places.clear();
  pick_points(in, kForecastS, 0, scratch, plan);
  plan_sights(in.step, plan);
  plan_sights_ahead(plan);
  request_all(in, plan);
}

SampledPoints TakenMaps::of(const Sampled& sampled) const {
  return {maps, sampled.maps_of_point, sampled.points_of_target, settings.visibility_threshold};
}

double TakenMaps::falls_short_m(uint32_t sight, const glm::dvec3& position_m) const {
  return map_falls_short_m(plan.now.first_sight + sight, position_m);
}

double TakenMaps::map_falls_short_m(uint32_t map, const glm::dvec3& position_m) const {
  return glm::distance(position_m, maps[map].view.eye_m) - maps[map].distance_at(0, 0) * (1.0 + settings.relative_bias);
}

OwnSight own_sight(const TakenMaps& taken, size_t target, const glm::dvec3& position_m) {
  const MapRange& sights = taken.plan.now.sights_of_target[target];
  OwnSight own{.points = sights.count};
  for (uint32_t k = sights.first; k < sights.first + sights.count; ++k)
    own.seen += taken.falls_short_m(k, position_m) <= 0;
  return own;
}

}  // namespace sightline
