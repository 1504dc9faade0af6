#include "scenes/hall.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// Seen from above: +x along the hall, lanes -1, 0, 1 across it, bays between the columns.
//
//   z = -7.5 ------------------------------  wall
//                     lane -1
//   z = -2.5   o     o     o     o     o     row 0
//                     lane 0   bay 2
//   z = +2.5   o     o     o     o     o     row 1
//                     lane 1
//   z = +7.5 ------------------------------  wall
//              x = 4     8     12            boundary 1, 2, 3
constexpr double kBay_m = 4.0;
constexpr double kLane_m = 5.0;
constexpr double kColumnRadius_m = 0.7;
constexpr double kWallThickness_m = 0.3;
constexpr int kFirstBay = 2;
constexpr double kHalfGap_m = 0.45;  // between each target and the middle of the pair
constexpr double kSlowest_mps =
    2.0;  // of the middle of the pair; the inner of two turns alike walks 22 % slower
constexpr double kFastest_mps = 2.35;
constexpr double kCurtainWidth_m = 3.5;
constexpr double kCurtainHeight_m = 3.0;
constexpr double kComing_s = 0.25;
constexpr double kLeaving_s = 0.4;

double bay_x(int bay) {
  return (bay + 0.5) * kBay_m;
}
double lane_z(int lane) {
  return lane * kLane_m;
}
double row_z(int row) {
  return (row - 0.5) * kLane_m;
}

// The way of the pair, and which openings it needs.
struct Way {
  Polyline middle;
  std::vector<double> times_s;
  std::set<std::pair<int, int>> boundaries;  // (lane, boundary) passed along the hall
  std::set<std::pair<int, int>> openings;    // (row, bay) passed across it
  int bays = 0;
};

class WayMaker {
 public:
  explicit WayMaker(CounterRandom& random) : random_(random) {
    way_.middle = {{bay_x(kFirstBay), 0.0}};
    way_.times_s = {0.0};
    for (int boundary = 1; boundary <= kFirstBay; ++boundary)
      way_.boundaries.insert({0, boundary});  // the camera's
  }

  Way make(double duration_s) {
    while (way_.times_s.back() < duration_s + 1) {
      advance(1 + static_cast<int>(random_.next_below(2)));
      change_lane();
    }
    advance(1);
    way_.bays = bay_ + 2;
    return std::move(way_);
  }

 private:
  void advance(int bays) {
    for (int i = 0; i < bays; ++i) way_.boundaries.insert({lane_, ++bay_});
    walk_to({bay_x(bay_), lane_z(lane_)});
  }

  // From the middle to either side; from a side to the middle or, one time in three, right across.
  void change_lane() {
    const int to =
        lane_ == 0 ? (random_.next_below(2) == 0 ? -1 : 1) : (random_.next_below(3) == 0 ? -lane_ : 0);
    if (std::min(lane_, to) < 0) way_.openings.insert({0, bay_});
    if (std::max(lane_, to) > 0) way_.openings.insert({1, bay_});
    lane_ = to;
    walk_to({bay_x(bay_), lane_z(lane_)});
  }

  void walk_to(const glm::dvec2& corner) {
    const double speed = random_.next_in(kSlowest_mps, kFastest_mps);
    way_.times_s.push_back(way_.times_s.back() + length(corner - way_.middle.back()) / speed);
    way_.middle.push_back(corner);
  }

  CounterRandom& random_;
  Way way_;
  int bay_ = kFirstBay;
  int lane_ = 0;
};

MeshData column_mesh(double height_m) {
  MeshData mesh;
  append_box(mesh, {-0.8, 0, -0.8}, {0.8, 0.3125, 0.8});
  append_frustum(mesh, {0, 0.3125, 0}, kColumnRadius_m, kColumnRadius_m - 0.0625, height_m - 0.6875, 24);
  append_box(mesh, {-0.8, height_m - 0.375, -0.8}, {0.8, height_m, 0.8});
  return mesh;
}

void add_shell(ScenarioBuilder& scene, double hall_length_m, double ceiling_m) {
  const double half_width = 1.5 * kLane_m, middle = hall_length_m / 2;
  const int slab = scene.add_mesh("slab", standing_box(hall_length_m, 0.25, 2 * half_width), colors::kFloor);
  scene.add_static("floor", slab, {middle, -0.25, 0});
  scene.add_static("ceiling", slab, {middle, ceiling_m, 0});
  const int side =
      scene.add_mesh("side", standing_box(hall_length_m, ceiling_m, kWallThickness_m), colors::kWall);
  const int end =
      scene.add_mesh("end", standing_box(kWallThickness_m, ceiling_m, 2 * half_width), colors::kWall);
  scene.add_static("wall-north", side, {middle, 0, -half_width - kWallThickness_m / 2});
  scene.add_static("wall-south", side, {middle, 0, half_width + kWallThickness_m / 2});
  scene.add_static("wall-west", end, {-kWallThickness_m / 2, 0, 0});
  scene.add_static("wall-east", end, {hall_length_m + kWallThickness_m / 2, 0, 0});
}

void add_columns(ScenarioBuilder& scene, int bays, double ceiling_m) {
  const int mesh = scene.add_mesh("column", column_mesh(ceiling_m), colors::kStone);
  for (int row : {0, 1})
    for (int boundary = 1; boundary < bays; ++boundary)
      scene.add_static(numbered(numbered("column", row), boundary), mesh, {boundary * kBay_m, 0, row_z(row)});
}

