// The flight plan: where the camera should be at each time of the coming second, found by dynamic programming over the
// lattice's cells and slices of time.
//
// A cell has a cost for each slice of time, which holds what is expected to be hidden from there *then*. At each slice
// the camera stays in its cell or flies to one of its 26 neighbours. A leg takes as long as its length does at the
// camera's mean speed, and at least a slice. It costs its length and, for each slice on the way, the mean of both
// cells' costs. A leg that ends between two slices costs the mean of what it would cost if it ended at the one or the
// other, weighted by how near they are. Beyond the last slice the camera is taken to stay, or to fly on to where it
// sees more. The plan with the least sum of costs is found exactly, with lengths and distances measured between the
// cells' middles. So the camera leaves early for a place that will be good, and passes a bad one only while that pays.
//
// The paper (3.4, 6.1) chooses a position that is good now or at one predicted time. This goes further: it also chooses
// when to be where.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/aggregate/places.h"
#include "server/move/cell_table.h"
#include "server/settings/move_settings.h"

namespace sightline {

struct FlightSettings {
  double slice_s = 0.1;    // > 0
  double speed_mps = 4.5;  // > 0: the camera's mean speed on a leg
  double route = 0.3;      // >= 0: cost of a metre of way, in units of the cost of a whole plan
  // >= 0: how much the time after the last slice counts, in plans. It costs as much as the last slice, less the gain of
  // flying on (look_beyond).
  double afterwards = 0.3;
  // >= 0: how much the sight beyond the last slice counts in addition (look_beyond), in plans. It counts alone, without
  // the shot and the distance.
  double beyond = 0.0;
};

// The plan. Times are from the present; the camera moves straight and evenly from point to point.
struct FlightPlan {
  std::vector<glm::dvec3> point_m;   // the camera's own position first
  std::vector<double> at_s;          // parallel; ascending, the first is 0
  std::vector<uint32_t> candidates;  // of the points, without the first
  double cost = 0.0;                 // mean cost of the slices, metres

  glm::dvec3 at(double time_s) const;
};

// The way from the camera to its first cell.
struct FlightStart {
  glm::dvec3 position_m{0.0};
  // How far the camera goes on before it can change its course. Times to the first cell are counted from there.
  glm::dvec3 drift_m{0.0};
  // Returns whether the body can go straight from the start to a candidate.
  std::function<bool(uint32_t candidate)> is_free = {};
};

// Memory is kept from call to call. Not thread-safe. Deterministic.
class FlightPlanner {
 public:
  // The time constant with which the time after a plan counts less.
  static constexpr double kFarS = 1.0;

  // Sets the cells and the legs between them. `places`: at least one run, none empty. `position_m`: of each candidate
  // in the runs; where the camera is in that cell, less than a spacing from the cell's middle (clearance_cache.h).
  // `clearance_m`: from there to the nearest collider, metres
  // >= 0. The body, of a radius >= 0, must fit at both ends of a leg, and nothing may cross it. `slices` >= 1.
  void lay(const PlaceView& places, std::span<const glm::dvec3> position_m, std::span<const float> clearance_m,
           double body_radius_m, size_t slices);

  // The costs of a slice by cell, to be written in full after each `lay`: index a candidate's with cell_of. They should
  // be at least 0 and less than 1e6. Cells without a candidate are ignored. Valid until the next `lay`.
  std::span<float> costs(size_t slice) { return cost_[slice]; }
  uint32_t cell_of(size_t candidate) const { return cell_of_[candidate]; }
  // The candidate whose cell holds a position, or nothing.
  std::optional<uint32_t> candidate_at(const glm::dvec3& position_m) const;

  // Replaces each cost by a mix with the mean over the open cells of the 3 x 3 x 3 around it, which counts by `share`,
  // [0, 1]. A place whose neighbours are good too is good even if the camera or the targets are not quite where they
  // were expected. Must be called once for each slice when its costs are written, since it also closes the cells where
  // the body does not fit.
  void blur(size_t slice, double share);

  // Looks beyond the last slice: what a camera that flies on from each cell will lack of its sight, if what is hidden
  // at the last slice stays hidden. It is the mean over the time to come, which counts the less, the later it is (see
  // kFarS), on the best way that a few sweeps over the cells find. A cell in the dark is the better, the nearer it is
  // to one in the light. Called once, when the last slice holds the costs of what is hidden and is blurred.
  void look_beyond(const FlightSettings& settings);
  // The result for a candidate in the runs: at least 0, and at most its cost at the last slice then.
  double sight_beyond(uint32_t candidate) const { return beyond_[cell_of_[candidate]]; }
  // How much that is less than staying costs, at any position: at most 0, interpolated as by cost_at.
  double gain_beyond_at(const glm::dvec3& position_m) const;

