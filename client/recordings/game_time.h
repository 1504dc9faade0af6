// The game's own clock in a recording, beside the wall clock of its log times.
#pragma once

#include <optional>

#include "client/recordings/recording.h"

namespace sightline {

// Tick.time_s of the first and the last tick of the file. A snapshot tick has the time of the newest tick that it sums
// up.
struct GameTime {
  double start_s = 0.0;
  double end_s = 0.0;

  double duration_s() const { return end_s - start_s; }
};

// Reads the first and the last chunk that hold ticks. Empty when the file holds no tick that can be read.
std::optional<GameTime> game_time_of(const Recording& recording);

// "12.500 s, from 3.000 s to 15.500 s".
std::string game_time_text(const GameTime& time);

}  // namespace sightline
