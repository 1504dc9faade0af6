#include "client/truth/reports.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

void add_report(double said, double truth, ReportErrors& sums) {
  sums.false_visible += said >= 0.5 && truth < 0.5;
  sums.false_occluded += said < 0.5 && truth >= 0.5;
  sums.mean_absolute_error += std::abs(said - truth);
}

// Turns sums over pairs into shares and a mean.
void divide_by_pairs(const ReportMetrics& metrics, ReportErrors& errors) {
  const auto divide = [](double& sum, size_t n) { sum = n == 0 ? 0.0 : sum / static_cast<double>(n); };
  divide(errors.false_visible, metrics.hidden_pairs);
  divide(errors.false_occluded, metrics.pairs - metrics.hidden_pairs);
  divide(errors.mean_absolute_error, metrics.pairs);
}

bool half_hidden(const PictureTruth& picture, std::span<const uint64_t> ids) {
  return std::any_of(picture.targets.begin(), picture.targets.end(), [ids](const TargetTruth& target) {
    return target.visible_share() < 0.5 && std::find(ids.begin(), ids.end(), target.id) != ids.end();
  });
}

}  // namespace

ReportMetrics judge_reports(std::span<const FrameTruth> truths, std::span<const std::vector<ReportedShare>> reports) {
  ReportMetrics metrics;
  for (size_t i = 0; i < truths.size(); ++i) {
    if (!truths[i].picture) continue;
    for (const TargetTruth& target : truths[i].picture->targets) {
      const auto report = std::find_if(reports[i].begin(), reports[i].end(),
                                       [&](const ReportedShare& r) { return r.id == target.id; });
      if (report == reports[i].end() || target.alone_pixels == 0) continue;
      ++metrics.pairs;
      metrics.hidden_pairs += target.visible_share() < 0.5;
      add_report(report->visible_share, target.visible_share(), metrics.visible);
      add_report(report->filtered_share, target.visible_share(), metrics.filtered);
    }
  }
  divide_by_pairs(metrics, metrics.visible);
  divide_by_pairs(metrics, metrics.filtered);
  return metrics;
}

StatusMetrics judge_status(std::span<const FrameTruth> truths, std::span<const std::optional<bool>> tracking,
                           std::span<const uint64_t> required_ids) {
  StatusMetrics metrics;
  size_t lost = 0, lost_tracking = 0, half_hidden_tracking = 0;
  for (size_t i = 0; i < truths.size(); ++i) {
    if (!truths[i].picture || !tracking[i]) continue;
    const PictureTruth& picture = *truths[i].picture;
    ++metrics.pictures;
    lost += picture.fully_hidden();
    lost_tracking += picture.fully_hidden() && *tracking[i];
    half_hidden_tracking += half_hidden(picture, required_ids) && *tracking[i];
  }
  const auto share = [](size_t part, size_t of) {
    return of == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(of);
  };
  metrics.tracking_while_lost = share(lost_tracking, metrics.pictures);
  metrics.lost_called_tracking = share(lost_tracking, lost);
  metrics.tracking_while_half_hidden = share(half_hidden_tracking, metrics.pictures);
  return metrics;
}

}  // namespace sightline
