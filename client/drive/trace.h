// The trace of a drive as CSV: one line a reply.
#pragma once

#include <ostream>
#include <span>
#include <string>

#include "client/drive/player.h"
#include "client/truth/judge.h"

namespace sightline {

// Writes a header, then one line for each reply. The first columns are the tick, times, the pose (canonical frame,
// metres) and the field of view. Counts of candidates, status, reason and flags follow, then latency, stage times,
// clearance, collision, and r_N and r_P of the frame. Last, for each target, "<name>.<column>" holds the reply's values
// and the truth. Truth columns are empty where a frame was not judged. `truths` is empty or as long as `frames`.
void write_trace(std::ostream& out, const Scenario& scenario, std::span<const PlayedFrame> frames,
                 std::span<const FrameTruth> truths);

}  // namespace sightline
