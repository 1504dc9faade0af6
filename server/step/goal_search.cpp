// The goal of strategy kMinCost. A flight plan (move/flight_plan.h) says where the camera should be at each time of the
// coming second, so that the targets are seen then. Two simpler ways are compared with it: to follow the desired
// position, and to stay. A plan knows nothing of what lies outside the bound. So a camera takes a far way through the
// level when it sees no target and no plan shows one, or when targets that stand are seen better from the wanted shot.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "server/base/inline_vector.h"
#include "server/move/best_acceleration.h"
#include "server/move/picture_worth.h"
#include "server/move/sight_weight.h"
#include "server/step/plan_pricer.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// A leg of a plan is flown at the mean speed of a camera that speeds up over this way, or over four cells if these are
// longer.
constexpr double kWayM = 4.0;
// Before this time the camera can hardly change its course.
constexpr double kAnswerS = 0.15;
// The time constant with which that point moves, so that it does not jump between two plans that are equally good. It
// must be several times as long as from one decision to the next.
constexpr double kCalmS = 0.1;
// A point of the plan that is no farther than this is where the camera is.
constexpr double kHereM = 0.05;
// Where a path is farther beyond the bound than this, its places are not judged, since nothing is known of them.
constexpr double kBeyondM = 2.0;
// A plan is straight if it leads this part of the way that its speed allows.
constexpr double kStraightOn = 0.9;
// From this many times the length of such a plan on, the desired position is far away.
constexpr double kFarBehind = 3.0;
// What the greatest acceleration costs at this move_response_s, in units of the cost of a plan. It grows with the
// square of that time.
constexpr double kEffortM = 0.17, kEffortResponseS = 0.2;
// A camera that follows with its targets in sight does not hurry to its place. The velocity of the targets is added to
// its own, so it does not fall behind.
constexpr Pace kUnhurried{.response = 1.5, .closing = 2.5, .braking = 0.25};
constexpr Pace kHurried{};

// A camera that has seen no target for so long takes a way through the level (move/far_way.h), and searches it again
// after this time, since targets move.
constexpr double kBlindS = 2.0, kSearchAgainS = 1.0;
// The grid of the search has at most this number of cells between the camera and the target. Ways to targets beyond
// this distance are not searched for.
constexpr double kFarCells = 80.0, kFarthestM = 400.0;
// The viewpoint search may know that this share more of standing targets is seen at the wanted shot than pictures of
// late have shown. When it has known that for this time, or for as long as the straight way takes if that is longer,
// the camera takes a far way to the shot, which ends this near to it. On its way, this part of the gain is enough to go
// on.
constexpr double kShotGain = 0.3, kShotGainsS = 0.5, kShotGoesOn = 0.5, kShotNearM = 1.0;
// Nothing is known at first, and all viewpoints are assumed to be good. That is forgotten after so many time constants
// of the search's memory.
constexpr double kSurelyKnown = 3.0;
// How much more what is seen beyond a plan counts where nothing is seen on it, in plans.
constexpr double kBeyondWhileBlind = 3.0;
// On a far way the camera brakes for each corner as if it were to stop so far behind it.
constexpr double kTurnM = 0.4;

double body_m(const MoveInput& in) {
  return swept_radius_m(in.step.input.limits, in.step.lens);
}

// The look of kEvadeS at which a moving collider closes places to the plan. A later one would close places to which the
// mover may never come.
constexpr size_t kSoonLook = 2;

// Sets the clearance of candidates to 0 where a moving collider, such as a cart, is about to be. No plan then leads to
// them or through them.
void give_way(const MoveInput& in, double body_radius_m, std::vector<float>& clearance_m) {
  const ClearanceField& soon = in.surroundings.movers_ahead[kSoonLook];
  if (soon.collider_count() == 0) return;
  const auto& position_m = in.sights.position_m;
  for (size_t i = 0; i < position_m.size(); ++i)
    if (soon.clearance_m(position_m[i], body_radius_m) < body_radius_m) clearance_m[i] = 0;
}

// ---- the flight plan ----

