// The sample stage: it picks the sampled points of the targets and plans the maps from them (paper 3.2, 4; design 4).
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <span>

#include "server/base/random.h"
#include "server/move/sight_weight.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// Points of a predicted target. A prediction is uncertain, so it needs fewer points than the target itself.
constexpr size_t kPointsAhead = 3;
// A shorter prediction would add nothing to the present poses.
constexpr double kLeastAheadS = 0.05;
// How far ahead strategy kMinCost foretells what will be seen; farther, people do something else. Its plan looks farther ahead.
constexpr double kForecastS = 0.5;

glm::dvec2 texel_jitter(const StepInput& input) {
  if (!input.settings.sample.jitter) return {0.5, 0.5};
  CounterRandom random(input.seed, input.tick, RandomPurpose::kTexelJitter);
  const double x = random.next_unit(), y = random.next_unit();
  return {x, y};
}

// `world_from` gives the transform of the instance in a mirror slot.
template <typename WorldFrom>
void add_points(std::vector<glm::dvec3>& points_m, std::span<const TargetPoint> points, WorldFrom world_from) {
  for (const TargetPoint& p : points) points_m.push_back(transform_point(world_from(p.slot), glm::dvec3(p.at_m)));
}

// The range from `first` to the end of a list.
MapRange run_from(size_t first, const std::vector<glm::dvec3>& list) {
  return {static_cast<uint32_t>(first), static_cast<uint32_t>(list.size() - first)};
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

// The camera's position at the time of the prediction: on the way to its goal, else as it goes on with its velocity. Maps hold only positions
// in the bound.
glm::dvec3 camera_ahead_m(const SampleInput& in, double ahead_s) {
  const CameraState& camera = in.step.camera;
  glm::dvec3 way_m = camera.velocity_mps * ahead_s;
  if (in.carried.goal_m) way_m = (*in.carried.goal_m - camera.pose.position_m) * (ahead_s / kGoalS);
  return nearest_in_bound_m(in.bound, camera.pose.position_m + way_m);
}

// The longest time for which every steered target can be predicted, at most MoveSettings::prediction_s.
void decide_ahead(const SampleInput& in, SamplePlan& plan) {
  const StepContext& step = in.step;
  double ahead_s = step.input.settings.move.prediction_s, confidence = 1.0;
  if (weighs_hidden(step.input)) ahead_s = std::min(ahead_s, kForecastS);
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
  PointPicker(const SampleInput& in, TargetPicker& picker, SamplePlan& plan)
      : in_(in),
        random_(in.step.input.seed, in.step.input.tick, RandomPurpose::kViewBlend),
        picker_(picker),
        now_(plan.now),
        ahead_(plan.ahead),
        ahead_s_(plan.ahead_s) {}

  void pick_target(size_t i) {
    const Instance& instance = *in_.step.input.scene.find(in_.step.targets.ids[i]);
    const size_t first = now_.points_m.size(), first_ahead = ahead_.points_m.size(), first_sight = now_.sights_m.size();
    const Affine later =
        ahead_s_ > 0 ? world_from_instance_at(past_of(in_.pasts, instance.id).predictor.at(ahead_s_).pose, instance)
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
    add_points(now_.sights_m, pick(pieces, {.viewer_m = position_on_course_m(in_.step), .blend = glm::dvec2(x, y)}), now);
    const std::span<const TargetPoint> picked = pick(pieces, {.viewer_m = in_.bound.center_m});
    // A flight plan adds up the maps of many steps, so it needs fewer of them in each.
    const size_t mapped = weighs_hidden(in_.step.input) ? (picked.size() + 1) / 2 : picked.size();
    add_points(now_.points_m, picked.first(mapped), now);
    if (ahead_s_ <= 0) return;
    // The parts go the way of the target's own instance.
    const Affine way = compose(later, inverse(instance.world_from_instance));
    const auto then = [&](uint32_t slot) { return &in_.step.input.scene.instances()[slot] == &instance ? later : compose(way, now(slot)); };
    add_points(ahead_.points_m, picked.first(std::min(kPointsAhead, picked.size())), then);
  }
  void pick_aim_point(const glm::dvec3& aim_m, const Instance& instance, const Affine& later) {
    now_.points_m.push_back(aim_m);
    now_.sights_m.push_back(aim_m);
    if (ahead_s_ <= 0) return;
    ahead_.points_m.push_back(transform_point(later, transform_point(inverse(instance.world_from_instance), aim_m)));
  }
  std::span<const TargetPoint> pick(std::span<const TargetPiece> pieces, TargetView view) {
    const StepInput& input = in_.step.input;
    view.round = input.tick, view.count = static_cast<size_t>(input.settings.sample.points);
    return picker_.pick(input.scene, pieces, view);
  }

  const SampleInput& in_;
  CounterRandom random_;
  TargetPicker& picker_;
  Sampled &now_, &ahead_;
  const double ahead_s_;
};

// Turns a vector about the vertical.
glm::dvec3 turned(const glm::dvec3& v, double rad) {
  const double c = std::cos(rad), s = std::sin(rad);
  return {c * v.x + s * v.z, v.y, c * v.z - s * v.x};
}

glm::dvec3 box_middle_m(const Instance& instance) {
  return transform_point(instance.world_from_instance, glm::dvec3(instance.geometry->bounds.center()));
}

// By how much to move a point of a target, given its offset from the target's middle, so that the plan takes the target to be wider and taller
// than it is. A place that only just shows the whole target soon loses it, because the camera and the target never pass exactly where they were
// expected, and because places lie apart. There is no margin below the target, where the ground is. With several targets (`several` is
// several_factor) the margin is smaller, since few places show them all.
glm::dvec3 margin_m(const glm::dvec3& from_middle_m, double several) {
  constexpr double kWiderM = 0.35, kTallerM = 0.45;
  const double out_m = std::hypot(from_middle_m.x, from_middle_m.z);
  const double wider = out_m > kWiderM ? kWiderM / out_m : 1.0;
  const double taller_m = std::clamp(from_middle_m.y / 2, 0.0, kTallerM);
  return glm::dvec3(wider * from_middle_m.x, taller_m, wider * from_middle_m.z) / several;
}

// Picks the points of the targets at the slices that are due. In each slice all targets go on as predicted or turn to one side, by
// chance, since people do turn. The estimates of several steps together hold every way that they may go.
class SlicePicker {
 public:
  SlicePicker(const SampleInput& in, SampleScratch& scratch, SamplePlan& plan)
      : in_(in), scratch_(scratch), plan_(plan), random_(in.step.input.seed, in.step.input.tick, RandomPurpose::kTurn),
        several_(several_factor(effective_count(in.step.targets.sight_weights))) {}

  void pick() {
    const MoveSettings& settings = in_.step.input.settings.move;
    plan_.slices.resize(0);
    if (!weighs_hidden(in_.step.input) || in_.step.targets.steered == 0) return;
    const auto count = static_cast<size_t>(std::ceil(kSlices * in_.step.move_s / kRenewS - 1e-9));
    for (const DueSlice& due : in_.carried.candidates.ahead.due(in_.step.move_s, count)) {
      plan_.slices.resize(plan_.slices.size() + 1);
      SampledSlice& slice = plan_.slices[plan_.slices.size() - 1];
      slice.due = due;
      slice.aim_m.clear();
      slice.sampled.clear();
      const double chance = random_.next_unit() / std::max(settings.turn_probability, 1e-9);
      turns_rad_[due.slice] = chance < 0.5 ? settings.turn_rad : chance < 1.0 ? -settings.turn_rad : 0.0;
    }
    for (size_t i = 0; i < in_.step.target_count(); ++i) pick_target(i);
  }

 private:
  // All slices of one target, since its surroundings are gathered once.
  void pick_target(size_t i) {
    const MotionPredictor& predictor = past_of(in_.pasts, in_.step.targets.ids[i]).predictor;
    const double longest_s = std::min(in_.step.input.settings.move.prediction_s, kSlices * kSliceS);
    const double reach_m = longest_s * (glm::length(predictor.velocity_mps()) + longest_s * glm::length(predictor.acceleration_mps2())) + 2 * kWalkerM;
    const SceneMirror& scene = in_.step.input.scene;
    scratch_.colliders.gather(scene, in_.step.targets.tracked_targets[i].aim_m, reach_m, scene.moving_slots());
    scratch_.colliders.allow(kMostTests / in_.step.target_count());
    for (SampledSlice& slice : plan_.slices) {
      const size_t first = slice.sampled.points_m.size();
      pick_points_of(i, predictor, slice);
      slice.sampled.points_of_target.push_back(run_from(first, slice.sampled.points_m));
    }
  }
  void pick_points_of(size_t i, const MotionPredictor& predictor, SampledSlice& slice) {
    const glm::dvec3 aim_m = in_.step.targets.tracked_targets[i].aim_m;
    const double ahead_s = std::min(slice.due.ahead_s, in_.step.input.settings.move.prediction_s);
    const glm::dvec3 way_m = free_way(aim_m, turned(predictor.at(ahead_s).pose.position_m - predictor.at(0).pose.position_m, turns_rad_[slice.due.slice]));
    slice.aim_m.push_back(aim_m + way_m);
    if (!samples_surface(in_.step, i)) return slice.sampled.points_m.push_back(aim_m + way_m);
    const SceneMirror& scene = in_.step.input.scene;
    const TargetView view{.viewer_m = in_.bound.center_m,
                        .moved_m = way_m,
                        .round = in_.step.input.tick + slice.due.slice,
                        .count = std::min<size_t>(kPointsOfSlice, static_cast<size_t>(in_.step.input.settings.sample.points))};
    std::vector<glm::dvec3>& points_m = slice.sampled.points_m;
    const size_t first = points_m.size();
    add_points(points_m, scratch_.picker.pick(scene, in_.step.targets.pieces[i], view), [&](uint32_t slot) {
      Affine then = scene.instances()[slot].world_from_instance;
      then[3] += way_m;
      return then;
    });
    // The middle of its first piece, not of all, which would swing with every limb.
    const glm::dvec3 middle_m = box_middle_m(scene.instances()[in_.step.targets.pieces[i].front().slot]) + way_m;
    for (glm::dvec3& point_m : std::span(points_m).subspan(first)) point_m += margin_m(point_m - middle_m, several_);
  }
  // The part of a predicted way that leads through no wall.
  glm::dvec3 free_way(const glm::dvec3& from_m, const glm::dvec3& way_m) const {
    if (glm::length(way_m) < 1e-6) return way_m;
    const double core_m = scratch_.colliders.clearance_m(from_m, 2 * kWalkerM) / 2;  // less where the target touches the ground
    return way_m * scratch_.colliders.free_fraction(from_m, from_m + way_m, core_m);
  }

  static constexpr double kWalkerM = 0.2;      // radius of the core of a target that walks past a wall
  static constexpr double kRenewS = 1.0 / 15;  // every slice is renewed once in this time
  static constexpr size_t kPointsOfSlice = 2;  // of each target; successive renewals take others

  const SampleInput& in_;
  SampleScratch& scratch_;
  SamplePlan& plan_;
  CounterRandom random_;
  const double several_;
  std::array<double, kSlices> turns_rad_{};
};

// Plans pair volumes from one point of each target, the paper's one per frame.
void chain_pairs(const SampleInput& in, const glm::dvec2& jitter, SamplePlan& plan) {
  const StepSettings& settings = in.step.input.settings;
  plan.pair = {.asked = settings.aggregate.volume == Volume::kPair};
  if (!plan.pair.asked) return;
  plan.pair.needs_two = in.step.target_count() < 2;
  // These keep what they know of a position by its lattice cell.
  plan.pair.needs_lattice = weighs_hidden(in.step.input) || settings.aggregate.filter.mode == FilterMode::kPerTarget;
  if (plan.pair.needs_two || plan.pair.needs_lattice) return;
  plan.chained_m.clear();
  for (const MapRange& points : plan.now.points_of_target) plan.chained_m.push_back(plan.now.points_m[points.first]);
  plan.pair.gap = make_pair_chain(plan.chained_m, in.bound, map_resolution(settings.sample, in.bound), jitter, plan.chain);
  plan.pair.used = plan.pair.gap == PairGap::kNone;
}

// Plans one map and one sight for each target. These maps come first: maps[i] belongs to target i.
void plan_chain_maps(const glm::dvec2& jitter, SamplePlan& plan) {
  Sampled& now = plan.now;
  now.points_m = plan.chained_m;
  for (uint32_t i = 0; i < now.points_m.size(); ++i) {
    now.sights_m[i] = now.sights_m[now.sights_of_target[i].first];
    now.sights_of_target[i] = {i, 1};
    now.points_of_target[i] = now.maps_of_point.emplace_back(MapRange{i, 1});
    plan.views.push_back(chain_view(plan.chain, i, jitter));
  }
  now.sights_m.resize(now.points_m.size());
}

void plan_maps(const SampleInput& in, const glm::dvec2& jitter, Sampled& sampled, SamplePlan& plan) {
  for (const glm::dvec3& point_m : sampled.points_m) {
    const auto first = static_cast<uint32_t>(plan.views.size());
    const int count = plan_views(point_m, in.bound, in.step.input.settings.sample, jitter, plan.views);
    sampled.maps_of_point.push_back({first, static_cast<uint32_t>(count)});
    plan.used_cube_map |= count > 1;
  }
}

// A flight plan knows what is hidden at coming times (SlicePicker), so the forecast needs only what the camera will see.
void plan_maps_ahead(const SampleInput& in, const glm::dvec2& jitter, SamplePlan& plan) {
  if (!weighs_hidden(in.step.input)) return plan_maps(in, jitter, plan.ahead, plan);
  for (const glm::dvec3& point_m : plan.ahead.points_m) {
    plan.ahead.maps_of_point.push_back({static_cast<uint32_t>(plan.views.size()), 1});
    plan.views.push_back(plan_sight(point_m, plan.camera_ahead_m));
  }
}

void plan_sights(const StepContext& step, SamplePlan& plan) {
  plan.now.first_sight = static_cast<uint32_t>(plan.views.size());
  for (const glm::dvec3& point_m : plan.now.sights_m)
    plan.views.push_back(plan_sight(point_m, position_on_course_m(step)));
}

// The greatest depth of any position that is looked up in this map. Candidates lie in the bound, and the camera moves by one step at most.
// Candidates of pair volumes may lie anywhere before their far plane.
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

void clear(SamplePlan& plan) {
  plan.views.clear();
  plan.now.clear();
  plan.ahead.clear();
  plan.used_cube_map = false;
}

}  // namespace

