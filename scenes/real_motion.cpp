#include "scenes/real_motion.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "scenes/exact.h"
#include "scenes/motion_tracks.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kCornerDuration_s = 14.0, kBeforeCorner_s = 4.0;  // before the first of the targets was recorded
constexpr double kHalfCorridor_m = 1.5, kCorridorLength_m = 40.0, kCeiling_m = 2.8, kWall_m = 0.25;
constexpr double kWalkerRadius_m = 0.22, kAboveHead_m = 0.1;
constexpr double kNear_m = 10.0;  // others are in the scene if they come so near to the first target
constexpr size_t kFirstChoices = 7, kChoiceStep = 13, kChoices = 110;
constexpr double kCornerCameraBehind_m = 3.5, kCornerEye_m = 2.1;
constexpr double kAttackDuration_s = 9.7, kBallRadius_m = 0.11;
constexpr double kAttackCamera_m = 25.0, kAttackRise = 0.2588190451025207, kAttackAway = 0.9659258262890683;  // 15 deg
constexpr double kLastingLong_s = 1000.0;

// Keys 60 times a second; the body faces where it goes over half a second.
Motion motion_of(const Track& track, double from_s, double duration_s, bool with_height) {
  Motion motion;
  glm::dvec2 heading{0, 1};
  const auto last = static_cast<int>(duration_s * kKeysPerSecond + 0.5);
  for (int i = 0; i <= last; ++i) {
    const double time_s = i / kKeysPerSecond;
    const glm::dvec3 p = track.position_m(from_s + time_s), before = track.position_m(from_s + time_s - 0.25),
                     after = track.position_m(from_s + time_s + 0.25);
    const glm::dvec2 way{after.x - before.x, after.z - before.z};
    if (length(way) > 0.05) heading = way / length(way);
    motion.add(time_s, {p.x, with_height ? p.y : 0.0, p.z}, facing(heading));
  }
  return motion;
}

std::vector<Track> by_entry(std::vector<Track> tracks) {
  std::stable_sort(tracks.begin(), tracks.end(), [](const Track& a, const Track& b) { return a.first_s < b.first_s; });
  return tracks;
}

double nearest_m(const Track& a, const Track& b, double from_s, double duration_s) {
  double nearest = INFINITY;
  for (double time_s = from_s; time_s <= from_s + duration_s; time_s += 0.25) {
    const glm::dvec3 p = a.position_m(time_s), q = b.position_m(time_s);
    nearest = std::min(nearest, length(glm::dvec2(p.x - q.x, p.z - q.z)));
  }
  return nearest;
}

void add_corridor(ScenarioBuilder& scene, bool roofed) {
  MeshData walls;
  const double h = kHalfCorridor_m, w = kWall_m, far = kCorridorLength_m;
  append_box(walls, {-far, 0, -h - w}, {h + w, kCeiling_m, -h});
  append_box(walls, {h, 0, -h}, {h + w, kCeiling_m, far});
  append_box(walls, {-far, 0, h}, {-h, kCeiling_m, h + w});
  append_box(walls, {-h - w, 0, h + w}, {-h, kCeiling_m, far});
  scene.add_static("walls", scene.add_mesh("walls", walls, colors::kWall), {0, 0, 0});
  MeshData slab;
  append_box(slab, {-far, 0, -h - w}, {h + w, w, h + w});
  append_box(slab, {-h - w, 0, h + w}, {h + w, w, far});
  const int mesh = scene.add_mesh("slab", slab, colors::kFloor);
  scene.add_static("floor", mesh, {0, -w, 0});
  if (roofed) scene.add_static("ceiling", mesh, {0, kCeiling_m, 0});
}

// One mesh for people of about the same height.
class Bodies {
 public:
  explicit Bodies(ScenarioBuilder& scene) : scene_(scene) {}
  int of_height(double head_m, const glm::vec3& color, const char* name) {
    const int centimetres = static_cast<int>(std::floor((head_m + kAboveHead_m) * 20 + 0.5)) * 5;
    const auto [at, added] = meshes_.try_emplace({name, centimetres}, -1);
    if (!added) return at->second;
    MeshData body;
    append_capsule(body, {0, 0, 0}, kWalkerRadius_m, centimetres / 100.0, 12, 3);
    return at->second = scene_.add_mesh(numbered(name, centimetres), body, color);
  }

 private:
  ScenarioBuilder& scene_;
  std::map<std::pair<std::string, int>, int> meshes_;
};

// The ids of the ball and of the two players nearest to it.
std::vector<int> subjects_at(const std::vector<Track>& tracks, double time_s) {
  const glm::dvec3 ball = tracks.front().position_m(time_s);
  std::vector<std::pair<double, int>> players;
  for (size_t k = 1; k < tracks.size(); ++k) {
    const glm::dvec3 p = tracks[k].position_m(time_s);
    players.emplace_back(length(glm::dvec2(p.x - ball.x, p.z - ball.z)), tracks[k].id);
  }
  std::sort(players.begin(), players.end());
  return {tracks.front().id, players.at(0).second, players.at(1).second};
}

