#include "scenes/subjects.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kColumnRadius_m = 0.4, kColumnHeight_m = 4.5;
constexpr int kPeople = 6;
constexpr double kStroll_m = 1.0, kStroll_mps = 1.0;  // of each person about its place
constexpr double kGrid_m = 8.0, kRun_mps = 5.0;
constexpr int kHalfGrid = 4;  // crossings from the middle of the runner's ground
constexpr double kFromCamera_m = 5.0, kEye_m = 2.0, kLook_m = 1.0;
constexpr double kTalk_m = 1.6, kCeiling_m = 2.8, kHalfRoom_m = 4.5;
constexpr double kHeadRadius_m = 0.125, kHead_m = 1.5, kNeck_m = 1.5;  // from where the head begins up; of the body
constexpr double kShoulderRadius_m = 0.22;
constexpr double kLastingLong_s = 1000.0;  // beyond the end of any scene

glm::dvec3 on_floor(const glm::dvec2& p, double y_m = 0.0) {
  return {p.x, y_m, p.y};
}

void add_ground(ScenarioBuilder& scene, double size_m) {
  scene.add_static("ground", scene.add_mesh("ground", standing_box(snap(size_m), 0.25, snap(size_m)), colors::kFloor),
                   {0, -0.25, 0});
}

// Round columns at places that keep `room_m` from everything that is kept free.
void add_columns(ScenarioBuilder& scene, int count, double reach_m, double room_m,
                 const std::vector<glm::dvec2>& kept_free_m, CounterRandom& random) {
  MeshData mesh;
  append_frustum(mesh, {0, 0, 0}, kColumnRadius_m, kColumnRadius_m, kColumnHeight_m, 20);
  const int column = scene.add_mesh("column", mesh, colors::kStone);
  std::vector<glm::dvec2> taken = kept_free_m;
  for (int attempt = 0, made = 0; attempt < 40 * count && made < count; ++attempt) {
    const glm::dvec2 p{snapped_in(random, -reach_m, reach_m), snapped_in(random, -reach_m, reach_m)};
    if (!std::all_of(taken.begin(), taken.end(), [&](const glm::dvec2& at) { return length(at - p) >= room_m; }))
      continue;
    taken.push_back(p);
    scene.add_static(numbered("column", ++made), column, on_floor(p));
  }
}

// From place to place within `reach_m` of `home_m`.
TimedPath stroll(const glm::dvec2& home_m, double reach_m, double speed_mps, double duration_s, CounterRandom& random) {
  Polyline line{home_m};
  std::vector<double> times_s{0};
  while (times_s.back() < duration_s + 2) {
    const glm::dvec2 next = home_m +
                            glm::dvec2(snapped_in(random, -reach_m, reach_m), snapped_in(random, -reach_m, reach_m));
    const double way_m = length(next - line.back());
    if (way_m < reach_m / 2) continue;
    line.push_back(next);
    times_s.push_back(times_s.back() + way_m / speed_mps);
  }
  return {line, times_s};
}

void keep_free(const Motion& motion, std::vector<glm::dvec2>& kept_free_m) {
  for (size_t i = 0; i < motion.positions_m.size(); i += 15)
    kept_free_m.emplace_back(motion.positions_m[i].x, motion.positions_m[i].z);
}

// When each person of the cycle is the subject.
std::array<TargetTimes, kPeople> turns_of(const CycleOptions& options, CounterRandom& random) {
  std::array<TargetTimes, kPeople> turns;
  int subject = 0;
  for (double from_s = 0; from_s < options.duration_s; from_s += options.each_s) {
    const bool last = from_s + options.each_s >= options.duration_s;
    turns[static_cast<size_t>(subject)].emplace_back(from_s, last ? kLastingLong_s : from_s + options.each_s);
    subject = (subject + (random.next_below(2) == 0 ? 1 : kPeople - 1)) % kPeople;
  }
  return turns;
}

