#include "server/aggregate/history.h"

#include <algorithm>

namespace sightline {

void VisibilityHistory::resize(size_t slots) {
  if (slots == slots_.size()) return;
  slots_.assign(slots, Slot{});
  records_.assign(slots * targets_, VisibilityRecord{});
}

void VisibilityHistory::remap(std::span<const int> old_of_new) {
  const size_t count = old_of_new.size();
  scratch_.assign(slots_.size() * count, VisibilityRecord{});
  for (size_t slot = 0; slot < slots_.size(); ++slot)
    for (size_t i = 0; i < count; ++i)
      if (old_of_new[i] >= 0) scratch_[slot * count + i] = records_[slot * targets_ + old_of_new[i]];
  records_.swap(scratch_);
  targets_ = count;
}

void VisibilityHistory::bring_up_to_date(uint32_t slot) {
  const uint64_t passed = step_ - slots_[slot].step;
  if (passed == 0) return;
  slots_[slot].step = step_;
  for (VisibilityRecord* r = row(slot); r != row(slot) + targets_; ++r) {
    r->visible = passed < kHistorySteps ? r->visible << passed : 0;
    r->known = passed < kHistorySteps ? r->known << passed : 0;
  }
}

void VisibilityHistory::push(uint32_t slot, uint64_t owner, uint32_t visible_targets, uint32_t known_targets) {
  if (owner == 0 || owner != slots_[slot].owner) std::fill_n(row(slot), targets_, VisibilityRecord{});
  slots_[slot].owner = owner;
  bring_up_to_date(slot);
  for (size_t i = 0; i < targets_; ++i) {
    VisibilityRecord& r = row(slot)[i];
    const uint64_t known = known_targets >> i & 1u;
    r.known = (r.known & ~uint64_t{1}) | known;
    r.visible = (r.visible & ~uint64_t{1}) | (visible_targets >> i & known);
  }
}

void VisibilityHistory::copy(uint32_t from, uint32_t to) {
  std::copy_n(row(from), targets_, row(to));
  slots_[to] = slots_[from];
}

std::span<const VisibilityRecord> VisibilityHistory::records(uint32_t slot) {
  bring_up_to_date(slot);
  return {row(slot), targets_};
}

}  // namespace sightline