// When each is a subject; neighbouring seconds make one span.
std::map<int, TargetTimes> subjects_by_second(const std::vector<Track>& tracks) {
  std::map<int, TargetTimes> times;
  for (double from_s = 0; from_s < kAttackDuration_s; from_s += 1) {
    const double to_s = from_s + 1 > kAttackDuration_s ? kLastingLong_s : from_s + 1;
    for (const int id : subjects_at(tracks, tracks.front().first_s + from_s)) {
      TargetTimes& own = times[id];
      if (!own.empty() && own.back().second == from_s)
        own.back().second = to_s;
      else
        own.emplace_back(from_s, to_s);
    }
  }
  return times;
}

void add_pitch(ScenarioBuilder& scene) {
  scene.add_static("grass", scene.add_mesh("grass", standing_box(140, 0.25, 150), colors::kLeaf), {0, -0.25, 0});
  MeshData goal;
  for (const double z : {-3.66, 3.66}) append_box(goal, {-0.0625, 0, z - 0.0625}, {0.0625, 2.5, z + 0.0625});
  append_box(goal, {-0.0625, 2.4375, -3.6875}, {0.0625, 2.5625, 3.6875});
  const int mesh = scene.add_mesh("goal", goal, colors::kWall);
  scene.add_static("goal-1", mesh, {-52.5, 0, 0});
  scene.add_static("goal-2", mesh, {52.5, 0, 0});
}

}  // namespace

Result<std::vector<std::byte>> make_real_corner(const RealMotionOptions& options, bool roofed) {
  auto read = read_corner(motion_folder(options.folder));
  if (!read) return tl::unexpected(read.error());
  const std::vector<Track> tracks = by_entry(std::move(*read));
  const size_t people = options.seed % 2 == 0 ? 3 : 2, first = kFirstChoices + options.seed * kChoiceStep % kChoices;
  if (first + people > tracks.size()) return invalid("motion", "corner_traj.txt has too few people");
  const double from_s = tracks[first].first_s - kBeforeCorner_s;
  ScenarioBuilder scene(kCornerDuration_s);
  add_corridor(scene, roofed);
  Bodies bodies(scene);
  InstanceAttributes attributes;
  attributes.collides = false;
  double hindmost_m = INFINITY;
  glm::dvec3 middle_m{0.0};
  for (size_t k = 0; k < tracks.size(); ++k) {
    const bool is_target = k >= first && k < first + people;
    if (!is_target && nearest_m(tracks[k], tracks[first], from_s, kCornerDuration_s) > kNear_m) continue;
    const double head_m = tracks[k].positions_m.front().y;
    const Motion motion = motion_of(tracks[k], from_s, kCornerDuration_s, false);
    if (!is_target) {
      scene.add_occluder(numbered("walker", tracks[k].id), bodies.of_height(head_m, colors::kCar, "walker"), motion,
                         attributes);
      continue;
    }
    scene.add_target(numbered("target", tracks[k].id), bodies.of_height(head_m, colors::kBody, "target"), motion);
    hindmost_m = std::min(hindmost_m, motion.positions_m[0].x);
    middle_m += motion.positions_m[0] / static_cast<double>(people);
  }
  scene.add_camera({hindmost_m - kCornerCameraBehind_m, kCornerEye_m, 0}, {middle_m.x, 1, middle_m.z});
  return scene.write();
}

Result<std::vector<std::byte>> make_real_attack(const RealMotionOptions& options) {
  const auto tracks = read_attack(motion_folder(options.folder));
  if (!tracks) return tl::unexpected(tracks.error());
  if (tracks->size() < 3) return invalid("motion", "football_goal.csv has too few players");
  const double from_s = tracks->front().first_s;
  std::map<int, TargetTimes> subjects = subjects_by_second(*tracks);
  ScenarioBuilder scene(kAttackDuration_s);
  add_pitch(scene);
  Bodies bodies(scene);
  MeshData ball;
  append_capsule(ball, {0, 0, 0}, kBallRadius_m, 2 * kBallRadius_m, 12, 4);
  const int ball_mesh = scene.add_mesh("ball", ball, colors::kWall);
  InstanceAttributes attributes;
  attributes.collides = false;
  for (const Track& track : *tracks) {
    const bool is_ball = &track == &tracks->front();
    const Motion motion = motion_of(track, from_s, kAttackDuration_s, is_ball);
    const std::string name = is_ball ? "ball" : numbered("player", track.id);
    const bool is_subject = subjects.contains(track.id);
    const int mesh = is_ball ? ball_mesh
                             : bodies.of_height(kBodyHeight_m - kAboveHead_m, is_subject ? colors::kBody : colors::kCar,
                                                is_subject ? "subject" : "other");
    if (is_subject)
      scene.add_target(name, mesh, motion, 1.0, subjects[track.id]);
    else
      scene.add_occluder(name, mesh, motion, attributes);
  }
  const glm::dvec3 at_m = tracks->front().position_m(from_s);
  const double side = options.seed % 2 == 0 ? -1 : 1;
  scene.add_camera(at_m + glm::dvec3(0, kAttackCamera_m * kAttackRise, side * kAttackCamera_m * kAttackAway), at_m,
                   {20, 15});
  return scene.write();
}

}  // namespace sightline::scenes
