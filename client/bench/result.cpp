#include "client/bench/result.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "client/base/text_table.h"
#include "client/truth/metrics.h"

namespace sightline {
namespace {

using Windows = std::span<const MeasuredWindow>;
using Json = BenchJson;

// `value` of each window.
template <typename Value>
std::vector<double> each(Windows windows, Value value) {
  std::vector<double> values;
  for (const MeasuredWindow& window : windows) values.push_back(static_cast<double>(value(window)));
  return values;
}

template <typename Value>
double sum(Windows windows, Value value) {
  const std::vector<double> values = each(windows, value);
  return std::accumulate(values.begin(), values.end(), 0.0);
}

double per(double value, double count) {
  return count > 0.0 ? value / count : 0.0;
}

// One figure over several windows.
Json spread(const std::vector<double>& values) {
  return {{"median", percentile(values, 0.5)}, {"min", percentile(values, 0.0)}, {"max", percentile(values, 1.0)}};
}

// The spread of each percentile over the windows; `latencies` returns the latencies of one window.
template <typename Latencies>
Json figures(Windows windows, Latencies latencies) {
  std::vector<Quantiles> all;
  for (const MeasuredWindow& window : windows) all.push_back(quantiles_of(latencies(window)));
  const auto over = [&](auto Quantiles::*part) {
    std::vector<double> values;
    for (const Quantiles& q : all) values.push_back(static_cast<double>(q.*part));
    return values;
  };
  const std::vector<double> counts = over(&Quantiles::count);
  return {{"count", static_cast<uint64_t>(std::accumulate(counts.begin(), counts.end(), 0.0))},
          {"p50", spread(over(&Quantiles::p50))},
          {"p90", spread(over(&Quantiles::p90))},
          {"p99", spread(over(&Quantiles::p99))},
          {"p99_9", spread(over(&Quantiles::p999))},
          {"max", spread(over(&Quantiles::max))}};
}

double p50_of(const BenchWindow& window, BenchMetric metric) {
  return percentile(window.of(metric), 0.5);
}

Json echo_json(Windows windows) {
  const auto floor_us = [](const MeasuredWindow& w) {
    return p50_of(*w.echo, BenchMetric::kRoundTrip) + p50_of(w.daemon, BenchMetric::kStep);
  };
  const auto share = [&](const MeasuredWindow& w) {
    return per(p50_of(w.daemon, BenchMetric::kRoundTrip), floor_us(w));
  };
  const auto of = [](BenchMetric metric) { return [=](const MeasuredWindow& w) { return w.echo->of(metric); }; };
  return {{"round_trip_us", figures(windows, of(BenchMetric::kRoundTrip))},
          {"send_us", figures(windows, of(BenchMetric::kSend))},
          {"floor_us", spread(each(windows, floor_us))},
          {"share", spread(each(windows, share))},
          {"allowed_share", kAllowedOverFloor}};
}

double late_share(Windows windows) {
  return per(sum(windows, [](const auto& w) { return w.daemon.late; }),
             sum(windows, [](const auto& w) { return w.daemon.ticks(); }));
}

double degraded_share(Windows windows) {
  return per(sum(windows, [](const auto& w) { return w.daemon.degraded; }),
             sum(windows, [](const auto& w) { return w.daemon.replies; }));
}

Json windows_json(Windows windows, double window_s) {
  const auto range = [&](double p) {
    return relative_range(
        each(windows, [p](const auto& w) { return percentile(w.daemon.of(BenchMetric::kRoundTrip), p); }));
  };
  return {{"reported", windows.size()}, {"seconds", window_s}, {"p50_range", range(0.5)}, {"p99_range", range(0.99)}};
}

Json service_json(Windows windows, double window_s, size_t sessions) {
  const double seconds = window_s * static_cast<double>(windows.size());
  std::vector<double> served_hz;
  for (size_t i = 0; i < sessions; ++i)
    served_hz.push_back(per(sum(windows, [i](const auto& w) { return w.replies_by_session[i]; }), seconds));
  return {{"achieved_hz", per(std::accumulate(served_hz.begin(), served_hz.end(), 0.0), static_cast<double>(sessions))},
          {"least_served_hz", percentile(served_hz, 0.0)},
          {"most_served_hz", percentile(served_hz, 1.0)},
          {"late_share", late_share(windows)},
          {"degraded_share", degraded_share(windows)}};
}

Json bytes_json(Windows windows) {
  return {{"tick", per(sum(windows, [](const auto& w) { return w.daemon.tick_bytes; }),
                       sum(windows, [](const auto& w) { return w.daemon.of(BenchMetric::kSend).size(); }))},
          {"reply", per(sum(windows, [](const auto& w) { return w.daemon.reply_bytes; }),
                        sum(windows, [](const auto& w) { return w.daemon.replies; }))}};
}

Json cpu_json(Windows windows) {
  const bool watched = std::all_of(windows.begin(), windows.end(), [](const auto& w) { return w.daemon_cpu_us; });
  return {{"daemon", watched ? spread(each(windows, [](const auto& w) { return *w.daemon_cpu_us; })) : Json(nullptr)},
          {"generator", spread(each(windows, [](const auto& w) { return w.generator_cpu_us; }))}};
}

// ---- as text ----

// About three significant digits.
std::string micros(double us) {
  return us < 100.0 ? formatted("%.1f us", us) : us < 1e4 ? formatted("%.0f us", us) : formatted("%.1f ms", us / 1e3);
}

std::string median(const Json& spread) {
  return micros(spread["median"]);
}

std::string range(const Json& spread) {
  return micros(spread["min"]).append(" .. ").append(micros(spread["max"]));
}

void print_latencies(const Json& latencies, std::ostream& out) {
  Table table(
      {{""}, {"p50", true}, {"p90", true}, {"p99", true}, {"p99.9", true}, {"max", true}, {"p50 of the windows"}});
  for (const auto& [name, m] : latencies.items()) {
    std::vector<std::string> cells{name};
    for (const char* part : {"p50", "p90", "p99", "p99_9", "max"})
      cells.push_back(m["count"] == 0 ? "-" : median(m[part]));
    cells.push_back(m["count"] == 0 ? "" : range(m["p50"]));
    table.row(std::move(cells));
  }
  table.print(out);
}

void print_service(const Json& result, std::ostream& out) {
  const Json &service = result["service"], &ticks = result["ticks"], &bytes = result["message_bytes"];
  const double rate_hz = result["load"]["rate_hz"];
  const auto number = [](const Json& value) { return value.get<double>(); };
  out << formatted("replies       %.2f a second and session of %.2f wanted; least served %.2f, most %.2f\n",
                   number(service["achieved_hz"]), rate_hz, number(service["least_served_hz"]),
                   number(service["most_served_hz"]))
      << formatted("late          %.2f %% of the ticks took longer than the tick interval of %.1f ms\n",
                   100 * number(service["late_share"]), 1e3 / rate_hz)
      << formatted("degraded      %.2f %% of the replies\n", 100 * number(service["degraded_share"]))
      << "whole run     " << ticks["sent"] << " ticks sent: " << ticks["answered"] << " answered, " << ticks["merged"]
      << " merged, " << ticks["rejected"] << " rejected, " << ticks["lost"] << " lost\n"
      << formatted("messages      tick %.0f bytes, reply %.0f bytes\n", number(bytes["tick"]), number(bytes["reply"]));
  if (result["trouble"] != "") out << "trouble       " << result["trouble"].get<std::string>() << '\n';
}

void print_costs(const Json& result, std::ostream& out) {
  const Json &cpu = result["cpu_us_per_tick"], &memory = result["daemon_memory"];
  out << "CPU a tick    daemon " << (cpu["daemon"].is_null() ? "not watched" : median(cpu["daemon"])) << ", generator "
      << median(cpu["generator"]) << '\n';
  if (memory.is_null()) return;
  const auto mebibytes = [](const Json& bytes) { return formatted("%.1f MiB", bytes.get<double>() / (1 << 20)); };
  out << "daemon memory " << mebibytes(memory["start_bytes"]) << " at first, " << mebibytes(memory["scene_bytes"])
      << " with scene and one session, " << mebibytes(memory["sessions_bytes"]) << " with all";
  if (const Json& own = memory["per_session_bytes"]; !own.is_null())
    out << "; " << mebibytes(own) << " a further session";
  out << '\n';
}

void print_echo(const Json& result, std::ostream& out) {
  const Json& echo = result["echo"];
  if (echo.is_null()) return;
  const Json &own = echo["round_trip_us"], &share = echo["share"];
  const double middle = share["median"], least = share["min"], most = share["max"];
  out << "echo          p50 " << median(own["p50"]) << " (" << range(own["p50"]) << "), p99 " << median(own["p99"])
      << "\nagainst echo  round trip p50 " << median(result["latency_us"]["round_trip"]["p50"])
      << ", echo p50 + step p50 " << median(echo["floor_us"])
      << formatted(": %.2f x (%.2f .. %.2f), %s the %.2f x that is wanted\n", middle, least, most,
                   middle <= kAllowedOverFloor ? "within" : "over", kAllowedOverFloor);
}

}  // namespace

void BenchWindow::add(const BenchWindow& other) {
  for (size_t metric = 0; metric < kBenchMetrics; ++metric)
    us[metric].insert(us[metric].end(), other.us[metric].begin(), other.us[metric].end());
  replies += other.replies;
  late += other.late;
  degraded += other.degraded;
  tick_bytes += other.tick_bytes;
  reply_bytes += other.reply_bytes;
}

Quantiles quantiles_of(const std::vector<double>& values) {
  return {values.size(),
          percentile(values, 0.5),
          percentile(values, 0.9),
          percentile(values, 0.99),
          percentile(values, 0.999),
          percentile(values, 1.0)};
}

double relative_range(const std::vector<double>& values) {
  const double least = percentile(values, 0.0), most = percentile(values, 1.0);
  if (least == most) return 0.0;
  return least > 0.0 ? (most - least) / least : std::numeric_limits<double>::infinity();
}

bool are_stable(std::span<const Quantiles> round_trips) {
  if (round_trips.size() < kStableWindows) return false;
  std::vector<double> p50, p99;
  for (const Quantiles& window : round_trips.last(kStableWindows)) {
    if (window.count == 0) return false;
    p50.push_back(window.p50);
    p99.push_back(window.p99);
  }
  return relative_range(p50) <= 0.1 && relative_range(p99) <= 0.3;
}

BenchJson summarize(std::span<const MeasuredWindow> windows, const BenchJson& load) {
  Json latencies;
  for (size_t metric = 0; metric < kBenchMetrics; ++metric)
    latencies[std::string(kBenchMetricNames[metric])] = figures(
        windows, [&](const MeasuredWindow& w) { return w.daemon.us[metric]; });
  const bool echoed = std::all_of(windows.begin(), windows.end(), [](const auto& w) { return w.echo.has_value(); });
  const double window_s = load["window_s"];
  return {{"load", load},
          {"windows", windows_json(windows, window_s)},
          {"latency_us", latencies},
          {"service", service_json(windows, window_s, load["sessions"])},
          {"message_bytes", bytes_json(windows)},
          {"cpu_us_per_tick", cpu_json(windows)},
          {"echo", echoed ? echo_json(windows) : Json(nullptr)}};
}

void print_bench(const BenchJson& result, std::ostream& out) {
  const Json &load = result["load"], &windows = result["windows"];
  const auto text = [&](const char* field) { return load[field].get<std::string>(); };
  const auto percent = [](const Json& share) { return formatted("%.0f %%", 100 * share.get<double>()); };
  const auto count = [&](const char* field, const char* noun) {
    return load[field].dump().append(" ").append(noun).append(load[field] == 1 ? "" : "s");
  };
  out << count("sessions", "session") << " at " << formatted("%g Hz, ", load["rate_hz"].get<double>())
      << load["targets"] << " targets, " << load["moving"] << " moving of " << load["instances"] << " instances, "
      << load["triangles"] << " triangles, sampler " << text("sampler") << ", " << count("channels", "channel")
      << " to " << text("address") << '\n'
      << (result["stable"] ? "stable: " : "NOT STABLE: ") << windows["reported"] << " windows of " << windows["seconds"]
      << " s, of " << windows["seen"] << " seen; their p50 lie " << percent(windows["p50_range"]) << ", their p99 "
      << percent(windows["p99_range"]) << " apart\n\n";
  print_latencies(result["latency_us"], out);
  out << '\n';
  print_service(result, out);
  print_costs(result, out);
  print_echo(result, out);
}

}  // namespace sightline
