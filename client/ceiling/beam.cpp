#include "client/ceiling/beam.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <unordered_map>
#include <utility>

#include "client/ceiling/shot_cost.h"
#include "client/ceiling/sight.h"
#include "client/truth/truth.h"

namespace sightline {
namespace {

// The limits are used up to this share, so that rounding never breaks one.
constexpr double kLimitShare = 0.999;
// Kept between the body and every collider. The judge measures in single precision.
constexpr double kSkinM = 0.002;
// Clearances are measured up to this distance beyond the body.
constexpr double kReachM = 3.0;
// States whose velocities are this much alike share a bucket.
constexpr double kVelocityCellMps = 2.5;
// The least accelerations, as a share of the limit. Full ones alone would leave no gentle motion.
constexpr double kGentle = 0.35;
// Rays to each target. If the first ones all arrive, the others are traced too. Otherwise the search would prefer
// places at which a few rays happen to miss the occluder.
constexpr size_t kFirstRays = 16, kAllRays = kExtentPoints;
// Rays to each target for what a picture is worth. That is no matter of yes or no, so a ray more or less changes
// little.
constexpr size_t kWorthRays = 24;
// The shares of rays beyond which no picture needs to be taken.
constexpr double kSurelyHidden = 0.75, kSurelySeen = 0.98;
// In a picture that is taken, a target should cover about this many pixels. It is judged more strictly than by the
// judge, whose pixels are finer.
constexpr double kTargetPixels = 160.0, kCarefulPixels = 600.0;
constexpr double kStrictTolerance = 0.04;

struct State {
  glm::dvec3 place_m{0.0}, velocity_mps{0.0};
  TurnState turn;
  double cost = 0.0;           // until now
  double promise = 0.0;        // cost, and what the guide expects after it
  uint32_t parent = 0;         // in the step before
  glm::dvec3 change_mps{0.0};  // of the velocity, in each tick of the step that led here
  double slack_m = 0.0;        // the body cannot touch anything before this much relative motion
};

// The directions of acceleration: the 26 of a cube's faces, edges and corners.
std::vector<glm::dvec3> directions() {
  std::vector<glm::dvec3> all;
  for (int k = 0; k < 27; ++k)
    if (k != 13) all.push_back(glm::normalize(glm::dvec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)));
  return all;
}

struct Bucket {
  glm::ivec3 place, velocity;
  bool operator==(const Bucket&) const = default;
};
struct BucketHash {
  size_t operator()(const Bucket& bucket) const {
    uint64_t hash = 0;
    for (const int part :
         {bucket.place.x, bucket.place.y, bucket.place.z, bucket.velocity.x, bucket.velocity.y, bucket.velocity.z})
      hash = (hash ^ static_cast<uint32_t>(part)) * 0x9E3779B97F4A7C15ull, hash ^= hash >> 29;
    return hash;
  }
};

bool more_promising(const State& a, const State& b) {
  return a.promise < b.promise;
}

class Beam {
 public:
  Beam(ScenarioWorld& world, ExtentCache& extents, const Guide& guide, const Timeline& timeline,
       const CameraLimits& limits, const MoveSettings& place_limits, const BeamOptions& options)
      : world_(world),
        guide_(guide),
        timeline_(timeline),
        limits_(shrunk(limits)),
        body_m_(std::max(limits.body_radius_m, near_corner_distance_m(world.scenario().lens())) + kSkinM),
        options_(options),
        costs_(PlanCosts::of(timeline, limits)),
        lens_(world.scenario().lens()),
        sight_(world, extents, place_limits, kFirstRays) {
    set_tick(0);
    if (options.aim == PlanAim::kWorth)
      shot_cost_.emplace(sight_, world.targets_center_m(), world.scenario().camera(), lens_);
  }

