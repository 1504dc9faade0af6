// Dynamic programming over a graph of places and stages of time, backwards from the last stage.
//
// A camera is at one place at each stage and pays that place's cost. Between a stage and the next it stays, or goes by
// up to `hops` edges; each edge adds its length times `cost_per_m`. The cost to go of a place at a stage is the least
// sum from there to the end, this stage included. A place whose cost is kBarredCost or more is not passed through
// either.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "client/ceiling/places.h"

namespace sightline {

inline constexpr float kBarredCost = 1e6f;

class CostsToGo {
 public:
  // `graph` must outlive the object.
  CostsToGo(const PlaceGraph& graph, double cost_per_m);

  // Goes one stage back in time. `cost`: of every place at that stage, >= 0. `hops` >= 0: the greatest number of edges
  // from there to the stage that was added before; not used at the first call.
  void add_stage_before(std::span<const float> cost, int hops);

  // By place, at the stage that was added last. Empty before the first.
  std::span<const float> costs() const { return costs_; }

 private:
  void hop();

  const PlaceGraph& graph_;
  const float cost_per_m_;
  std::vector<float> costs_, next_;
  std::vector<uint32_t> barred_;  // the barred places of the stage that was added last
};

}  // namespace sightline
