// Two runs over the same ticks side by side: the replies that were recorded, and those of a replay.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "client/truth/judge.h"
#include "client/truth/metrics.h"
#include "client/drive/report.h"
#include "server/session/convention.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// A reply's camera in the canonical frame; `told` gives what of the lens no reply says.
CameraFrame frame_of(const v1::CameraReply& reply, const Convention& convention, const Lens& told = {});

// One run. Not thread-safe.
class ReplayFigures {
 public:
  explicit ReplayFigures(const Convention& convention) : convention_(convention) {}

  void add(const v1::CameraReply& reply);
  uint64_t replies() const { return frames_.size(); }

 private:
  friend std::vector<FigureRow> side_by_side(const ReplayFigures& recorded, const ReplayFigures& replayed);
  struct TargetSums {
    uint64_t replies = 0;
    double visible = 0.0, filtered = 0.0;
  };
  // By stage, in the order of the path, then the whole step.
  static constexpr std::array<const char*, 7> kStages{"queue",     "scene", "bound", "sample",
                                                      "aggregate", "move",  "step"};

  const Convention convention_;
  std::vector<CameraFrame> frames_;
  std::map<uint64_t, TargetSums> targets_;
  std::map<int, uint64_t> statuses_, reasons_;  // replies
  uint64_t all_seen_ = 0, cuts_ = 0, merged_ticks_ = 0, degraded_ = 0, body_overlaps_ = 0;
  std::array<std::vector<double>, kStages.size()> stage_us_;
};

// Rows of both; those that say nothing of either are left out. Motion is by finite differences of the poses.
std::vector<FigureRow> side_by_side(const ReplayFigures& recorded, const ReplayFigures& replayed);

}  // namespace sightline
