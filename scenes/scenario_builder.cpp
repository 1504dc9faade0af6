#include "scenes/scenario_builder.h"

#include <cmath>

#include "scenes/exact.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

using Json = nlohmann::ordered_json;

// Only what differs from the defaults, so that the file reads as a person would write it.
void put_attributes(Json& role, const InstanceAttributes& attributes) {
  const InstanceAttributes defaults;
  if (attributes.layers != defaults.layers) role["layers"] = attributes.layers;
  if (attributes.opacity != defaults.opacity) role["opacity"] = attributes.opacity;
  if (attributes.occludes != defaults.occludes) role["occludes"] = attributes.occludes;
  if (attributes.collides != defaults.collides) role["collides"] = attributes.collides;
  if (attributes.visible != defaults.visible) role["visible"] = attributes.visible;
}

Json target_role(double weight, const TargetTimes& during) {
  Json role = {{"role", "target"}, {"weight", weight}, {"required", true}};
  if (!during.empty()) role["during"] = during;
  return role;
}

Json extras_of(const Json& role) {
  return role.empty() ? Json() : Json::object({{"sightline", role}});
}

// Turns the unit direction `from` towards `to`, by no more in one key than a body can.
glm::dvec2 turned(const glm::dvec2& from, const glm::dvec2& to, double keys_per_second) {
  constexpr double kFastestTurn_radps = 8.0;  // a little more than the sharpest corner of a walk asks for
  const glm::dvec2 step = circle_point(kFastestTurn_radps / keys_per_second / (2 * std::numbers::pi));
  if (from.x * to.x + from.y * to.y >= step.x) return to;
  const double sine = from.x * to.y - from.y * to.x >= 0 ? step.y : -step.y;
  return {from.x * step.x - from.y * sine, from.x * sine + from.y * step.x};
}

}  // namespace

std::string numbered(std::string name, int number) {
  name += '-';
  name += std::to_string(number);
  return name;
}

void Motion::add(double time_s, const glm::dvec3& position_m, const glm::dquat& rotation) {
  times_s.push_back(time_s);
  positions_m.push_back(snap_key(position_m));
  // q and -q are one rotation; interpolation wants neighbours on the same side.
  const bool flip = !rotations.empty() && glm::dot(rotations.back(), rotation) < 0;
  rotations.push_back(flip ? -rotation : rotation);
}

Motion walk(const TimedPath& path, double duration_s, double keys_per_second) {
  Motion motion;
  const glm::dvec2 first = path.velocity_mps(0);
  glm::dvec2 heading = length(first) > 0.01 ? first / length(first) : glm::dvec2(0, 1);
  const auto last = static_cast<int>(std::floor(duration_s * keys_per_second + 0.5));
  for (int i = 0; i <= last; ++i) {
    const double time_s = i / keys_per_second;
    const glm::dvec2 p = path.position_m(time_s), v = path.velocity_mps(time_s);
    const double speed = length(v);
    if (speed > 0.01)
      heading = turned(heading, v / speed, keys_per_second);  // a walker that stands still keeps its direction
    motion.add(time_s, {p.x, 0, p.y}, facing(heading));
  }
  return motion;
}

int ScenarioBuilder::add_mesh(const std::string& name, const MeshData& mesh, const glm::vec3& color) {
  return writer_.add_mesh(name, mesh, color);
}

void ScenarioBuilder::add_static(const std::string& name, int mesh, const glm::dvec3& position_m,
                                 const glm::dquat& rotation, const InstanceAttributes& attributes) {
  Json role = Json::object();
  put_attributes(role, attributes);
  writer_.add_node({name, -1, mesh, -1, snap(position_m), rotation, extras_of(role)});
}

int ScenarioBuilder::add_moving(const std::string& name, int mesh, const Motion& motion, Json role) {
  const int node = writer_.add_node(
      {name, -1, mesh, -1, motion.positions_m.front(), motion.rotations.front(), extras_of(role)});
  const std::vector<float> times(motion.times_s.begin(), motion.times_s.end());
  const std::vector<glm::vec3> positions(motion.positions_m.begin(), motion.positions_m.end());
  const std::vector<glm::quat> rotations(motion.rotations.begin(), motion.rotations.end());
  writer_.animate(node, times, positions, rotations);
  return node;
}

void ScenarioBuilder::add_character(const std::string& name, const Motion& motion, const TargetTimes& during) {
  if (body_mesh_ < 0) {
    MeshData body, visor;
    append_capsule(body, {0, 0, 0}, kBodyRadius_m, kBodyHeight_m, 16, 4);
    append_box(visor, {-0.125, 1.5, 0.15}, {0.125, 1.59375, 0.296875});
    body_mesh_ = writer_.add_mesh("body", body, colors::kBody);
    visor_mesh_ = writer_.add_mesh("visor", visor, colors::kVisor);
  }
  const int node = add_moving(name, body_mesh_, motion, target_role(1, during));
  writer_.add_node({name + "-visor", node, visor_mesh_, -1, {}, {1, 0, 0, 0}, {}});
}

void ScenarioBuilder::add_target(const std::string& name, int mesh, const Motion& motion, double weight,
                                 const TargetTimes& during) {
  add_moving(name, mesh, motion, target_role(weight, during));
}

void ScenarioBuilder::add_occluder(const std::string& name, int mesh, const Motion& motion,
                                   const InstanceAttributes& attributes) {
  Json role = Json::object({{"role", "occluder"}});
  put_attributes(role, attributes);
  add_moving(name, mesh, motion, std::move(role));
}

void ScenarioBuilder::add_camera(const glm::dvec3& eye_m, const glm::dvec3& at_m, const CameraMotion& motion) {
  const int camera = writer_.add_camera(0.6981317007977318, 16.0 / 9.0, 0.1);  // 40 degrees
  Json role = Json::object({{"role", "camera"}});
  if (motion.max_speed_mps > 0) role["max_speed_mps"] = motion.max_speed_mps;
  if (motion.max_acceleration_mps2 > 0) role["max_acceleration_mps2"] = motion.max_acceleration_mps2;
  writer_.add_node({"camera", -1, -1, camera, snap(eye_m), looking(snap(eye_m), snap(at_m)), extras_of(role)});
}

}  // namespace sightline::scenes