  BeamResult run(const Pose& start) {
    State first;
    first.place_m = start.position_m;
    first.turn.angles = angles_from_rotation(start.rotation);
    take_picture(first);
    std::vector<std::vector<State>> steps{{first}};
    std::vector<size_t> ends{0};
    const size_t step_ticks = kStagesPerStep * timeline_.ticks_per_stage;
    while (ends.back() + 1 < timeline_.ticks) {
      const size_t end = std::min(ends.back() + step_ticks, timeline_.ticks - 1);
      std::vector<State> next = next_step(steps.back(), ends.back(), end);
      if (next.empty()) break;
      steps.push_back(std::move(next));
      ends.push_back(end);
    }
    BeamResult result{path_of(steps, ends, start), steps.back().front().cost};
    if (result.path.size() < timeline_.ticks) result.cost += kTouchCost;
    result.path.resize(timeline_.ticks, result.path.back());
    return result;
  }

 private:
  static CameraLimits shrunk(CameraLimits limits) {
    limits.max_speed_mps *= kLimitShare;
    limits.max_acceleration_mps2 *= kLimitShare;
    limits.max_angular_speed_radps *= kLimitShare;
    limits.max_angular_acceleration_radps2 *= kLimitShare;
    return limits;
  }

  // ---- time ----

  // Moves the world, and notes how far any moving collider came since the last call.
  void set_tick(size_t tick) {
    const std::vector<Affine> before = mover_frames();
    world_.set_time(timeline_.tick_time_s(tick));
    sight_.refresh(tick);
    center_m_ = world_.targets_center_m();
    const size_t stage = tick / timeline_.ticks_per_stage;
    careful_ = stage < options_.careful_stages.size() && options_.careful_stages[stage];
    const std::vector<Affine> now = mover_frames();
    mover_travel_m_ = 0.0;
    size_t k = 0;
    for (const uint32_t slot : world_.mirror().moving_slots()) {
      const Instance& instance = world_.mirror().instances()[slot];
      if (!instance.collides()) continue;
      mover_travel_m_ = std::max(mover_travel_m_, travel_m(instance, before[k], now[k]));
      ++k;
    }
  }

  std::vector<Affine> mover_frames() const {
    std::vector<Affine> frames;
    for (const uint32_t slot : world_.mirror().moving_slots())
      if (world_.mirror().instances()[slot].collides())
        frames.push_back(world_.mirror().instances()[slot].world_from_instance);
    return frames;
  }

  // The greatest distance that a corner of the instance's bounding box has moved: no point of it moved farther.
  static double travel_m(const Instance& instance, const Affine& before, const Affine& now) {
    const Aabb& box = instance.geometry->bounds;
    double most_m = 0.0;
    for (int k = 0; k < 8; ++k) {
      const glm::dvec3 corner(k & 1 ? box.max.x : box.min.x, k & 2 ? box.max.y : box.min.y,
                              k & 4 ? box.max.z : box.min.z);
      most_m = std::max(most_m, glm::distance(transform_point(before, corner), transform_point(now, corner)));
    }
    return most_m;
  }

  // ---- a step ----

  std::vector<State> next_step(const std::vector<State>& now, size_t from_tick, size_t to_tick) {
    std::vector<State> tried = most_promising(now, from_tick, to_tick);
    for (size_t tick = from_tick + 1; tick <= to_tick; ++tick) {
      set_tick(tick);
      for (State& state : tried) play_tick(state);
      if (tick % timeline_.ticks_per_stage == 0)
        for (State& state : tried) take_picture(state);
    }
    for (State& state : tried) state.promise = state.cost + expected_after(state, to_tick);
    std::stable_sort(tried.begin(), tried.end(), more_promising);
    if (tried.size() > options_.width) tried.resize(options_.width);
    return tried;
  }

