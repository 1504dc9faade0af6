#include "server/settings/rules.h"

#include "server/base/check.h"

namespace sightline {

Status check_rules(const CostWeights& w) {
  return check_some_weight("tuning.move.cost", "occlusion, distance and route", {w.occlusion, w.distance, w.route});
}

Status check_rules(const MoveSettings& s) {
  return check_range("settings.max_distance_m", s.max_distance_m, 1e-6, 10000.0);
}

Status check_rules(const FramingSettings& s) {
  const bool has_min = s.min_vertical_fov_rad != 0, has_max = s.max_vertical_fov_rad != 0;
  if (has_min == has_max) return {};
  return invalid(has_min ? "settings.max_vertical_fov_rad" : "settings.min_vertical_fov_rad",
                 "is absent: a zoom range needs both ends");
}

}  // namespace sightline
