// Figures of one or several runs side by side, as rows of text: from replies alone, and from the judged truth.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "client/page/session_page.h"
#include "client/truth/metrics.h"
#include "server/session/convention.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Prints rows aligned under the names of their columns.
void print_rows(std::ostream& out, std::span<const std::string> columns, std::span<const FigureRow> rows);

// Rows of the judged truth: what was seen and touched. `other` adds a second column.
std::vector<FigureRow> truth_rows(const RunMetrics& run, const std::optional<RunMetrics>& other);

// The camera of a reply in the canonical frame. `told` gives the parts of the lens that a reply does not carry.
CameraFrame frame_of(const v1::CameraReply& reply, const Convention& convention, const Lens& told = {});

// Sums over the replies of one run. Not thread-safe.
class ReplyFigures {
 public:
  explicit ReplyFigures(const Convention& convention) : convention_(convention) {}
  // Where the client's world is from now on. Call it before the tick's reply is added.
  void take(const v1::Tick& tick);
  void add(const v1::CameraReply& reply);
  uint64_t replies() const { return frames_.size(); }

 private:
  friend class ReplyTable;
  struct TargetSums {
    uint64_t replies = 0;
    double visible = 0.0, filtered = 0.0, distance_m = 0.0;
  };
  static constexpr std::array<const char*, 7> kStages{"queue", "scene", "bound", "sample", "aggregate", "move", "all"};

  Convention convention_;
  std::vector<CameraFrame> frames_;
  double travel_m_ = 0.0;  // between poses; cuts do not count
  std::map<uint64_t, TargetSums> targets_;
  std::map<std::string, uint64_t> states_;  // replies by "status ..." and "reason ..."
  uint64_t with_targets_ = 0, all_visible_ = 0, all_seen_ = 0;
  uint64_t cuts_ = 0, merged_ticks_ = 0, degraded_ = 0, recording_degraded_ = 0, body_overlaps_ = 0;
  std::array<std::vector<double>, kStages.size()> stage_us_;
};

// One column for each run. Motion is by finite differences of the poses. `names`: of targets, by id; others are called
// "target 10".
std::vector<FigureRow> reply_rows(std::span<const ReplyFigures* const> runs,
                                  const std::map<uint64_t, std::string>& names = {});

// "p50 0.210  p99 0.350 ms"; "not known" without values.
std::string spread_text(const std::vector<double>& values, double per_ms);

}  // namespace sightline
