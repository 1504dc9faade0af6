#include "server/step/step.h"

#include <algorithm>
#include <utility>

#include "server/step/far_apart.h"
#include "server/step/opening.h"
#include "server/step/report.h"
#include "server/step/shot_in_force.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

class StageTimer {
 public:
  StageTimer(const StageClock& clock, Stage stage, std::array<int64_t, kStageCount>& stage_ns)
      : clock_(clock), out_ns_(stage_ns[static_cast<size_t>(stage)]), begin_ns_(clock()) {}
  ~StageTimer() { out_ns_ += clock_() - begin_ns_; }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  const StageClock& clock_;
  int64_t& out_ns_;
  int64_t begin_ns_;
};

// Extra distance that the bound keeps from the targets' centre, beyond the camera's least distance. Nearer, one map
// could no longer show the whole bound.
constexpr double kBoundFromTargetsM = 0.5;

// The lens of the returned picture.
Lens picture_lens(const StepContext& step, const StepResult& result) {
  Lens lens = step.input.lens;
  lens.vertical_fov_rad = result.vertical_fov_rad;
  return lens;
}

// The carried horizon, clamped to the present settings.
double horizon_s(const CarriedState& carried, const BoundSettings& settings) {
  return std::clamp(carried.horizon_s, settings.horizon_s, settings.max_horizon_s);
}

// Paper 3.1.
Bound reachable_bound(const StepContext& step, double horizon_s) {
  const BoundSettings& settings = step.input.settings.bound;
  const Bound bound = bound_camera(step.camera, step.input.limits, settings, horizon_s, step.move_s);
  if (step.targets.steered == 0 || settings.target_reach_m == 0) return bound;
  return extend_towards(bound, step.center_m(), settings.target_reach_m,
                        step.input.settings.move.min_distance_m + kBoundFromTargetsM);
}

}  // namespace

glm::dvec3 desired_position_m(const StepContext& step, const WantedShot& shot) {
  const MoveSettings& settings = step.input.settings.move;
  if (settings.follow == Follow::kStay) return step.camera.pose.position_m;
  return desired_place_m(step.targets.tracked_targets, shot.shown_offset_m(), place_lens(step),
                         step.input.settings.framing.framing_margin, settings);
}

double route_radius_m(const StepContext& step) {
  constexpr double kRoomM = 0.05;
  return swept_radius_m(step.input.limits, step.lens) + kRoomM;
}

// Data of the step between `begin` and `finish`, and scratch memory that is reused. Its contents have no meaning for
// the next step.
struct Stepper::Work {
  std::optional<StepInput> input;
  Opening opening;
  std::array<int64_t, kStageCount> stage_ns{};

  SampleScratch sample;
  AggregateScratch aggregate;
  MoveScratch move;
  CutScratch cut;

  StepContext context(const TargetsNow& targets, const CameraState& camera, const DecisionInForce& last) const {
    Lens lens = input->lens;
    lens.vertical_fov_rad = opening.zoom.vertical_fov_rad;
    return {.input = *input,
            .targets = targets,
            .camera = camera,
            .lens = lens,
            .move_s = opening.move_s,
            .decides = opening.decides,
            .decision_s = opening.decision_s,
            .decision = opening.decision,
            .clock_s = last.clock_s + opening.move_s};
  }
  StageTimer time(const StageClock& clock, Stage stage) { return {clock, stage, stage_ns}; }
};

Stepper::Stepper() : work_(std::make_unique<Work>()) {}
Stepper::~Stepper() = default;
Stepper::Stepper(Stepper&&) noexcept = default;
Stepper& Stepper::operator=(Stepper&&) noexcept = default;

void Stepper::place_camera(const Pose& pose, const glm::dvec3& velocity_mps) {
  place_camera({.pose = pose, .velocity_mps = velocity_mps});
}

void Stepper::place_camera(const ViewerCamera& viewer) {
  sightline::place_camera(carried_, viewer);
}

