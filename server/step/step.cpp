#include "server/step/step.h"

#include <algorithm>
#include <utility>

#include "server/base/hash.h"
#include "server/step/step_work.h"

namespace sightline {
namespace {

class StageTimer {
 public:
  StageTimer(const StageClock& clock, int64_t& out_ns) : clock_(clock), out_ns_(out_ns), begin_ns_(clock()) {}
  ~StageTimer() { out_ns_ += clock_() - begin_ns_; }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  const StageClock& clock_;
  int64_t& out_ns_;
  int64_t begin_ns_;
};

// What an optional target's weight counts beside a required one's where both are weighed together.
constexpr double kOptionalShare = 0.1;

// The bound keeps this much more from the targets' centre than the camera from a target: nearer, one map no longer shows it all.
constexpr double kBoundFromTargetsM = 0.5;

TargetView view_of(const Target& target, const Instance& instance) {
  TargetView view;
  const glm::dvec3 aim = target.aim_offset_m.value_or(glm::dvec3(instance.geometry->bounds.center()));
  view.aim_m = transform_point(instance.world_from_instance, aim);
  view.radius_m = instance.radius_m;
  view.velocity_mps = instance.velocity_mps;
  view.weight = target.weight;
  view.required = target.required;
  return view;
}

void add_slot(const SceneMirror& scene, uint64_t id, std::vector<uint32_t>& slots) {
  if (const auto slot = scene.slot_of(id)) slots.push_back(*slot);
}

// Ids that the mirror no longer holds are passed over: an attachment may be gone before the list is renewed.
void slots_left_out(const SceneMirror& scene, const Target& target, std::vector<uint32_t>& slots) {
  slots.clear();
  add_slot(scene, target.instance_id, slots);
  for (const uint64_t id : target.attached_ids) add_slot(scene, id, slots);
  for (const uint64_t id : target.ignored_ids) add_slot(scene, id, slots);
  std::sort(slots.begin(), slots.end());
  slots.erase(std::unique(slots.begin(), slots.end()), slots.end());
}

TargetPast& past_of(StepMemory& memory, uint64_t id) {
  for (TargetPast& past : memory.pasts)
    if (past.id == id) return past;
  memory.pasts.push_back({id, MotionPredictor()});
  return memory.pasts.back();
}

// Runs on every step, so that a prediction is there at once when it is switched on.
void remember_pasts(StepWork& w) {
  for (TargetPast& past : w.memory.pasts) past.current = false;
  for (const Target& target : w.input.targets) {
    TargetPast& past = past_of(w.memory, target.instance_id);
    past.current = true;
    past.predictor.configure({.ahead_s = w.input.settings.move.prediction_s});
    past.predictor.observe(w.input.dt_s, w.input.scene.find(target.instance_id)->pose);
  }
  std::erase_if(w.memory.pasts, [](const TargetPast& past) { return !past.current; });
}

// The offset that the camera keeps belongs to one set of targets: with another set it is taken anew from where the camera
// is, so that adding, removing or switching off a target makes no jump.
void keep_offset(StepWork& w) {
  if (w.steered == 0) return;
  uint64_t set = 0;
  for (size_t i = 0; i < w.input.targets.size(); ++i)
    if (w.steered >> i & 1u)
      set += hash64_bytes(std::as_bytes(std::span(&w.input.targets[i].instance_id, 1)));
  if (w.memory.has_offset && w.memory.offset_targets == set) return;
  w.memory.desired_offset_m = w.memory.camera.pose.position_m - weighted_center_m(w.memory.target_views);
  w.memory.shot.asked_offset_m = w.memory.desired_offset_m;
  w.memory.shot.place.reset();
  w.memory.offset_targets = set;
  w.memory.has_offset = true;
}

// A lens that is told anew holds at once. One that has zoomed and shall no more goes back as it went (see `turn`).
void take_lens(StepWork& w) {
  const double told_rad = w.input.lens.vertical_fov_rad;
  const bool told_anew = w.memory.told_fov_rad != told_rad;
  if (w.memory.vertical_fov_rad == 0.0 || (told_anew && !zooms(w.input.settings.framing)))
    w.memory.vertical_fov_rad = told_rad;
  w.memory.told_fov_rad = told_rad;
  w.lens.vertical_fov_rad = w.memory.vertical_fov_rad;
}

void start(StepWork& w) {
  w.move_s = std::min(w.input.dt_s, kMaxStepS);
  w.result.flags.dt_capped = w.input.dt_s > kMaxStepS;
  take_lens(w);
  look_at_targets(w);
  remember_pasts(w);
  keep_offset(w);
  if (w.steered != 0) w.memory.goal.trail.pass(weighted_center_m(w.memory.target_views));
}

// Whether the picture shows a point that lies in it: what hides it may be too near the lens to be drawn.
bool shows(const StepWork& w, uint32_t sight, const Pose& pose, const Lens& lens) {
  const glm::dvec3 to_point = glm::normalize(w.memory.now.sights_m[sight] - pose.position_m);
  const double along_axis = glm::dot(to_point, pose.rotation * glm::dvec3(0, 0, -1));
  return falls_short_m(w, sight, pose.position_m) * along_axis < lens.near_m;
}

// A picture cuts a target at its edges: only the points inside stand for pixels.
void remember_shares(StepWork& w, const Lens& lens) {
  static_assert(kShareWindowS <= kMaxStepS, "so that a step that was capped leaves nothing from before it");
  const Pose& pose = w.memory.camera.pose;
  w.memory.shares.begin_step(w.memory.target_ids, w.move_s);
  for (size_t i = 0; i < w.input.targets.size(); ++i) {
    const MapRange& sights = w.memory.now.sights_of_target[i];
    uint32_t seen = 0, inside = 0;
    for (uint32_t k = sights.first; k < sights.first + sights.count; ++k) {
      if (!in_picture(pose, lens, w.memory.now.sights_m[k])) continue;
      ++inside;
      seen += shows(w, k, pose, lens);
    }
    w.memory.shares.add(i, seen, inside);
  }
}

Status take_maps(StepMemory& memory, const SceneMirror& scene, Sampler& sampler) {
  if (!memory.requests.empty()) return sampler.take(scene, memory.requests, memory.maps);
  memory.maps.clear();
  return {};
}

}  // namespace

void look_at_targets(StepWork& w) {
  const auto& targets = w.input.targets;
  w.memory.target_views.clear();
  w.memory.target_ids.clear();
  w.memory.goal.target_weights.clear();
  w.memory.ignored_slots.resize(targets.size());
  for (size_t i = 0; i < targets.size(); ++i) {
    w.memory.target_views.push_back(view_of(targets[i], *w.input.scene.find(targets[i].instance_id)));
    w.memory.target_ids.push_back(targets[i].instance_id);
    w.memory.goal.target_weights.push_back(targets[i].weight * (targets[i].required ? 1.0 : kOptionalShare));
    if (targets[i].weight > 0) w.steered |= 1u << i;
    slots_left_out(w.input.scene, targets[i], w.memory.ignored_slots[i]);
  }
}

glm::dvec3 desired_place(const StepWork& w) {
  if (w.input.settings.move.follow == Follow::kStay) return w.memory.camera.pose.position_m;
  return desired_place_m(w.memory.target_views, w.memory.desired_offset_m, w.lens,
                         w.input.settings.framing.framing_margin, w.input.settings.move);
}

void bound(StepWork& w) {
  const BoundSettings& settings = w.input.settings.bound;
  w.memory.horizon_s = std::clamp(w.memory.horizon_s, settings.horizon_s, settings.max_horizon_s);
  w.memory.bound = bound_camera(w.memory.camera, w.input.limits, settings, w.memory.horizon_s, w.move_s);
  if (w.steered == 0 || settings.target_reach_m == 0) return;
  w.memory.bound =
      extend_towards(w.memory.bound, weighted_center_m(w.memory.target_views), settings.target_reach_m,
                     w.input.settings.move.min_distance_m + kBoundFromTargetsM);
}

void report_targets(StepWork& w) {
  const glm::dvec3 place = w.memory.camera.pose.position_m;
  Lens lens = w.input.lens;
  lens.vertical_fov_rad = w.memory.vertical_fov_rad;
  remember_shares(w, lens);
  for (size_t i = 0; i < w.input.targets.size(); ++i) {
    const OwnSight sight = own_sight(w, i, place);
    TargetSight report;
    report.id = w.input.targets[i].instance_id;
    report.visible_share = sight.share();
    report.filtered_share = w.memory.shares.share(i).value_or(sight.share());
    report.filtered_visible = w.memory.candidates.filtered()[w.own_candidate] >> i & 1u;
    report.in_picture = in_picture(w.memory.camera.pose, lens, w.memory.target_views[i].aim_m);
    report.distance_m = glm::distance(place, w.memory.target_views[i].aim_m);
    if (sight.occluder != kNoOccluder) report.occluder_id = w.input.scene.instances()[sight.occluder].id;
    w.result.targets.push_back(report);
  }
}

void place_camera(StepMemory& memory, const Pose& pose, const glm::dvec3& velocity_mps) {
  memory.camera.pose = pose;
  memory.camera.velocity_mps = velocity_mps;
  memory.camera.angular_velocity_radps = glm::dvec3(0.0);
  memory.turn = TurnState{};
  memory.turn.angles = angles_from_rotation(pose.rotation, 0.0);
  memory.has_offset = false;
  memory.horizon_s = 0.0;
  memory.goal.goal_m.reset();
  memory.shares.forget();
  memory.shot.survey.forget();
}

StepWork begin_step(StepMemory& memory, const StepInput& input, const StageClock& clock) {
  StepWork work{.memory = memory, .input = input, .result = {}, .lens = input.lens};
  start(work);
  {  // 1. Where can the camera be soon?
    StageTimer timer(clock, work.result.stage_ns[static_cast<size_t>(Stage::kBound)]);
    bound(work);
  }
  {  // 2. From which points do the targets look at it?
    StageTimer timer(clock, work.result.stage_ns[static_cast<size_t>(Stage::kSample)]);
    plan_sample(work);
  }
  return work;
}

StepResult finish_step(StepWork work, const StageClock& clock) {
  {  // 3. Which places see which targets, now and over the last steps?
    StageTimer timer(clock, work.result.stage_ns[static_cast<size_t>(Stage::kAggregate)]);
    aggregate(work);
  }
  {  // 4. Where to go, how fast, and which way to look?
    StageTimer timer(clock, work.result.stage_ns[static_cast<size_t>(Stage::kMove)]);
    move(work);
  }
  report_targets(work);
  work.result.camera = work.memory.camera;
  work.result.vertical_fov_rad = work.memory.vertical_fov_rad;
  return std::move(work.result);
}

Result<StepResult> take_step(StepMemory& memory, const StepInput& input, Sampler& sampler,
                             const StageClock& clock) {
  StepWork work = begin_step(memory, input, clock);
  {  // 2. What do they see of it?
    StageTimer timer(clock, work.result.stage_ns[static_cast<size_t>(Stage::kSample)]);
    if (auto ok = take_maps(memory, input.scene, sampler); !ok) return tl::unexpected(ok.error());
  }
  return finish_step(std::move(work), clock);
}

}  // namespace sightline
