// The composition operator for N targets (paper 3.3): from depth maps to the set of targets that each candidate sees.
// The paper's {N, P_A, P_B, V} are the four values of two bits.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/aggregate/filter.h"
#include "server/aggregate/look_up.h"
#include "server/settings/aggregate_settings.h"

namespace sightline {

// A run of a list: [first, first + count).
struct MapRange {
  uint32_t first = 0;
  uint32_t count = 0;
};

// What has been sampled of the targets: maps_of_point[k] are the maps taken from point k, points_of_target[i] the points of
// target i. A target is seen from a place when at least `visibility_threshold` of its points are, [0, 1]; more than none in any case.
struct SampledPoints {
  std::span<const DepthMap> maps;
  std::span<const MapRange> maps_of_point;
  std::span<const MapRange> points_of_target;
  double visibility_threshold = 1.0;
};

bool is_enough(uint32_t seen, uint32_t points, double visibility_threshold);

// What hides the targets, by position: shares in [0, 1].
struct HiddenShares {
  std::vector<double> by_staying, by_passing;
  void reset(size_t positions) { by_staying.assign(positions, 0.0), by_passing.assign(positions, 0.0); }
};

// How hidden points count. `passes` has an entry for each mirror slot: 1 for occluders that may be gone at once.
struct HiddenWeights {
  std::span<const uint8_t> passes;
  std::span<const double> of_target;
  double weight = 1.0;  // of what is added, >= 0
};

// What many positions see, by one look at the maps for all that is asked of them. Memory is kept from call to call. Not
// thread-safe. Every call is O(positions * maps). At most 254 points a target.
class Composer {
 public:
  // The positions of the calls to come; what the view refers to must outlive them.
  void set_positions(const PlaceView& positions) { look_up_.set_places(positions); }

  // visible[i] becomes the set of targets that position i sees.
  void visibility(const SampledPoints& sampled, double relative_bias, std::vector<uint32_t>& visible);

  // Adds weight * the mean, by `of_target`, of the shares of each target's points that are hidden from position i, by what stays
  // and by what passes; nothing when all of them are 0. A position that no map shows counts as hidden by what stays. `hidden` is
  // as long as the positions.
  void add_hidden(const SampledPoints& sampled, double relative_bias, const HiddenWeights& weights, HiddenShares& hidden);

  // Both.
  void visibility_and_hidden(const SampledPoints& sampled, double relative_bias, const HiddenWeights& weights,
                             std::vector<uint32_t>& visible, HiddenShares& hidden);

 private:
  // What is asked of one target.
  struct Asked {
    uint32_t target = 0;
    MapRange points;
    bool hides = false;
    double each = 0.0;  // what one hidden point adds
    uint8_t least = 0;  // of points seen are enough
  };
  void compose(const SampledPoints& sampled, double relative_bias, const HiddenWeights& weights,
               std::vector<uint32_t>* visible, HiddenShares* hidden);
  void ask(const SampledPoints& sampled, const HiddenWeights& weights, bool visible, bool hidden);
  struct Tile;
  void compose_tile(const SampledPoints& sampled, Tile& tile, uint32_t* visible, HiddenShares* hidden);
  void count_points(const SampledPoints& sampled, const Asked& asked, Tile& tile);

  LookUp look_up_;
  std::vector<Asked> asked_;
};

// How many candidates see how much, by what the filter makes of it. `steered` has a bit for each target that counts.
struct SightCounts {
  uint32_t total = 0, all_visible = 0, some_visible = 0, none_visible = 0;
  std::vector<uint32_t> visible_by_target;
};
void count_sights(const CandidateSet& candidates, uint32_t steered, size_t target_count, SightCounts& counts);

}  // namespace sightline