bool Stepper::observe_camera(const ViewerCamera& viewer) {
  return sightline::observe_camera(carried_, viewer);
}

MapOrder Stepper::begin(const StepInput& input, const StageClock& clock) {
  Work& work = *work_;
  const CarriedState& carried = carried_;  // only `finish` changes it
  work.input.emplace(input);
  work.stage_ns.fill(0);
  open_step(input, carried, dump_.targets, work.opening);
  const StepContext step = work.context(dump_.targets, carried.camera, carried.in_force);
  dump_.decided = step.decides;
  {  // 1. Where can the camera be soon?
    const StageTimer timer = work.time(clock, Stage::kBound);
    dump_.bound = reachable_bound(step, horizon_s(carried, input.settings.bound));
  }
  {  // 2. Which maps are needed, and from which points?
    const StageTimer timer = work.time(clock, Stage::kSample);
    const SampleInput in{step, dump_.bound, work.opening.pasts, work.opening.shot, carried};
    if (step.decides) {
      plan_sample(in, work.sample, dump_.plan);
      plan_cut(in, carried, work.opening.target_jumped, work.sample.picker, work.cut, dump_.plan);
    } else {
      plan_sights_alone(in, work.sample, dump_.plan);
    }
  }
  if (dump_.plan.requests.empty()) dump_.maps.clear();
  return {dump_.plan.requests, &dump_.maps};
}

StepResult Stepper::finish(const StageClock& clock) {
  Work& work = *work_;
  const StepContext step = work.context(dump_.targets, carried_.camera, carried_.in_force);
  const TakenMaps taken{dump_.plan, dump_.maps, work.input->settings.aggregate};
  // Nothing can fail from here on, so the changes of `begin` are stored now.
  const WantedShot& opened = work.opening.shot;
  if (opened.frame.number != carried_.shot.frame.number || opened.target_set != carried_.shot.target_set)
    carried_.in_force.facts = {};
  carried_.zoom = work.opening.zoom;
  carried_.shot = work.opening.shot;
  carried_.given_up = work.opening.given_up;
  carried_.horizon_s = horizon_s(carried_, work.input->settings.bound);
  carried_.pasts.swap(work.opening.pasts);
  carried_.doors.pass(work.input->scene, {step.targets.ids.begin(), step.targets.ids.size()}, step.move_s,
                      step.clock_s);

  glm::dvec3 desired_m(0.0);
  {  // 3. Which candidates see which targets, now and over the last steps, and which shot is best?
    const StageTimer timer = work.time(clock, Stage::kAggregate);
    const WantedShot before = carried_.shot;
    if (step.decides) {
      search_viewpoints(step, taken, carried_.viewpoints, carried_.shot);
      watch_asked_place(step, taken, carried_.shot);
      line_up_shot(step, carried_.viewpoints, carried_.shot);
    }
    dump_.new_shot = carried_.shot.other_viewpoint() != before.other_viewpoint() ||
                     carried_.shot.in_line_m.has_value() != before.in_line_m.has_value();
    if (step.targets.steered != 0) desired_m = desired_position_m(step, carried_.shot);
    if (step.decides)
      aggregate({step, dump_.bound, taken, desired_m}, carried_.candidates, work.aggregate, dump_.sights);
    else
      dump_.sights.candidates.clear(), dump_.sights.counts = carried_.in_force.counts;
  }
  {  // 4. Where to go, how fast, and which way to look? `choose_goal` (goal_search.cpp) chooses the candidate.
    const StageTimer timer = work.time(clock, Stage::kMove);
    if (step.move_s > 0) gather_colliders(step, dump_.bound, dump_.surroundings);
    const uint32_t seen_here = seen_from_own_position(step, taken);
    const MoveInput in{step, carried_, dump_.bound, dump_.plan, dump_.sights, dump_.surroundings, desired_m, seen_here};
    dump_.decision = step.decides ? decide(in, work.move) : go_on(in);
    const CutPlace* place = choose_cut(in, taken, work.opening.target_jumped, dump_.decision, work.move, carried_.cut);
    carried_.cut.target_jumped = jump_waits(in, work.opening.target_jumped);
    if (place) cut_to(in, taken, *place, work.move, carried_.shot, dump_.decision), begin_at_cut(*place);
    carried_.shot.cut_s = std::max(0.0, carried_.shot.cut_s - step.move_s);
  }
  carried_.camera = dump_.decision.camera;
  carried_.path.pass(carried_.camera.pose, step.move_s);
  carried_.pull_mps = glm::dvec3(0.0);
  carried_.turn = dump_.decision.turn;
  carried_.zoom.vertical_fov_rad = dump_.decision.vertical_fov_rad;
  carried_.horizon_s = dump_.decision.horizon_s;
  carried_.goal_m = dump_.decision.goal_m;
  carried_.follows = dump_.decision.follows;
  carried_.change = dump_.decision.change;
  carried_.blind = dump_.decision.blind;
  carried_.not_aimed_at = dump_.decision.not_aimed_at;
  // A target that is no longer given up is aimed at when it can be shown.
  for (const uint64_t id : carried_.given_up)
    if (std::ranges::find(carried_.not_aimed_at, id) == carried_.not_aimed_at.end())
      carried_.not_aimed_at.push_back(id);

  keep_decision(step);
  StepResult result = report_step(
      {*work.input, dump_, taken, carried_.pasts, carried_.given_up, carried_.in_force.seen}, carried_.shares);
  if (step.targets.steered != 0 && work.input->settings.move.follow == Follow::kOffset)
    result.shot = report_shot(step, carried_.shot, result.camera, picture_lens(step, result),
                              {result.targets.begin(), result.targets.size()});
  note_sights(step, result, work.opening.target_jumped, carried_.shot.cut_s > 0, carried_.cut);
  result.stage_ns = work.stage_ns;
  return result;
}

