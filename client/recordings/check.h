// Checks whether a recording describes a possible session. A sound container can still hold an impossible one.
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
  uint64_t ticks = 0;  // that were applied, without a snapshot tick
  uint64_t replies = 0;
  uint64_t rejections = 0;
  uint64_t gap_messages = 0;  // reported as missing by Gaps
  uint64_t missing = 0;       // missing by the numbers of their topics
  uint64_t undecodable = 0;
  uint64_t troubles = 0;                       // all of them
  std::vector<SessionTrouble> first_troubles;  // at most kKeptTroubles

  static constexpr size_t kKeptTroubles = 16;
  bool sound() const { return troubles == 0; }
};

// Checks three rules. The numbers of applied ticks increase strictly, and so do those of replies. A reply is for the
// newest applied tick of the file, and its merged_ticks counts the applied ticks between that one and the reply before.
// No more messages are missing by the numbers of their topics than Gaps report.
//
// After missing messages, only rules that must still hold are checked. At the head of a later part, the numbers of
// ticks that were refused earlier are missing, and a Gap reports earlier losses. Neither says anything about the rest
// of the part.
SessionVerdict check_session(const Recording& recording);

}  // namespace sightline
