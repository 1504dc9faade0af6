// The second stage: which points of the targets are sampled, and the maps taken from them (paper 3.2, 4; design 4).
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "server/base/random.h"
#include "server/step/step_work.h"

namespace sightline {
namespace {

// A prediction is a guess: fewer points than of the real target are enough for it.
constexpr size_t kPointsAhead = 3;
// A shorter look ahead tells nothing that the present does not.
constexpr double kLeastAheadS = 0.05;

glm::dvec2 texel_jitter(const StepInput& input) {
  if (!input.settings.sample.jitter) return {0.5, 0.5};
  CounterRandom random(input.seed, input.tick, RandomPurpose::kTexelJitter);
  const double x = random.next_unit(), y = random.next_unit();
  return {x, y};
}

const ExtentTable* table_of(const StepInput& input, size_t target) {
  if (input.settings.sample.points == 0 || target >= input.extents.size()) return nullptr;
  return input.extents[target];
}

// The surface points of one target to sample in this step, mesh frame, of those that a view of its shape has.
void pick(StepWork& w, std::span<const glm::vec3> of_view) {
  pick_points(of_view, w.input.tick, static_cast<size_t>(w.input.settings.sample.points), w.memory.picked);
}

void add_points(std::vector<glm::dvec3>& points_m, std::span<const glm::vec3> points,
                const Affine& world_from_instance) {
  for (const glm::vec3& p : points) points_m.push_back(transform_point(world_from_instance, glm::dvec3(p)));
}

// The run of a list that began at `first` and ends with it.
MapRange run_from(size_t first, const std::vector<glm::dvec3>& list) {
  return {static_cast<uint32_t>(first), static_cast<uint32_t>(list.size() - first)};
}

// Where the camera is about to be when nothing changes its course: the place whose visibility must be known exactly.
glm::dvec3 place_on_course(const StepWork& w) {
  return w.memory.camera.pose.position_m + w.memory.camera.velocity_mps * w.move_s;
}

// Where a predicted pose puts the instance.
Affine placed(const Instance& instance, const Pose& pose) {
  const glm::dmat3 linear = glm::mat3_cast(pose.rotation) * instance.linear;
  return Affine(linear[0], linear[1], linear[2], pose.position_m);
}

const TargetPast* find_past(const StepMemory& memory, uint64_t id) {
  const auto found =
      std::find_if(memory.pasts.begin(), memory.pasts.end(), [=](const auto& p) { return p.id == id; });
  return found == memory.pasts.end() ? nullptr : &*found;
}

// As far as every steered target can be foretold, at most as the settings ask.
void decide_ahead(StepWork& w) {
  double ahead_s = w.input.settings.move.prediction_s, confidence = 1.0;
  for (size_t i = 0; i < w.input.targets.size(); ++i)
    if (w.steered >> i & 1u)
      ahead_s = find_past(w.memory, w.input.targets[i].instance_id)->predictor.usable_ahead_s(ahead_s);
  for (size_t i = 0; i < w.input.targets.size(); ++i)
    if (w.steered >> i & 1u)
      confidence = std::min(
          confidence, find_past(w.memory, w.input.targets[i].instance_id)->predictor.confidence(ahead_s));
  const bool usable = w.steered != 0 && ahead_s >= kLeastAheadS;
  w.memory.ahead_s = usable ? ahead_s : 0.0;
  w.memory.ahead_confidence = usable ? confidence : 0.0;
}

void pick_all(StepWork& w) {
  Sampled &now = w.memory.now, &ahead = w.memory.ahead;
  CounterRandom random(w.input.seed, w.input.tick, RandomPurpose::kViewBlend);
  for (size_t i = 0; i < w.input.targets.size(); ++i) {
    const Instance& instance = *w.input.scene.find(w.input.targets[i].instance_id);
    const size_t first = now.points_m.size(), first_ahead = ahead.points_m.size(),
                 first_sight = now.sights_m.size();
    const Affine later =
        w.memory.ahead_s > 0
            ? placed(instance, find_past(w.memory, instance.id)->predictor.at(w.memory.ahead_s).pose)
            : instance.world_from_instance;
    if (const ExtentTable* table = table_of(w.input, i)) {
      const Affine mesh_from_world = inverse(instance.world_from_instance);
      const double x = random.next_unit(), y = random.next_unit();
      pick(w, table->points_blended(transform_point(mesh_from_world, place_on_course(w)), {x, y}));
      add_points(now.sights_m, w.memory.picked, instance.world_from_instance);
      pick(w, table->points(transform_point(mesh_from_world, w.memory.bound.center_m)));
      add_points(now.points_m, w.memory.picked, instance.world_from_instance);
      if (w.memory.ahead_s > 0)
        add_points(ahead.points_m,
                   std::span(w.memory.picked).first(std::min(kPointsAhead, w.memory.picked.size())), later);
    } else {
      const glm::dvec3 aim = w.memory.target_views[i].aim_m;
      now.points_m.push_back(aim);
      now.sights_m.push_back(aim);
      if (w.memory.ahead_s > 0)
        ahead.points_m.push_back(
            transform_point(later, transform_point(inverse(instance.world_from_instance), aim)));
    }
    now.points_of_target.push_back(run_from(first, now.points_m));
    now.sights_of_target.push_back(run_from(first_sight, now.sights_m));
    ahead.points_of_target.push_back(run_from(first_ahead, ahead.points_m));
  }
}

// The same way, turned about the vertical.
glm::dvec3 turned(const glm::dvec3& way, double rad) {
  const double c = std::cos(rad), s = std::sin(rad);
  return {c * way.x + s * way.z, way.y, c * way.z - s * way.x};
}

// What is foretold is one future; people also turn. Each future is of aim points alone.
void pick_futures(StepWork& w) {
  const MoveSettings& settings = w.input.settings.move;
  if (w.memory.ahead_s <= 0 || settings.strategy != Strategy::kMinCost || settings.turn_probability <= 0)
    return w.memory.futures.clear();
  const double shares[] = {1 - settings.turn_probability, settings.turn_probability / 2, settings.turn_probability / 2};
  const double turns_rad[] = {0, settings.turn_rad, -settings.turn_rad};
  static_assert(std::size(shares) == kMaxFutures);
  w.memory.futures.resize(kMaxFutures);
  for (size_t f = 0; f < std::size(shares); ++f) {
    Future& future = w.memory.futures[f];
    future.sampled.clear();
    future.weight = shares[f];
    for (size_t i = 0; i < w.input.targets.size(); ++i) {
      const Instance& instance = *w.input.scene.find(w.input.targets[i].instance_id);
      const Pose foretold = find_past(w.memory, instance.id)->predictor.at(w.memory.ahead_s).pose;
      const glm::dvec3 way = foretold.position_m - instance.world_from_instance[3];
      future.sampled.points_of_target.push_back({static_cast<uint32_t>(i), 1});
      future.sampled.points_m.push_back(w.memory.target_views[i].aim_m + turned(way, turns_rad[f]));
    }
  }
}

// The pair volumes are of one point of each target, the paper's one a frame. Whether they can be laid around the bound.
bool chain_pairs(StepWork& w) {
  w.result.pair_asked = w.input.settings.aggregate.volume == Volume::kPair;
  if (!w.result.pair_asked) return false;
  w.result.pair_needs_two = w.input.targets.size() < 2;
  if (w.result.pair_needs_two) return false;
  w.memory.chained_m.clear();
  for (const MapRange& points : w.memory.now.points_of_target)
    w.memory.chained_m.push_back(w.memory.now.points_m[points.first]);
  w.result.pair_gap =
      make_pair_chain(w.memory.chained_m, w.memory.bound, w.input.settings.sample.resolution, w.memory.chain);
  return w.result.pair_gap == PairGap::kNone;
}

// One map a target, before all others: maps[i] is target i's. And one sight.
void plan_chain_maps(StepWork& w, const glm::dvec2& jitter) {
  Sampled& now = w.memory.now;
  now.points_m = w.memory.chained_m;
  for (uint32_t i = 0; i < now.points_m.size(); ++i) {
    now.sights_m[i] = now.sights_m[now.sights_of_target[i].first];
    now.sights_of_target[i] = {i, 1};
    now.points_of_target[i] = now.maps_of_point.emplace_back(MapRange{i, 1});
    w.memory.views.push_back(chain_view(w.memory.chain, i, jitter));
  }
  now.sights_m.resize(now.points_m.size());
}

void plan_maps(StepWork& w, Sampled& sampled, const glm::dvec2& jitter) {
  for (const glm::dvec3& point : sampled.points_m) {
    const auto first = static_cast<uint32_t>(w.memory.views.size());
    const int count = plan_views(point, w.memory.bound, w.input.settings.sample, jitter, w.memory.views);
    sampled.maps_of_point.push_back({first, static_cast<uint32_t>(count)});
    w.result.flags.used_cube_map |= count > 1;
  }
}

void plan_sights(StepWork& w) {
  w.memory.now.first_sight = static_cast<uint32_t>(w.memory.views.size());
  for (const glm::dvec3& point : w.memory.now.sights_m)
    w.memory.views.push_back(plan_sight(point, place_on_course(w)));
}

// No place that is looked up in this step's maps is farther from the eye: candidates lie in the bound, the camera is where it is or
// a step away. The places of pair volumes may lie anywhere before their far plane.
double far_m(const StepWork& w, const glm::dvec3& eye_m) {
  if (w.pair) return std::numeric_limits<double>::infinity();
  const CameraState& camera = w.memory.camera;
  const double speed_mps = std::max(w.input.limits.max_speed_mps, glm::length(camera.velocity_mps));
  const double bound_m = glm::distance(eye_m, w.memory.bound.center_m) + w.memory.bound.radius_m;
  const double camera_m = glm::distance(eye_m, camera.pose.position_m) + speed_mps * w.move_s;
  return beyond_all_m(std::max(bound_m, camera_m));
}

void request(StepWork& w, const Sampled& sampled, double ahead_s) {
  for (size_t target = 0; target < sampled.points_of_target.size(); ++target) {
    const MapRange& points = sampled.points_of_target[target];
    const auto ask = [&](uint32_t view) {
      w.memory.requests[view] = {.view = w.memory.views[view],
                                 .layer_mask = w.input.targets[target].layer_mask,
                                 .ahead_s = ahead_s,
                                 .far_m = far_m(w, w.memory.views[view].eye_m),
                                 .ignored_slots = w.memory.ignored_slots[target]};
    };
    for (uint32_t p = points.first; p < points.first + points.count; ++p) {
      const MapRange& maps = sampled.maps_of_point[p];
      for (uint32_t view = maps.first; view < maps.first + maps.count; ++view) ask(view);
    }
    if (sampled.sights_of_target.empty()) continue;
    const MapRange& sights = sampled.sights_of_target[target];
    for (uint32_t k = sights.first; k < sights.first + sights.count; ++k) ask(sampled.first_sight + k);
  }
}

}  // namespace

void plan_sample(StepWork& w) {
  w.memory.views.clear();
  w.memory.now.clear();
  w.memory.ahead.clear();
  decide_ahead(w);
  pick_all(w);
  const glm::dvec2 jitter = texel_jitter(w.input);
  w.pair = chain_pairs(w);
  if (w.pair)
    plan_chain_maps(w, jitter);
  else
    plan_maps(w, w.memory.now, jitter);
  plan_sights(w);
  plan_maps(w, w.memory.ahead, jitter);
  pick_futures(w);
  for (Future& future : w.memory.futures) plan_maps(w, future.sampled, jitter);
  plan_survey(w);

  w.memory.requests.resize(w.memory.views.size());
  request(w, w.memory.now, 0.0);
  request(w, w.memory.ahead, w.memory.ahead_s);
  for (const Future& future : w.memory.futures) request(w, future.sampled, w.memory.ahead_s);
  request_survey(w);
}

}  // namespace sightline