// The runner's crossings, each one grid step from the one before, never twice straight on.
Polyline crossings(size_t count, CounterRandom& random) {
  Polyline line{{0, 0}, {0, -kGrid_m}};
  glm::dvec2 way{0, -kGrid_m};
  while (line.size() < count) {
    const uint32_t turn = random.next_below(3);
    const glm::dvec2 next = turn == 0 ? -way : turn == 1 ? glm::dvec2(way.y, -way.x) : glm::dvec2(-way.y, way.x);
    const glm::dvec2 to = line.back() + next;
    if (std::max(std::abs(to.x), std::abs(to.y)) > kHalfGrid * kGrid_m) continue;
    line.push_back(to);
    way = next;
  }
  return line;
}

// A person in two parts that move as one: the body with its shoulders, and the head.
struct Person {
  Motion body, head;
};
Person person(const TimedPath& path, const TimedPath& faces, double duration_s) {
  Person person;
  const auto last = static_cast<int>(duration_s * kKeysPerSecond + 0.5);
  for (int i = 0; i <= last; ++i) {
    const double time_s = i / kKeysPerSecond;
    const glm::dvec2 p = path.position_m(time_s), way = faces.position_m(time_s) - p;
    const glm::dquat rotation = facing(way / length(way));
    person.body.add(time_s, on_floor(p), rotation);
    person.head.add(time_s, on_floor(p, kHead_m), rotation);
  }
  return person;
}

void add_room(ScenarioBuilder& scene) {
  MeshData walls;
  const double h = kHalfRoom_m, w = 0.25;
  append_box(walls, {-h - w, 0, -h - w}, {-h, kCeiling_m, h + w});
  append_box(walls, {h, 0, -h - w}, {h + w, kCeiling_m, h + w});
  append_box(walls, {-h, 0, -h - w}, {h, kCeiling_m, -h});
  append_box(walls, {-h, 0, h}, {h, kCeiling_m, h + w});
  const int slab = scene.add_mesh("slab", standing_box(2 * (h + w), w, 2 * (h + w)), colors::kFloor);
  scene.add_static("walls", scene.add_mesh("walls", walls, colors::kWall), {0, 0, 0});
  scene.add_static("floor", slab, {0, -w, 0});
  scene.add_static("ceiling", slab, {0, kCeiling_m, 0});
}

}  // namespace

std::vector<std::byte> make_cycle(const CycleOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration),
      column_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  ScenarioBuilder scene(options.duration_s);
  const std::array<TargetTimes, kPeople> turns = turns_of(options, random);
  std::vector<glm::dvec2> kept_free_m;
  glm::dvec2 first_m{0, 0};
  MeshData body;
  append_capsule(body, {0, 0, 0}, kBodyRadius_m, kBodyHeight_m, 16, 4);
  const int body_mesh = scene.add_mesh("body", body, colors::kBody);
  for (int k = 0; k < kPeople; ++k) {
    const glm::dvec2 home = circle_point(k / static_cast<double>(kPeople)) * options.apart_m;
    const Motion motion = walk(stroll(home, kStroll_m, kStroll_mps, options.duration_s, random), options.duration_s);
    if (k == 0) first_m = {motion.positions_m[0].x, motion.positions_m[0].z};
    keep_free(motion, kept_free_m);
    // Whoever never has a turn is no target at all.
    const TargetTimes& own = turns[static_cast<size_t>(k)];
    if (own.empty())
      scene.add_occluder(numbered("person", k + 1), body_mesh, motion, {});
    else
      scene.add_target(numbered("person", k + 1), body_mesh, motion, 1.0, own);
  }
  for (int k = 0; k <= 5; ++k) kept_free_m.push_back(first_m + glm::dvec2(0, k));
  const double reach_m = options.apart_m + 8;
  add_columns(scene, static_cast<int>(options.apart_m) + 4, reach_m, 1.5, kept_free_m, column_random);
  add_ground(scene, 2 * reach_m + 20);
  scene.add_camera(on_floor(first_m + glm::dvec2(0, kFromCamera_m), kEye_m), on_floor(first_m, kLook_m));
  return scene.write();
}

