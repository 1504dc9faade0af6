#include "client/check/wandering.h"

#include <algorithm>
#include <limits>
#include <queue>

#include "scenes/scenario_builder.h"
#include "server/base/random.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

constexpr double kSpeedMps = 1.5, kApartM = 1.8;
constexpr double kLeadM = 4.0;  // from the camera to the second person at the start
constexpr double kEyeHeightM = 1.5;
constexpr size_t kFewestPlaces = 50;  // 12 square metres

// Dijkstra; both are in the same connected set.
std::vector<uint32_t> shortest_way(std::span<const StandingPlace> places, uint32_t from, uint32_t to) {
  using Entry = std::pair<double, uint32_t>;
  std::vector<double> length_m(places.size(), std::numeric_limits<double>::infinity());
  std::vector<uint32_t> before(places.size(), from);
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  length_m[from] = 0.0;
  open.push({0.0, from});
  while (!open.empty()) {
    const auto [so_far_m, at] = open.top();
    open.pop();
    if (at == to) break;
    if (so_far_m > length_m[at]) continue;
    for (const uint32_t next : places[at].neighbours) {
      const double through_m = so_far_m + glm::distance(places[at].foot_m, places[next].foot_m);
      if (through_m < length_m[next]) length_m[next] = through_m, before[next] = at, open.push({through_m, next});
    }
  }
  std::vector<uint32_t> way{to};
  while (way.back() != from) way.push_back(before[way.back()]);
  std::ranges::reverse(way);
  return way;
}

// A walk as places, and the way from its start to each, in metres.
struct Walk {
  std::vector<glm::dvec3> feet_m;
  std::vector<double> way_m;

  void add(const glm::dvec3& foot) {
    const double step_m = feet_m.empty() ? 0.0 : glm::distance(foot, feet_m.back());
    if (!feet_m.empty() && step_m == 0.0) return;
    way_m.push_back(feet_m.empty() ? 0.0 : way_m.back() + step_m);
    feet_m.push_back(foot);
  }
  glm::dvec3 at(double way) const {
    const auto after = std::clamp<size_t>(static_cast<size_t>(std::ranges::upper_bound(way_m, way) - way_m.begin()), 1,
                                          way_m.size() - 1);
    const double share = (way - way_m[after - 1]) / (way_m[after] - way_m[after - 1]);
    return glm::mix(feet_m[after - 1], feet_m[after], share);
  }
};

Walk random_walk(std::span<const StandingPlace> places, double length_m, uint64_t seed) {
  CounterRandom random(seed, 0, RandomPurpose::kSceneGeneration);
  const auto any = [&] { return random.next_below(static_cast<uint32_t>(places.size())); };
  Walk walk;
  uint32_t at = any();
  walk.add(places[at].foot_m);
  while (walk.way_m.back() < length_m) {
    const uint32_t goal = any();
    for (const uint32_t place : shortest_way(places, at, goal)) walk.add(places[place].foot_m);
    at = goal;
  }
  return walk;
}

// The keys of somebody who has come `ahead_m` along the walk at the start.
scenes::Motion motion_along(const Walk& walk, double ahead_m) {
  scenes::Polyline corners;
  std::vector<double> times_s;
  for (size_t i = 0; i < walk.feet_m.size(); ++i) {
    corners.emplace_back(walk.feet_m[i].x, walk.feet_m[i].z);
    times_s.push_back((walk.way_m[i] - ahead_m) / kSpeedMps);
  }
  scenes::Motion motion = scenes::walk(scenes::TimedPath(corners, times_s), kWalkS);
  for (size_t i = 0; i < motion.times_s.size(); ++i)
    motion.positions_m[i].y = walk.at(ahead_m + kSpeedMps * motion.times_s[i]).y;
  return motion;
}

// The level's file in memory, with more nodes.
class WanderedAsset {
 public:
  explicit WanderedAsset(const Level& level)
      : store_(*level.store), asset_(std::make_shared<SceneAsset>(*level.asset)) {
    for (AssetNode& node : asset_->nodes) node.extras_json.clear();
    asset_->animations = {AssetAnimation{"wandering", kWalkS, {}}};
    mesh_ = static_cast<int>(asset_->meshes.size());
    MeshData body = *tessellate(CapsuleShape{kPersonRadiusM, 0.5 * kPersonHeightM - kPersonRadiusM});
    for (glm::vec3& p : body.positions) p.y += static_cast<float>(0.5 * kPersonHeightM);
    asset_->meshes.push_back(*store_.intern(std::move(body)));
    asset_->mesh_names.emplace_back("person");
    asset_->mesh_double_sided.push_back(false);
  }

  void add_person(const std::string& name, const scenes::Motion& motion) {
    AssetNode& node = add(name, "target", {motion.positions_m[0], motion.rotations[0]});
    node.mesh = mesh_;
    AssetChannel place, turn;
    place.node = turn.node = static_cast<int>(asset_->nodes.size()) - 1;
    place.path = AssetChannel::Path::kTranslation, turn.path = AssetChannel::Path::kRotation;
    for (size_t i = 0; i < motion.times_s.size(); ++i) {
      const glm::vec3 p(motion.positions_m[i]);
      const glm::quat q(motion.rotations[i]);
      place.times_s.push_back(static_cast<float>(motion.times_s[i]));
      place.values.insert(place.values.end(), {p.x, p.y, p.z});
      turn.values.insert(turn.values.end(), {q.x, q.y, q.z, q.w});
    }
    turn.times_s = place.times_s;
    asset_->animations[0].channels.push_back(std::move(place));
    asset_->animations[0].channels.push_back(std::move(turn));
  }

  void add_camera(const glm::dvec3& eye_m, const glm::dvec3& at_m) {
    add("sightline camera", "camera", {eye_m, look_rotation(glm::normalize(at_m - eye_m), {0, 1, 0}, {1, 0, 0})});
  }

  std::shared_ptr<const SceneAsset> take() { return asset_; }

 private:
  AssetNode& add(const std::string& name, const std::string& role, const Pose& pose) {
    AssetNode& node = asset_->nodes.emplace_back();
    node.name = name;
    node.translation_m = pose.position_m, node.rotation = pose.rotation;
    node.parent_from_node = make_affine(pose.position_m, pose.rotation, node.scale);
    node.extras_json = R"({"sightline":{"role":")" + role + R"("}})";
    return node;
  }

  GeometryStore& store_;
  std::shared_ptr<SceneAsset> asset_;
  int mesh_ = -1;
};

}  // namespace

Result<Scenario> wandering_in(const Level& level, std::span<const StandingPlace> places, uint64_t seed) {
  if (places.size() < kFewestPlaces)
    return fail(ErrorCode::kFailedPrecondition, "level", "has no floor with room for people to walk on");
  const Walk walk = random_walk(places, kLeadM + kApartM + kSpeedMps * (kWalkS + 1.0), seed);
  WanderedAsset asset(level);
  asset.add_person("sightline walker ahead", motion_along(walk, kLeadM + kApartM));
  asset.add_person("sightline walker behind", motion_along(walk, kLeadM));
  const glm::dvec3 eye(0, kEyeHeightM, 0);
  asset.add_camera(walk.at(0.0) + eye, walk.at(kLeadM) + 0.5 * eye);
  return Scenario::from_asset(asset.take());
}

}  // namespace sightline
