// A simple reference for bit histories: lists of what was seen.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "server/aggregate/history.h"
#include "server/base/random.h"

namespace sightline {

enum class Seen { kUnknown, kHidden, kVisible };
using PlainPast = std::vector<Seen>;  // the newest last; before the first all is unknown

inline Seen steps_before(const PlainPast& past, size_t k) {
  return k < past.size() ? past[past.size() - 1 - k] : Seen::kUnknown;
}

inline VisibilityRecord as_record(const PlainPast& past) {
  VisibilityRecord record;
  for (size_t k = 0; k < kHistorySteps; ++k) {
    if (steps_before(past, k) != Seen::kUnknown) record.known |= uint64_t{1} << k;
    if (steps_before(past, k) == Seen::kVisible) record.visible |= uint64_t{1} << k;
  }
  return record;
}

inline std::vector<VisibilityRecord> as_records(const std::vector<PlainPast>& pasts) {
  std::vector<VisibilityRecord> records;
  for (const PlainPast& past : pasts) records.push_back(as_record(past));
  return records;
}

// A random past in runs, like those that passing occluders and a moving bound cause. Runs of seen and hidden steps are
// up to `longest` steps long; one run in `unknown_in` is unknown (0: never).
inline PlainPast random_past(CounterRandom& random, size_t length, uint32_t longest, uint32_t unknown_in) {
  PlainPast past;
  while (past.size() < length) {
    const Seen seen = unknown_in != 0 && random.next_below(unknown_in) == 0 ? Seen::kUnknown
                      : random.next_below(2) == 0                           ? Seen::kHidden
                                                                            : Seen::kVisible;
    const size_t run = 1 + random.next_below(longest);
    past.insert(past.end(), std::min(run, length - past.size()), seen);
  }
  return past;
}

// The joint filter, written as the paper states it.
struct PlainState {
  std::vector<bool> visible;  // by target
  bool known = false;
};
inline PlainState plain_joint(const std::vector<PlainPast>& pasts, int n, double alpha) {
  struct Occurrences {
    int count = 0, last_before = 0;
  };
  std::map<std::vector<bool>, Occurrences> occurred;
  int known = 0;
  for (int k = n - 1; k >= 0; --k) {
    std::vector<bool> state;
    bool all_known = true;
    for (const PlainPast& past : pasts) {
      all_known = all_known && steps_before(past, k) != Seen::kUnknown;
      state.push_back(steps_before(past, k) == Seen::kVisible);
    }
    if (!all_known) continue;
    ++known, ++occurred[state].count, occurred[state].last_before = k;
  }
  PlainState kept{std::vector<bool>(pasts.size(), false), known > 0};
  Occurrences best;
  for (const auto& [state, o] : occurred) {
    if (o.count < alpha * known - 1e-6) continue;
    if (best.count > o.count || (best.count == o.count && best.last_before < o.last_before)) continue;
    best = o, kept.visible = state;
  }
  return kept;
}

}  // namespace sightline
