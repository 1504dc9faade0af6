#include "server/move/flight_plan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/vector_clones.h"
#include "server/move/picture_worth.h"

namespace sightline {
namespace {

// The cost of a cell where the body does not fit. More than any plan costs; sums of it stay finite.
constexpr float kClosed = 1e12f;
constexpr float kNoWay = 1e11f;  // a plan that costs more leads through a closed cell
// Nothing crosses a leg if the clearances of its ends add up to its length and this much more, metres. Across a wall
// that stands upright on the leg they add up to the length itself, and they are rounded to single precision.
constexpr double kNoCrossingM = 1e-4;

struct LegStep {
  int x, y, z;
  int axes;  // the number of axes along which it runs, 1 to 3
};
// The 26 legs; leg 25 - k is leg k backwards.
constexpr std::array<LegStep, 26> kLegs = [] {
  std::array<LegStep, 26> legs{};
  size_t k = 0;
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x)
        if (x != 0 || y != 0 || z != 0) legs[k++] = {x, y, z, x * x + y * y + z * z};
  return legs;
}();

// How long a leg takes, in slices.
struct LegTime {
  LegTime(double length_m, const FlightSettings& settings) {
    const double slices = std::max(1.0, length_m / (settings.speed_mps * settings.slice_s));
    whole = static_cast<size_t>(slices);
    rest = static_cast<float>(slices - static_cast<double>(whole));
  }
  size_t whole;  // >= 1
  float rest;    // [0, 1)
};

std::ptrdiff_t offset_of(const LegStep& leg, const CellBox& box) {
  return leg.x + leg.y * static_cast<std::ptrdiff_t>(box.row()) + leg.z * static_cast<std::ptrdiff_t>(box.slice());
}

// The cells at one end of legs, by cell: clearance, and the offset of the camera's place.
struct LegEnds {
  const float *clear_m, *x_m, *y_m, *z_m;
};

SIGHTLINE_VECTOR_CLONES
void mark_leg(const LegEnds& here, const LegEnds& there, size_t count, float body_m, const glm::vec3& leg_m,
              uint32_t bit, uint32_t* __restrict legs) {
  const float* __restrict clear = here.clear_m;
  const float* __restrict x = here.x_m;
  const float* __restrict y = here.y_m;
  const float* __restrict z = here.z_m;
  const float* __restrict clear_there = there.clear_m;
  const float* __restrict x_there = there.x_m;
  const float* __restrict y_there = there.y_m;
  const float* __restrict z_there = there.z_m;
  const float leg_x = leg_m.x, leg_y = leg_m.y, leg_z = leg_m.z;
  for (size_t i = 0; i < count; ++i) {
    const float dx = leg_x + x_there[i] - x[i], dy = leg_y + y_there[i] - y[i], dz = leg_z + z_there[i] - z[i];
    const float clear_of_both = clear[i] + clear_there[i] - static_cast<float>(kNoCrossingM);
    const bool fits = (clear[i] >= body_m) & (clear_there[i] >= body_m) &
                      (clear_of_both * clear_of_both > dx * dx + dy * dy + dz * dz);
    legs[i] |= fits ? bit : 0u;
  }
}

SIGHTLINE_VECTOR_CLONES
void take_least(const float* __restrict there, const uint32_t* __restrict legs, size_t count, uint32_t bit,
                float* __restrict least) {
  for (size_t i = 0; i < count; ++i) {
    const float value = (legs[i] & bit) != 0 ? there[i] : kClosed;
    least[i] = value < least[i] ? value : least[i];
  }
}

SIGHTLINE_VECTOR_CLONES
void add_to(const float* __restrict values, size_t count, float factor, float* __restrict sums) {
  for (size_t i = 0; i < count; ++i) sums[i] += factor * values[i];
}

// The values of a leg's end that lies between two slices, and what the slices on the way cost there.
SIGHTLINE_VECTOR_CLONES
void arrive_between(const float* __restrict before, const float* __restrict after, const float* __restrict on_the_way,
                    size_t count, float rest, float* __restrict values) {
  for (size_t i = 0; i < count; ++i) values[i] = before[i] + rest * (after[i] - before[i]) + on_the_way[i];
}

// The lesser of the values at `step` before and after each.
SIGHTLINE_VECTOR_CLONES
void least_beside(const float* __restrict values, size_t begin, size_t end, size_t step, float* __restrict least) {
  const float* before = values - step;
  const float* after = values + step;
  for (size_t i = begin; i < end; ++i) least[i] = before[i] < after[i] ? before[i] : after[i];
}

// least = min(least, values + extra)
SIGHTLINE_VECTOR_CLONES
void take_leg(const float* __restrict values, size_t count, float extra, float* __restrict least) {
  for (size_t i = 0; i < count; ++i) {
    const float value = values[i] + extra;
    least[i] = value < least[i] ? value : least[i];
  }
}

// The cost of flying on from each place: a leg's time at the place counts by 1 - `keep`, and the rest lies beyond its
// end. Returns whether that is less than `least` anywhere, and takes it over.
SIGHTLINE_VECTOR_CLONES
bool take_way_on(const float* __restrict here, const float* __restrict there, size_t count, float keep, float way,
                 float* __restrict least) {
  int less = 0;
  for (size_t i = 0; i < count; ++i) {
    const float value = here[i] + keep * (there[i] - here[i]) + way;
    const bool is_less = (value < least[i]) & (here[i] < kNoWay);
    less |= static_cast<int>(is_less);
    least[i] = is_less ? value : least[i];
  }
  return less != 0;
}

SIGHTLINE_VECTOR_CLONES
void sum_of_three(const float* __restrict values, size_t count, std::ptrdiff_t step, float* __restrict sums) {
  const float* before = values - step;
  const float* after = values + step;
  for (size_t i = 0; i < count; ++i) sums[i] = before[i] + values[i] + after[i];
}

SIGHTLINE_VECTOR_CLONES
void multiply(const float* __restrict a, const float* __restrict b, size_t count, float* __restrict products) {
  for (size_t i = 0; i < count; ++i) products[i] = a[i] * b[i];
}

SIGHTLINE_VECTOR_CLONES
void add_distance(const float* __restrict x, const float* __restrict y, const float* __restrict z, size_t count,
                  float px, float py, float pz, float weight, const float* __restrict others, float* __restrict costs) {
  for (size_t i = 0; i < count; ++i) {
    const float dx = x[i] - px, dy = y[i] - py, dz = z[i] - pz;
    costs[i] += weight * std::sqrt(dx * dx + dy * dy + dz * dz) + others[i];
  }
}

// Mixes costs with sums over `counts` open cells, the cell itself included; closed cells become kClosed.
SIGHTLINE_VECTOR_CLONES
void mix(const float* __restrict sums, const float* __restrict counts, const float* __restrict open, size_t count,
         float share, float* __restrict costs) {
  for (size_t i = 0; i < count; ++i) {
    const float mixed = costs[i] + share * (sums[i] / (counts[i] > 1.0f ? counts[i] : 1.0f) - costs[i]);
    costs[i] = open[i] > 0 ? mixed : kClosed;
  }
}

}  // namespace

