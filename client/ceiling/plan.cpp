#include "client/ceiling/plan.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "client/ceiling/costs_to_go.h"
#include "client/ceiling/shot_cost.h"
#include "client/ceiling/sight.h"
#include "client/truth/truth.h"

namespace sightline {
namespace {

constexpr double kShortestStageS = 0.05, kLongestStageS = 0.125;
// The body keeps this much more from standing colliders in the grid than it must: ways between places are swept with an
// error of 1 cm.
constexpr double kGridSkinM = 0.01;
// The upper estimate counts a target as seen when this share of its rays arrives.
constexpr double kDoubtfulShare = 0.8;
// The search is repeated up to so often where the judge sees less of its path than it expected. Then it looks at those
// stages more carefully.
constexpr int kRounds = 3;
// Cells this far from the targets' path, in metres, belong to the camera's way to them.
constexpr double kWayToTargetsM = 2.0;

// The guide's camera is as fast as the targets' centre is but for this part of the time, so that jumps do not count.
constexpr double kFastestPart = 0.05;

// The targets' centre over time.
struct TargetsPath {
  std::vector<glm::dvec3> centers_m;  // at least 0.5 m apart
  double spread_m = 0.0;              // the greatest distance between a target and the centre
  double speed_mps = 0.0;             // of the centre
};

// The greatest speed, without the fastest part of the time.
double usual_speed_mps(std::vector<double> speeds_mps) {
  if (speeds_mps.empty()) return 0.0;
  const auto at = speeds_mps.begin() +
                  static_cast<ptrdiff_t>(static_cast<double>(speeds_mps.size()) * (1 - kFastestPart));
  std::nth_element(speeds_mps.begin(), at, speeds_mps.end());
  return *at;
}

TargetsPath follow_targets(ScenarioWorld& world, const Timeline& timeline) {
  TargetsPath path;
  std::vector<double> speeds_mps;
  glm::dvec3 before_m(0.0);
  for (size_t stage = 0; stage < timeline.stages(); ++stage) {
    world.set_time(timeline.tick_time_s(stage * timeline.ticks_per_stage));
    const glm::dvec3 center_m = world.targets_center_m();
    if (stage > 0) speeds_mps.push_back(glm::distance(center_m, before_m) / timeline.stage_s());
    before_m = center_m;
    for (const TrackedTarget& target : tracked_targets(world))
      path.spread_m = std::max(path.spread_m, glm::distance(target.aim_m, center_m));
    if (path.centers_m.empty() || glm::distance(path.centers_m.back(), center_m) >= 0.5)
      path.centers_m.push_back(center_m);
  }
  path.speed_mps = usual_speed_mps(std::move(speeds_mps));
  return path;
}

class Planner {
 public:
  Planner(ScenarioWorld& world, ExtentCache& extents, const Timeline& timeline, const CameraLimits& limits,
          const MoveSettings& place_limits, const PlanOptions& options)
      : world_(world),
        timeline_(timeline),
        limits_(limits),
        place_limits_(place_limits),
        options_(options),
        extents_(extents),
        costs_(PlanCosts::of(timeline, limits)),
        body_m_(std::max(limits.body_radius_m, near_corner_distance_m(world.scenario().lens())) + kGridSkinM),
        path_(follow_targets(world, timeline)),
        reach_m_(std::min(std::max(options.reach_m + 2 * path_.spread_m, kWayToTargetsM + start_distance_m()),
                          place_limits.max_distance_m)),
        near_m_(options.near_m + path_.spread_m),
        sight_(world, extents, place_limits, options.rays),
        grid_(make_grid()) {
    if (options.aim != PlanAim::kWorth) return;
    sight_.refresh(0);  // make_grid has set the world's first moment
    shot_cost_.emplace(sight_, world.targets_center_m(), world.scenario().camera(), world.scenario().lens());
  }

  CeilingPlan plan() {
    CeilingPlan plan;
    plan.places = grid_.size();
    Guide guide(grid_, timeline_.stages());
    if (grid_.size() > 0) plan.most = look_back(guide);
    BeamOptions beam = options_.beam;
    beam.aim = options_.aim;
    beam.careful_stages.assign(timeline_.stages(), false);
    for (int round = 0; round < kRounds; ++round) {
      BeamResult found = search_beam(world_, extents_, world_.scenario().camera(), guide, timeline_, limits_,
                                     place_limits_, beam);
      const std::vector<bool> hidden = judged_hidden(found.path);
      const auto count = static_cast<double>(std::count(hidden.begin(), hidden.end(), true));
      const double joint = 1 - count / static_cast<double>(timeline_.stages());
      if (round == 0 || joint > plan.joint) plan.joint = joint, plan.path = std::move(found.path);
      if (shot_cost_ || count <= std::floor(found.cost)) break;
      std::transform(hidden.begin(), hidden.end(), beam.careful_stages.begin(), beam.careful_stages.begin(),
                     std::logical_or<>());
    }
    return plan;
  }

