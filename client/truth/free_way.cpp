#include "client/truth/free_way.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>

#include "client/truth/blindness.h"

namespace sightline {
namespace {

constexpr double kLeastCellM = 0.1;
constexpr std::array<glm::ivec3, 6> kFaces{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

class Search {
 public:
  Search(const ScenarioWorld& world, const glm::dvec3& from_m, double body_radius_m, double reach_m)
      : world_(world),
        from_m_(from_m),
        cell_m_(std::max(body_radius_m, kLeastCellM)),
        clearance_m_(static_cast<float>(std::hypot(body_radius_m, cell_m_ / 2))),
        reach_(static_cast<int>(reach_m / cell_m_)),
        known_(static_cast<size_t>(side()) * side() * side(), false) {}

  std::optional<FreeWay> run() {
    add({0, 0, 0}, 0);
    while (!open_.empty()) {
      const Cell cell = open_.front();
      open_.pop_front();
      if (const uint64_t seen = seen_from(center_m(cell.at)))
        return FreeWay{cell.steps * cell_m_, center_m(cell.at), seen};
      if (cell.steps == reach_) continue;
      for (const glm::ivec3& face : kFaces)
        if (!known(cell.at + face)) add_if_free(cell.at + face, cell.steps + 1);
    }
    return std::nullopt;
  }

 private:
  struct Cell {
    glm::ivec3 at;
    int steps;  // from the camera's cell
  };

  int side() const { return 2 * reach_ + 1; }
  glm::dvec3 center_m(const glm::ivec3& at) const { return from_m_ + cell_m_ * glm::dvec3(at); }
  std::vector<bool>::reference known(const glm::ivec3& at) {
    const glm::ivec3 p = at + reach_;
    return known_[(static_cast<size_t>(p.z) * side() + p.y) * side() + p.x];
  }

  void add(const glm::ivec3& at, int steps) {
    known(at) = true;
    open_.push_back({at, steps});
  }
  void add_if_free(const glm::ivec3& at, int steps) {
    known(at) = true;
    if (world_.colliders().nearest_surface_m(center_m(at), clearance_m_) >= clearance_m_) open_.push_back({at, steps});
  }

  // The first target whose aim point is in free sight; 0: none. Ids of a scenario begin at 1.
  uint64_t seen_from(const glm::dvec3& position_m) const {
    for (const Target& target : world_.targets())
      if (!world_.is_aim_hidden(target, position_m)) return target.instance_id;
    return 0;
  }

  const ScenarioWorld& world_;
  const glm::dvec3 from_m_;
  const double cell_m_;
  const float clearance_m_;
  const int reach_;          // in cells
  std::vector<bool> known_;  // cells that were tested
  std::deque<Cell> open_;
};

// The longest time without a break within one stretch in which a way existed.
double longest_with_way_s(ScenarioWorld& world, std::span<const CameraFrame> frames, std::span<const FrameTruth> truths,
                          const BlindStretch& stretch, const CameraLimits& limits) {
  const double reach_m = reach_from_rest_m(limits, kFreeWayS);
  double longest_s = 0.0, since_s = 0.0, searched_s = -INFINITY;
  bool exists = false;
  const auto end_at = [&](double time_s) {
    if (exists) longest_s = std::max(longest_s, time_s - since_s);
  };
  for (size_t i = stretch.first; i < stretch.end; ++i) {
    const double time_s = frames[i].time_s;
    if (!truths[i].picture || time_s - searched_s < kFreeWayEveryS - 1e-9) continue;
    searched_s = time_s;
    world.set_time(time_s);
    const bool still = find_free_way(world, frames[i].camera.position_m, limits.body_radius_m, reach_m).has_value();
    if (!still) end_at(time_s);
    if (still && !exists) since_s = time_s;
    exists = still;
  }
  end_at(frames[stretch.end].time_s);
  return longest_s;
}

}  // namespace

std::optional<FreeWay> find_free_way(const ScenarioWorld& world, const glm::dvec3& from_m, double body_radius_m,
                                     double reach_m) {
  return Search(world, from_m, body_radius_m, reach_m).run();
}

double reach_from_rest_m(const CameraLimits& limits, double time_s) {
  const double rising_s = std::min(time_s, limits.max_speed_mps / limits.max_acceleration_mps2);
  return limits.max_acceleration_mps2 * rising_s * rising_s / 2 + limits.max_speed_mps * (time_s - rising_s);
}

double longest_blind_with_way_s(ScenarioWorld& world, std::span<const CameraFrame> frames,
                                std::span<const FrameTruth> truths, const CameraLimits& limits) {
  std::vector<BlindStretch> stretches = blind_stretches(frames, truths);
  std::stable_sort(stretches.begin(), stretches.end(), [&](const BlindStretch& a, const BlindStretch& b) {
    return a.length_s(frames) > b.length_s(frames);
  });
  double longest_s = 0.0;
  for (const BlindStretch& stretch : stretches) {
    if (stretch.length_s(frames) <= longest_s) break;
    longest_s = std::max(longest_s, longest_with_way_s(world, frames, truths, stretch, limits));
  }
  return longest_s;
}

}  // namespace sightline