  // The states to play: those that the guide thinks best, one a bucket. A state is still where its parent was.
  std::vector<State> most_promising(const std::vector<State>& now, size_t from_tick, size_t to_tick) {
    std::vector<State> best;
    std::unordered_map<Bucket, size_t, BucketHash> by_bucket;
    for (uint32_t parent = 0; parent < now.size(); ++parent)
      for (const glm::dvec3& change : changes(now[parent].velocity_mps, to_tick - from_tick)) {
        State state = now[parent];
        state.parent = parent;
        state.change_mps = change;
        const State later = after(state, to_tick - from_tick);
        if (glm::length(later.velocity_mps) > limits_.max_speed_mps) continue;
        const size_t stage = from_tick / timeline_.ticks_per_stage;
        const State midway = after(state, std::min(timeline_.ticks_per_stage, to_tick - from_tick));
        state.promise = later.cost + guide_.picture(midway.place_m, stage + 1) +
                        guide_.picture(later.place_m, stage + 2) + expected_after(later, to_tick);
        if (state.promise >= kNoWayCost) continue;
        const Bucket bucket{glm::ivec3(glm::floor(later.place_m / kPlaceCellM)),
                            glm::ivec3(glm::round(later.velocity_mps / kVelocityCellMps))};
        const auto [at, added] = by_bucket.try_emplace(bucket, best.size());
        if (added)
          best.push_back(state);
        else if (more_promising(state, best[at->second]))
          best[at->second] = state;
      }
    std::stable_sort(best.begin(), best.end(), more_promising);
    if (best.size() > options_.tried) best.resize(options_.tried);
    return best;
  }
  static constexpr double kPlaceCellM = 0.5;

  // The changes of velocity a tick that are tried: none, full and gentle ones in every direction, and braking to a
  // stop.
  std::vector<glm::dvec3> changes(const glm::dvec3& velocity_mps, size_t ticks) const {
    const double most = limits_.max_acceleration_mps2 * timeline_.tick_s;
    std::vector<glm::dvec3> all{glm::dvec3(0.0)};
    for (const glm::dvec3& direction : directions_) {
      all.push_back(direction * most);
      all.push_back(direction * (most * kGentle));
    }
    const double speed = glm::length(velocity_mps), stop = speed / static_cast<double>(ticks);
    if (speed > 1e-9) all.push_back(-velocity_mps / speed * std::min(stop, most));
    return all;
  }

  // The state after `ticks` ticks of its step, without turn and pictures.
  State after(const State& state, size_t ticks) const {
    const auto n = static_cast<double>(ticks);
    State later = state;
    const glm::dvec3 way = (state.velocity_mps * n + state.change_mps * (n * (n + 1) / 2)) * timeline_.tick_s;
    later.place_m += way;
    later.velocity_mps += state.change_mps * n;
    later.cost += costs_.per_m * glm::length(way);
    return later;
  }

  // The guide's expectation after the stage of `tick`: the worse one of the camera's position a stage later and of its
  // position of rest. Without the second, the search would race into walls.
  double expected_after(const State& state, size_t tick) const {
    const size_t stage = tick / timeline_.ticks_per_stage;
    const glm::dvec3 next_m = state.place_m + state.velocity_mps * timeline_.stage_s();
    const double brake_s = glm::length(state.velocity_mps) / limits_.max_acceleration_mps2;
    const glm::dvec3 stop_m = state.place_m + state.velocity_mps * (brake_s / 2);
    const auto stop_stages = std::max<size_t>(1, static_cast<size_t>(std::ceil(brake_s / timeline_.stage_s())));
    return std::max(guide_.to_go(next_m, stage + 1), guide_.to_go(stop_m, stage + stop_stages));
  }

  // ---- a tick ----

  void play_tick(State& state) {
    state.velocity_mps += state.change_mps;
    const glm::dvec3 way = state.velocity_mps * timeline_.tick_s;
    state.place_m += way;
    state.cost += costs_.per_m * glm::length(way);
    turn(state);
    state.slack_m -= glm::length(way) + mover_travel_m_;
    if (state.slack_m > 0) return;
    state.slack_m = world_.colliders().nearest_surface_m(state.place_m, static_cast<float>(body_m_ + kReachM)) -
                    body_m_;
    if (state.slack_m < 0) state.cost += kTouchCost;
  }

  void turn(State& state) const {
    const ViewAngles aim = best_aim(state.place_m, sight_.targets(), state.turn.angles, lens_);
    state.turn = turn_towards(state.turn, aim, limits_, 0.0, timeline_.tick_s);
  }