FlightSettings flight_settings(const MoveInput& in) {
  const double way_m = std::max(kWayM, 4 * in.carried.candidates.lattice.spacing_m());
  const CameraLimits& limits = in.step.input.limits;
  return {.slice_s = kSliceS,
          .speed_mps = std::min(limits.max_speed_mps, std::sqrt(limits.max_acceleration_mps2 * way_m / 2)),
          .route = in.step.input.settings.move.cost.route,
          .afterwards = kAfterwards};
}

// The mean cost of the slices along a path, as of a flight plan. Beyond the bound, the last cost that is known is taken
// to hold: a camera behind a car is soon far from any place that is known now.
template <typename Path>
double cost_of_path(const FlightPlanner& planner, const HiddenAhead& ahead, const FlightSettings& settings,
                    const Bound& bound, Path path) {
  double sum = 0, last = 0;
  bool is_known = true;
  glm::dvec3 in_bound_m(0.0);
  for (size_t slice = 0; slice < kSlices; ++slice) {
    const glm::dvec3 at_m = path(ahead.ahead_s(slice));
    in_bound_m = nearest_in_bound_m(bound, at_m);
    is_known = slice == 0 || glm::distance(at_m, in_bound_m) <= kBeyondM;
    if (is_known) last = planner.cost_at(in_bound_m, slice, 100.0);
    sum += last;
  }
  const double afterwards = is_known ? last + planner.gain_beyond_at(in_bound_m) : last;
  return sum / kSlices + settings.afterwards * afterwards + settings.route * glm::distance(path(0), in_bound_m);
}

class GoalSearch {
 public:
  GoalSearch(const MoveInput& in, MoveScratch& scratch)
      : in_(in),
        scratch_(scratch),
        planner_(scratch.planner),
        settings_(flight_settings(in)),
        pricer_(in, settings_, scratch),
        ways_(in.surroundings.colliders, in.step.camera.pose.position_m, body_m(in)) {}

  Goal choose() {
    const double body_radius_m = route_radius_m(in_.step);
    scratch_.way.clear();
    scratch_.way.reserve(kSlices + 1 + in_.sights.position_m.size());
    scratch_.clearance_m = in_.sights.clearance_m;
    give_way(in_, body_radius_m, scratch_.clearance_m);
    planner_.lay(in_.sights.candidates.position_m, in_.sights.position_m, scratch_.clearance_m, body_radius_m, kSlices);
    pricer_.price();
    const FlightPlan& plan = planner_.plan(start(), settings_);
    blind_ = blind_since();
    std::optional<Goal> goal;
    if (blind_.blind_s >= kBlindS || goes_to_shot()) goal = take_far_way(body_radius_m);
    if (!goal) goal = sees_any(plan) ? go_on(plan) : go_to_view(plan, body_radius_m);
    if (goal->courses.taken != FlightCourse::kFarWay && goal->courses.taken != FlightCourse::kToShot)
      blind_.way_m.clear();
    goal->blind = blind_;
    goal->change = change_;
    return *goal;
  }

 private:
  Goal go_on(const FlightPlan& plan) {
    const double stay = stay_cost(), follow = follow_cost();
    Goal goal = decide_to_follow(follow, stay, plan.cost) ? follow_desired(pace())
                : stay <= plan.cost                       ? stay_here()
                                                          : fly(plan);
    set_losses(follow, stay, plan, goal.courses);
    return goal;
  }
  void set_losses(double follow, double stay, const FlightPlan& plan, ComparedCourses& courses) const {
    const double blind = pricer_.blind_cost();
    if (blind <= 0) return;
    const auto loss = [blind](double cost) { return std::clamp(cost / blind, 0.0, kMostLoss); };
    if (std::isfinite(follow)) courses.follow_loss = loss(follow);
    courses.stay_loss = loss(stay);
    if (!plan.candidates.empty()) courses.plan_loss = loss(plan.cost);
  }
  bool decide_to_follow(double follow, double stay, double plan) {
    change_ = in_.carried.change.value_or(SummedGain{});
    if (!in_.carried.change) return follow <= std::min(stay, plan);
    const double steadiness = in_.step.input.settings.move.cost.steadiness;
    const double gain_m = in_.carried.follows ? follow - std::min(stay, plan + steadiness)
                                              : std::min(stay, plan) - follow;
    return change_->add(gain_m, in_.step.decision_s) != in_.carried.follows;
  }