glm::dvec3 FlightPlan::at(double time_s) const {
  for (size_t k = 1; k < point_m.size(); ++k)
    if (time_s < at_s[k]) return glm::mix(point_m[k - 1], point_m[k], (time_s - at_s[k - 1]) / (at_s[k] - at_s[k - 1]));
  return point_m.back();
}

void FlightPlanner::lay(const PlaceView& places, std::span<const glm::dvec3> position_m,
                        std::span<const float> clearance_m, double body_radius_m, size_t slices) {
  lay_box(places, slices);
  const size_t cells = box_.count();
  open_.assign(cells, 0.0f);
  clear_m_.assign(cells, -1.0f);
  gain_beyond_.assign(cells, 0.0f);
  candidate_.assign(cells, UINT32_MAX);
  cell_of_.resize(places.in_runs());
  for (std::vector<float>* offsets_m : {&offset_.x_m, &offset_.y_m, &offset_.z_m}) offsets_m->assign(cells, 0.0f);
  longest_offset_m_ = 0;
  for (size_t run = 0; run < places.runs().size(); ++run) {
    size_t cell = box_.address(places.runs()[run].cell);
    for (size_t i = places.runs()[run].first; i < places.end_of_run(run); ++i, ++cell) {
      cell_of_[i] = static_cast<uint32_t>(cell);
      candidate_[cell] = static_cast<uint32_t>(i);
      clear_m_[cell] = clearance_m[i];
      open_[cell] = clearance_m[i] >= body_radius_m ? 1.0f : 0.0f;
      const glm::dvec3 offset_m = position_m[i] - places.in_run(places.runs()[run], i);
      if (offset_m == glm::dvec3(0.0)) continue;
      offset_.x_m[cell] = static_cast<float>(offset_m.x), offset_.y_m[cell] = static_cast<float>(offset_m.y);
      offset_.z_m[cell] = static_cast<float>(offset_m.z);
      longest_offset_m_ = std::max(longest_offset_m_, glm::length(offset_m));
    }
  }
  pull_.assign(slices, Pull{});
  lay_legs(body_radius_m);
  sum_around(open_.data(), open_around_.data());
}

