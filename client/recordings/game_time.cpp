#include "client/recordings/game_time.h"

#include "client/base/text_table.h"

namespace sightline {
namespace {

constexpr uint64_t kFirstWindowNs = 1'000'000'000;

// The time of the first tick from `start_ns` on, or of the last one.
std::optional<double> tick_time_from(const Recording& recording, uint64_t start_ns, bool first) {
  const McapQuery query{.start_ns = start_ns,
                        .topics = {all_record_topics()[static_cast<size_t>(RecordTopic::kTick)].topic}};
  std::optional<double> time_s;
  v1::Tick tick;
  recording.reader().read(query, [&](const McapMessage& m) {
    if (tick.ParseFromArray(m.message.data.data(), static_cast<int>(m.message.data.size()))) time_s = tick.time_s();
    return !(first && time_s);
  });
  return time_s;
}

}  // namespace

std::optional<GameTime> game_time_of(const Recording& recording) {
  const std::optional<double> start_s = tick_time_from(recording, 0, true);
  if (!start_s) return std::nullopt;
  const uint64_t first_ns = recording.start_ns(), last_ns = recording.container().statistics.end_time_ns;
  // The last tick stands near the end; a window that grows finds it wherever it is.
  for (uint64_t window_ns = kFirstWindowNs; last_ns > first_ns && window_ns < last_ns - first_ns; window_ns *= 4)
    if (const auto end_s = tick_time_from(recording, last_ns - window_ns, false)) return GameTime{*start_s, *end_s};
  return GameTime{*start_s, tick_time_from(recording, 0, false).value_or(*start_s)};
}

std::string game_time_text(const GameTime& time) {
  return formatted("%.3f s, from %.3f s to %.3f s", time.duration_s(), time.start_s, time.end_s);
}

}  // namespace sightline