  // Appends the way with the fewest legs from the cell of a candidate in the runs to a candidate that `is_wanted`,
  // without the first. Returns false, and appends nothing, if legs lead to none.
  bool append_way(uint32_t candidate, const std::function<bool(uint32_t candidate)>& is_wanted,
                  std::vector<uint32_t>& way);

  // Adds `weight` >= 0 times the distance of each cell from a point, and `others`, by cell. Called after `blur`, at
  // most once for each slice.
  void add_distances(size_t slice, const glm::dvec3& point_m, double weight, std::span<const float> others);
  // Adds `weight` >= 0 times what a picture from each cell loses by departing from a shot (unbounded_shot_losses in
  // picture_worth.h). `center_m`: the targets' centre at that slice, world metres. `asked_m`: the asked offset from
  // there, not zero. Called like add_distances.
  void add_shot_losses(size_t slice, const glm::dvec3& center_m, const glm::dvec3& asked_m, const ShotWeights& weights,
                       double weight, double tolerance = 1.0);
  size_t cell_count() const { return box_.count(); }

  // The cheapest plan, after all costs are set. Its first point alone if no cell can be reached.
  const FlightPlan& plan(const FlightStart& start, const FlightSettings& settings);

  // The cost of a slice at any position: interpolated between the open cells around it; `otherwise` if there is none.
  // The distance from the point that add_distances was given counts exactly.
  double cost_at(const glm::dvec3& position_m, size_t slice, double otherwise) const;
  // The cost of the cheapest plan that begins at a position and a slice, [0, slice_count()]: the sum over its slices,
  // with its way and the time after it. Valid after `plan`. Interpolated as above, but `otherwise` also where the
  // position is hardly in an open cell.
  double cost_from(const glm::dvec3& position_m, size_t slice, double otherwise) const;
  size_t slice_count() const { return cost_.size(); }

 private:
  static constexpr int kSweepsBeyond = 8;  // each adds up to three legs to the ways

  template <typename Value>
  double mean_of_open(const glm::dvec3& position_m, double least_open, double otherwise, const Value& value_of) const;
  void lay_box(const PlaceView& places, size_t slices);
  void set_positions();
  void lay_legs(double body_radius_m);
  glm::dvec3 place_m(uint32_t cell) const;
  void sum_around(const float* values, float* sums);
  // Writes to best_: the least of the values at the ends of the legs that run along `axes` axes.
  void least_at_legs(const float* values, int axes);
  void least_at_unmasked_legs(const float* values, int axes);
  bool fly_on(int axes, const FlightSettings& settings);
  void price_afterwards(const FlightSettings& settings);
  void price_slice(size_t slice, const FlightSettings& settings);
  uint32_t best_move(size_t slice, uint32_t cell, const FlightSettings& settings) const;
  double move_cost(size_t slice, uint32_t cell, uint32_t leg, const FlightSettings& settings) const;
  bool enter(const FlightStart& start, const FlightSettings& settings);
  void go_on(const FlightSettings& settings);
  double leg_m(uint32_t leg) const;
  const std::vector<float>& value(size_t slice) const { return value_[std::min(slice, cost_.size())]; }

  double spacing_m_ = 1.0;
  CellBox box_;
  size_t begin_ = 0, end_ = 0;       // the cells between the rims
  std::vector<uint32_t> cell_of_;    // by candidate
  std::vector<uint32_t> candidate_;  // by cell
  std::vector<float> open_;          // by cell: 1 if the body fits
  std::vector<float> clear_m_;       // by cell: clearance
  struct Offset {
    std::vector<float> x_m, y_m, z_m;
  };
  Offset offset_;  // by cell: from its middle to the place of the camera
  double longest_offset_m_ = 0;
  std::vector<float> x_m_, y_m_, z_m_;  // by cell: position relative to the box's lowest cell
  std::vector<uint32_t> legs_;          // by cell: a bit for each leg (see kLegs) that can be flown
  struct Pull {
    glm::dvec3 point_m{0.0};
    double weight = 0;
  };
  std::vector<Pull> pull_;                        // by slice: what add_distances was given
  std::vector<std::vector<float>> cost_, value_;  // by slice and cell; value_ has one slice more: what comes afterwards
  std::vector<float> beyond_, gain_beyond_;       // by cell, see look_beyond; the gain is at most 0
  std::array<bool, 4> is_masked_{};  // by number of axes: the clearances decide which of these legs can be flown
  std::vector<float> open_around_;   // by cell: the number of open cells in the 3 x 3 x 3 around it
  std::vector<float> scratch_, best_, arrive_;
  std::vector<uint32_t> reached_, reached_from_;  // cells in the order in which they were reached; by cell
  std::array<std::vector<float>, 2> along_;
  uint32_t at_ = 0;
  size_t at_slice_ = 0;
  FlightPlan plan_;
};

}  // namespace sightline
