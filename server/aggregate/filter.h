// From what was seen in the last steps to what is taken as seen (paper 5, design 5): a fence post that passes
// must not move the camera, an occlusion that lasts must, and soon.
//
// Two filters over the same bits:
//   joint: the paper's. A state is the set of targets seen at one step (for two targets N, P_A, P_B, V). Kept
//     is a state that made up a share of at least alpha of the last n steps; when none did, N, nothing seen.
//   per target: the default. Each target by itself, with hysteresis and times. The joint filter turns a place
//     N although A was visible in every step and only B flickered, as neither V nor P_A reached alpha; this
//     one keeps A.
//
// Both look only at known steps. When some of the n steps are unknown, the paper's x_v / n becomes x_v / (the
// known ones of the n), as the paper counts "all but out-of-bounds configurations": a place that just came
// into the bound is what it is now.
#pragma once

#include <cstdint>
#include <span>

#include "server/aggregate/history.h"
#include "server/settings/aggregate_settings.h"

namespace sightline {

// The times of a per-target filter in steps. With steps of uneven length these are the steps that would fit
// if all had been as long as the present one. A lasting occlusion is noticed after max((1 - off) window + 1,
// min_occlusion, hold) steps at the latest: 0.25 s with the defaults at 60 Hz.
struct FilterSteps {
  int window = 1;         // round(window_s / dt) in [1, 64]
  int min_occlusion = 1;  // the least that are not shorter than it, in [1, 64]
  int hold = 0;           // likewise, in [0, 64]

  // How far back anything matters: a place unknown for all of that before now is what it is now.
  int memory() const;
};
// dt_s >= 0; at 0 the largest.
FilterSteps filter_steps(const FilterSettings& settings, double dt_s);

struct JointState {
  uint32_t visible_targets = 0;
  bool known = false;  // false: no step was known for all of `targets`; the state is then N, pessimistically
};
// The paper's filter over the newest n steps. Only the targets in the mask `targets` make up the state and
// are in the answer, and a step counts if it is known for all of them. With alpha <= 0.5 several states can
// qualify: the most frequent is kept, of equals the one that occurred last. n = 0 is n = 1. `records` has one
// for each target. At most min(n, 2^targets) states occur: for few targets the cost does not depend
// on n.
JointState joint_state(std::span<const VisibilityRecord> records, uint32_t targets, int n, double alpha);

struct VisibleShare {
  int visible = 0, known = 0;  // steps
  float share() const { return known > 0 ? static_cast<float>(visible) / static_cast<float>(known) : 0.0f; }
};
VisibleShare visible_share(const VisibilityRecord& record, int steps);

// How many known steps the present occlusion has lasted; 0 while the target is seen.
int occluded_steps(const VisibilityRecord& record);

// What the per-target filter remembers of one place and target.
struct TargetSwitch {
  uint64_t held_until_step = 0;
  bool visible = false;
};
// One step of the per-target filter; `step` counts steps. It turns on only when the target is seen now and
// off only when it is hidden now, so that it never changes more often than what it filters. A step at which
// the target is unknown changes nothing. Calling it twice in one step is the same as once.
void update(TargetSwitch& state, const VisibilityRecord& record, uint64_t step, const FilterSteps& steps,
            const FilterSettings& settings);

}  // namespace sightline
