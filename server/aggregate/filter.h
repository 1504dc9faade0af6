// Filters visibility over the last steps (paper 5, design 5). A passing fence post must not move the camera; a long
// occlusion must, and soon. There are two filters over the same history:
//   joint: the paper's, which exists only to reproduce the paper. A state is the set of targets seen at one step (for
//   two targets N, P_A,
//     P_B, V). The filter keeps a state that made up a share of at least alpha of the last n steps. Without such a
//     state it keeps N, nothing seen.
//   per target: the default. It filters each target by itself, with hysteresis and minimum times. Where A is visible in
//   every step and B
//     flickers, neither V nor P_A may reach alpha, so the joint filter says N; this filter keeps A.
//
// Both count known steps only. The paper's x_v / n becomes x_v / (known steps among the n), since the paper counts "all
// but out-of-bounds configurations". So a candidate that has just come into the bound has the state that it has now.
#pragma once

#include <cstdint>
#include <span>

#include "server/aggregate/history.h"
#include "server/settings/aggregate_settings.h"

namespace sightline {

// The times of a per-target filter in steps of the present length. A continuing occlusion is noticed after
// max((1 - off) window + 1, min_occlusion, hold) steps at the latest: 0.25 s with the defaults at 60 Hz.
struct FilterSteps {
  int window = 1;         // round(window_s / dt) in [1, 64]
  int min_occlusion = 1;  // rounded up, in [1, 64]
  int hold = 0;           // rounded up, in [0, 64]

  // How many steps back the filter looks. If all of them before the present step are unknown, the present step alone
  // decides.
  int memory() const;
};
// dt_s >= 0, the length of the present step; 0 gives the largest numbers of steps.
FilterSteps filter_steps(const FilterSettings& settings, double dt_s);

struct JointState {
  uint32_t visible_targets = 0;
  bool known = false;  // false: no step is known for all of `targets`, and the state is N
};
// The paper's filter over the newest n steps; n = 0 is n = 1. Only targets in the mask `targets` are part of the state
// and of the result, and a step counts if it is known for all of them. With alpha <= 0.5 several states can qualify:
// the most frequent is kept, of equally frequent ones the one that occurred last. `records` has one entry a target. The
// cost grows with the number of different states, which is at most min(n, 2^targets).
JointState joint_state(std::span<const VisibilityRecord> records, uint32_t targets, int n, double alpha);

struct VisibleShare {
  int visible = 0, known = 0;  // steps
  float share() const { return known > 0 ? static_cast<float>(visible) / static_cast<float>(known) : 0.0f; }
};
VisibleShare visible_share(const VisibilityRecord& record, int steps);

// The length of the present occlusion in known steps; 0 while the target is seen.
int occluded_steps(const VisibilityRecord& record);

// The state of the per-target filter for one candidate and target.
struct TargetSwitch {
  uint64_t held_until_step = 0;
  bool visible = false;
};
// One step of the per-target filter; `step` counts steps. It switches on only when the target is seen now, and off only
// when it is hidden now, so it never changes more often than its input. A step at which the target is unknown changes
// nothing. A second call in the same step changes nothing.
void update(TargetSwitch& state, const VisibilityRecord& record, uint64_t step, const FilterSteps& steps,
            const FilterSettings& settings);

}  // namespace sightline
