// The temporal visibility volume (paper 5): the histories of every place that a step considers, and what the
// filter makes of them. One belongs to one lattice; in each step, after `Lattice::cover`:
//
//   volume.begin_step(lattice, places, target_ids, settings, dt_s);
//   volume.push(lattice, visible_targets);           // what the covered cells see now
//   volume.push_place(k, lattice, place, visible);   // and places that no lattice holds, k in [0, places)
//   volume.filter(slots, visible_now, steered, out); // of lattice.addresses(), volume.place_slot(k), ...
//
// A cell that leaves the bound and comes back has its history, the steps between unknown; one that lost its
// address to another cell meanwhile starts anew, and so do all when the lattice changes its spacing. In a
// step in which no time passes (dt = 0) none of this is called.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/filter.h"
#include "server/aggregate/history.h"
#include "server/aggregate/lattice.h"

namespace sightline {

// One entry a candidate, in the order of the slots given. Memory is reused from step to step.
struct FilteredSights {
  // Bit i: target i is taken as seen; as CandidateSet::visible_targets.
  std::vector<uint32_t> visible_targets;
  // Bit i: at least one step of the window says something about target i.
  std::vector<uint32_t> known_targets;
  std::vector<float> visible_shares;  // candidate by candidate, target by target
  size_t target_count = 0;

  // At which share of the known steps of the window (n steps, or window_s; without a filter the newest one)
  // the target was seen from there.
  float visible_share(size_t candidate, size_t target) const {
    return visible_shares[candidate * target_count + target];
  }
};

class TemporalVolume {
 public:
  // A candidate with no past: it is taken as it is now.
  static constexpr uint32_t kNoSlot = UINT32_MAX;

  // Counts a step, for `places` places beside the lattice. Targets are known by id: one that is there again
  // keeps its history, wherever it stands in the list; a new one starts unknown. At most kMaxTargets ids, no
  // id twice. Settings may change from step to step, the mode too.
  void begin_step(const Lattice& lattice, size_t places, std::span<const uint64_t> target_ids,
                  const FilterSettings& settings, double dt_s);

  // What every covered cell sees; parallel to lattice.addresses().
  void push(const Lattice& lattice, std::span<const uint32_t> visible_targets);

  // What a place sees that may move from step to step. Its past is its own while it stays nearest to one
  // lattice point; when it comes nearest to another, it takes over that one's past, or starts anew when there
  // is none. Call after `push`.
  void push_place(size_t place, const Lattice& lattice, const glm::dvec3& place_m, uint32_t visible_targets);
  uint32_t place_slot(size_t place) const { return static_cast<uint32_t>(lattice_slots_ + place); }

  // Candidate i is the one with slots[i] (a slot may be given more than once, or kNoSlot) and sees
  // visible_now[i] in this step. Targets outside the mask `steered` form no part of the joint state and are,
  // in joint mode, taken as of now. O(candidates * targets), whatever the window; the joint mode with many
  // targets costs more, see joint_state.
  void filter(std::span<const uint32_t> slots, std::span<const uint32_t> visible_now, uint32_t steered,
              FilteredSights& out);

  VisibilityHistory& history() { return history_; }

 private:
  struct Verdict {
    uint32_t visible = 0, known = 0;  // a bit a target
  };
  void follow(std::span<const uint64_t> target_ids);
  void push(uint32_t slot, uint64_t owner, uint32_t visible_targets);
  uint32_t switched_on(uint32_t slot);
  Verdict judge(uint32_t slot, uint32_t steered);
  TargetSwitch* switches(uint32_t slot) { return switches_.data() + slot * history_.target_count(); }

  FilterSettings settings_;  // of this step, as the next
  FilterSteps steps_;
  size_t lattice_slots_ = 0;
  std::vector<uint64_t> target_ids_;
  VisibilityHistory history_;
  std::vector<TargetSwitch> switches_;  // slot by slot, target by target
  std::vector<TargetSwitch> scratch_;
  std::vector<int> old_of_new_;
};

}  // namespace sightline