void FlightPlanner::lay_box(const PlaceView& places, size_t slices) {
  glm::ivec3 low(INT32_MAX), high(INT32_MIN);
  for (size_t run = 0; run < places.runs().size(); ++run) {
    const glm::ivec3 first = places.runs()[run].cell;
    const auto count = static_cast<int>(places.end_of_run(run) - places.runs()[run].first);
    low = glm::min(low, first);
    high = glm::max(high, first + glm::ivec3(count - 1, 0, 0));
  }
  const CellBox former = box_;
  const double former_spacing_m = spacing_m_;
  box_ = {low - 1, high - low + 3};
  spacing_m_ = places.spacing_m();
  if (box_.size == former.size && spacing_m_ == former_spacing_m && cost_.size() == slices) return;
  const size_t cells = box_.count();
  begin_ = box_.slice() + box_.row() + 1;
  end_ = cells - begin_;
  cost_.resize(slices);
  value_.resize(slices + 1);
  for (std::vector<float>& costs : cost_) costs.resize(cells);
  for (std::vector<float>* values : {&arrive_, &best_, &along_[0], &along_[1], &scratch_, &open_around_})
    values->assign(cells, 0.0f);
  // The rims of these are read, and never written again.
  for (std::vector<float>& values : value_) values.assign(cells, kClosed);
  arrive_.assign(cells, kClosed);
  beyond_.assign(cells, kClosed);
  reached_.reserve(cells), reached_from_.reserve(cells);
  set_positions();
}

void FlightPlanner::set_positions() {
  const size_t cells = box_.count();
  x_m_.resize(cells), y_m_.resize(cells), z_m_.resize(cells);
  size_t at = 0;
  for (int z = 0; z < box_.size.z; ++z)
    for (int y = 0; y < box_.size.y; ++y)
      for (int x = 0; x < box_.size.x; ++x, ++at) {
        const glm::dvec3 place_m = glm::dvec3(x, y, z) * spacing_m_;
        x_m_[at] = static_cast<float>(place_m.x), y_m_[at] = static_cast<float>(place_m.y),
        z_m_[at] = static_cast<float>(place_m.z);
      }
}

// A surface that crosses a leg at a point is no farther from each end than that point is. So nothing crosses a leg that
// is shorter than the sum of its ends' clearances.
void FlightPlanner::lay_legs(double body_radius_m) {
  const auto ends = [&](std::ptrdiff_t at) -> LegEnds {
    const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(begin_) + at;
    return {clear_m_.data() + first, offset_.x_m.data() + first, offset_.y_m.data() + first,
            offset_.z_m.data() + first};
  };
  legs_.assign(box_.count(), 0u);
  for (size_t leg = 0; leg < kLegs.size(); ++leg) {
    const double length_m = spacing_m_ * std::sqrt(static_cast<double>(kLegs[leg].axes));
    is_masked_[static_cast<size_t>(kLegs[leg].axes)] = static_cast<float>(length_m + 2 * longest_offset_m_ +
                                                                          kNoCrossingM) >=
                                                       2 * static_cast<float>(body_radius_m);
    const glm::vec3 leg_m = glm::vec3(kLegs[leg].x, kLegs[leg].y, kLegs[leg].z) * static_cast<float>(spacing_m_);
    mark_leg(ends(0), ends(offset_of(kLegs[leg], box_)), end_ - begin_, static_cast<float>(body_radius_m), leg_m,
             1u << leg, legs_.data() + begin_);
  }
}