bool samples_surface(const StepContext& step, size_t target) {
  return step.input.settings.sample.points > 0 && sampled_pieces(step.targets.pieces[target]) > 0;
}

void plan_sample(const SampleInput& in, SampleScratch& scratch, SamplePlan& plan) {
  clear(plan);
  decide_ahead(in, plan);
  PointPicker picker(in, scratch.picker, plan);
  for (size_t i = 0; i < in.step.target_count(); ++i) picker.pick_target(i);
  const glm::dvec2 jitter = texel_jitter(in.step.input);
  chain_pairs(in, jitter, plan);
  if (plan.pair.used)
    plan_chain_maps(jitter, plan);
  else
    plan_maps(in, jitter, plan.now, plan);
  plan_sights(in.step, plan);
  plan_maps_ahead(in, jitter, plan);
  SlicePicker(in, scratch, plan).pick();
  for (SampledSlice& slice : plan.slices) plan_maps(in, jitter, slice.sampled, plan);
  plan.look = plan_look(in, plan.views);
  request_all(in, plan);
}

SampledPoints TakenMaps::of(const Sampled& sampled) const {
  return {maps, sampled.maps_of_point, sampled.points_of_target, settings.visibility_threshold};
}

double TakenMaps::falls_short_m(uint32_t sight, const glm::dvec3& position_m) const {
  const DepthMap& map = maps[plan.now.first_sight + sight];
  return glm::distance(position_m, plan.now.sights_m[sight]) - map.distance_at(0, 0) * (1.0 + settings.relative_bias);
}

OwnSight own_sight(const TakenMaps& taken, size_t target, const glm::dvec3& position_m) {
  const MapRange& sights = taken.plan.now.sights_of_target[target];
  OwnSight own{.points = sights.count};
  for (uint32_t k = sights.first; k < sights.first + sights.count; ++k)
    own.seen += taken.falls_short_m(k, position_m) <= 0;
  return own;
}

}  // namespace sightline
