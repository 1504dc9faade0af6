#include "client/scenario/scenario.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "server/scene/gltf.h"

namespace sightline {
namespace {

using Json = nlohmann::json;

std::string field_of(const AssetNode& node, const std::string& key) {
  return "nodes[" + node.name + "].extras.sightline." + key;
}

// extras.sightline of a node; null when it has none. The glTF reader has checked that the extras are JSON.
Json sightline_extras(const AssetNode& node) {
  if (node.extras_json.empty()) return nullptr;
  const Json extras = Json::parse(node.extras_json, nullptr, false);
  if (!extras.is_object()) return nullptr;
  const auto found = extras.find("sightline");
  return found != extras.end() && found->is_object() ? *found : Json(nullptr);
}

// A rotation near `m`, by Gram-Schmidt; exact when `m` is a rotation.
glm::dquat rotation_of(const glm::dmat3& m) {
  const glm::dvec3 x = glm::normalize(m[0]);
  const glm::dvec3 y = glm::normalize(m[1] - x * glm::dot(x, m[1]));
  return glm::normalize(glm::quat_cast(glm::dmat3(x, y, glm::cross(x, y))));
}

glm::dmat3 linear_of(const Affine& a) {
  return {a[0], a[1], a[2]};
}

// The product of the rotations from the root down to `node`: the rotation of a binding's instance at rest.
glm::dquat rest_rotation(const SceneAsset& asset, int node) {
  glm::dquat rotation{1, 0, 0, 0};
  for (int at = node; at >= 0; at = asset.nodes[at].parent) rotation = asset.nodes[at].rotation * rotation;
  return glm::normalize(rotation);
}

// The value of "during".
Result<std::vector<TimeSpan>> spans_of(const Json& list, const std::string& field) {
  constexpr const char* kShape = "must be a list of pairs [from, to] in seconds, in the order of time";
  std::vector<TimeSpan> spans;
  if (!list.is_array()) return invalid(field, kShape);
  for (const Json& pair : list) {
    if (!pair.is_array() || pair.size() != 2 || !pair[0].is_number() || !pair[1].is_number())
      return invalid(field, kShape);
    const TimeSpan span{pair[0].get<double>(), pair[1].get<double>()};
    if (!(span.from_s < span.to_s) || (!spans.empty() && span.from_s < spans.back().to_s))
      return invalid(field, kShape);
    spans.push_back(span);
  }
  if (spans.empty()) return invalid(field, "must not be empty");
  return spans;
}

std::vector<Affine> world_at(const SceneAsset& asset, double time_s) {
  if (asset.animations.empty()) return rest_world_from_node(asset);
  return animated_world_from_node(asset, asset.animations.front(), time_s);
}

}  // namespace

bool ScenarioActor::is_target_at(double time_s) const {
  return is_target && weight > 0.0 && (during.empty() || std::ranges::any_of(during, [time_s](const TimeSpan& span) {
                                         return span.from_s <= time_s && time_s < span.to_s;
                                       }));
}

bool has_roles(const SceneAsset& asset) {
  return std::ranges::any_of(asset.nodes,
                             [](const AssetNode& node) { return sightline_extras(node).contains("role"); });
}

Result<Scenario> Scenario::read(const std::string& path, GeometryStore& store) {
  auto asset = read_gltf_file(path, store);
  if (!asset) return tl::unexpected(asset.error());
  return from_asset(std::move(*asset));
}

Result<Scenario> Scenario::from_asset(std::shared_ptr<const SceneAsset> asset) {
  Scenario scenario;
  scenario.asset_ = std::move(asset);
  if (auto taken = scenario.take_roles(); !taken) return tl::unexpected(taken.error());
  if (auto found = scenario.find_target_changes(); !found) return tl::unexpected(found.error());
  scenario.remember_rest();
  return scenario;
}

Status Scenario::take_roles() {
  for (int node = 0; node < static_cast<int>(asset_->nodes.size()); ++node)
    if (auto taken = take_role(node); !taken) return taken;
  if (camera_node_ < 0) return invalid("nodes", "no node has the role \"camera\", so the camera has no start");
  return {};
}

Status Scenario::take_role(int node) {
  const AssetNode& asset_node = asset_->nodes[node];
  const Json extras = sightline_extras(asset_node);
  const auto role = extras.is_null() ? extras.end() : extras.find("role");
  if (extras.is_null() || role == extras.end()) return {};
  if (!role->is_string()) return invalid(field_of(asset_node, "role"), "must be a string");
  const Json weight = extras.value("weight", Json(1.0));
  if (!weight.is_number() || !(weight.get<double>() >= 0.0))
    return invalid(field_of(asset_node, "weight"), "must be a number >= 0");
  const Json required = extras.value("required", Json(true));
  if (!required.is_boolean() && required != 0 && required != 1)
    return invalid(field_of(asset_node, "required"), "must be true or false");
  if (*role == "camera") return take_camera(node);
  ScenarioActor actor;
  actor.weight = weight.get<double>(), actor.required = required == true || required == 1;
  if (const auto during = extras.find("during"); during != extras.end()) {
    auto spans = spans_of(*during, field_of(asset_node, "during"));
    if (!spans) return tl::unexpected(spans.error());
    actor.during = std::move(*spans);
  }
  return take_actor(node, role->get<std::string>(), std::move(actor));
}

Status Scenario::take_actor(int node, const std::string& role, ScenarioActor actor) {
  const AssetNode& asset_node = asset_->nodes[node];
  if (role != "target" && role != "occluder")
    return invalid(field_of(asset_node, "role"), "must be target, occluder or camera, got \"" + role + "\"");
  const auto same_name = std::count_if(asset_->nodes.begin(), asset_->nodes.end(),
                                       [&](const AssetNode& other) { return other.name == asset_node.name; });
  if (asset_node.name.empty() || same_name != 1)
    return invalid(field_of(asset_node, "role"), "a node with a role needs a name that no other node has");
  actor.id = actors_.size() + 1, actor.node = node, actor.name = asset_node.name, actor.is_target = role == "target";
  actors_.push_back(std::move(actor));
  return {};
}

Status Scenario::find_target_changes() {
  std::vector<double> times_s{0.0};
  for (const ScenarioActor& actor : actors_)
    for (const TimeSpan& span : actor.during)
      for (const double time_s : {span.from_s, span.to_s})
        if (time_s > 0.0 && time_s <= duration_s()) times_s.push_back(time_s);
  if (std::ranges::all_of(actors_, [](const ScenarioActor& actor) { return actor.during.empty(); })) return {};
  std::ranges::sort(times_s);
  times_s.erase(std::unique(times_s.begin(), times_s.end()), times_s.end());
  for (const double time_s : times_s)
    if (std::ranges::none_of(actors_, [time_s](const ScenarioActor& actor) { return actor.is_target_at(time_s); }))
      return invalid("nodes", "no node is a target at " + std::to_string(time_s) + " s");
  target_changes_s_.assign(times_s.begin() + 1, times_s.end());
  return {};
}

Status Scenario::take_camera(int node) {
  const AssetNode& asset_node = asset_->nodes[node];
  if (camera_node_ >= 0)
    return invalid(field_of(asset_node, "role"),
                   "the node \"" + asset_->nodes[camera_node_].name + "\" is the camera already");
  camera_node_ = node;
  const Affine world = world_at(*asset_, 0.0)[node];
  camera_ = {world[3], rotation_of(linear_of(world))};
  if (asset_node.camera >= 0) take_lens(asset_->cameras[asset_node.camera]);
  return {};
}

void Scenario::take_lens(const AssetCamera& camera) {
  if (camera.vertical_fov_rad > 0.0) lens_.vertical_fov_rad = camera.vertical_fov_rad;
  if (camera.aspect) lens_.aspect = *camera.aspect;
  if (camera.near_m > 0.0) lens_.near_m = camera.near_m;
}

void Scenario::remember_rest() {
  const std::vector<Affine> rest = rest_world_from_node(*asset_);
  for (const ScenarioActor& actor : actors_) {
    node_from_rest_.push_back(glm::inverse(linear_of(rest[actor.node])));
    rest_rotations_.push_back(rest_rotation(*asset_, actor.node));
  }
}

std::vector<ScenarioActor> Scenario::targets() const {
  std::vector<ScenarioActor> targets;
  std::copy_if(actors_.begin(), actors_.end(), std::back_inserter(targets),
               [](const ScenarioActor& actor) { return actor.is_target; });
  return targets;
}

bool Scenario::targets_change(double after_s, double until_s) const {
  return std::ranges::any_of(target_changes_s_,
                             [=](double change_s) { return after_s < change_s && change_s <= until_s; });
}

double Scenario::duration_s() const {
  return asset_->animations.empty() ? 0.0 : asset_->animations.front().duration_s;
}

// The rotation since rest is taken from the linear parts, so that scale and mirroring of the node cancel.
std::vector<Pose> Scenario::poses_at(double time_s) const {
  const std::vector<Affine> world = world_at(*asset_, time_s);
  std::vector<Pose> poses;
  poses.reserve(actors_.size());
  for (size_t i = 0; i < actors_.size(); ++i) {
    const Affine& now = world[actors_[i].node];
    const glm::dquat turn = rotation_of(linear_of(now) * node_from_rest_[i]);
    poses.push_back({now[3], glm::normalize(turn * rest_rotations_[i])});
  }
  return poses;
}

std::vector<ActorMotion> Scenario::motion_at(double time_s, double step_s) const {
  const std::vector<Pose> now = poses_at(time_s);
  const double from_s = std::clamp(time_s - step_s / 2, 0.0, duration_s());
  const double to_s = std::clamp(time_s + step_s / 2, 0.0, duration_s());
  std::vector<ActorMotion> motion(now.size());
  for (size_t i = 0; i < now.size(); ++i) motion[i].pose = now[i];
  if (!(to_s > from_s)) return motion;
  const std::vector<Pose> before = poses_at(from_s), after = poses_at(to_s);
  for (size_t i = 0; i < now.size(); ++i)
    motion[i].velocity_mps = (after[i].position_m - before[i].position_m) / (to_s - from_s);
  return motion;
}

}  // namespace sightline