// The sum over the 3 x 3 x 3 is taken one axis at a time.
void FlightPlanner::sum_around(const float* values, float* sums) {
  const size_t cells = box_.count(), row = box_.row(), slice = box_.slice();
  float *const x = along_[0].data(), *const y = along_[1].data();
  sum_of_three(values + 1, cells - 2, 1, x + 1);
  sum_of_three(x + row + 1, cells - 2 * row - 2, static_cast<std::ptrdiff_t>(row), y + row + 1);
  sum_of_three(y + begin_, end_ - begin_, static_cast<std::ptrdiff_t>(slice), sums + begin_);
}

void FlightPlanner::blur(size_t slice, double share) {
  float* const costs = cost_[slice].data();
  multiply(costs, open_.data(), box_.count(), scratch_.data());
  sum_around(scratch_.data(), best_.data());
  mix(best_.data() + begin_, open_around_.data() + begin_, open_.data() + begin_, end_ - begin_,
      static_cast<float>(share), costs + begin_);
}

void FlightPlanner::add_distances(size_t slice, const glm::dvec3& point_m, double weight,
                                  std::span<const float> others) {
  pull_[slice] = {point_m, weight};
  const glm::vec3 point(point_m - glm::dvec3(box_.low) * spacing_m_);
  add_distance(x_m_.data() + begin_, y_m_.data() + begin_, z_m_.data() + begin_, end_ - begin_, point.x, point.y,
               point.z, static_cast<float>(weight), others.data() + begin_, cost_[slice].data() + begin_);
}

void FlightPlanner::add_shot_losses(size_t slice, const glm::dvec3& center_m, const glm::dvec3& asked_m,
                                    const ShotWeights& weights, double weight, double tolerance) {
  const ShotPlaces places{x_m_.data() + begin_, y_m_.data() + begin_, z_m_.data() + begin_, end_ - begin_,
                          glm::vec3(center_m - glm::dvec3(box_.low) * spacing_m_)};
  unbounded_shot_losses(places, asked_m, weights, scratch_.data() + begin_, tolerance);
  add_to(scratch_.data() + begin_, end_ - begin_, static_cast<float>(weight), cost_[slice].data() + begin_);
}

// Where the body fits at both ends of a leg that is shorter than two radii, nothing crosses the leg. So the least value
// at the ends of these legs is found one axis at a time; closed cells hold kClosed.
void FlightPlanner::least_at_unmasked_legs(const float* values, int axes) {
  const size_t cells = box_.count(), row = box_.row(), slice = box_.slice();
  float *const x = along_[0].data(), *const y = along_[1].data();
  least_beside(values, 1, cells - 1, 1, x);
  if (axes == 1) {
    least_beside(values, begin_, end_, row, best_.data());
    least_beside(values, begin_, end_, slice, y);
    take_leg(x + begin_, end_ - begin_, 0.0f, best_.data() + begin_);
    return take_leg(y + begin_, end_ - begin_, 0.0f, best_.data() + begin_);
  }
  if (axes == 3) {
    least_beside(x, row + 1, cells - row - 1, row, y);
    return least_beside(y, begin_, end_, slice, best_.data());
  }
  least_beside(x, begin_, end_, row, best_.data());
  least_beside(x, begin_, end_, slice, y);
  take_leg(y + begin_, end_ - begin_, 0.0f, best_.data() + begin_);
  least_beside(values, row, cells - row, row, y);
  least_beside(y, begin_, end_, slice, x);
  take_leg(x + begin_, end_ - begin_, 0.0f, best_.data() + begin_);
}

void FlightPlanner::least_at_legs(const float* values, int axes) {
  if (!is_masked_[static_cast<size_t>(axes)]) return least_at_unmasked_legs(values, axes);
  const size_t count = end_ - begin_;
  std::fill_n(best_.data() + begin_, count, kClosed);
  for (size_t leg = 0; leg < kLegs.size(); ++leg)
    if (kLegs[leg].axes == axes)
      take_least(values + begin_ + offset_of(kLegs[leg], box_), legs_.data() + begin_, count, 1u << leg,
                 best_.data() + begin_);
}

