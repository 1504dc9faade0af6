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

// A part of a list: [first, first + count).
struct MapRange {
  uint32_t first = 0;
  uint32_t count = 0;
};

// The sampled points of all targets: maps_of_point[k] are the maps taken from point k, points_of_target[i] the points
// of target i. A candidate sees a target when it sees at least the share `visibility_threshold`, [0, 1], of its points,
// and at least one point.
struct SampledPoints {
  std::span<const DepthMap> maps;
  std::span<const MapRange> maps_of_point;
  std::span<const MapRange> points_of_target;
  double visibility_threshold = 1.0;
};

bool is_enough(uint32_t seen, uint32_t points, double visibility_threshold);

// For each position, the share of the targets that is hidden, [0, 1], by occluders that stay and by occluders that
// pass.
struct HiddenShares {
  std::vector<double> by_staying, by_passing;
  void reset(size_t positions) { by_staying.assign(positions, 0.0), by_passing.assign(positions, 0.0); }
};

// How hidden points count. `passes` has an entry for each mirror slot: 1 for occluders that move and may soon be gone.
struct HiddenWeights {
  std::span<const uint8_t> passes;
  std::span<const double> of_target;
  double weight = 1.0;  // factor of the shares that are added, >= 0
};

// Finds what many positions see. Each call looks up every position in every map once, O(positions * maps). Memory is
// kept from call to call. Not thread-safe. At most 254 points a target.
class Composer {
 public:
  // Sets the positions for the following calls. The memory behind the view must outlive them.
  void set_positions(const PlaceView& positions) { look_up_.set_places(positions); }

  // Sets visible[i] to the set of targets that position i sees.
  void visibility(const SampledPoints& sampled, double relative_bias, std::vector<uint32_t>& visible);

  // Adds, for each position, weight * the mean over the targets (weighted by `of_target`) of the share of a target's
  // points that is hidden from there. Adds nothing when all target weights are 0. A position outside all maps counts as
  // hidden by occluders that stay. `hidden` has one entry a position.
  void add_hidden(const SampledPoints& sampled, double relative_bias, const HiddenWeights& weights,
                  HiddenShares& hidden);

  // Does both of the above with one pass over the maps.
  void visibility_and_hidden(const SampledPoints& sampled, double relative_bias, const HiddenWeights& weights,
                             std::vector<uint32_t>& visible, HiddenShares& hidden);

 private:
  // The work of one call for one target.
  struct Asked {
    uint32_t target = 0;
    MapRange points;
    bool hides = false;
    double each = 0.0;  // share that one hidden point adds
    uint8_t least = 0;  // this many seen points are enough
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

// Counts the candidates that see all, some or none of the targets in the mask `steered`, after the filter.
struct SightCounts {
  uint32_t total = 0, all_visible = 0, some_visible = 0, none_visible = 0;
  std::vector<uint32_t> visible_by_target;
};
void count_sights(const CandidateSet& candidates, uint32_t steered, size_t target_count, SightCounts& counts);

}  // namespace sightline
