// A daemon's figures as text for a person.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <ostream>
#include <span>
#include <string>

#include "client/status/window.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// "2 d 3 h", "4 min 10 s", "12 s"
std::string duration_text(double seconds);

// The state of the daemon now: sessions, memory, limits that were hit, recording.
void print_state(std::ostream& out, const std::string& address, const v1::GetServerInfoResponse& info,
                 const v1::GetServerStatsResponse& stats);

// Prints one line for each session: what its camera shows, and has shown since it was opened. Those that see nothing
// come first, the longest of them at the top, then those that show the least of their targets.
void print_sessions(std::ostream& out, std::span<const v1::SessionFigures> sessions);

// Prints rates and a table of durations within `window`.
void print_window(std::ostream& out, const Window& window);

// The same as one object, by the names of Window and DurationRow.
nlohmann::ordered_json json_of(const Window& window);

}  // namespace sightline
