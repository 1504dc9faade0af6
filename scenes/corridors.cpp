#include "scenes/corridors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

// Crossings stand on a square grid; passages join neighbours. Seen from above, +x to the right, +z down:
//
//   +---+     +---+
//   |   |=====|   |    a crossing is as long as it is wide, 2 m; a passage is as long as is left of the pitch, 2 m
//   +---+     +---+
constexpr double kPitch_m = 4.0;
constexpr double kHeight_m = 2.8;
constexpr double kWall_m = 0.1875;  // thick, outside of the passage
constexpr double kSlowest_mps = 1.5;
constexpr double kFastest_mps = 2.1;
constexpr double kFollowing_s = 0.75;  // between the first and the second target
constexpr int kReach = 3;              // crossings to each side of the first

using Crossing = std::pair<int, int>;                                          // x, z
constexpr std::array<Crossing, 4> kSides{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};  // a quarter turn each

Crossing beside(const Crossing& c, size_t side) {
  return {c.first + kSides[side].first, c.second + kSides[side].second};
}
glm::dvec2 middle_of(const Crossing& c) {
  return {c.first * kPitch_m, c.second * kPitch_m};
}

// The passages that exist, each by its end towards -x or -z and whether it leads towards +z.
class Passages {
 public:
  void open(const Crossing& from, size_t side) {
    crossings_.insert(from);
    crossings_.insert(beside(from, side));
    passages_.insert(key(from, side));
  }
  bool is_open(const Crossing& from, size_t side) const { return passages_.contains(key(from, side)); }
  bool has(const Crossing& c) const { return crossings_.contains(c); }
  const std::set<Crossing>& crossings() const { return crossings_; }

 private:
  static std::pair<Crossing, bool> key(const Crossing& from, size_t side) {
    return {side < 2 ? from : beside(from, side), side % 2 == 1};
  }
  std::set<Crossing> crossings_;
  std::set<std::pair<Crossing, bool>> passages_;
};

// The path always goes on towards +x. Between two such legs it goes once or twice to one side, so it can never meet
// itself.
class WayMaker {
 public:
  explicit WayMaker(CounterRandom& random) : random_(random) {
    passages_.open({-1, 0}, 0);  // where the camera starts
    passages_.open({-2, 0}, 0);
  }

  void make(double duration_s) {
    while (times_s_.back() < duration_s + 1) {
      advance(0, leg());
      const bool has_room[] = {here_.second<kReach - 1, here_.second> 1 - kReach};  // +z, -z
      const bool to_low = has_room[0] && has_room[1] ? random_.next_below(2) == 0 : has_room[1];
      advance(to_low ? 3 : 1, leg());
    }
  }

  const Passages& passages() const { return passages_; }
  Passages& passages() { return passages_; }
  const Polyline& corners() const { return corners_; }
  // The same path, walked `ahead_s` earlier.
  TimedPath path(double ahead_s) const {
    std::vector<double> times_s = times_s_;
    for (double& time_s : times_s) time_s -= ahead_s;
    return {corners_, times_s};
  }

 private:
  // The length of a leg in passages: one, or two in one of three cases.
  uint32_t leg() { return random_.next_below(3) == 0 ? 2 : 1; }

  void advance(size_t side, uint32_t passages) {
    for (uint32_t i = 0; i < passages; ++i) {
      passages_.open(here_, side);
      here_ = beside(here_, side);
    }
    const glm::dvec2 corner = middle_of(here_);
    const double speed = random_.next_in(kSlowest_mps, kFastest_mps);
    times_s_.push_back(times_s_.back() + length(corner - corners_.back()) / speed);
    corners_.push_back(corner);
  }

  CounterRandom& random_;
  Passages passages_;
  Crossing here_{0, 0};
  Polyline corners_{{-0.5, 0}};  // where the second target starts
  std::vector<double> times_s_{0};
};

// Opens dead ends: passages from a crossing to positions that have no crossing.
void open_blind_passages(Passages& passages, double share, CounterRandom& random) {
  const std::set<Crossing> crossings = passages.crossings();
  for (const Crossing& c : crossings)
    for (size_t side = 0; side < kSides.size(); ++side)
      if (random.next_unit() < share && !passages.has(beside(c, side))) passages.open(c, side);
}

// Adds two kinds of wall. Each side of a crossing without a passage gets one that is long enough to close the corners
// with its neighbours. Each passage gets two that are no longer than the passage, so that none juts into another.
void add_walls(ScenarioBuilder& scene, const Passages& passages, double half_width_m) {
  const int closing = scene.add_mesh("closing", standing_box(2 * half_width_m + 2 * kWall_m, kHeight_m, kWall_m),
                                     colors::kWall);
  const int along = scene.add_mesh("along", standing_box(kPitch_m - 2 * half_width_m, kHeight_m, kWall_m),
                                   colors::kWall);
  int count = 0;
  const auto put = [&](int mesh, const glm::dvec2& middle, size_t side) {
    const glm::dvec2 out(kSides[side].first, kSides[side].second);
    const glm::dvec2 p = middle + out * (half_width_m + kWall_m / 2);
    scene.add_static(numbered("wall", ++count), mesh, {p.x, 0, p.y}, quarter_turns(side % 2 == 0 ? 1 : 0));
  };
  for (const Crossing& c : passages.crossings())
    for (size_t side = 0; side < kSides.size(); ++side)
      if (!passages.is_open(c, side)) {
        put(closing, middle_of(c), side);
      } else if (side < 2) {  // the other two are its neighbours'
        const glm::dvec2 middle = (middle_of(c) + middle_of(beside(c, side))) / 2.0;
        put(along, middle, (side + 1) % 4);
        put(along, middle, (side + 3) % 4);
      }
}

// A floor under all of it and a ceiling over all of it.
void add_slabs(ScenarioBuilder& scene, const Passages& passages) {
  glm::dvec2 low(0.0), high(0.0);
  for (const Crossing& c : passages.crossings()) {
    low = glm::min(low, middle_of(c));
    high = glm::max(high, middle_of(c));
  }
  const glm::dvec2 size = high - low + kPitch_m, middle = (low + high) / 2.0;
  const int slab = scene.add_mesh("slab", standing_box(size.x, 0.25, size.y), colors::kFloor);
  scene.add_static("floor", slab, {middle.x, -0.25, middle.y});
  scene.add_static("ceiling", slab, {middle.x, kHeight_m, middle.y});
}

}  // namespace

std::vector<std::byte> make_corridors(const CorridorsOptions& options) {
  CounterRandom way_random(options.seed, 0, RandomPurpose::kSceneGeneration);
  CounterRandom blind_random(options.seed, 1, RandomPurpose::kSceneGeneration);
  WayMaker way(way_random);
  way.make(options.duration_s);
  open_blind_passages(way.passages(), options.blind_share, blind_random);

  ScenarioBuilder scene(options.duration_s);
  add_slabs(scene, way.passages());
  add_walls(scene, way.passages(), options.width_m / 2);
  const glm::dvec2 start = way.corners().front();
  scene.add_camera({start.x - 2.75, 1.8, start.y}, {start.x + 1, 1.2, start.y});
  if (options.targets > 1) scene.add_character("target-1", walk(way.path(kFollowing_s), options.duration_s));
  scene.add_character(numbered("target", options.targets), walk(way.path(0), options.duration_s));
  return scene.write();
}

}  // namespace sightline::scenes
