// Visibility over the last 64 steps, one bit a step (paper 5, design 5). A filter counts how often a state occurred,
// which is then a count of bits. Its cost does not depend on the number of steps n, so the paper's O(n g^3) becomes
// O(g^3).
//
// Each slot (for the cells of a lattice, their address) has a history for each target. Steps in which a slot was not
// pushed, because its cell was outside the bound, are unknown: neither seen nor hidden.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sightline {

inline constexpr int kHistorySteps = 64;

// The history of one target from one slot. Bit 0 is the newest step, bit k is k steps older.
struct VisibilityRecord {
  uint64_t visible = 0;  // a subset of `known`
  uint64_t known = 0;

  bool operator==(const VisibilityRecord&) const = default;
};

// The newest `steps` bits, steps in [0, 64].
constexpr uint64_t newest_steps(int steps) {
  return steps >= kHistorySteps ? ~uint64_t{0} : (uint64_t{1} << steps) - 1;
}

// Takes 16 bytes for each slot and target, and 16 for each slot. Memory is reused: only a growing number of slots or
// targets allocates. Slots that are not pushed cost no time. Not thread-safe.
class VisibilityHistory {
 public:
  // Forgets everything when `slots` differs from before. Slots are numbered [0, slots).
  void resize(size_t slots);

  // Forgets everything, and keeps the memory.
  void forget() { std::fill(slots_.begin(), slots_.end(), Slot{}); }

  // Renumbers the targets: target i is now the one that had index old_of_new[i], or a new one for -1. At most 32
  // targets; none at the start.
  void remap(std::span<const int> old_of_new);

  // Begins a new step for every slot.
  void begin_step() { ++step_; }
  uint64_t step() const { return step_; }

  // Stores what a slot sees in this step; bit i of the masks is target i. A second push in the same step replaces the
  // first. `owner` identifies the cell that has the slot: when it is 0, or not the owner of the last push, the history
  // is cleared first.
  void push(uint32_t slot, uint64_t owner, uint32_t visible_targets, uint32_t known_targets = 0xFFFFFFFF);

  // Copies the records and the owner of slot `from` to slot `to`.
  void copy(uint32_t from, uint32_t to);

  // The records of a slot in this step, one for each target. Valid until the next call of resize, remap or push.
  std::span<const VisibilityRecord> records(uint32_t slot);
  uint64_t owner(uint32_t slot) const { return slots_[slot].owner; }

  size_t slot_count() const { return slots_.size(); }
  size_t target_count() const { return targets_; }

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  struct Slot {
    uint64_t owner = 0;
    uint64_t step = 0;  // the records are shifted up to this step
  };
  VisibilityRecord* row(uint32_t slot) { return records_.data() + slot * targets_; }
  void bring_up_to_date(uint32_t slot);

  uint64_t step_ = 0;
  size_t targets_ = 0;
  std::vector<Slot> slots_;
  std::vector<VisibilityRecord> records_;  // slot by slot, target by target
  std::vector<VisibilityRecord> scratch_;  // of remap
};

}  // namespace sightline