// Flying on along legs of so many axes. Returns whether that is better anywhere.
bool FlightPlanner::fly_on(int axes, const FlightSettings& settings) {
  const double length_m = spacing_m_ * std::sqrt(static_cast<double>(axes));
  const auto keep = static_cast<float>(std::exp(-length_m / (settings.speed_mps * kFarS)));
  least_at_legs(beyond_.data(), axes);
  return take_way_on(cost_.back().data() + begin_, best_.data() + begin_, end_ - begin_, keep,
                     static_cast<float>(settings.route * length_m), beyond_.data() + begin_);
}

void FlightPlanner::look_beyond(const FlightSettings& settings) {
  const size_t count = end_ - begin_;
  const float* const staying = cost_.back().data() + begin_;
  std::copy_n(staying, count, beyond_.data() + begin_);
  bool is_better = true;
  for (int sweep = 0; sweep < kSweepsBeyond && is_better; ++sweep) {
    is_better = false;
    for (int axes = 1; axes <= 3; ++axes) is_better = fly_on(axes, settings) || is_better;
  }
  std::copy_n(beyond_.data() + begin_, count, gain_beyond_.data() + begin_);
  add_to(staying, count, -1.0f, gain_beyond_.data() + begin_);
}

bool FlightPlanner::append_way(uint32_t candidate, const std::function<bool(uint32_t candidate)>& is_wanted,
                               std::vector<uint32_t>& way) {
  constexpr uint32_t kNotReached = UINT32_MAX;
  const uint32_t start = cell_of_[candidate];
  reached_from_.assign(box_.count(), kNotReached);
  reached_.assign(1, start);
  reached_from_[start] = start;
  size_t k = 0;
  for (; k < reached_.size() && !is_wanted(candidate_[reached_[k]]); ++k)
    for (size_t leg = 0; leg < kLegs.size(); ++leg) {
      if ((legs_[reached_[k]] >> leg & 1u) == 0) continue;
      const uint32_t there = reached_[k] + static_cast<uint32_t>(offset_of(kLegs[leg], box_));
      if (reached_from_[there] == kNotReached) reached_from_[there] = reached_[k], reached_.push_back(there);
    }
  if (k == reached_.size()) return false;
  const auto first = static_cast<std::ptrdiff_t>(way.size());
  for (uint32_t cell = reached_[k]; cell != start; cell = reached_from_[cell]) way.push_back(candidate_[cell]);
  std::reverse(way.begin() + first, way.end());
  return true;
}

void FlightPlanner::price_afterwards(const FlightSettings& settings) {
  const auto weight = static_cast<float>(settings.afterwards * static_cast<double>(cost_.size()));
  const size_t count = end_ - begin_;
  float* const last = value_.back().data() + begin_;
  std::fill_n(last, count, 0.0f);
  add_to(cost_.back().data() + begin_, count, weight, last);
  add_to(gain_beyond_.data() + begin_, count, weight, last);
  if (settings.beyond > 0)
    add_to(beyond_.data() + begin_, count, static_cast<float>(settings.beyond * static_cast<double>(cost_.size())),
           last);
}

double FlightPlanner::leg_m(uint32_t leg) const {
  return spacing_m_ * std::sqrt(static_cast<double>(kLegs[leg].axes));
}

// The values of one slice follow from the values of the slices after it.
void FlightPlanner::price_slice(size_t slice, const FlightSettings& settings) {
  const size_t count = end_ - begin_;
  const auto slices = static_cast<double>(cost_.size());
  float* const least = value_[slice].data() + begin_;
  std::copy_n(value(slice + 1).data() + begin_, count, least);  // it stays
  for (int axes = 1; axes <= 3; ++axes) {
    const double length_m = spacing_m_ * std::sqrt(static_cast<double>(axes));
    const LegTime time(length_m, settings);
    const size_t before = slice + time.whole;
    std::fill_n(scratch_.data() + begin_, count, 0.0f);  // half of what the slices on the way cost counts at either end
    for (size_t k = slice + 1; k < std::min(before, cost_.size()); ++k)
      add_to(cost_[k].data() + begin_, count, 0.5f, scratch_.data() + begin_);
    if (before < cost_.size()) add_to(cost_[before].data() + begin_, count, 0.5f * time.rest, scratch_.data() + begin_);
    arrive_between(value(before).data() + begin_, value(before + 1).data() + begin_, scratch_.data() + begin_, count,
                   time.rest, arrive_.data() + begin_);
    least_at_legs(arrive_.data(), axes);
    add_to(scratch_.data() + begin_, count, 1.0f, best_.data() + begin_);
    take_leg(best_.data() + begin_, count, static_cast<float>(settings.route * length_m * slices), least);
  }
  add_to(cost_[slice].data() + begin_, count, 1.0f, least);
}