 private:
  // The stages at which a path does not show all targets, by the judge's own pictures.
  std::vector<bool> judged_hidden(const std::vector<Pose>& path) {
    std::vector<bool> hidden;
    for (size_t stage = 0; stage < timeline_.stages(); ++stage) {
      const size_t tick = stage * timeline_.ticks_per_stage;
      world_.set_time(timeline_.tick_time_s(tick));
      const PictureTruth picture = measure_picture(world_.occluders(), world_.mirror(), world_.targets(), path[tick],
                                                   world_.scenario().lens());
      hidden.push_back(picture.fully_hidden() || picture.partly_hidden(kPartialTolerance));
    }
    return hidden;
  }

  PlaceGrid make_grid() {
    world_.set_time(0.0);
    PlaceGridOptions options;
    options.body_m = body_m_;
    options.most_places = options_.most_places;
    options.wanted = [&](const glm::dvec3& center_m) { return is_wanted(center_m); };
    // A grid that is too large is made again with larger cells.
    for (options.spacing_m = options_.spacing_m;; options.spacing_m *= 1.25) {
      PlaceGrid grid(world_.colliders(), world_.mirror().moving_slots(), start_m(), options);
      if (grid.complete()) return grid;
    }
  }

  double start_distance_m() const { return glm::distance(start_m(), path_.centers_m.front()); }
  const glm::dvec3& start_m() const { return world_.scenario().camera().position_m; }

  bool is_wanted(const glm::dvec3& point_m) const {
    const glm::dvec3 way = path_.centers_m.front() - start_m();
    const double gone = std::clamp(glm::dot(point_m - start_m(), way) / std::max(glm::dot(way, way), 1e-9), 0.0, 1.0);
    if (glm::distance(point_m, start_m() + way * gone) <= kWayToTargetsM) return true;
    return std::any_of(path_.centers_m.begin(), path_.centers_m.end(),
                       [&](const glm::dvec3& center_m) { return glm::distance(point_m, center_m) <= reach_m_; });
  }

  // Fills the guide. Returns the upper estimate of what the plan aims at.
  double look_back(Guide& guide) {
    CostsToGo careful(grid_.graph(), costs_.per_m), doubtful(grid_.graph(), 0.0);
    const double stage_m = limits_.max_speed_mps * timeline_.stage_s();
    const int doubtful_hops = static_cast<int>(std::ceil(stage_m / grid_.spacing_m()));
    std::vector<float> cost(grid_.size()), doubtful_cost(grid_.size());
    for (size_t stage = timeline_.stages(); stage-- > 0;) {
      look_from_places(stage, cost, doubtful_cost);
      careful.add_stage_before(cost, guide_hops(stage));
      doubtful.add_stage_before(doubtful_cost, doubtful_hops);
      guide.keep(stage, cost, careful.costs());
    }
    const uint32_t start = grid_.at(glm::ivec3(0));
    return 1 - static_cast<double>(doubtful.costs()[start]) / static_cast<double>(timeline_.stages());
  }

  // The number of edges that the guide's camera may go between a stage and the next, so that it keeps its speed on
  // average.
  int guide_hops(size_t stage) const {
    const double speed_mps = std::min(std::max(options_.guide_speed_mps, path_.speed_mps), limits_.max_speed_mps);
    const double per_stage = speed_mps * timeline_.stage_s() / grid_.spacing_m();
    const auto now = static_cast<double>(stage);
    return static_cast<int>(std::floor((now + 1) * per_stage) - std::floor(now * per_stage));
  }

  // The cost of a picture from every place: for the guide, and for the upper estimate.
  void look_from_places(size_t stage, std::vector<float>& cost, std::vector<float>& doubtful_cost) {
    world_.set_time(timeline_.tick_time_s(stage * timeline_.ticks_per_stage));
    sight_.refresh(stage);
    const glm::dvec3 center_m = world_.targets_center_m();
    const double flight_m = farthest_flight_m(timeline_.stage_s() * static_cast<double>(stage));
    looked_.assign(grid_.size(), std::nullopt);
    for (uint32_t place = 0; place < grid_.size(); ++place) {
      const PictureCost picture = look_from(place, center_m);
      cost[place] = picture.careful;
      doubtful_cost[place] = glm::distance(grid_.place_m(place), start_m()) > flight_m ? kBarredCost : picture.doubtful;
    }
    block_movers(cost, doubtful_cost);
  }