// A paused step decides, but time does not pass.
void Stepper::keep_decision(const StepContext& step) {
  DecisionInForce& kept = carried_.in_force;
  kept.clock_s += step.move_s;
  if (!step.decides) return static_cast<void>(kept.age_s += step.move_s);
  const Decision& decision = dump_.decision;
  if (step.move_s > 0) {
    kept.age_s = 0.0, kept.is_due = decision.cut;
    kept.made = step.target_count() > 0 ? kept.made + 1 : 0;
    kept.tracking = decision.tracking;
    kept.status = decision.status, kept.reason = decision.course_reason, kept.courses = decision.courses,
    kept.facts = decision.facts;
    kept.view_way_m = decision.view_way_m, kept.sees_none = decision.sees_none,
    kept.nearest_view_m = decision.nearest_view_m;
  }
  kept.counts = dump_.sights.counts;
  kept.target_ids.clear();
  for (const uint64_t id : step.targets.ids) kept.target_ids.push_back(id);
  kept.seen = step.target_count() > 0 ? dump_.sights.candidates.filtered()[dump_.sights.own_candidate] : 0;
}

// The state begins again as after place_camera, and the report uses the sights from the new place.
void Stepper::begin_at_cut(const CutPlace& place) {
  carried_.cut = {};
  carried_.candidates.lattice.start_again();
  carried_.shares.forget();
  carried_.path.start(dump_.decision.camera.pose);
  Sampled& now = dump_.plan.now;
  now.sights_m = place.sights_m;
  now.sights_of_target = place.sights_of_target;
  now.first_sight = place.first_sight;
}

Result<StepResult> Stepper::take(const StepInput& input, Sampler& sampler, const StageClock& clock) {
  const MapOrder order = begin(input, clock);
  if (!order.requests.empty()) {  // 2. Take the maps.
    const StageTimer timer = work_->time(clock, Stage::kSample);
    if (auto ok = sampler.take(input.scene, order.requests, *order.maps); !ok) return tl::unexpected(ok.error());
  }
  return finish(clock);
}

}  // namespace sightline
