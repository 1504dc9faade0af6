#include "client/bench/world.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/constants.hpp>

#include "client/scenario/scenario_session.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

constexpr double kPathStepS = 1.0 / 30;
constexpr double kSlowest = 0.8, kFastest = 1.2;  // pace of the sessions; 1 is the pace of the scene

// A further target.
constexpr double kCapsuleRadiusM = 0.3, kCapsuleHalfHeightM = 0.6;
constexpr double kApartM = 0.9;

// Boxes of the size of people and crates. They have few shapes, so that sessions share them.
constexpr std::array<glm::dvec3, 3> kHalfExtentsM{{{0.3, 0.9, 0.2}, {0.5, 0.5, 0.5}, {0.8, 1.1, 0.3}}};
constexpr double kNearestToPathM = 2.0, kFarthestFromPathM = 25.0;
constexpr double kLeastCircleM = 1.0, kMostCircleM = 4.0;
constexpr double kLeastSpeedMps = 0.8, kMostSpeedMps = 2.0;
constexpr double kFreeRoundCameraM = 2.0;
constexpr int kMostTries = 16;
constexpr double kTurnRad = 2 * glm::pi<double>();

// Interpolates between the steps of a path; after the last step its pose stays.
Pose pose_on(const std::vector<Pose>& path, double time_s) {
  const double at = time_s / kPathStepS;
  const auto before = std::min(static_cast<size_t>(at), path.size() - 1);
  const auto after = std::min(before + 1, path.size() - 1);
  const double share = at - std::floor(at);
  return {glm::mix(path[before].position_m, path[after].position_m, share),
          glm::slerp(path[before].rotation, path[after].rotation, share)};
}

glm::dvec3 on_circle(double radius_m, double angle_rad) {
  return {radius_m * std::cos(angle_rad), 0.0, radius_m * std::sin(angle_rad)};
}

void add_transform(uint64_t id, const Pose& pose, const glm::dvec3& velocity_mps, v1::Transforms& transforms) {
  transforms.add_ids(id);
  for (int axis = 0; axis < 3; ++axis) {
    transforms.add_positions(pose.position_m[axis]);
    transforms.add_velocities(static_cast<float>(velocity_mps[axis]));
  }
  for (const double part : {pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w})
    transforms.add_rotations(static_cast<float>(part));
}

}  // namespace

Result<BenchWorld> BenchWorld::make(std::span<const std::byte> scene, const BenchWorldOptions& options) {
  GeometryStore store;
  const auto asset = read_gltf(scene, nullptr, store);
  if (!asset) return tl::unexpected(asset.error());
  auto scenario = Scenario::from_asset(*asset);
  if (!scenario) return tl::unexpected(scenario.error());
  if (scenario->targets().empty())
    return invalid("scene", "no node has the role \"target\", so no path is known for targets");
  if (!scenario->target_changes_s().empty())
    return invalid("scene", "the targets change in the course of the scene; the load needs the same all the time");
  return BenchWorld(std::move(*scenario), options);
}

BenchWorld::BenchWorld(Scenario scenario, const BenchWorldOptions& options)
    : options_(options), scenario_(std::move(scenario)) {
  options_.instances = std::max(options_.instances, options_.moving);
  take_walkers();
  place_boxes();
}

void BenchWorld::take_walkers() {
  const std::vector<ScenarioActor>& actors = scenario_.actors();
  std::vector<Walker> own;
  for (const ScenarioActor& actor : actors)
    if (actor.is_target) own.push_back({.id = actor.id, .path = {}});
  const auto steps = static_cast<size_t>(scenario_.duration_s() / kPathStepS) + 1;
  for (size_t step = 0; step < steps; ++step) {
    const std::vector<Pose> poses = scenario_.poses_at(static_cast<double>(step) * kPathStepS);
    for (Walker& walker : own) walker.path.push_back(poses[walker.id - 1]);
  }
  for (size_t i = 0; i < options_.targets; ++i) {
    walkers_.push_back(own[i % own.size()]);
    if (i < own.size()) continue;
    walkers_.back().id = actors.size() + 1 + i;
    // Spread like the seeds of a sunflower: all are about equally far from their neighbours.
    const double rank = static_cast<double>(i - own.size() + 1);
    walkers_.back().beside_m = on_circle(kApartM * std::sqrt(rank), rank * glm::golden_ratio<double>() * kTurnRad);
    walkers_.back().beside_m.y = kCapsuleRadiusM + kCapsuleHalfHeightM;
  }
}

void BenchWorld::place_boxes() {
  const uint64_t first_id = scenario_.actors().size() + 1 + options_.targets;
  boxes_.resize(options_.sessions);
  for (size_t session = 0; session < options_.sessions; ++session) {
    CounterRandom random(options_.seed, session, RandomPurpose::kSceneGeneration);
    for (size_t i = 0; i < options_.instances; ++i)
      boxes_[session].push_back(make_box(first_id + i, i < options_.moving, random));
  }
}