double FlightPlanner::move_cost(size_t slice, uint32_t cell, uint32_t leg, const FlightSettings& settings) const {
  const LegTime time(leg_m(leg), settings);
  const size_t there = cell + static_cast<size_t>(offset_of(kLegs[leg], box_)), before = slice + time.whole;
  double cost = settings.route * leg_m(leg) * static_cast<double>(cost_.size()) +
                std::lerp(value(before)[there], value(before + 1)[there], time.rest);
  for (size_t k = slice + 1; k < std::min(before, cost_.size()); ++k) cost += 0.5 * (cost_[k][cell] + cost_[k][there]);
  if (before < cost_.size()) cost += 0.5 * time.rest * (cost_[before][cell] + cost_[before][there]);
  return cost;
}

// The leg that a plan takes from a cell at a slice; kLegs.size(): none, it stays for a slice.
uint32_t FlightPlanner::best_move(size_t slice, uint32_t cell, const FlightSettings& settings) const {
  double least = value(slice + 1)[cell];
  uint32_t best = kLegs.size();
  for (uint32_t leg = 0; leg < kLegs.size(); ++leg) {
    if ((legs_[cell] >> leg & 1u) == 0) continue;
    const double cost = move_cost(slice, cell, leg, settings);
    if (cost < least) least = cost, best = leg;
  }
  return best;
}

// The place of the camera in a cell.
glm::dvec3 FlightPlanner::place_m(uint32_t cell) const {
  const glm::ivec3 index(static_cast<int>(cell % box_.row()),
                         static_cast<int>(cell / box_.row() % static_cast<size_t>(box_.size.y)),
                         static_cast<int>(cell / box_.slice()));
  return glm::dvec3(index + box_.low) * spacing_m_ +
         glm::dvec3(offset_.x_m[cell], offset_.y_m[cell], offset_.z_m[cell]);
}

// Chooses the first cell among those around the start.
bool FlightPlanner::enter(const FlightStart& start, const FlightSettings& settings) {
  struct Entry {
    double cost;
    uint32_t cell;
    size_t slice;
  };
  std::array<Entry, 27> entries;
  size_t count = 0;
  const glm::ivec3 own(glm::round(start.position_m / spacing_m_));
  const auto slices = static_cast<double>(cost_.size());
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        const glm::ivec3 at = own + glm::ivec3(x, y, z);
        if (glm::any(glm::lessThan(at, box_.low)) || glm::any(glm::greaterThanEqual(at, box_.low + box_.size)))
          continue;
        const size_t cell = box_.address(at);
        if (open_[cell] == 0) continue;
        const glm::dvec3 to_m = place_m(static_cast<uint32_t>(cell));
        const double late_m = glm::distance(start.position_m + start.drift_m, to_m);
        const auto slice = static_cast<size_t>(std::lround(late_m / (settings.speed_mps * settings.slice_s)));
        const size_t arrival = std::min(slice, cost_.size() - 1);
        double cost = settings.route * slices * glm::distance(start.position_m, to_m) + value_[arrival][cell];
        for (size_t k = 0; k < arrival; ++k) cost += cost_[k][cell];
        if (cost < kNoWay) entries[count++] = {cost, static_cast<uint32_t>(cell), arrival};
      }
  std::sort(entries.begin(), entries.begin() + count,
            [](const Entry& a, const Entry& b) { return std::pair(a.cost, a.cell) < std::pair(b.cost, b.cell); });
  for (size_t k = 0; k < count; ++k) {
    if (start.is_free && !start.is_free(candidate_[entries[k].cell])) continue;
    at_ = entries[k].cell, at_slice_ = entries[k].slice;
    plan_.cost = entries[k].cost / slices;
    return true;
  }
  return false;
}