  // Targets that move apart leave the picture, unless the camera is in line with them in time.
  const Pace& pace() const { return in_.carried.shot.in_line_m ? kHurried : kUnhurried; }
  const glm::dvec3& eye_m() const { return in_.step.camera.pose.position_m; }
  // The point at most this far on the straight way to a position.
  glm::dvec3 part_of_way_m(const glm::dvec3& to_m, double at_most_m) const {
    const double length_m = glm::distance(eye_m(), to_m);
    return length_m > at_most_m ? glm::mix(eye_m(), to_m, at_most_m / length_m) : to_m;
  }
  const HiddenAhead& ahead() const { return in_.carried.candidates.ahead; }

  FlightStart start() {
    return {.position_m = eye_m(),
            .drift_m = in_.step.camera.velocity_mps * kAnswerS,
            .is_free = [this](uint32_t candidate) { return ways_.is_free(in_.sights.position_m[candidate]); }};
  }
  bool sees_any(const FlightPlan& plan) const {
    if (in_.sights.hidden[in_.sights.own_candidate] < kAllHidden) return true;
    return std::ranges::any_of(plan.candidates,
                               [&](uint32_t candidate) { return in_.sights.hidden[candidate] < kAllHidden; });
  }
  // `arrives_s`: when the camera is there.
  Goal goal_at(size_t candidate, const glm::dvec3& position_m, FlightCourse course, double arrives_s = 0.0) const {
    Goal goal{
        .choice = choice_of(static_cast<uint32_t>(candidate), in_.sights.candidates, in_.step.targets.tracked_targets),
        .position_m = position_m};
    const uint32_t steered = in_.step.targets.steered;
    const WantedShot& shot = in_.carried.shot;
    goal.courses.taken = course;
    const WhatIsSeen seen{.from_goal = in_.sights.candidates.filtered()[candidate] & steered,
                          .steered = steered,
                          .somewhere_all = in_.sights.counts.all_visible > 0,
                          .other_shot = shot.other_viewpoint() || shot.in_line_m,
                          .keeps_shot = pricer_.is_in_free_bands(in_.sights.position_m[candidate], arrives_s)};
    goal.facts = hold(seen);
    goal.choice.reason = reason_of(course, course == FlightCourse::kPlan ? as_held(seen, goal.facts) : seen);
    return goal;
  }
  HeldFacts hold(const WhatIsSeen& seen) const {
    const HeldFacts& before = in_.carried.in_force.facts;
    const auto longer_s = [&](bool is_so, double before_s) {
      return is_so ? std::min(before_s + in_.step.decision_s, kFactHoldsS) : 0.0;
    };
    return {longer_s(seen.from_goal == seen.steered, before.goal_sees_all_s),
            longer_s(seen.keeps_shot, before.goal_keeps_shot_s), longer_s(!seen.somewhere_all, before.none_sees_all_s)};
  }
  // Without what has not held for long enough to be said.
  static WhatIsSeen as_held(WhatIsSeen seen, const HeldFacts& facts) {
    if (seen.from_goal == seen.steered && facts.goal_sees_all_s < kFactHoldsS) seen.from_goal = 0;
    if (facts.none_sees_all_s < kFactHoldsS) seen.somewhere_all = true;
    if (facts.goal_keeps_shot_s < kFactHoldsS) seen.keeps_shot = false;
    return seen;
  }
  static Choice choice_for(MoveStatus status, FlightCourse course) { return {status, reason_of(course, {}), -1}; }

  // ---- following the desired position ----

