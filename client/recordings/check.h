// Whether a recording tells a session that can have been: what a container that is sound can still have wrong.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/recordings/recording.h"

namespace sightline {

// Where: seconds of log time since the first message of the file.
struct SessionTrouble {
  double at_s = 0.0;
  std::string text;
};

struct SessionVerdict {
  uint64_t ticks = 0;  // that were applied, without one that stands for others
  uint64_t replies = 0;
  uint64_t rejections = 0;
  uint64_t gap_messages = 0;  // that Gaps say are missing
  uint64_t missing = 0;       // that the numbers of topics say are missing
  uint64_t undecodable = 0;
  uint64_t troubles = 0;                       // all of them
  std::vector<SessionTrouble> first_troubles;  // at most kKeptTroubles

  static constexpr size_t kKeptTroubles = 16;
  bool sound() const { return troubles == 0; }
};

// What must hold: applied ticks have strictly increasing numbers, and so have replies; a reply is for the newest applied
// tick of the file, and its merged_ticks is how many applied ones stand before that since the former reply; no more
// messages are missing by the numbers of their topics than Gaps tell of. Where some are missing only what must hold all
// the same is asked for. At the head of a later part numbers of ticks that were refused before are missing, and a Gap there
// tells of what was lost before: neither says anything of the rest of the part.
SessionVerdict check_session(const Recording& recording);

}  // namespace sightline
