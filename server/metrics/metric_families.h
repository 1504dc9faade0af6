// The figures of the daemon as Prometheus families. deploy/METRICS.md lists them for operators; a test compares both.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "server/gate/gate.h"
#include "server/service/daemon_state.h"
#include "server/service/parts.h"

namespace prometheus {
struct MetricFamily;
}

namespace sightline {

// Everything must outlive what is made with it.
struct MetricSource {
  const ServiceParts& parts;
  const DaemonState& state;
  std::function<GateCounts()> connections;
  std::function<uint64_t()> context_losses;
};

// All families as they are now, sorted by theme. Every family is there from the start, with the value 0 where nothing
// has been counted, so that a query never meets a missing series. Thread-safe; takes about a millisecond.
std::vector<prometheus::MetricFamily> metric_families(const MetricSource& source);

}  // namespace sightline
