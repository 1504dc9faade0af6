#include "server/aggregate/share_window.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sightline {
namespace {

// Number of newest steps that are compared with the steps before them. A single step could be an outlier.
constexpr size_t kNewest = 2;

}  // namespace

void ShareWindow::begin_step(std::span<const uint64_t> target_ids, double dt_s) {
  time_s_ += dt_s;
  for (size_t i = 0; i < target_ids.size(); ++i) {
    const auto track = std::find_if(tracks_.begin() + static_cast<ptrdiff_t>(std::min(i, tracks_.size())),
                                    tracks_.end(), [&](const Track& t) { return t.id == target_ids[i]; });
    const auto at = static_cast<size_t>(track - tracks_.begin());
    if (at == tracks_.size()) tracks_.push_back({.id = target_ids[i]});
    if (at != i) std::swap(tracks_[i], tracks_[at]);
  }
  tracks_.resize(target_ids.size());
}

void ShareWindow::add(size_t target, uint32_t seen, uint32_t points) {
  Track& track = tracks_[target];
  track.ring[track.added++ % kShareSteps] = {time_s_, seen, points};
  track.kept = std::min(track.kept + 1, kShareSteps);
  drop_old(track);
  if (has_changed(track)) track.kept = kNewest;
}

void ShareWindow::drop_old(Track& track) const {
  while (track.kept > 0 && time_s_ - track.newest(track.kept - 1).time_s >= kShareWindowS) --track.kept;
}

// The usual test whether two samples have different proportions. One seen and one hidden point are added, so that the
// variance is never 0.
bool ShareWindow::has_changed(const Track& track) const {
  double seen[2] = {}, points[2] = {};
  for (size_t back = 0; back < track.kept; ++back) {
    const Step& step = track.newest(back);
    seen[back >= kNewest] += step.seen, points[back >= kNewest] += step.points;
  }
  if (points[0] == 0 || points[1] == 0) return false;
  const double pooled = (seen[0] + seen[1] + 1) / (points[0] + points[1] + 2);
  const double variance = pooled * (1 - pooled) * (1 / points[0] + 1 / points[1]);
  return std::abs(seen[0] / points[0] - seen[1] / points[1]) > kShareSigmas * std::sqrt(variance);
}

std::optional<double> ShareWindow::share(size_t target) const {
  if (target >= tracks_.size()) return std::nullopt;
  const Track& track = tracks_[target];
  double seen = 0.0, points = 0.0;
  for (size_t back = 0; back < track.kept; ++back) {
    const Step& step = track.newest(back);
    const double weight = 1.0 - (time_s_ - step.time_s) / kShareWindowS;
    seen += weight * step.seen;
    points += weight * step.points;
  }
  if (points <= 0.0) return std::nullopt;
  return seen / points;
}

}  // namespace sightline
