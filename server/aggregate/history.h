// Visibility over the last 64 steps, one bit a step (paper 5, design 5). What a filter asks, how often a
// state occurred, is then a count of bits: its cost does not depend on how far back it looks, and the paper's
// O(n g^3) becomes O(g^3).
//
// A history belongs to a slot (for the cells of a lattice, their address) and to a target. Steps at which a
// slot was not pushed, because its cell was outside the bound, are unknown: neither seen nor hidden.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sightline {

inline constexpr int kHistorySteps = 64;

// One target from one slot. Bit 0 is the newest step, bit k the one k steps before.
struct VisibilityRecord {
  uint64_t visible = 0;  // never a bit that is not in `known`
  uint64_t known = 0;

  bool operator==(const VisibilityRecord&) const = default;
};

// The newest `steps` bits, steps in [0, 64].
constexpr uint64_t newest_steps(int steps) {
  return steps >= kHistorySteps ? ~uint64_t{0} : (uint64_t{1} << steps) - 1;
}

// Memory is 16 bytes for each slot and target, and 16 for each slot; it is reused, so that nothing is
// allocated unless the number of slots or targets grows. Nothing is touched for a slot that is not pushed.
// Not thread-safe.
class VisibilityHistory {
 public:
  // Forgets everything when `slots` differs from before. Slots are numbered [0, slots).
  void resize(size_t slots);

  // From now on target i is the one that had index old_of_new[i], or, with -1, one of which nothing is known.
  // At most 32 targets; none at the start.
  void remap(std::span<const int> old_of_new);

  // A step has passed, for every slot.
  void begin_step() { ++step_; }
  uint64_t step() const { return step_; }

  // Stores what a slot sees in this step: bit i of the masks is target i. A second push in the same step
  // replaces the first. `owner` tells whose slot it is: when it differs from the last push's, or is 0, the
  // past is forgotten first.
  void push(uint32_t slot, uint64_t owner, uint32_t visible_targets, uint32_t known_targets = 0xFFFFFFFF);

  // Makes `to` what `from` is: records and owner.
  void copy(uint32_t from, uint32_t to);

  // The records of a slot, one a target, as of this step. Valid until the next call of resize, remap or push.
  std::span<const VisibilityRecord> records(uint32_t slot);
  uint64_t owner(uint32_t slot) const { return slots_[slot].owner; }

  size_t slot_count() const { return slots_.size(); }
  size_t target_count() const { return targets_; }

 private:
  struct Slot {
    uint64_t owner = 0;
    uint64_t step = 0;  // to which its records are up to date
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
