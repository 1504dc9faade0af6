#include "scenes/hall.h"

#include <cmath>
#include <utility>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// Seen from above: +x along the hall, lanes -1, 0, 1 of the nave across it, bays between the columns.
//
//   z = -8   ------------------------------  wall
//                     aisle 0
//   z = -4.5   o     o     o     o     o     row 0
//                     lanes, 1.8 m apart
//   z = +4.5   o     o     o     o     o     row 1
//                     aisle 1
//   z = +8   ------------------------------  wall
//              x = 4     8     12            boundary 1, 2, 3
constexpr double kBay_m = 4.0;
constexpr double kLane_m = 1.8;
constexpr double kHalfNave_m = 4.5;
constexpr double kAisle_m = 3.5;
constexpr double kColumnRadius_m = 0.4;
constexpr double kHalfBase_m = 0.5;
constexpr double kWallThickness_m = 0.3;
constexpr int kFirstBay = 2;
constexpr double kHalfGap_m = 0.45;  // between each target and the middle of the pair
constexpr double kSlowest_mps = 1.35;
constexpr double kFastest_mps = 1.5;
constexpr double kFromCamera_m = 5.0;
constexpr double kUp_m = 2.0;

constexpr double kCurtainLength_m = 7.0;
constexpr double kCurtainHeight_m = 3.0;
constexpr double kCurtain_mps = 4.0;
constexpr double kBeforeCamera_m = 1.1;
constexpr double kBeyondSight_m = 0.8;  // how far past the line from camera to targets it is drawn
constexpr double kFirstCurtain_s = 2.0;
constexpr double kStraight_s = 1.0;  // from a turn to a curtain

double bay_x(int bay) {
  return (bay + 0.5) * kBay_m;
}
double lane_z(int lane) {
  return lane * kLane_m;
}
// The side of the hall on which a row of columns is: -1 or 1.
double side_of(int row) {
  return 2 * row - 1;
}

// The path of the pair.
struct Way {
  Polyline middle;
  std::vector<double> times_s;
  int bays = 0;
};

class WayMaker {
 public:
  explicit WayMaker(CounterRandom& random) : random_(random) {
    way_.middle = {{bay_x(kFirstBay), 0.0}};
    way_.times_s = {0.0};
  }

  Way make(double duration_s) {
    while (way_.times_s.back() < duration_s + 1) {
      advance(2 + static_cast<int>(random_.next_below(2)));
      change_lane();
    }
    advance(1);
    way_.bays = bay_ + 2;
    return std::move(way_);
  }

 private:
  void advance(int bays) {
    bay_ += bays;
    walk_to({bay_x(bay_), lane_z(lane_)});
  }