std::vector<std::byte> make_runner(const RunnerOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  const auto legs = static_cast<size_t>(options.duration_s * kRun_mps / kGrid_m) + 3;
  const Polyline line = crossings(legs, random);
  std::vector<double> times_s;
  for (size_t k = 0; k < line.size(); ++k) times_s.push_back(static_cast<double>(k) * kGrid_m / kRun_mps);
  ScenarioBuilder scene(options.duration_s);
  add_ground(scene, 2 * (kHalfGrid + 2) * kGrid_m);
  MeshData mesh;
  append_frustum(mesh, {0, 0, 0}, kColumnRadius_m, kColumnRadius_m, kColumnHeight_m, 20);
  const int column = scene.add_mesh("column", mesh, colors::kStone);
  int count = 0;
  for (int x = -kHalfGrid - 1; x <= kHalfGrid; ++x)
    for (int z = -kHalfGrid - 1; z <= kHalfGrid; ++z)
      scene.add_static(numbered("column", ++count), column, {(x + 0.5) * kGrid_m, 0, (z + 0.5) * kGrid_m});
  scene.add_character("runner", walk(TimedPath(line, times_s), options.duration_s));
  scene.add_camera({0, kEye_m, kFromCamera_m}, {0, kLook_m, 0});
  return scene.write();
}

std::vector<std::byte> make_conversation(const ConversationOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  ScenarioBuilder scene(options.duration_s);
  add_room(scene);
  constexpr double kSteps_m = 0.25, kSteps_mps = 0.25;
  const TimedPath listener = stroll({0, kTalk_m / 2}, kSteps_m, kSteps_mps, options.duration_s, random),
                  speaker = stroll({0, -kTalk_m / 2}, kSteps_m, kSteps_mps, options.duration_s, random);
  MeshData body, head;
  append_capsule(body, {0, 0, 0}, kShoulderRadius_m, kNeck_m, 16, 4);
  append_capsule(head, {0, 0, 0}, kHeadRadius_m, 2 * kHeadRadius_m, 16, 6);
  const int body_mesh = scene.add_mesh("body", body, colors::kCar),
            head_mesh = scene.add_mesh("head", head, colors::kBody);
  const Person near = person(listener, speaker, options.duration_s),
               far = person(speaker, listener, options.duration_s);
  InstanceAttributes attributes;
  attributes.collides = false;
  scene.add_occluder("listener", body_mesh, near.body, attributes);
  scene.add_occluder("listener-head", head_mesh, near.head, attributes);
  scene.add_occluder("speaker", body_mesh, far.body, attributes);
  scene.add_target("speaker-head", head_mesh, far.head);
  for (int k = 0; k < 2; ++k) {
    const double side = k == 0 ? -1 : 1;
    scene.add_occluder(numbered("passer-by", k + 1), body_mesh,
                       walk(stroll({side * 2.75, 0}, 1.25, 1.2, options.duration_s, random), options.duration_s),
                       attributes);
  }
  scene.add_camera({0.55, 1.75, kTalk_m / 2 + 0.9}, {0, kHead_m + kHeadRadius_m, -kTalk_m / 2});
  return scene.write();
}

std::vector<std::byte> make_apart(const ApartOptions& options) {
  CounterRandom random(options.seed, 0, RandomPurpose::kSceneGeneration);
  ScenarioBuilder scene(options.duration_s);
  constexpr double kPerGap[] = {0.5, 0.5773502691896258};  // radius of the ring, by gap
  const double radius_m = options.apart_m * kPerGap[options.people - 2];
  std::vector<glm::dvec2> kept_free_m{{0, 0}, {0, 4}};
  const double turn = random.next_in(-0.05, 0.05);
  for (int k = 0; k < options.people; ++k) {
    const glm::dvec2 way = circle_point(turn + k / static_cast<double>(options.people)), p = way * radius_m;
    Motion motion;
    for (const double time_s : {0.0, options.duration_s}) motion.add(time_s, on_floor(p), facing(-way));
    kept_free_m.push_back(p);
    scene.add_character(numbered("target", k + 1), motion);
  }
  add_columns(scene, 6, options.apart_m, 2.5, kept_free_m, random);
  add_ground(scene, 4 * options.apart_m + 20);
  scene.add_camera({0, kEye_m, 4}, {0, kLook_m, 0});
  return scene.write();
}

}  // namespace sightline::scenes