void FlightPlanner::go_on(const FlightSettings& settings) {
  const auto pass = [&](double at_s) {
    plan_.point_m.push_back(place_m(at_));
    plan_.at_s.push_back(at_s);
    plan_.candidates.push_back(candidate_[at_]);
  };
  pass(settings.slice_s * static_cast<double>(at_slice_ + 1));
  for (auto slices = static_cast<double>(at_slice_); at_slice_ + 1 < cost_.size();) {
    const uint32_t leg = best_move(at_slice_, at_, settings);
    double takes = 1;
    if (leg < kLegs.size()) {
      at_ += static_cast<uint32_t>(offset_of(kLegs[leg], box_));
      const LegTime time(leg_m(leg), settings);
      takes = static_cast<double>(time.whole) + time.rest;
    }
    slices += takes;
    at_slice_ = std::max(at_slice_ + 1, static_cast<size_t>(std::lround(slices)));
    pass(plan_.at_s.back() + settings.slice_s * takes);
  }
}

const FlightPlan& FlightPlanner::plan(const FlightStart& start, const FlightSettings& settings) {
  plan_.point_m.reserve(cost_.size() + 2), plan_.at_s.reserve(cost_.size() + 2),
      plan_.candidates.reserve(cost_.size() + 1);
  plan_.point_m.assign(1, start.position_m);
  plan_.at_s.assign(1, 0.0);
  plan_.candidates.clear();
  plan_.cost = kClosed;
  price_afterwards(settings);
  for (size_t slice = cost_.size(); slice-- > 0;) price_slice(slice, settings);
  if (enter(start, settings)) go_on(settings);
  return plan_;
}

std::optional<uint32_t> FlightPlanner::candidate_at(const glm::dvec3& position_m) const {
  const glm::ivec3 cell(glm::round(position_m / spacing_m_));
  if (glm::any(glm::lessThan(cell, box_.low)) || glm::any(glm::greaterThanEqual(cell, box_.low + box_.size)))
    return std::nullopt;
  const uint32_t candidate = candidate_[box_.address(cell)];
  return candidate == UINT32_MAX ? std::nullopt : std::optional(candidate);
}

// The mean of the values of the open cells around a position, weighted by how near they are; all eight cells together
// have the weight 1.
template <typename Value>
double FlightPlanner::mean_of_open(const glm::dvec3& position_m, double least_open, double otherwise,
                                   const Value& value_of) const {
  const glm::dvec3 at = position_m / spacing_m_, low = glm::floor(at), part = at - low;
  double sum = 0, weights = 0;
  for (int k = 0; k < 8; ++k) {
    const glm::ivec3 corner(k & 1, k >> 1 & 1, k >> 2);
    const glm::ivec3 cell = glm::ivec3(low) + corner;
    if (glm::any(glm::lessThan(cell, box_.low)) || glm::any(glm::greaterThanEqual(cell, box_.low + box_.size)))
      continue;
    const size_t address = box_.address(cell);
    if (open_[address] == 0) continue;
    const glm::dvec3 share = glm::mix(1.0 - part, part, glm::dvec3(corner));
    const double weight = share.x * share.y * share.z;
    sum += weight * value_of(address, cell);
    weights += weight;
  }
  return weights > least_open ? sum / weights : otherwise;
}

double FlightPlanner::cost_at(const glm::dvec3& position_m, size_t slice, double otherwise) const {
  const Pull& pull = pull_[slice];
  const double mean = mean_of_open(position_m, 1e-6, INFINITY, [&](size_t address, const glm::ivec3& cell) {
    return cost_[slice][address] - pull.weight * glm::distance(glm::dvec3(cell) * spacing_m_, pull.point_m);
  });
  return std::isfinite(mean) ? mean + pull.weight * glm::distance(position_m, pull.point_m) : otherwise;
}

double FlightPlanner::gain_beyond_at(const glm::dvec3& position_m) const {
  return mean_of_open(position_m, 1e-6, 0.0,
                      [&](size_t address, const glm::ivec3&) { return static_cast<double>(gain_beyond_[address]); });
}

double FlightPlanner::cost_from(const glm::dvec3& position_m, size_t slice, double otherwise) const {
  const std::vector<float>& values = value(slice);
  // The plans of the cells on the other side of a wall are none of this side.
  return mean_of_open(position_m, 0.3, otherwise,
                      [&](size_t address, const glm::ivec3&) { return static_cast<double>(values[address]); });
}

}  // namespace sightline