BenchWorld::Box BenchWorld::make_box(uint64_t id, bool moves, CounterRandom& random) const {
  const std::vector<Pose>& path = walkers_.front().path;
  Box box{.id = id, .half_extent_m = kHalfExtentsM[random.next_below(kHalfExtentsM.size())]};
  if (moves) {
    box.radius_m = random.next_in(kLeastCircleM, kMostCircleM);
    box.phase_rad = random.next_in(0.0, kTurnRad);
    box.speed_radps = random.next_in(kLeastSpeedMps, kMostSpeedMps) / box.radius_m;
  }
  const double free_m = box.radius_m + glm::length(box.half_extent_m) + kFreeRoundCameraM;
  for (int attempt = 0; attempt < kMostTries; ++attempt) {
    const Pose& pose = path[random.next_below(static_cast<uint32_t>(path.size()))];
    const double away_m = random.next_in(kNearestToPathM, kFarthestFromPathM);
    box.centre_m = pose.position_m + on_circle(away_m, random.next_in(0.0, kTurnRad));
    box.centre_m.y += box.half_extent_m.y;
    if (glm::distance(box.centre_m, scenario_.camera().position_m) > free_m) break;
  }
  return box;
}

v1::OpenSession BenchWorld::open(size_t session, const std::string& scene_hash) const {
  v1::OpenSession open = open_request(scenario_, scene_hash, options_.seed + session);
  open.set_label("sightline bench");
  const int own = open.targets_size();
  const int wanted = static_cast<int>(walkers_.size());
  if (wanted < own) open.mutable_targets()->DeleteSubrange(wanted, own - wanted);
  for (int i = own; i < wanted; ++i) {
    const Walker& walker = walkers_[static_cast<size_t>(i)];
    v1::NewInstance* instance = open.add_instances();
    instance->set_id(walker.id);
    instance->mutable_shape()->mutable_capsule()->set_radius(kCapsuleRadiusM);
    instance->mutable_shape()->mutable_capsule()->set_half_height(kCapsuleHalfHeightM);
    set_pose({walker.path.front().position_m + walker.beside_m, {1, 0, 0, 0}}, instance->mutable_pose());
    open.add_targets()->set_id(walker.id);
  }
  for (const Box& box : boxes_[session]) {
    v1::NewInstance* instance = open.add_instances();
    instance->set_id(box.id);
    v1::Vec3& half_extent = *instance->mutable_shape()->mutable_box()->mutable_half_extent();
    half_extent.set_x(box.half_extent_m.x);
    half_extent.set_y(box.half_extent_m.y);
    half_extent.set_z(box.half_extent_m.z);
    set_pose({box.centre_m + on_circle(box.radius_m, box.phase_rad), {1, 0, 0, 0}}, instance->mutable_pose());
  }
  return open;
}

double BenchWorld::path_time_s(size_t session, uint64_t sequence) const {
  const double duration_s = kPathStepS * static_cast<double>(walkers_.front().path.size() - 1);
  if (duration_s <= 0.0) return 0.0;
  const double rank = options_.sessions < 2 ? 0.5
                                            : static_cast<double>(session) / static_cast<double>(options_.sessions - 1);
  const double pace = kSlowest + rank * (kFastest - kSlowest);
  const double walked_s = std::fmod(pace * static_cast<double>(sequence - 1) / options_.rate_hz, 2 * duration_s);
  return std::min(walked_s, 2 * duration_s - walked_s);
}

void BenchWorld::fill_tick(size_t session, uint64_t sequence, v1::Tick& tick) const {
  const double dt_s = 1.0 / options_.rate_hz;
  const double time_s = dt_s * static_cast<double>(sequence - 1);
  tick.set_sequence(sequence);
  tick.set_time_s(time_s);
  v1::Transforms& transforms = *tick.mutable_transforms();
  transforms.Clear();
  const double now_s = path_time_s(session, sequence);
  const double before_s = path_time_s(session, std::max<uint64_t>(sequence, 2) - 1);
  for (const Walker& walker : walkers_) {
    Pose pose = pose_on(walker.path, now_s);
    const glm::dvec3 velocity_mps = (pose.position_m - pose_on(walker.path, before_s).position_m) / dt_s;
    pose.position_m += walker.beside_m;
    add_transform(walker.id, pose, velocity_mps, transforms);
  }
  for (const Box& box : std::span(boxes_[session]).first(options_.moving)) {
    const glm::dvec3 from_centre_m = on_circle(box.radius_m, box.phase_rad + box.speed_radps * time_s);
    const glm::dvec3 velocity_mps = box.speed_radps * glm::dvec3(-from_centre_m.z, 0.0, from_centre_m.x);
    add_transform(box.id, {box.centre_m + from_centre_m, {1, 0, 0, 0}}, velocity_mps, transforms);
  }
}

}  // namespace sightline
