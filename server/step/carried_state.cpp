#include "server/step/carried_state.h"

namespace sightline {
namespace {

// Nearer to the path than this, the viewer's camera is on it: a client that follows late lies between poses that were
// returned.
constexpr double kOnPathM = 0.002;
// The viewer's camera follows if it is nearer to the path than this, plus kLateShare of the path's length. A client
// that smooths with a time constant of 0.2 s leaves a path that turns at 10 m/s^2 by 0.2 m. It leaves a direction that
// turns at 12 rad/s^2 by 0.24 rad. The share lets a client be 0.2 s later than the path is long.
constexpr double kNearM = 1.0, kNearRad = 0.35, kLateShare = 0.4;
// The pull towards the viewer's camera, as a share of its distance from the path per second.
constexpr double kPullPerS = 1.0;

double apart(const glm::dvec3& a, const glm::dvec3& b) {
  return glm::distance(a, b);
}
double apart(const glm::dquat& a, const glm::dquat& b) {
  return angle_between(a, b);
}
// Metres or radians.
template <typename Value>
double length(const RecentTrack<Value>& track) {
  double sum = 0;
  for (size_t i = 1; i < track.count(); ++i) sum += apart(track[i - 1], track[i]);
  return sum;
}

void start_position(CarriedState& state, const ViewerCamera& viewer) {
  state.camera.pose.position_m = viewer.pose.position_m;
  state.camera.velocity_mps = viewer.velocity_mps;
  state.camera.acceleration_mps2 = glm::dvec3(0.0);
  state.goal_m.reset();
  state.follows = false;
  state.change.reset();
  state.blind = {};
  state.shares.forget();
  state.given_up.clear();
  state.not_aimed_at.clear();
  state.viewpoints.forget();
  state.path.position_m.start(viewer.pose.position_m);
  state.pull_mps = glm::dvec3(0.0);
  state.in_force.is_due = true;
}

void start_rotation(CarriedState& state, const ViewerCamera& viewer) {
  state.camera.pose.rotation = viewer.pose.rotation;
  state.camera.angular_velocity_radps = viewer.angular_velocity_radps;
  state.turn = TurnState{};
  state.turn.angles = angles_from_rotation(viewer.pose.rotation);
  const glm::dquat level = rotation_from_angles({state.turn.angles.yaw_rad, state.turn.angles.pitch_rad, 0.0});
  state.turn.yaw_rate_radps = viewer.angular_velocity_radps.y;
  state.turn.pitch_rate_radps = glm::dot(viewer.angular_velocity_radps, level * glm::dvec3(1, 0, 0));
  state.shares.forget();
  state.path.rotation.start(viewer.pose.rotation);
  state.in_force.is_due = true;
}

// No step was taken since the camera was put where it is. A velocity that is sent then is news.
bool is_at_start(const CarriedState& state) {
  return state.path.position_m.count() <= 1;
}

glm::dvec3 pull_towards(const glm::dvec3& away_m, double on_path_m) {
  const double distance_m = glm::length(away_m);
  return distance_m > on_path_m ? away_m * (kPullPerS * (distance_m - on_path_m) / distance_m) : glm::dvec3(0.0);
}

}  // namespace

void place_camera(CarriedState& state, const ViewerCamera& viewer) {
  start_position(state, viewer);
  start_rotation(state, viewer);
  state.shot.is_set = false;
  state.horizon_s = 0.0;
  state.candidates.lattice.start_again();
  state.cut = {};
}

bool observe_camera(CarriedState& state, const ViewerCamera& viewer) {
  const glm::dvec3 still(0.0);
  const glm::dvec3 away_m = away_from(state.path.position_m, viewer.pose.position_m);
  const bool moves_at_start = is_at_start(state) && viewer.velocity_mps != still;
  const bool turns_at_start = is_at_start(state) && viewer.angular_velocity_radps != still;
  const double near_rad = kNearRad + kLateShare * length(state.path.rotation);
  const double near_m = kNearM + kLateShare * length(state.path.position_m) + viewer.rounding_m;
  if (turns_at_start || angle_from(state.path.rotation, viewer.pose.rotation) > near_rad) start_rotation(state, viewer);
  if (moves_at_start || glm::length(away_m) > near_m) {
    start_position(state, viewer);
    return true;
  }
  state.pull_mps = pull_towards(away_m, kOnPathM + viewer.rounding_m);
  return false;
}

}  // namespace sightline
