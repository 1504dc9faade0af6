// The pages that the daemon serves to its operators: /metrics, /livez and /readyz.
#pragma once

#include "server/metrics/http_port.h"
#include "server/metrics/metric_families.h"

namespace sightline {

// /metrics: all families in Prometheus's text format.
// /livez:   200 while no thread hangs, otherwise 503 with the names of those that do.
// /readyz:  200 while the daemon is ready for sessions, otherwise 503 with the reason.
// What `source` refers to must outlive the pages.
HttpPort::Pages operator_pages(const MetricSource& source);

}  // namespace sightline
