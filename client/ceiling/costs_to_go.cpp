#include "client/ceiling/costs_to_go.h"

#include <algorithm>
#include <cassert>

namespace sightline {

CostsToGo::CostsToGo(const PlaceGraph& graph, double cost_per_m)
    : graph_(graph), cost_per_m_(static_cast<float>(cost_per_m)) {}

void CostsToGo::add_stage_before(std::span<const float> cost, int hops) {
  assert(cost.size() == graph_.size());
  if (costs_.empty()) costs_.assign(cost.size(), 0.0f), hops = 0;
  for (int k = 0; k < hops; ++k) {
    hop();
    if (k + 1 == hops) break;
    for (const uint32_t place : barred_) costs_[place] = kBarredCost;
  }
  barred_.clear();
  for (uint32_t place = 0; place < costs_.size(); ++place) {
    costs_[place] += cost[place];
    if (cost[place] >= kBarredCost) barred_.push_back(place);
  }
}

void CostsToGo::hop() {
  next_ = costs_;
  for (size_t i = 0; i < costs_.size(); ++i) {
    float least = costs_[i];
    for (uint32_t edge = graph_.first[i]; edge < graph_.first[i + 1]; ++edge)
      least = std::min(least, costs_[graph_.to[edge]] + cost_per_m_ * graph_.length_m[edge]);
    next_[i] = least;
  }
  costs_.swap(next_);
}

}  // namespace sightline
