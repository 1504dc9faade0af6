#include "tests/bench/speed/map_agreement.h"

namespace sightline::bench {
namespace {

// Returns the share of a peer's answers that the step gives too, or -1 without any. Bit t of counts[k] says whether
// candidate k counts for target t.
double agreement(const std::vector<uint32_t>& seen, const std::vector<uint32_t>& counts, const StepDump& dump,
                 size_t targets) {
  size_t same = 0, all = 0;
  for (size_t k = 0; k < seen.size(); ++k)
    for (size_t t = 0; t < targets; ++t)
      if ((counts[k] >> t & 1u) != 0) {
        same += ((seen[k] ^ dump.sights.candidates.visible_targets[k]) >> t & 1u) == 0;
        ++all;
      }
  return all == 0 ? -1 : static_cast<double>(same) / static_cast<double>(all);
}

}  // namespace

void MapAgreement::Mean::add(double share) {
  if (share < 0) return;
  sum += share;
  ++frames;
}

void MapAgreement::add(const StepDump& dump, const std::vector<SeenFrom>& from, const std::vector<glm::dvec3>& place_m,
                       const std::vector<uint32_t>& seen) {
  clear_.assign(place_m.size(), 0);
  for (size_t t = 0; t < from.size(); ++t) find_clear(from[t], place_m, t);
  plain_.add(agreement(seen, clear_, dump, from.size()));
  on_rays_.add(on_rays(dump, from, place_m));
}

void MapAgreement::find_clear(const SeenFrom& from, const std::vector<glm::dvec3>& place_m, size_t t) {
  constexpr double kMargin_m = 0.01;
  for (const double beyond_m : {-kMargin_m, kMargin_m}) {
    moved_m_ = place_m;
    for (glm::dvec3& moved_m : moved_m_) moved_m += beyond_m * glm::normalize(moved_m - from.aim_m);
    peer_.look(std::span(&from, 1), moved_m_, beyond_m < 0 ? before_ : beyond_);
  }
  for (size_t k = 0; k < clear_.size(); ++k) clear_[k] |= static_cast<uint32_t>(before_[k] == beyond_[k]) << t;
}

double MapAgreement::on_rays(const StepDump& dump, const std::vector<SeenFrom>& from,
                             const std::vector<glm::dvec3>& place_m) {
  std::vector<uint32_t> on_ray_seen(place_m.size(), 0);
  std::vector<glm::dvec3> on_ray_m = place_m;
  clear_.assign(place_m.size(), 0);
  for (size_t t = 0; t < from.size(); ++t) {
    const MapRange& maps = dump.plan.now.maps_of_point[dump.plan.now.points_of_target[t].first];
    if (maps.count != 1) continue;
    const MapView& view = dump.plan.views[maps.first];
    for (size_t k = 0; k < place_m.size(); ++k) {
      const MapPoint at = project(view, place_m[k]);
      const glm::dvec3 direction = texel_direction(view, nearest_ray(at.x, view.jitter.x, view.width),
                                                   nearest_ray(at.y, view.jitter.y, view.height));
      on_ray_m[k] = view.eye_m + glm::distance(place_m[k], view.eye_m) * glm::normalize(direction);
    }
    peer_.look(std::span(&from[t], 1), on_ray_m, on_ray_);
    for (size_t k = 0; k < place_m.size(); ++k) on_ray_seen[k] |= on_ray_[k] << t;
    find_clear(from[t], on_ray_m, t);
  }
  return agreement(on_ray_seen, clear_, dump, from.size());
}

}  // namespace sightline::bench