  size_t desired_candidate() const { return in_.sights.position_m.size() - 1; }
  glm::dvec3 behind_m() const { return in_.sights.position_m[desired_candidate()] - eye_m(); }
  double follow_cost() {
    if (!ways_.is_free(in_.sights.position_m[desired_candidate()])) return INFINITY;
    return cost_of_path(planner_, ahead(), settings_, in_.bound, [&](double time_s) { return following_m(time_s); });
  }
  // Where a camera that follows is after a time.
  glm::dvec3 following_m(double time_s) const {
    const glm::dvec3 target_m = in_.sights.position_m[desired_candidate()];
    return part_of_way_m(target_m, settings_.speed_mps * time_s) + group_velocity_mps(in_.step) * time_s;
  }
  Goal follow_desired(const Pace& pace) {
    Goal goal = goal_at(desired_candidate(), following_m(kGoalS), FlightCourse::kFollow);
    goal.follows = true;
    const bool is_far = glm::length(behind_m()) > in_.carried.candidates.lattice.spacing_m();
    for (size_t k = 1; is_far && k < kSlices; ++k)  // the cells on the way
      if (const auto candidate = planner_.candidate_at(eye_m() + behind_m() * (static_cast<double>(k) / kSlices)))
        scratch_.way.push_back(*candidate);
    scratch_.way.push_back(static_cast<uint32_t>(desired_candidate()));
    // A place outside the bound is farther away than its candidate, which is at the edge.
    const double beyond_m = glm::distance(in_.desired_m, nearest_in_bound_m(in_.bound, in_.desired_m));
    const Leg leg{in_.sights.position_m[desired_candidate()], glm::length(behind_m()) + beyond_m};
    goal.velocity_mps = velocity_along(in_.step, leg, group_velocity_mps(in_.step), pace);
    goal.tracking = {.by = TrackBy::kFollow, .pace = pace, .vector = leg.to_m - in_.desired_m, .beyond_m = beyond_m};
    return goal;
  }

  // ---- staying ----

  double stay_cost() {
    return cost_of_path(planner_, ahead(), settings_, in_.bound, [&](double) { return eye_m(); });
  }
  Goal stay_here() {
    Goal goal = goal_at(in_.sights.own_candidate, eye_m(), FlightCourse::kStay);
    goal.velocity_mps = velocity_along(in_.step, {eye_m(), 0}, glm::dvec3(0.0));
    goal.tracking.by = TrackBy::kStay;
    return goal;
  }

  // ---- the flight plan ----

  Goal fly(const FlightPlan& plan) {
    scratch_.way = plan.candidates;
    glm::dvec3 to_m = plan.at(kGoalS);
    if (in_.carried.goal_m) to_m = glm::mix(to_m, *in_.carried.goal_m, std::exp(-in_.step.decision_s / kCalmS));
    Goal goal = goal_at(plan.candidates.back(), to_m, FlightCourse::kPlan, plan.at_s.back());
    for (size_t k = 0; k < plan.point_m.size(); ++k) goal.plan_m.push_back({plan.at_s[k], plan.point_m[k]});
    goal.tracking = track(plan, to_m);
    goal.velocity_mps = velocity_by(in_.step, goal.tracking, in_.desired_m);
    return goal;
  }
  double response_s() const { return in_.step.input.settings.move.move_response_s; }

