// A load's result as a table and as JSON.
#include <iomanip>
#include <nlohmann/json.hpp>

#include "client/bench/result.h"
#include "client/base/text_table.h"

namespace sightline {
namespace {

// In the file's own order: it is read by people too.
using Json = nlohmann::ordered_json;

// Three figures that mean something, whatever the size.
std::string micros(double us) {
  return us < 100.0 ? formatted("%.1f us", us)
         : us < 1e4 ? formatted("%.0f us", us)
                    : formatted("%.1f ms", us / 1e3);
}

std::string between(const Spread& spread) {
  return micros(spread.least).append(" .. ").append(micros(spread.most));
}

std::string mebibytes(double bytes) {
  return formatted("%.1f MiB", bytes / (1 << 20));
}

double share(uint64_t part, uint64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

void print_metrics(const BenchResult& result, std::ostream& out) {
  constexpr int kName = 12, kCell = 11;
  out << std::left << std::setw(kName) << "" << std::right;
  for (const char* column : {"p50", "p90", "p99", "p99.9", "max"}) out << std::setw(kCell) << column;
  out << "   p50 of the windows\n";
  for (size_t i = 0; i < kBenchMetrics; ++i) {
    const MetricFigures& m = result.metrics[i];
    out << std::left << std::setw(kName) << kBenchMetricNames[i] << std::right;
    for (const Spread* figure : {&m.p50, &m.p90, &m.p99, &m.p999, &m.max})
      out << std::setw(kCell) << (m.count == 0 ? "-" : micros(figure->median));
    out << "   " << (m.count == 0 ? "" : between(m.p50)) << '\n';
  }
}

void print_service(const BenchResult& result, std::ostream& out) {
  const TickCounts& t = result.totals;
  out << formatted("replies       %.2f a second and session of %.2f wanted; least served %.2f, most %.2f\n",
                   result.achieved_hz, result.rate_hz, result.least_served_hz, result.most_served_hz)
      << formatted("late          %.2f %% of the ticks took longer than the tick interval of %.1f ms\n",
                   100 * share(result.late, result.ticks), 1e3 / result.rate_hz)
      << formatted("degraded      %.2f %% of the replies\n", 100 * share(result.degraded, result.replies))
      << "whole run     " << t.sent << " ticks sent: " << t.answered << " answered, " << t.merged
      << " merged, " << t.rejected << " rejected, " << t.lost << " lost\n"
      << formatted("messages      tick %.0f bytes, reply %.0f bytes\n", result.tick_bytes,
                   result.reply_bytes);
  if (!result.trouble.empty()) out << "trouble       " << result.trouble << '\n';
}

void print_costs(const BenchResult& result, std::ostream& out) {
  out << "CPU a tick    daemon "
      << (result.daemon_cpu_us ? micros(result.daemon_cpu_us->median) : "not watched") << ", generator "
      << micros(result.generator_cpu_us.median) << '\n';
  if (!result.memory) return;
  const BenchMemory& memory = *result.memory;
  const auto size = [](size_t bytes) { return mebibytes(static_cast<double>(bytes)); };
  out << "daemon memory " << size(memory.start) << " at first, " << size(memory.scene)
      << " with scene and one session, " << size(memory.sessions) << " with all, " << size(memory.after)
      << " after";
  if (const auto each = memory.per_session()) out << "; " << mebibytes(*each) << " a further session";
  out << '\n';
}

void print_echo(const BenchResult& result, std::ostream& out) {
  if (!result.echo) return;
  const EchoComparison& echo = *result.echo;
  out << "echo          p50 " << micros(echo.round_trip.p50.median) << " (" << between(echo.round_trip.p50)
      << "), p99 " << micros(echo.round_trip.p99.median) << "; CPU a tick: echo "
      << micros(echo.server_cpu_us.median) << ", generator " << micros(echo.generator_cpu_us.median) << '\n'
      << "against echo  round trip p50 " << micros(result.of(BenchMetric::kRoundTrip).p50.median)
      << ", echo p50 + step p50 " << micros(echo.floor_us.median)
      << formatted(": %.2f x (%.2f .. %.2f), %s the %.2f x that is wanted\n", echo.share.median,
                   echo.share.least, echo.share.most,
                   echo.share.median <= kAllowedOverFloor ? "within" : "over", kAllowedOverFloor);
}

Json json_of(const Spread& spread) {
  return {{"median", spread.median}, {"min", spread.least}, {"max", spread.most}};
}

Json json_of(const MetricFigures& m) {
  return {{"count", m.count},      {"p50", json_of(m.p50)},    {"p90", json_of(m.p90)},
          {"p99", json_of(m.p99)}, {"p99_9", json_of(m.p999)}, {"max", json_of(m.max)}};
}

Json json_of(const WindowFigures& w) {
  return {{"round_trip_p50_us", w.round_trip_p50_us},
          {"round_trip_p99_us", w.round_trip_p99_us},
          {"step_p50_us", w.step_p50_us},
          {"late_share", w.late_share},
          {"degraded_share", w.degraded_share},
          {"daemon_cpu_us_per_tick", w.daemon_cpu_us ? Json(*w.daemon_cpu_us) : Json(nullptr)}};
}

Json json_of(const BenchMemory& memory) {
  const auto each = memory.per_session();
  return {{"start_bytes", memory.start},
          {"scene_bytes", memory.scene},
          {"sessions_bytes", memory.sessions},
          {"after_bytes", memory.after},
          {"per_session_bytes", each ? Json(*each) : Json(nullptr)}};
}

Json json_of(const EchoComparison& echo) {
  return {{"round_trip_us", json_of(echo.round_trip)},
          {"send_us", json_of(echo.send)},
          {"floor_us", json_of(echo.floor_us)},
          {"share", json_of(echo.share)},
          {"allowed_share", kAllowedOverFloor},
          {"server_cpu_us_per_tick", json_of(echo.server_cpu_us)},
          {"generator_cpu_us_per_tick", json_of(echo.generator_cpu_us)}};
}

Json load_json(const BenchResult& result) {
  return {{"address", result.address},     {"sampler", result.sampler},     {"sessions", result.sessions},
          {"rate_hz", result.rate_hz},     {"targets", result.targets},     {"moving", result.moving},
          {"instances", result.instances}, {"triangles", result.triangles}, {"channels", result.channels}};
}

}  // namespace

void print_bench(const BenchResult& result, std::ostream& out) {
  out << result.sessions << (result.sessions == 1 ? " session" : " sessions")
      << formatted(" at %g Hz, ", result.rate_hz) << result.targets << " targets, " << result.moving
      << " moving of " << result.instances << " instances, " << result.triangles << " triangles, sampler "
      << result.sampler << ", " << result.channels << (result.channels == 1 ? " channel" : " channels")
      << " to " << result.address << '\n'
      << (result.stable ? "stable: " : "NOT STABLE: ") << result.windows << " windows of " << result.window_s
      << " s, of " << result.windows_seen << " seen"
      << formatted("; their p50 lie %.0f %%, their p99 %.0f %% apart\n\n", 100 * result.p50_range,
                   100 * result.p99_range);
  print_metrics(result, out);
  out << '\n';
  print_service(result, out);
  print_costs(result, out);
  print_echo(result, out);
}

std::string bench_json(const BenchResult& result) {
  Json metrics, course = Json::array();
  for (const WindowFigures& window : result.course) course.push_back(json_of(window));
  for (size_t i = 0; i < kBenchMetrics; ++i)
    metrics[std::string(kBenchMetricNames[i])] = json_of(result.metrics[i]);
  const TickCounts& t = result.totals;
  const Json json{{"load", load_json(result)},
                  {"stable", result.stable},
                  {"windows",
                   {{"reported", result.windows},
                    {"seen", result.windows_seen},
                    {"seconds", result.window_s},
                    {"p50_range", result.p50_range},
                    {"p99_range", result.p99_range},
                    {"course", course}}},
                  {"latency_us", metrics},
                  {"ticks",
                   {{"sent", t.sent},
                    {"answered", t.answered},
                    {"merged", t.merged},
                    {"rejected", t.rejected},
                    {"lost", t.lost}}},
                  {"service",
                   {{"achieved_hz", result.achieved_hz},
                    {"least_served_hz", result.least_served_hz},
                    {"most_served_hz", result.most_served_hz},
                    {"late_share", share(result.late, result.ticks)},
                    {"degraded_share", share(result.degraded, result.replies)}}},
                  {"message_bytes", {{"tick", result.tick_bytes}, {"reply", result.reply_bytes}}},
                  {"cpu_us_per_tick",
                   {{"daemon", result.daemon_cpu_us ? json_of(*result.daemon_cpu_us) : Json(nullptr)},
                    {"generator", json_of(result.generator_cpu_us)}}},
                  {"daemon_memory", result.memory ? json_of(*result.memory) : Json(nullptr)},
                  {"echo", result.echo ? json_of(*result.echo) : Json(nullptr)},
                  {"trouble", result.trouble}};
  return json.dump(2).append("\n");
}

}  // namespace sightline
