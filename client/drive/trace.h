// The trace of a drive as CSV: one line a reply.
#pragma once

#include <ostream>
#include <span>
#include <string>

#include "client/truth/judge.h"
#include "client/drive/player.h"

namespace sightline {

// Columns, header first: tick and times; pose (canonical frame, metres) and field of view; counts of
// candidates; status, reason and flags; latency and stage times; what the body touched; r_N and r_P of the
// frame; then for each target
// "<name>.<column>": what the service said of it, and the truth. Truth columns are empty where a frame was
// not judged. `truths` is empty or as long as `frames`.
void write_trace(std::ostream& out, const Scenario& scenario, std::span<const PlayedFrame> frames,
                 std::span<const FrameTruth> truths);

// As the wire names them: "TRACKING", "NEAREST_ALL_VISIBLE"; a number for a value that this build does not
// know.
std::string name_of(v1::TrackingStatus status);
std::string name_of(v1::MoveReason reason);

}  // namespace sightline
