#include "server/metrics/operator_pages.h"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <string>

namespace sightline {
namespace {

HttpAnswer health(const std::string& trouble) {
  return trouble.empty() ? HttpAnswer{.body = "ok\n"} : HttpAnswer{.status = 503, .body = trouble + "\n"};
}

}  // namespace

HttpPort::Pages operator_pages(const MetricSource& source) {
  const DaemonState& state = source.state;
  const MakePage metrics = [source] {
    return HttpAnswer{.body = prometheus::TextSerializer().Serialize(metric_families(source)),
                      .content_type = "text/plain; version=0.0.4; charset=utf-8"};
  };
  return {{"/livez", {[&state] { return health(state.why_not_alive()); }}},
          {"/readyz", {[&state] { return health(state.why_not_ready()); }}},
          {"/metrics", {metrics, true}}};
}

}  // namespace sightline