  // How far the camera can be from its start, at which it rests; with a cell more, since a camera may be anywhere in
  // its cell.
  double farthest_flight_m(double time_s) const {
    const double speed_up_s = std::min(time_s, limits_.max_speed_mps / limits_.max_acceleration_mps2);
    const double speed_mps = limits_.max_acceleration_mps2 * speed_up_s;
    return speed_mps * (speed_up_s + timeline_.tick_s) / 2 + speed_mps * (time_s - speed_up_s) +
           std::sqrt(3.0) * grid_.spacing_m();
  }

  // The cost of a picture from a place: for the guide, and for the upper estimate.
  struct PictureCost {
    float careful = 0.0f, doubtful = 0.0f;
  };
  // Far from the targets, a place takes over what its neighbour with even coordinates sees.
  PictureCost look_from(uint32_t place, const glm::dvec3& center_m) {
    uint32_t from = place;
    if (glm::distance(grid_.place_m(place), center_m) > near_m_)
      if (const uint32_t even = grid_.at(grid_.cell(place) & ~1); even != kNoPlace) from = even;
    if (!looked_[from]) looked_[from] = picture_cost(grid_.place_m(from), center_m);
    return *looked_[from];
  }
  PictureCost picture_cost(const glm::dvec3& eye_m, const glm::dvec3& center_m) const {
    if (shot_cost_) {
      const auto cost = static_cast<float>(shot_cost_->from(eye_m, center_m, options_.rays));
      return {cost, cost};
    }
    const TargetsSeen seen = sight_.from(eye_m);
    const bool shows_all = seen.allowed && seen.least_share >= 1 - kPartialTolerance;
    return {static_cast<float>(costs_.picture(shows_all, seen.mean_share)),
            seen.allowed && seen.least_share >= kDoubtfulShare ? 0.0f : 1.0f};
  }

  // Bars the places where the body would touch a moving collider. The guide may hope for a free point beside it.
  void block_movers(std::vector<float>& cost, std::vector<float>& doubtful_cost) const {
    for (const uint32_t slot : world_.mirror().moving_slots()) {
      const Instance& mover = world_.mirror().instances()[slot];
      if (!mover.collides()) continue;
      const glm::dvec3 reach(mover.radius_m + body_m_ + grid_.spacing_m());
      const glm::ivec3 low = grid_.cell_of(mover.center_m - reach), high = grid_.cell_of(mover.center_m + reach);
      for (int x = low.x; x <= high.x; ++x)
        for (int y = low.y; y <= high.y; ++y)
          for (int z = low.z; z <= high.z; ++z)
            if (const uint32_t place = grid_.at({x, y, z}); place != kNoPlace && touches(place))
              cost[place] = std::max(cost[place], kBlockedCost), doubtful_cost[place] = kBarredCost;
    }
  }

  bool touches(uint32_t place) const {
    const auto reach = static_cast<float>(body_m_ - kGridSkinM);
    return world_.colliders().nearest_surface_m(grid_.place_m(place), reach) < reach;
  }
  static constexpr float kBlockedCost = 100.0f;  // a camera would rather miss ten seconds

  ScenarioWorld& world_;
  const Timeline timeline_;
  const CameraLimits limits_;
  const MoveSettings& place_limits_;
  const PlanOptions& options_;
  ExtentCache& extents_;
  const PlanCosts costs_;
  const double body_m_;
  const TargetsPath path_;
  const double reach_m_, near_m_;
  SightEstimate sight_;
  const PlaceGrid grid_;
  std::optional<ShotCost> shot_cost_;               // of a plan for kWorth
  std::vector<std::optional<PictureCost>> looked_;  // by place, at the present stage
};

}  // namespace

Timeline timeline_of(double tick_s, size_t ticks, size_t ticks_per_picture) {
  const auto most = std::max<size_t>(1, static_cast<size_t>(kLongestStageS / tick_s));
  size_t between = std::min(ticks_per_picture, most);
  while (ticks_per_picture % between != 0) --between;
  if (between == ticks_per_picture)
    between *= most / between;
  else if (static_cast<double>(between) * tick_s < kShortestStageS)
    between = most;
  return {.tick_s = tick_s, .ticks = ticks, .ticks_per_stage = between};
}

Result<CeilingPlan> plan_ceiling(const Scenario& scenario, GeometryStore& store, EmbreeDevice& device,
                                 ExtentCache& extents, const Timeline& timeline, const CameraLimits& limits,
                                 const MoveSettings& place_limits, const PlanOptions& options) {
  if (!scenario.target_changes_s().empty())
    return fail(ErrorCode::kFailedPrecondition, "targets", "a ceiling needs the same targets all the time");
  auto world = ScenarioWorld::make(scenario, store, device);
  if (!world) return tl::unexpected(world.error());
  return Planner(**world, extents, timeline, limits, place_limits, options).plan();
}

}  // namespace sightline
