// The maps that the flight plan needs: few of the present, many of coming times, and single rays to where the camera is
// about to be.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "server/base/random.h"
#include "server/move/sight_weight.h"
#include "server/step/sampled_points.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// A flight plan adds up the maps of many steps, so each step takes maps from every second point only.
constexpr size_t kOfPoints = 2;

// Turns a vector about the vertical.
glm::dvec3 turned(const glm::dvec3& v, double rad) {
  const double c = std::cos(rad), s = std::sin(rad);
  return {c * v.x + s * v.z, v.y, c * v.z - s * v.x};
}

glm::dvec3 box_middle_m(const Instance& instance) {
  return transform_point(instance.world_from_instance, glm::dvec3(instance.geometry->bounds.center()));
}

// By how much to move a point of a target, given its offset from the target's middle, so that the plan takes the target
// to be wider and taller than it is. A place that only just shows the whole target soon loses it, because the camera
// and the target never pass exactly where they were expected, and because places lie apart. There is no margin below
// the target, where the ground is. With several targets (`several` is several_factor) the margin is smaller, since few
// places show them all.
glm::dvec3 margin_m(const glm::dvec3& from_middle_m, double several) {
  constexpr double kWiderM = 0.35, kTallerM = 0.45;
  const double out_m = std::hypot(from_middle_m.x, from_middle_m.z);
  const double wider = out_m > kWiderM ? kWiderM / out_m : 1.0;
  const double taller_m = std::clamp(from_middle_m.y / 2, 0.0, kTallerM);
  return glm::dvec3(wider * from_middle_m.x, taller_m, wider * from_middle_m.z) / several;
}

// Picks the points of the targets at the slices that are due. In each slice all targets go on as predicted or turn to
// one side, by chance, since people do turn. The estimates of several steps together hold every way that they may go.
class SlicePicker {
 public:
  SlicePicker(const SampleInput& in, SampleScratch& scratch, SamplePlan& plan)
      : in_(in),
        scratch_(scratch),
        plan_(plan),
        random_(in.step.input.seed, in.step.decision, RandomPurpose::kTurn),
        several_(several_factor(effective_count(in.step.targets.sight_weights))) {}

  void pick() {
    const MoveSettings& settings = in_.step.input.settings.move;
    if (in_.step.targets.steered == 0) return;
    const auto count = static_cast<size_t>(std::ceil(kSlices * in_.step.decision_s / kRenewS - 1e-9));
    for (const DueSlice& due : in_.carried.candidates.ahead.due(in_.step.decision_s, count)) {
      plan_.slices.resize(plan_.slices.size() + 1);
      SampledSlice& slice = plan_.slices[plan_.slices.size() - 1];
      slice.due = due;
      slice.aim_m.clear();
      slice.sampled.clear();
      const double chance = random_.next_unit() / std::max(settings.turn_probability, 1e-9);
      turns_rad_[due.slice] = chance < 0.5 ? settings.turn_rad : chance < 1.0 ? -settings.turn_rad : 0.0;
      slice.turned = chance < 1.0;
    }
    for (size_t i = 0; i < in_.step.target_count(); ++i) pick_target(i);
  }

 private:
  // All slices of one target, since its surroundings are gathered once.
  void pick_target(size_t i) {
    const MotionPredictor& predictor = past_of(in_.pasts, in_.step.targets.ids[i]).predictor;
    const double longest_s = std::min(in_.step.input.settings.move.prediction_s, kSlices * kSliceS);
    const double reach_m = longest_s * (glm::length(predictor.velocity_mps()) +
                                        longest_s * glm::length(predictor.acceleration_mps2())) +
                           2 * kWalkerM;
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
    const glm::dvec3 way_m = free_way(
        aim_m,
        turned(predictor.at(ahead_s).pose.position_m - predictor.at(0).pose.position_m, turns_rad_[slice.due.slice]));
    slice.aim_m.push_back(aim_m + way_m);
    if (!samples_surface(in_.step, i)) return slice.sampled.points_m.push_back(aim_m + way_m);
    const SceneMirror& scene = in_.step.input.scene;
    const TargetView view{
        .viewer_m = in_.bound.center_m,
        .moved_m = way_m,
        .round = in_.step.decision + slice.due.slice,
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
    // less where the target touches the ground
    const double core_m = scratch_.colliders.clearance_m(from_m, 2 * kWalkerM) / 2;
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

}  // namespace

// Since the slices tell what will be hidden from each cell, the forecast needs the camera's own position only.
void plan_sights_ahead(SamplePlan& plan) {
  for (const glm::dvec3& point_m : plan.ahead.points_m) {
    plan.ahead.maps_of_point.push_back({static_cast<uint32_t>(plan.views.size()), 1});
    plan.views.push_back(plan_sight(point_m, plan.camera_ahead_m));
  }
}

void plan_flight_maps(const SampleInput& in, SampleScratch& scratch, SamplePlan& plan) {
  const glm::dvec2 jitter = pick_points(in, kForecastS, kOfPoints, scratch, plan);
  plan_maps(in, jitter, plan.now, plan);
  plan_sights(in.step, plan);
  plan_sights_ahead(plan);
  SlicePicker(in, scratch, plan).pick();
  for (SampledSlice& slice : plan.slices) plan_maps(in, jitter, slice.sampled, plan);
}

}  // namespace sightline
