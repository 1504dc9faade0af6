// The temporal visibility volume (paper 5): the visibility history of every candidate, and what the filter makes of it.
// A volume belongs to one lattice. In each step in which time passes, after `Lattice::cover`:
//
//   volume.begin_step(lattice, singles, target_ids, settings, dt_s);
//   volume.push(lattice, visible_targets);           // what the covered cells see now
//   volume.push_place(k, lattice, place, visible);   // candidates off the lattice, k in [0, singles)
//   volume.filter(slots, visible_now, steered, out); // slots: lattice.addresses(), volume.place_slot(k), ...
//
// A cell that leaves the bound and comes back keeps its history; the steps between are unknown. A cell that lost its
// address to another cell meanwhile has no history, and no cell has one after the lattice has changed its spacing.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/filter.h"
#include "server/aggregate/history.h"
#include "server/aggregate/lattice.h"

namespace sightline {

class TemporalVolume {
 public:
  // The slot of a candidate without a history: the filter returns what it sees now.
  static constexpr uint32_t kNoSlot = UINT32_MAX;

  // Begins a step with `singles` candidates off the lattice. Targets are known by id: a target that was there before
  // keeps its history, wherever it is in the list. At most kMaxTargets ids, no id twice. Settings may change from step
  // to step, the mode too.
  void begin_step(const Lattice& lattice, size_t singles, std::span<const uint64_t> target_ids,
                  const FilterSettings& settings, double dt_s);

  // Stores what every covered cell sees; parallel to lattice.addresses().
  void push(const Lattice& lattice, std::span<const uint32_t> visible_targets);

  // Stores what a candidate off the lattice sees, which may move from step to step. It keeps its history while it stays
  // nearest to the same lattice point. When it comes nearest to another point it takes over that point's history, or
  // has none where the point has none. Call after `push`.
  void push_place(size_t place, const Lattice& lattice, const glm::dvec3& place_m, uint32_t visible_targets);
  uint32_t place_slot(size_t place) const { return static_cast<uint32_t>(lattice_slots_ + place); }

  // Sets visible_targets[i] to the targets that the filter takes as seen from candidate i. The candidate has slot
  // slots[i] and sees visible_now[i] in this step; kNoSlot and repeated slots are allowed. Targets outside the mask
  // `steered` form no part of the joint state; in joint mode they are as visible_now says. O(candidates * targets),
  // however long the window; the joint mode with many targets costs more, see joint_state.
  void filter(std::span<const uint32_t> slots, std::span<const uint32_t> visible_now, uint32_t steered,
              std::vector<uint32_t>& visible_targets);

  // Forgets what every candidate has seen, and keeps the memory.
  void forget() { history_.forget(); }

  VisibilityHistory& history() { return history_; }

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  void follow(std::span<const uint64_t> target_ids);
  void push(uint32_t slot, uint64_t owner, uint32_t visible_targets);
  uint32_t switched_on(uint32_t slot);
  uint32_t filtered(uint32_t slot, uint32_t steered);
  TargetSwitch* switches(uint32_t slot) { return switches_.data() + slot * history_.target_count(); }

  FilterSettings settings_;  // of this step
  FilterSteps steps_;
  size_t lattice_slots_ = 0;
  std::vector<uint64_t> target_ids_;
  VisibilityHistory history_;
  std::vector<TargetSwitch> switches_;  // slot by slot, target by target
  std::vector<TargetSwitch> scratch_;
  std::vector<int> old_of_new_;
};

}  // namespace sightline
