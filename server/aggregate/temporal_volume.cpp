#include "server/aggregate/temporal_volume.h"

#include <algorithm>
#include <cassert>

namespace sightline {
namespace {

uint32_t visible_now(std::span<const VisibilityRecord> records) {
  uint32_t visible = 0;
  for (size_t i = 0; i < records.size(); ++i) visible |= static_cast<uint32_t>(records[i].visible & 1u) << i;
  return visible;
}

}  // namespace

void TemporalVolume::begin_step(const Lattice& lattice, size_t singles, std::span<const uint64_t> target_ids,
                                const FilterSettings& settings, double dt_s) {
  settings_ = settings;
  steps_ = filter_steps(settings, dt_s);
  lattice_slots_ = lattice.address_count();
  history_.resize(lattice_slots_ + singles);
  switches_.resize(history_.slot_count() * history_.target_count());
  if (!std::ranges::equal(target_ids, target_ids_)) follow(target_ids);
  history_.begin_step();
}

void TemporalVolume::follow(std::span<const uint64_t> target_ids) {
  const size_t before = target_ids_.size(), now = target_ids.size();
  old_of_new_.assign(now, -1);
  for (size_t i = 0; i < now; ++i) {
    const auto old = std::find(target_ids_.begin(), target_ids_.end(), target_ids[i]);
    if (old != target_ids_.end()) old_of_new_[i] = static_cast<int>(old - target_ids_.begin());
  }
  scratch_.assign(history_.slot_count() * now, TargetSwitch{});
  for (size_t slot = 0; slot < history_.slot_count(); ++slot)
    for (size_t i = 0; i < now; ++i)
      if (old_of_new_[i] >= 0) scratch_[slot * now + i] = switches_[slot * before + old_of_new_[i]];
  switches_.swap(scratch_);
  history_.remap(old_of_new_);
  target_ids_.assign(target_ids.begin(), target_ids.end());
}

// The switches are updated in every mode, so that a session can change its mode at any step.
void TemporalVolume::push(uint32_t slot, uint64_t owner, uint32_t visible_targets) {
  history_.push(slot, owner, visible_targets);
  const auto records = history_.records(slot);
  for (size_t i = 0; i < records.size(); ++i) update(switches(slot)[i], records[i], history_.step(), steps_, settings_);
}

void TemporalVolume::push(const Lattice& lattice, std::span<const uint32_t> visible_targets) {
  const auto& addresses = lattice.addresses();
  assert(addresses.size() == visible_targets.size());
  for (size_t i = 0; i < addresses.size(); ++i) push(addresses[i], lattice.owner(addresses[i]), visible_targets[i]);
}

void TemporalVolume::push_place(size_t place, const Lattice& lattice, const glm::dvec3& place_m,
                                uint32_t visible_targets) {
  const uint32_t slot = place_slot(place);
  const auto near = lattice.address_near(place_m);
  const uint64_t owner = near ? lattice.owner(*near) : 0;
  if (near && history_.owner(slot) != owner && history_.owner(*near) == owner) {
    history_.copy(*near, slot);
    std::copy_n(switches(*near), history_.target_count(), switches(slot));
  }
  push(slot, owner, visible_targets);
}

uint32_t TemporalVolume::switched_on(uint32_t slot) {
  uint32_t on = 0;
  for (size_t i = 0; i < history_.target_count(); ++i)
    if (switches(slot)[i].visible) on |= 1u << i;
  return on;
}

uint32_t TemporalVolume::filtered(uint32_t slot, uint32_t steered) {
  if (settings_.mode == FilterMode::kPerTarget) return switched_on(slot);
  const auto records = history_.records(slot);
  const uint32_t now = visible_now(records);
  if (settings_.mode == FilterMode::kNone) return now;
  return (now & ~steered) | joint_state(records, steered, settings_.n, settings_.alpha).visible_targets;
}

void TemporalVolume::filter(std::span<const uint32_t> slots, std::span<const uint32_t> visible_now, uint32_t steered,
                            std::vector<uint32_t>& visible_targets) {
  assert(slots.size() == visible_now.size());
  const auto all = static_cast<uint32_t>(newest_steps(static_cast<int>(history_.target_count())));
  visible_targets.assign(visible_now.begin(), visible_now.end());
  for (size_t i = 0; i < slots.size(); ++i)
    if (slots[i] != kNoSlot) visible_targets[i] = filtered(slots[i], steered & all);
}

}  // namespace sightline