  // From the middle to either side; from a side to the middle or, one time in three, right across.
  void change_lane() {
    const int to = lane_ == 0 ? (random_.next_below(2) == 0 ? -1 : 1) : (random_.next_below(3) == 0 ? -lane_ : 0);
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

// The path of one of the pair. The two walk side by side across the nave, on every leg.
Polyline beside(Polyline middle, double z_m) {
  for (glm::dvec2& corner : middle) corner.y += z_m;
  return middle;
}

MeshData column_mesh(double height_m) {
  MeshData mesh;
  append_box(mesh, {-kHalfBase_m, 0, -kHalfBase_m}, {kHalfBase_m, 0.3125, kHalfBase_m});
  append_frustum(mesh, {0, 0.3125, 0}, kColumnRadius_m, kColumnRadius_m - 0.0625, height_m - 0.6875, 24);
  append_box(mesh, {-kHalfBase_m, height_m - 0.375, -kHalfBase_m}, {kHalfBase_m, height_m, kHalfBase_m});
  return mesh;
}

void add_shell(ScenarioBuilder& scene, double hall_length_m, double ceiling_m) {
  const double half_width = kHalfNave_m + kAisle_m, middle = hall_length_m / 2;
  const int slab = scene.add_mesh("slab", standing_box(hall_length_m, 0.25, 2 * half_width), colors::kFloor);
  scene.add_static("floor", slab, {middle, -0.25, 0});
  scene.add_static("ceiling", slab, {middle, ceiling_m, 0});
  const int side = scene.add_mesh("side", standing_box(hall_length_m, ceiling_m, kWallThickness_m), colors::kWall);
  const int end = scene.add_mesh("end", standing_box(kWallThickness_m, ceiling_m, 2 * half_width), colors::kWall);
  scene.add_static("wall-north", side, {middle, 0, -half_width - kWallThickness_m / 2});
  scene.add_static("wall-south", side, {middle, 0, half_width + kWallThickness_m / 2});
  scene.add_static("wall-west", end, {-kWallThickness_m / 2, 0, 0});
  scene.add_static("wall-east", end, {hall_length_m + kWallThickness_m / 2, 0, 0});
}

void add_columns(ScenarioBuilder& scene, int bays, double ceiling_m) {
  const int mesh = scene.add_mesh("column", column_mesh(ceiling_m), colors::kStone);
  for (int row : {0, 1})
    for (int boundary = 1; boundary < bays; ++boundary)
      scene.add_static(numbered(numbered("column", row), boundary), mesh,
                       {boundary * kBay_m, 0, side_of(row) * kHalfNave_m});
}

// Walls across an aisle, each beside a column.
void add_inner_walls(ScenarioBuilder& scene, int bays, const HallOptions& options, CounterRandom& random) {
  const int across = scene.add_mesh("wall-across", standing_box(kWallThickness_m, options.ceiling_m, kAisle_m),
                                    colors::kWall);
  for (int row : {0, 1})
    for (int boundary = 1; boundary < bays; ++boundary)
      if (random.next_unit() < options.wall_share)
        scene.add_static(numbered(numbered("wall-across", row), boundary), across,
                         {boundary * kBay_m, 0, side_of(row) * (kHalfNave_m + kAisle_m / 2)});
}

// A curtain: its position across the nave, its side, where its edge stops, and when it comes to rest.
struct Curtain {
  double x_m;
  double side;
  double edge_z_m;
  double covers_s;
  double leaves_s;
  double length_z_m() const { return side * (kHalfNave_m + 0.25) - edge_z_m; }  // of its way, towards its aisle
  double takes_s() const { return std::abs(length_z_m()) / kCurtain_mps; }
  double gone_s() const { return leaves_s + takes_s(); }
};

Motion drawn(const Curtain& curtain) {
  const double in_z = curtain.edge_z_m + curtain.side * kCurtainLength_m / 2;
  const double out_z = in_z + curtain.length_z_m();
  const std::pair<double, double> keys[] = {{0.0, out_z},
                                            {curtain.covers_s - curtain.takes_s(), out_z},
                                            {curtain.covers_s, in_z},
                                            {curtain.leaves_s, in_z},
                                            {curtain.gone_s(), out_z}};
  Motion motion;
  for (const auto& [time_s, z_m] : keys) motion.add(time_s, {curtain.x_m, 0, z_m}, {1, 0, 0, 0});
  return motion;
}

// True when the pair walks along the hall during the whole time.
bool goes_straight(const TimedPath& middle, double from_s, double to_s) {
  for (double time_s = from_s; time_s <= to_s; time_s += 0.05)
    if (std::abs(middle.velocity_mps(time_s).y) > 1e-3) return false;
  return true;
}

// The camera's first place along the hall, from the middle of the pair.
double camera_x_m(const HallOptions& options) {
  return options.from_front ? kFromCamera_m : -kFromCamera_m;
}

// A curtain hangs between columns, not in them.
bool is_between_columns(double x_m) {
  return std::abs(x_m - std::floor(x_m / kBay_m + 0.5) * kBay_m) > kHalfBase_m + 0.0625;
}

void add_curtains(ScenarioBuilder& scene, const TimedPath& middle, const HallOptions& options, CounterRandom& random) {
  const int mesh = scene.add_mesh("curtain", standing_box(0.0625, kCurtainHeight_m, kCurtainLength_m),
                                  colors::kCurtain);
  InstanceAttributes attributes;
  attributes.collides = false;
  const double from_pair_m = camera_x_m(options) * (1 - kBeforeCamera_m / kFromCamera_m);
  int count = 0;
  double time_s = kFirstCurtain_s;
  while (time_s < options.duration_s) {
    const double hold_s = random.next_in(0.5, 0.8), side = side_of(static_cast<int>(random.next_below(2)));
    const glm::dvec2 pair = middle.position_m(time_s);
    const Curtain curtain{pair.x + from_pair_m, side, pair.y - side * kBeyondSight_m, time_s, time_s + hold_s};
    time_s += 0.1;
    if (curtain.gone_s() > options.duration_s || !is_between_columns(curtain.x_m) ||
        !goes_straight(middle, curtain.covers_s - kStraight_s, curtain.leaves_s))
      continue;
    scene.add_occluder(numbered("curtain", ++count), mesh, drawn(curtain), attributes);
    time_s = curtain.leaves_s + options.curtain_pause_s;
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
  add_inner_walls(scene, way.bays, options, wall_random);
  const glm::dvec2 start = way.middle.front();
  scene.add_camera({start.x + camera_x_m(options), kUp_m, start.y}, {start.x, 1.2, start.y});
  scene.add_character("target-1", walk({beside(way.middle, -kHalfGap_m), way.times_s}, options.duration_s));
  scene.add_character("target-2", walk({beside(way.middle, kHalfGap_m), way.times_s}, options.duration_s));
  add_curtains(scene, middle, options, curtain_random);
  return scene.write();
}

}  // namespace sightline::scenes
