#include "server/step.h"

#include <algorithm>
#include <cmath>

#include "server/base/hash.h"
#include "server/base/random.h"

namespace sightline {
namespace {

// The horizon doubles in this time while nothing is seen, and halves in it once something is (design 3).
constexpr double kHorizonDoublingS = 0.25;

class StageTimer {
 public:
  StageTimer(const StageClock& clock, int64_t& out_ns) : clock_(clock), out_ns_(out_ns), begin_ns_(clock()) {}
  ~StageTimer() { out_ns_ = clock_() - begin_ns_; }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  const StageClock& clock_;
  int64_t& out_ns_;
  int64_t begin_ns_;
};

// One step's working set: the inputs, the memory, and the answer that grows stage by stage.
struct Work {
  StepMemory& memory;
  const StepInput& input;
  StepResult& result;
  double move_s = 0;     // for how long the camera moves
  uint32_t steered = 0;  // bit i: target i has a weight
  Lens lens;             // as it is now, zoom included
};

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

void look_at_targets(Work& w) {
  const auto& targets = w.input.targets;
  w.memory.target_views.clear();
  w.memory.ignored_slots.resize(targets.size());
  for (size_t i = 0; i < targets.size(); ++i) {
    w.memory.target_views.push_back(view_of(targets[i], *w.input.scene.find(targets[i].instance_id)));
    if (targets[i].weight > 0) w.steered |= 1u << i;
    slots_left_out(w.input.scene, targets[i], w.memory.ignored_slots[i]);
  }
}

// The offset that the camera keeps belongs to one set of targets: with another set it is taken anew from where the camera
// is, so that adding, removing or switching off a target makes no jump.
void keep_offset(Work& w) {
  if (w.steered == 0) return;
  uint64_t set = 0;
  for (size_t i = 0; i < w.input.targets.size(); ++i)
    if (w.steered >> i & 1u) set += hash64_bytes(std::as_bytes(std::span(&w.input.targets[i].instance_id, 1)));
  if (w.memory.has_offset && w.memory.offset_targets == set) return;
  w.memory.desired_offset_m = w.memory.camera.pose.position_m - weighted_center_m(w.memory.target_views);
  w.memory.offset_targets = set;
  w.memory.has_offset = true;
}

glm::dvec3 desired_place(const Work& w) {
  if (w.input.settings.move.follow == Follow::kStay) return w.memory.camera.pose.position_m;
  return desired_place_m(w.memory.target_views, w.memory.desired_offset_m, w.lens, w.input.settings.framing.margin,
                         w.input.settings.move);
}

// ---- 1. bound ----

void bound(Work& w) {
  const double shortest = w.input.settings.bound.horizon_s;
  w.memory.horizon_s = std::clamp(w.memory.horizon_s, shortest, w.input.settings.bound.max_horizon_s);
  w.memory.bound =
      bound_camera(w.memory.camera, w.input.limits, w.input.settings.bound, w.memory.horizon_s, w.move_s);
}

// ---- 2. sample ----

glm::dvec2 texel_jitter(const StepInput& input) {
  if (!input.settings.sample.jitter_texels) return {0.5, 0.5};
  CounterRandom random(input.seed, input.tick, RandomPurpose::kTexelJitter);
  const double x = random.next_unit(), y = random.next_unit();
  return {x, y};
}

bool wants_pair(Work& w) {
  w.result.pair_asked = w.input.settings.aggregate.volume == Volume::kPair;
  if (!w.result.pair_asked) return false;
  w.result.pair_needs_two = w.input.targets.size() != 2;
  if (w.result.pair_needs_two) return false;
  w.result.pair_gap = pair_gap(w.memory.target_views[0].aim_m, w.memory.target_views[1].aim_m, w.memory.bound);
  return w.result.pair_gap == PairGap::kNone;
}

void plan_lattice_maps(Work& w, const glm::dvec2& jitter) {
  for (size_t i = 0; i < w.memory.target_views.size(); ++i) {
    const auto first = static_cast<uint32_t>(w.memory.views.size());
    const int count = plan_views(w.memory.target_views[i].aim_m, w.memory.bound, w.input.settings.sample, jitter,
                                 w.memory.views);
    w.memory.maps_of_target.push_back({first, static_cast<uint32_t>(count)});
    w.result.flags.resampled_faces |= count > 1;
  }
}

void plan_pair_maps(Work& w, const PairVolume& volume, const glm::dvec2& jitter) {
  for (const MapView& view : pair_views(volume, jitter)) {
    w.memory.maps_of_target.push_back({static_cast<uint32_t>(w.memory.views.size()), 1});
    w.memory.views.push_back(view);
  }
}

// Where the camera is about to be when nothing changes its course: the place whose visibility must be known exactly.
glm::dvec3 place_on_course(const Work& w) {
  return w.memory.camera.pose.position_m + w.memory.camera.velocity_mps * w.move_s;
}

void plan_sights(Work& w) {
  for (const TargetView& target : w.memory.target_views) {
    w.memory.sight_of_target.push_back(static_cast<uint32_t>(w.memory.views.size()));
    w.memory.views.push_back(plan_sight(target.aim_m, place_on_course(w)));
  }
}

void make_requests(Work& w) {
  w.memory.requests.resize(w.memory.views.size());
  for (size_t i = 0; i < w.input.targets.size(); ++i) {
    const MapRange& range = w.memory.maps_of_target[i];
    const auto request = [&](uint32_t k) {
      w.memory.requests[k] = {.view = w.memory.views[k],
                              .layer_mask = w.input.targets[i].layer_mask,
                              .ignored_slots = w.memory.ignored_slots[i]};
    };
    for (uint32_t k = range.first; k < range.first + range.count; ++k) request(k);
    request(w.memory.sight_of_target[i]);
  }
}

Status sample(Work& w, std::optional<PairVolume>& pair, Sampler& sampler) {
  w.memory.views.clear();
  w.memory.maps_of_target.clear();
  w.memory.sight_of_target.clear();
  const glm::dvec2 jitter = texel_jitter(w.input);
  if (wants_pair(w))
    pair = make_pair_volume(w.memory.target_views[0].aim_m, w.memory.target_views[1].aim_m, w.memory.bound,
                            w.input.settings.sample.resolution);
  if (pair) plan_pair_maps(w, *pair, jitter);
  else plan_lattice_maps(w, jitter);
  plan_sights(w);
  make_requests(w);
  if (w.memory.requests.empty()) {
    w.memory.maps.clear();
    return {};
  }
  return sampler.take(w.input.scene, w.memory.requests, w.memory.maps);
}

// ---- 3. aggregate ----

// The place itself when the bound holds it, else the nearest place of the bound.
glm::dvec3 nearest_in_bound(const Bound& bound, const glm::dvec3& place) {
  const glm::dvec3 out = place - bound.center_m;
  const double distance = glm::length(out), reach = bound.radius_m * (1 - 1e-9);
  return distance <= reach ? place : bound.center_m + out * (reach / distance);
}

// Whether target i sees the camera's own place: by the single-texel map, at the place's distance.
Sight own_sight(const Work& w, size_t i, const glm::dvec3& place) {
  const DepthMap& map = w.memory.maps[w.memory.sight_of_target[i]];
  Sight sight{.known = true};
  const double slack = 1.0 + w.input.settings.aggregate.relative_bias;
  sight.visible = glm::distance(place, w.memory.target_views[i].aim_m) <= map.distance_at(0, 0) * slack;
  if (!sight.visible) sight.occluder = map.occluder_at(0, 0);
  return sight;
}

void see_own_place(Work& w) {
  w.memory.candidates.add(w.memory.camera.pose.position_m);
  for (size_t i = 0; i < w.input.targets.size(); ++i)
    if (own_sight(w, i, w.memory.camera.pose.position_m).visible)
      w.memory.candidates.visible_targets.back() |= 1u << i;
}

void see(Work& w, const glm::dvec3& place) {
  w.memory.candidates.add(place);
  uint32_t& visible = w.memory.candidates.visible_targets.back();
  for (size_t i = 0; i < w.memory.maps_of_target.size(); ++i) {
    const MapRange& range = w.memory.maps_of_target[i];
    const auto maps = std::span<const DepthMap>(w.memory.maps).subspan(range.first, range.count);
    if (look_up(maps, place, w.input.settings.aggregate.relative_bias).visible) visible |= 1u << i;
  }
}

void aggregate(Work& w, const std::optional<PairVolume>& pair) {
  const AggregateSettings& settings = w.input.settings.aggregate;
  CandidateSet& candidates = w.memory.candidates;
  candidates.clear();
  w.result.volume = pair ? Volume::kPair : Volume::kLattice;
  if (w.input.targets.empty()) {
    count_sights(candidates, 0, 0, w.memory.counts);
    return;
  }
  if (pair) {
    compose_pair(*pair, w.memory.maps[0], w.memory.maps[1], w.memory.bound, settings.relative_bias, candidates);
  } else {
    w.memory.lattice.cover(w.memory.bound, settings.candidates);
    candidates.position_m = w.memory.lattice.positions_m();
    candidates.visible_targets.resize(candidates.position_m.size());
    compose_visibility(w.memory.maps, w.memory.maps_of_target, settings.relative_bias, candidates);
    w.memory.lattice.remember(candidates.visible_targets);
  }
  count_sights(candidates, w.steered, w.input.targets.size(), w.memory.counts);
  // Two places that no grid holds: where the camera is, and where it wants to be. Without them a camera at rest would
  // step between grid points.
  see_own_place(w);
  if (w.steered != 0) see(w, nearest_in_bound(w.memory.bound, desired_place(w)));
}

// ---- 4. move ----

void gather_colliders(Work& w) {
  const glm::dvec3 place = w.memory.camera.pose.position_m;
  const double body = swept_radius_m(w.input.limits, w.lens);
  const double reach = 2 * w.memory.bound.radius_m + w.input.limits.max_speed_mps * w.move_s +
                       braking_distance_m(glm::dvec3(w.input.limits.max_speed_mps, 0, 0), w.input.limits);
  w.memory.colliders.gather(w.input.scene, place, std::min(reach, 2 * w.memory.bound.radius_m + 20.0) + 2 * body, {});
  for (size_t look = 0; look < kEvadeS.size(); ++look)
    w.memory.movers_ahead[look].gather_movers(w.input.scene, place,
                                              w.input.limits.max_speed_mps * kEvadeS[look] + 2 * body + 1.0, {}, kEvadeS[look]);
}

Choice choose(Work& w) {
  if (w.steered == 0) return {MoveStatus::kHolding, MoveReason::kNoTargets, -1};
  const glm::dvec3 from = w.memory.camera.pose.position_m;
  const double body = swept_radius_m(w.input.limits, w.lens);
  const Reachable reachable = [&](const glm::dvec3& place) {
    return path_is_free(w.memory.colliders, from, place, body);
  };
  return choose_basic(w.memory.candidates, w.memory.target_views, desired_place(w), w.input.settings.move, reachable,
                      w.memory.order);
}

// Grows while no place sees everything, so that an escape looks further; shrinks again once one does.
void adapt_horizon(Work& w) {
  const double factor = std::exp2(w.move_s / kHorizonDoublingS);
  const bool all_seen = w.result.status == MoveStatus::kTracking || w.steered == 0;
  w.memory.horizon_s = all_seen ? w.memory.horizon_s / factor : w.memory.horizon_s * factor;
}

glm::dvec3 group_velocity(const Work& w) {
  glm::dvec3 sum(0.0);
  double weight = 0;
  for (const TargetView& t : w.memory.target_views) sum += t.weight * t.velocity_mps, weight += t.weight;
  return weight > 0 ? sum / weight : sum;
}

void travel(Work& w, const Choice& choice) {
  CameraState& camera = w.memory.camera;
  glm::dvec3 wanted = clamp_velocity(camera.velocity_mps, glm::dvec3(0.0), w.input.limits, w.move_s);
  if (choice.candidate >= 0) {
    // At the desired place the camera travels with the targets; elsewhere the goal is a fixed place in the world.
    const glm::dvec3 with = choice.reason == MoveReason::kAtDesiredPlace ? group_velocity(w) : glm::dvec3(0.0);
    wanted = velocity_towards(camera, w.memory.candidates.position_m[choice.candidate], with, w.input.limits, w.move_s);
  }
  wanted = evade(camera, wanted, w.input.limits, w.lens, w.memory.movers_ahead, w.move_s);
  const SafeMove safe = make_safe(camera, wanted, w.input.limits, w.lens, w.memory.colliders, w.move_s);
  w.result.flags.body_overlap = safe.overlap;
  if (safe.overlap) w.result.reason = MoveReason::kBodyOverlap;
  camera.velocity_mps = safe.velocity_mps;
  camera.pose.position_m += safe.velocity_mps * w.move_s;
}

void turn(Work& w) {
  TurnState& turn = w.memory.turn;
  const FramingSettings& framing = w.input.settings.framing;
  Aim aim{turn.angles, w.lens.vertical_fov_rad, true};
  if (w.steered != 0)
    aim = aim_at(w.memory.camera.pose.position_m, w.memory.target_views, turn.angles, w.lens, framing);
  const glm::dquat before = w.memory.camera.pose.rotation;
  turn = turn_towards(turn, aim.angles, w.input.limits, framing.response_s, w.move_s);
  w.memory.camera.pose.rotation = rotation_from_angles(turn.angles);
  const glm::dquat delta = w.memory.camera.pose.rotation * glm::conjugate(before);
  w.memory.camera.angular_velocity_radps =
      glm::axis(delta) * (std::remainder(glm::angle(delta), 2 * std::acos(-1.0)) / w.move_s);
  // Zoom closes at the same pace as the aim.
  const double share = framing.response_s > 0 ? 1 - std::pow(0.01, w.move_s / framing.response_s) : 1.0;
  w.memory.vertical_fov_rad += share * (aim.vertical_fov_rad - w.memory.vertical_fov_rad);
}

void move(Work& w) {
  if (w.move_s <= 0) {
    w.result.status = MoveStatus::kHolding;
    w.result.reason = MoveReason::kPaused;
    return;
  }
  gather_colliders(w);
  const Choice choice = choose(w);
  w.result.status = choice.status;
  w.result.reason = choice.reason;
  w.result.chosen_candidate = choice.candidate;
  adapt_horizon(w);
  travel(w, choice);
  turn(w);
}

// ---- the answer ----

void report_targets(Work& w) {
  const glm::dvec3 place = w.memory.camera.pose.position_m;
  Lens lens = w.input.lens;
  lens.vertical_fov_rad = w.memory.vertical_fov_rad;
  for (size_t i = 0; i < w.input.targets.size(); ++i) {
    const Sight sight = own_sight(w, i, place);
    TargetSight report;
    report.id = w.input.targets[i].instance_id;
    report.visible_share = sight.visible ? 1.0 : 0.0;
    report.in_picture = in_picture(w.memory.camera.pose, lens, w.memory.target_views[i].aim_m);
    report.distance_m = glm::distance(place, w.memory.target_views[i].aim_m);
    if (sight.occluder != kNoOccluder) report.occluder_id = w.input.scene.instances()[sight.occluder].id;
    w.result.targets.push_back(report);
  }
}

}  // namespace

Status validate(const StepSettings& s) {
  if (auto ok = validate(s.bound); !ok) return ok;
  if (auto ok = validate(s.sample); !ok) return ok;
  if (auto ok = validate(s.aggregate); !ok) return ok;
  if (auto ok = validate(s.move); !ok) return ok;
  return validate(s.framing);
}

void place_camera(StepMemory& memory, const Pose& pose, const glm::dvec3& velocity_mps) {
  memory.camera.pose = pose;
  memory.camera.velocity_mps = velocity_mps;
  memory.camera.angular_velocity_radps = glm::dvec3(0.0);
  memory.turn = TurnState{};
  memory.turn.angles = angles_from_rotation(pose.rotation, 0.0);
  memory.has_offset = false;
  memory.horizon_s = 0.0;
}

Result<StepResult> take_step(StepMemory& memory, const StepInput& input, Sampler& sampler, const StageClock& clock) {
  StepResult result;
  Work w{memory, input, result, std::min(input.dt_s, kMaxStepS), 0, input.lens};
  result.flags.dt_capped = input.dt_s > kMaxStepS;
  if (memory.vertical_fov_rad == 0.0 || !input.settings.framing.zooms())
    memory.vertical_fov_rad = input.lens.vertical_fov_rad;
  w.lens.vertical_fov_rad = memory.vertical_fov_rad;
  look_at_targets(w);
  keep_offset(w);

  {  // 1. Where can the camera be soon?
    StageTimer timer(clock, result.stage_ns[static_cast<size_t>(Stage::kBound)]);
    bound(w);
  }
  std::optional<PairVolume> pair;
  {  // 2. What do the targets see of it?
    StageTimer timer(clock, result.stage_ns[static_cast<size_t>(Stage::kSample)]);
    if (auto ok = sightline::sample(w, pair, sampler); !ok) return tl::unexpected(ok.error());
  }
  {  // 3. Which places see which targets?
    StageTimer timer(clock, result.stage_ns[static_cast<size_t>(Stage::kAggregate)]);
    aggregate(w, pair);
  }
  {  // 4. Where to go, how fast, and which way to look?
    StageTimer timer(clock, result.stage_ns[static_cast<size_t>(Stage::kMove)]);
    move(w);
  }
  report_targets(w);
  result.camera = memory.camera;
  result.vertical_fov_rad = memory.vertical_fov_rad;
  return result;
}

}  // namespace sightline
