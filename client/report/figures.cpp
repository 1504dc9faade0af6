// The figures of a recording as texts.
#include <algorithm>

#include "client/truth/metrics.h"
#include "client/page/page_reply.h"
#include "client/report/digest.h"
#include "client/base/text_table.h"

namespace sightline {
namespace {

std::string percent(size_t part, size_t of) {
  return formatted("%.1f %%", of == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(of));
}

std::string plain(std::string word) {
  for (char& c : word) c = c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return word;
}

std::string spread(const std::vector<double>& values, double per_ms) {
  if (values.empty()) return "not known";
  return formatted("p50 %.3f  p99 %.3f ms", percentile(values, 0.5) / per_ms,
                   percentile(values, 0.99) / per_ms);
}

}  // namespace

std::vector<PageFigure> figures_of(const DigestFigures& figures,
                                   const std::map<uint64_t, std::string>& names) {
  std::vector<PageFigure> rows;
  const auto row = [&](std::string name, std::string value) {
    rows.push_back({std::move(name), {std::move(value)}});
  };
  for (const auto& [id, sums] : figures.targets) {
    const auto named = names.find(id);
    const std::string name = named == names.end() ? std::to_string(id) : named->second;
    const double count = static_cast<double>(std::max<size_t>(1, sums.replies));
    row("visible share: " + name, formatted("%.1f %%", 100 * sums.visible / count));
    row("filtered share: " + name, formatted("%.1f %%", 100 * sums.filtered / count));
    row("distance: " + name, formatted("%.2f m", sums.distance_m / count));
  }
  row("every target wholly seen", percent(figures.all_visible, figures.with_targets));
  for (const auto& [status, count] : figures.statuses)
    row("status " + plain(status), percent(count, figures.replies));
  for (const auto& [reason, count] : figures.reasons)
    row("reason " + plain(reason), percent(count, figures.replies));
  row("camera travel", formatted("%.1f m", figures.travel_m));
  row("cuts", std::to_string(figures.cuts));
  row("ticks merged into a later reply", std::to_string(figures.merged_ticks));
  row("degraded steps", std::to_string(figures.degraded));
  row("steps with a degraded recording", std::to_string(figures.recording_degraded));
  row("ticks refused", std::to_string(figures.rejections));
  row("faults", std::to_string(figures.faults));
  row("messages missing in the file", std::to_string(figures.missing));
  const std::vector<std::string> stages = page_stages();
  for (size_t i = 0; i < stages.size(); ++i) row("stage " + stages[i], spread(figures.stage_us[i], 1000.0));
  row("step, all stages", spread(figures.total_us, 1000.0));
  row("tick waits for the step", spread(figures.queue_us, 1000.0));
  row("from tick to reply, at the server", spread(figures.answer_ms, 1.0));
  return rows;
}

}  // namespace sightline