  // The acceleration with which the camera flies a plan, which leads it to `to_m`; a velocity if it is far behind or no
  // acceleration is free.
  Tracking track(const FlightPlan& plan, const glm::dvec3& to_m) {
    glm::dvec3 wanted_mps = (to_m - eye_m()) / kGoalS;
    const bool hurries = is_far_behind(plan);
    if (hurries) wanted_mps = faster(wanted_mps);
    if (!ways_.is_free(to_m)) wanted_mps = round_corner(reachable_m(plan), wanted_mps);
    const Tracking at_velocity{.by = TrackBy::kVelocity, .vector = wanted_mps};
    if (hurries) return at_velocity;
    const double time_s = std::max(response_s(), in_.step.move_s);
    const glm::dvec3& velocity_mps = in_.step.camera.velocity_mps;
    const auto acceleration_mps2 = best_acceleration_mps2(planner_, settings_,
                                                          acceleration_input((wanted_mps - velocity_mps) / time_s));
    return acceleration_mps2 ? Tracking{.by = TrackBy::kAcceleration, .vector = *acceleration_mps2} : at_velocity;
  }
  // The farthest point of the plan that the body can reach straight.
  glm::dvec3 reachable_m(const FlightPlan& plan) {
    size_t last = plan.point_m.size() - 1;
    while (last > 1 && !ways_.is_free(plan.point_m[last])) --last;
    // A plan may begin in the cell where the camera is. The camera must not wait there for a way that is never quite
    // free.
    if (last + 1 < plan.point_m.size() && glm::distance(plan.point_m[last], eye_m()) < kHereM) ++last;
    return plan.point_m[last];
  }
  glm::dvec3 round_corner(const glm::dvec3& corner_m, const glm::dvec3& wanted_mps) const {
    const glm::dvec3 way_m = corner_m - eye_m();
    const double length_m = glm::length(way_m);
    if (length_m < 1e-9) return wanted_mps;
    return way_m *
           (std::min(glm::length(wanted_mps), length_m / std::max(response_s(), 2 * in_.step.move_s)) / length_m);
  }
  AccelerationInput acceleration_input(const glm::dvec3& planned_mps2) {
    const double response = response_s() / kEffortResponseS;
    return {.position_m = eye_m(),
            .velocity_mps = in_.step.camera.velocity_mps,
            .group_velocity_mps = group_velocity_mps(in_.step),
            .planned_mps2 = planned_mps2,
            .max_speed_mps = in_.step.input.limits.max_speed_mps,
            .max_acceleration_mps2 = in_.step.input.limits.max_acceleration_mps2,
            .first_slice_s = ahead().ahead_s(0),
            .is_free = [this](const glm::dvec3& position_m) { return ways_.is_free(position_m); },
            .effort_m = kEffortM * response * response};
  }

  // The plan flies straight on for all its time, and far beyond it. So the camera may be faster than the mean speed of
  // a plan.
  bool is_far_behind(const FlightPlan& plan) const {
    const double way_m = glm::distance(eye_m(), plan.point_m.back());
    return way_m > kStraightOn * settings_.speed_mps * ahead().ahead_s(kSlices - 1) && left_m() > kFarBehind * way_m;
  }
  double left_m() const { return glm::distance(eye_m(), in_.desired_m); }
  glm::dvec3 faster(const glm::dvec3& wanted_mps) const {
    const double arrival_mps = arrival_speed_mps(left_m(), in_.step.input.limits, in_.step.move_s);
    return wanted_mps * std::max(1.0, arrival_mps / std::max(glm::length(wanted_mps), 1e-9));
  }

  // ---- without a view on the plan: on to one beyond it, or through the level ----

  // What is seen beyond the plan counts for more than the shot, since nothing is seen on it.
  Goal go_to_view(const FlightPlan& seeing_none, double body_radius_m) {
    const auto shows_some = [this](uint32_t candidate) { return in_.sights.hidden[candidate] < kAllHidden; };
    const auto append_way_to_view = [&](const FlightPlan& plan) {
      return !plan.candidates.empty() && planner_.append_way(plan.candidates.back(), shows_some, scratch_.way);
    };
    scratch_.way.clear();
    if (!append_way_to_view(seeing_none)) return escape(seeing_none, body_radius_m);
    FlightSettings settings = settings_;
    settings.beyond = kBeyondWhileBlind;
    const FlightPlan& plan = planner_.plan(start(), settings);
    // It heads along the plan, not for the view: which places have one changes with the noise of the maps.
    scratch_.way = plan.candidates;
    Leg leg = first_leg(in_, scratch_.way, body_m(in_));
    append_way_to_view(plan);
    const uint32_t view = scratch_.way.back();
    leg.length_m += way_length_m(in_, plan.point_m.back(), std::span(scratch_.way).subspan(plan.candidates.size()));
    Goal goal = goal_at(view, part_of_way_m(leg.to_m, settings_.speed_mps * kGoalS), FlightCourse::kToView);
    goal.searches = true;
    goal.tracking = along(in_.step, leg);
    goal.velocity_mps = velocity_along(in_.step, leg, glm::dvec3(0.0));
    return goal;
  }
  Goal escape(const FlightPlan& plan, double body_radius_m) {
    std::optional<Goal> goal = take_far_way(body_radius_m);
    if (!goal) {
      goal = approach(plan);
      goal->choice.reason = reason_of(FlightCourse::kApproach, {});
      goal->courses.taken = FlightCourse::kApproach;
    }
    goal->lost = goal->searches = true;
    return *goal;
  }
  // Without a way the camera goes at least nearer to the desired position.
  Goal approach(const FlightPlan& plan) {
    if (ways_.is_free(in_.sights.position_m[desired_candidate()])) return follow_desired(kHurried);
    return plan.candidates.empty() ? stay_here() : fly(plan);
  }

