#include "client/bench/window.h"

namespace sightline {

void BenchWindow::add(const BenchWindow& other) {
  for (size_t metric = 0; metric < kBenchMetrics; ++metric)
    us[metric].insert(us[metric].end(), other.us[metric].begin(), other.us[metric].end());
  replies += other.replies;
  late += other.late;
  degraded += other.degraded;
  tick_bytes += other.tick_bytes;
  reply_bytes += other.reply_bytes;
}

}  // namespace sightline