// Walls up openings that the way does not need: across a lane, and between two columns of a row.
void add_inner_walls(ScenarioBuilder& scene, const Way& way, const HallOptions& options,
                     CounterRandom& random) {
  const double height = options.ceiling_m;
  const int across =
      scene.add_mesh("wall-across", standing_box(kWallThickness_m, height, kLane_m), colors::kWall);
  const int along =
      scene.add_mesh("wall-along", standing_box(kBay_m, height, kWallThickness_m), colors::kWall);
  for (int lane : {-1, 0, 1})
    for (int boundary = 1; boundary < way.bays; ++boundary)
      if (random.next_unit() < options.wall_share && !way.boundaries.contains({lane, boundary}))
        scene.add_static(numbered(numbered("wall-across", lane + 1), boundary), across,
                         {boundary * kBay_m, 0, lane_z(lane)});
  for (int row : {0, 1})
    for (int bay = 0; bay < way.bays; ++bay)
      if (random.next_unit() < options.wall_share && !way.openings.contains({row, bay}))
        scene.add_static(numbered(numbered("wall-along", row), bay), along, {bay_x(bay), 0, row_z(row)});
}

// A curtain: where it stands, which way it faces, when it comes, and when it is gone.
struct Curtain {
  glm::dvec2 middle_m;
  glm::dvec2 facing_xz;
  double comes_s;
  double leaves_s;
  double gone_s() const { return leaves_s + kLeaving_s; }
};

// True when both targets stay clear of the curtain as long as it is there.
bool is_clear(const Curtain& curtain, const std::array<Motion, 2>& walks) {
  const glm::dvec2 along{curtain.facing_xz.y, -curtain.facing_xz.x};
  for (const Motion& walker : walks)
    for (size_t k = 0; k < walker.times_s.size(); ++k) {
      if (walker.times_s[k] < curtain.comes_s || walker.times_s[k] > curtain.gone_s()) continue;
      const glm::dvec2 p = glm::dvec2(walker.positions_m[k].x, walker.positions_m[k].z) - curtain.middle_m;
      const double beside = std::abs(p.x * along.x + p.y * along.y) - kCurtainWidth_m / 2;
      const double before = std::abs(p.x * curtain.facing_xz.x + p.y * curtain.facing_xz.y);
      if (length({std::max(beside, 0.0), before}) < kBodyRadius_m + 0.15) return false;
    }
  return true;
}

// Across the way where the pair was 0.9 s before, or earlier where it would stand in their way after a
// corner.
std::optional<Curtain> place_curtain(const TimedPath& middle, const std::array<Motion, 2>& walks,
                                     double comes_s, double hold_s) {
  for (double ago_s = 0.9; ago_s < 1.7; ago_s += 0.1) {
    const glm::dvec2 v = middle.velocity_mps(comes_s - ago_s);
    const Curtain curtain{middle.position_m(comes_s - ago_s), v / length(v), comes_s,
                          comes_s + kComing_s + hold_s};
    if (is_clear(curtain, walks)) return curtain;
  }
  return std::nullopt;
}

// Hidden above the ceiling or below the floor, in place at once, and gone again.
Motion sudden_motion(const Curtain& curtain, double hidden_y_m) {
  const std::pair<double, double> keys[] = {{0.0, hidden_y_m},
                                            {curtain.comes_s, hidden_y_m},
                                            {curtain.comes_s + kComing_s, 0.0},
                                            {curtain.leaves_s, 0.0},
                                            {curtain.gone_s(), hidden_y_m}};
  Motion motion;
  for (const auto& [time_s, y_m] : keys)
    motion.add(time_s, {curtain.middle_m.x, y_m, curtain.middle_m.y}, facing(curtain.facing_xz));
  return motion;
}

void add_curtains(ScenarioBuilder& scene, const TimedPath& middle, const std::array<Motion, 2>& walks,
                  const HallOptions& options, CounterRandom& random) {
  const int mesh =
      scene.add_mesh("curtain", standing_box(kCurtainWidth_m, kCurtainHeight_m, 0.0625), colors::kCurtain);
  InstanceAttributes attributes;
  attributes.collides = false;
  int count = 0;
  for (double time_s = 2.0; time_s < options.duration_s - 2.5; time_s += options.curtain_period_s) {
    const double comes_s = time_s + random.next_in(0.0, 0.4);
    const double hold_s = random.next_in(0.8, 1.4);
    const bool from_above = random.next_below(2) == 0;
    if (const auto curtain = place_curtain(middle, walks, comes_s, hold_s))
      scene.add_occluder(
          numbered("curtain", ++count), mesh,
          sudden_motion(*curtain, from_above ? options.ceiling_m + 0.5 : -kCurtainHeight_m - 0.5),
          attributes);
  }
}

}  // namespace

std::vector<std::byte> make_hall(const HallOptions& options) {
  CounterRandom way_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom wall_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  CounterRandom curtain_random(options.seed, 2, RandomPurpose::kSceneGeneration);
  const Way way = WayMaker(way_random).make(options.duration_s);
  const TimedPath middle(way.middle, way.times_s);

  ScenarioBuilder scene(options.duration_s);
  add_shell(scene, way.bays * kBay_m, options.ceiling_m);
  add_columns(scene, way.bays, options.ceiling_m);
  add_inner_walls(scene, way, options, wall_random);
  const glm::dvec2 start = way.middle.front();
  scene.add_camera({start.x - 5, 2.0, start.y + 0.6}, {start.x, 1.2, start.y});
  const std::array<Motion, 2> walks{
      walk({parallel(way.middle, kHalfGap_m), way.times_s}, options.duration_s),
      walk({parallel(way.middle, -kHalfGap_m), way.times_s}, options.duration_s)};
  scene.add_character("target-1", walks[0]);
  scene.add_character("target-2", walks[1]);
  add_curtains(scene, middle, walks, options, curtain_random);
  return scene.write();
}

}  // namespace sightline::scenes