  // ---- a far way: round whatever keeps a camera from seeing its targets for long ----

  // The camera's own sights decide whether it is blind, over a short time. The maps see more than there is through gaps
  // and past movers, so plans made by them may lead nowhere.
  BlindState blind_since() const {
    BlindState blind = in_.carried.blind;
    blind.searched_s += in_.step.decision_s;
    const auto lasts_s = [&](bool is_so, double before_s) { return is_so ? before_s + in_.step.decision_s : 0.0; };
    blind.blind_s = lasts_s(seen_of_late(in_.step, in_.carried) == 0, blind.blind_s);
    blind.shot_gains_s = lasts_s(shot_shows_more(), blind.shot_gains_s);
    return blind;
  }
  bool knows_shot() const {
    const double known_s = kSurelyKnown * in_.step.input.settings.move.viewpoint_search.memory_s;
    return in_.carried.shot.viewpoint && in_.carried.viewpoints.known_s() >= known_s;
  }
  // The share of the targets that is hidden, by what is seen of each.
  template <typename Share>
  double hidden_by(Share share) const {
    std::array<float, kMaxTargets> seen;
    for (size_t i = 0; i < in_.step.target_count(); ++i) seen[i] = share(i);
    return hidden_share(in_.step.targets.tracked_targets, std::span(seen).first(in_.step.target_count()));
  }
  // Only of targets that stand: among those that move, what is seen from the shot may be over when the camera arrives.
  bool shot_shows_more() const {
    if (!targets_stand(in_.step) || !knows_shot()) return false;
    const std::optional<glm::dvec3>& in_line_m = in_.carried.shot.in_line_m;
    const ViewpointMap& known = in_.carried.viewpoints;
    const size_t place = in_line_m ? known.nearest_viewpoint(*in_line_m) : *in_.carried.shot.viewpoint;
    const double of_late = hidden_by(
        [&](size_t i) { return static_cast<float>(in_.carried.shares.share(i).value_or(0.0)); });
    const double enough = kShotGain * (in_.carried.blind.way_m.empty() ? 1.0 : kShotGoesOn);
    return of_late - hidden_by([&](size_t i) { return known.share(i, place); }) >
           good_enough_share(enough, effective_count(in_.step.targets.sight_weights));
  }
  // By the straight way the camera would be there by then.
  bool goes_to_shot() const { return blind_.shot_gains_s >= std::max(kShotGainsS, left_m() / settings_.speed_mps); }
  std::optional<Goal> take_far_way(double body_radius_m) {
    const bool to_shot = blind_.blind_s < kBlindS && goes_to_shot();
    if (blind_.searched_s >= kSearchAgainS) find_far_way(to_shot, body_radius_m);
    const std::optional<Leg> leg = leg_of_far_way();
    if (!leg) return std::nullopt;
    scratch_.way.clear();
    const FlightCourse course = to_shot ? FlightCourse::kToShot : FlightCourse::kFarWay;
    Goal goal{.choice = choice_for(to_shot ? MoveStatus::kPartial : MoveStatus::kEscaping, course),
              .position_m = part_of_way_m(leg->to_m, settings_.speed_mps * kGoalS),
              .velocity_mps = velocity_along(in_.step, *leg, glm::dvec3(0.0)),
              .tracking = along(in_.step, *leg)};
    goal.courses.taken = course;
    goal.searches = !to_shot, goal.way_m = leg->length_m;
    for (size_t k = 1; k < blind_.way_m.size(); ++k) *goal.way_m += glm::distance(blind_.way_m[k - 1], blind_.way_m[k]);
    return goal;
  }
  FarWayInput way_to_target(double body_radius_m) const {
    FarWayInput input{.from_m = eye_m(), .to_m = nearest_target_m(), .body_radius_m = body_radius_m};
    // The grid is coarser for a target that is far away.
    input.cell_m = std::max(input.cell_m, glm::distance(input.from_m, input.to_m) / kFarCells);
    input.keep_off_m = std::max(input.keep_off_m, in_.step.input.settings.move.min_distance_m + input.cell_m / 2);
    input.near_m = std::max(input.near_m, input.keep_off_m + input.cell_m);
    return input;
  }
  FarWayInput way_to_shot(double body_radius_m) const {
    return {.from_m = eye_m(),
            .to_m = in_.desired_m,
            .body_radius_m = body_radius_m,
            .near_m = kShotNearM,
            .keep_off_m = 0.0};
  }
  // To the wanted shot, or to the nearest steered target.
  void find_far_way(bool to_shot, double body_radius_m) {
    blind_.searched_s = 0.0;
    const FarWayInput input = to_shot ? way_to_shot(body_radius_m) : way_to_target(body_radius_m);
    if (glm::distance(input.from_m, input.to_m) > kFarthestM) return blind_.way_m.clear();
    std::vector<uint32_t>& slots = scratch_.target_slots;
    slots.clear();
    for (const uint64_t id : in_.step.targets.ids) slots.push_back(*in_.step.input.scene.slot_of(id));
    for (const std::vector<TargetPiece>& pieces : in_.step.targets.pieces)
      for (const TargetPiece& piece : pieces) slots.push_back(piece.slot);
    std::sort(slots.begin(), slots.end());
    scratch_.far_colliders.gather(in_.step.input.scene, eye_m(), FarWayFinder::kReachCells * input.cell_m, slots);
    scratch_.far_colliders.allow(kMostTests);
    WayPoints found_m;  // where nothing is found, the former way still leads nearer to the target
    if (scratch_.far_ways.find(scratch_.far_colliders, input, found_m) || to_shot) blind_.way_m = found_m;
  }
  glm::dvec3 nearest_target_m() const {
    glm::dvec3 nearest_m = in_.step.center_m();
    double least_m = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < in_.step.target_count(); ++i) {
      const glm::dvec3 aim_m = in_.step.targets.tracked_targets[i].aim_m;
      if (!in_.step.is_steered(i) || glm::distance(eye_m(), aim_m) >= least_m) continue;
      least_m = glm::distance(eye_m(), aim_m), nearest_m = aim_m;
    }
    return nearest_m;
  }
  // Heads for the farthest point that the body can reach straight, and drops the points before it.
  std::optional<Leg> leg_of_far_way() {
    WayPoints& way_m = blind_.way_m;
    const double known_m = in_.surroundings.colliders.reach_m() - 2 * body_m(in_);
    for (size_t k = way_m.size(); k-- > 0;) {
      const glm::dvec3 to_m = part_of_way_m(way_m[k], known_m);
      if (!ways_.is_free(to_m)) continue;
      const double turn_m = k + 1 < way_m.size() ? kTurnM : 0.0;
      const Leg leg{to_m, glm::distance(eye_m(), way_m[k]) + turn_m};
      std::copy(way_m.begin() + k, way_m.end(), way_m.begin());
      way_m.resize(way_m.size() - k);
      return leg;
    }
    way_m.clear();
    return std::nullopt;
  }

  const MoveInput& in_;
  MoveScratch& scratch_;
  FlightPlanner& planner_;
  const FlightSettings settings_;
  PlanPricer pricer_;
  StraightWays ways_;
  BlindState blind_;
  std::optional<SummedGain> change_;  // empty at a step that does not compare courses
};

}  // namespace

Goal choose_goal(const MoveInput& in, MoveScratch& scratch) {
  return GoalSearch(in, scratch).choose();
}

}  // namespace sightline