  // Most pictures are decided by a few rays. Only where these leave doubt, the picture is taken as the judge takes it.
  void take_picture(State& state) const {
    if (shot_cost_) {
      const Pose pose{state.place_m, rotation_from_angles(state.turn.angles)};
      state.cost += shot_cost_->of(pose, center_m_, kWorthRays);
      return;
    }
    if (!sight_.is_allowed(state.place_m)) {
      state.cost += costs_.picture(false, 0.0);
      return;
    }
    const Pose pose{state.place_m, rotation_from_angles(state.turn.angles)};
    const bool inside = std::all_of(sight_.targets().begin(), sight_.targets().end(),
                                    [&](const TrackedTarget& target) { return in_picture(pose, lens_, target.aim_m); });
    TargetsSeen seen = sight_.shares(state.place_m, kFirstRays);
    if (inside && seen.least_share == 1.0) seen = sight_.shares(state.place_m, kAllRays, kFirstRays);
    if (inside && !careful_ && seen.least_share >= kSurelySeen) return;
    if (inside && seen.least_share < kSurelyHidden)
      state.cost += costs_.picture(false, seen.mean_share);
    else
      state.cost += judged_picture(pose);
  }

  double judged_picture(const Pose& pose) const {
    const PictureTruth picture = measure_picture(world_.occluders(), world_.mirror(), world_.targets(), pose, lens_,
                                                 picture_size(pose.position_m));
    double sum = 0.0;
    for (const TargetTruth& target : picture.targets) sum += target.visible_share();
    return costs_.picture(!picture.fully_hidden() && !picture.partly_hidden(kStrictTolerance),
                          sum / static_cast<double>(picture.targets.size()));
  }

  // The size at which a target, taken as a third of its bounding sphere's disc, covers kTargetPixels.
  int picture_size(const glm::dvec3& eye_m) const {
    double extent = 0.0;
    for (const TrackedTarget& target : sight_.targets())
      extent += target.radius_m / glm::distance(target.aim_m, eye_m) / static_cast<double>(sight_.targets().size());
    const double height = 2 * std::tan(lens_.vertical_fov_rad / 2);
    const double pixels = careful_ ? kCarefulPixels : kTargetPixels;
    const double share = 3.14 / 3 * extent * extent / (height * height * lens_.aspect);
    return static_cast<int>(std::clamp(std::sqrt(pixels / share), 16.0, double{kTruthSize}));
  }

  // ---- the result ----

  std::vector<Pose> path_of(const std::vector<std::vector<State>>& steps, const std::vector<size_t>& ends,
                            const Pose& start) {
    std::vector<const State*> chain(steps.size());
    chain.back() = &steps.back().front();
    for (size_t k = steps.size() - 1; k > 0; --k) chain[k - 1] = &steps[k - 1][chain[k]->parent];
    std::vector<Pose> path{start};
    for (size_t k = 1; k < steps.size(); ++k) {
      State state = *chain[k - 1];
      state.change_mps = chain[k]->change_mps;
      for (size_t tick = ends[k - 1] + 1; tick <= ends[k]; ++tick) {
        set_tick(tick);
        state.velocity_mps += state.change_mps;
        state.place_m += state.velocity_mps * timeline_.tick_s;
        turn(state);
        path.push_back({state.place_m, rotation_from_angles(state.turn.angles)});
      }
    }
    return path;
  }

  ScenarioWorld& world_;
  const Guide& guide_;
  const Timeline timeline_;
  const CameraLimits limits_;
  const double body_m_;
  const BeamOptions options_;
  const PlanCosts costs_;
  const Lens lens_;
  const std::vector<glm::dvec3> directions_ = directions();
  SightEstimate sight_;
  std::optional<ShotCost> shot_cost_;  // of a plan for kWorth
  glm::dvec3 center_m_{0.0};           // of the targets
  double mover_travel_m_ = 0.0;        // since the tick before
  bool careful_ = false;
};

}  // namespace

BeamResult search_beam(ScenarioWorld& world, ExtentCache& extents, const Pose& start, const Guide& guide,
                       const Timeline& timeline, const CameraLimits& limits, const MoveSettings& place_limits,
                       const BeamOptions& options) {
  return Beam(world, extents, guide, timeline, limits, place_limits, options).run(start);
}

}  // namespace sightline
