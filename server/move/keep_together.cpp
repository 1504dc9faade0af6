#include "server/move/keep_together.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <tuple>

#include "server/move/choose.h"

namespace sightline {
namespace {

// At most this many targets are tried as the first of a choice. If there are more, the lightest are only added to the
// others.
constexpr size_t kMostFirst = 8;
// Sums of equal weights may differ by this share, since they are added in different orders.
constexpr double kRounding = 1e-9;

struct TotalWeight {
  double required = 0, optional = 0;
};

TotalWeight total_weight(std::span<const TrackedTarget> targets, uint32_t kept) {
  TotalWeight total;
  for (size_t i = 0; i < targets.size(); ++i)
    if (kept >> i & 1u) (targets[i].required ? total.required : total.optional) += targets[i].weight;
  return total;
}

// -1, 0 or 1: a is less than, equal to or greater than b.
int compare(double a, double b) {
  if (std::abs(a - b) <= kRounding * std::max(std::abs(a), std::abs(b))) return 0;
  return a < b ? -1 : 1;
}
int compare(const TotalWeight& a, const TotalWeight& b) {
  const int required = compare(a.required, b.required);
  return required != 0 ? required : compare(a.optional, b.optional);
}

class Chooser {
 public:
  Chooser(std::span<const TrackedTarget> targets, const glm::dvec3& camera_m, const FitTogether& fit)
      : targets_(targets), camera_m_(camera_m), fit_(fit) {}

  bool fits(uint32_t kept, double room) {
    const bool several = (kept & (kept - 1)) != 0;
    return !several || fit_(only_kept(targets_, kept, memory_), room);
  }

  // The best choice of targets that fit with room to spare.
  uint32_t choose() {
    list_by_rank();
    uint32_t best = 0;
    for (size_t first = 0; first < std::min(count_, kMostFirst); ++first) {
      const uint32_t kept = grow_from(order_[first]);
      if (best == 0 || is_better(kept, best)) best = kept;
    }
    return best;
  }

  TotalWeight total(uint32_t kept) const { return total_weight(targets_, kept); }

 private:
  // Required targets before optional ones, then heavier ones before lighter ones.
  void list_by_rank() {
    count_ = 0;
    for (size_t i = 0; i < targets_.size(); ++i)
      if (targets_[i].steered()) order_[count_++] = i;
    std::sort(order_.begin(), order_.begin() + static_cast<ptrdiff_t>(count_), [&](size_t a, size_t b) {
      const auto rank = [&](size_t i) { return std::tuple(!targets_[i].required, -targets_[i].weight, i); };
      return rank(a) < rank(b);
    });
  }

  uint32_t grow_from(size_t first) {
    uint32_t kept = 1u << first;
    for (size_t k = 0; k < count_; ++k)
      if (const uint32_t more = kept | 1u << order_[k]; more != kept && fits(more, kRoomToReturn)) kept = more;
    return kept;
  }

  bool is_better(uint32_t kept, uint32_t than) {
    if (const int weight = compare(total(kept), total(than)); weight != 0) return weight > 0;
    return distance_m(kept) < distance_m(than);
  }
  double distance_m(uint32_t kept) {
    return glm::distance(camera_m_, weighted_center_m(only_kept(targets_, kept, memory_)));
  }

  const std::span<const TrackedTarget> targets_;
  const glm::dvec3 camera_m_;
  const FitTogether& fit_;
  TargetMemory memory_;
  std::array<size_t, kMaxTargets> order_{};
  size_t count_ = 0;
};

}  // namespace

std::span<const TrackedTarget> only_kept(std::span<const TrackedTarget> targets, uint32_t kept, TargetMemory& memory) {
  assert(targets.size() <= memory.size());
  std::copy(targets.begin(), targets.end(), memory.begin());
  for (size_t i = 0; i < targets.size(); ++i)
    if (!(kept >> i & 1u)) memory[i].weight = 0;
  return std::span(memory).first(targets.size());
}

uint32_t keep_together(std::span<const TrackedTarget> targets, const glm::dvec3& camera_m, uint32_t former,
                       const FitTogether& fit) {
  uint32_t all = 0;
  for (size_t i = 0; i < targets.size(); ++i)
    if (targets[i].steered()) all |= 1u << i;
  former &= all;
  Chooser chooser(targets, camera_m, fit);
  if (chooser.fits(all, former == all ? 1.0 : kRoomToReturn)) return all;
  const uint32_t best = chooser.choose();
  const bool former_holds = former != 0 && former != all && chooser.fits(former, 1.0);
  return former_holds && compare(chooser.total(best), chooser.total(former)) <= 0 ? former : best;
}

}  // namespace sightline
