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

uint32_t known_within(std::span<const VisibilityRecord> records, int steps) {
  uint32_t known = 0;
  for (size_t i = 0; i < records.size(); ++i)
    if (records[i].known & newest_steps(steps)) known |= 1u << i;
  return known;
}

int window_of(const FilterSettings& settings, const FilterSteps& steps) {
  switch (settings.mode) {
    case FilterMode::kNone:
      return 1;
    case FilterMode::kJoint:
      return std::max(settings.n, 1);
    case FilterMode::kPerTarget:
      return steps.window;
  }
  return 1;
}

}  // namespace

void TemporalVolume::begin_step(const Lattice& lattice, size_t places, std::span<const uint64_t> target_ids,
                                const FilterSettings& settings, double dt_s) {
  settings_ = settings;
  steps_ = filter_steps(settings, dt_s);
  lattice_slots_ = lattice.address_count();
  history_.resize(lattice_slots_ + places);
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

// The switches go along in every mode: a live session that changes its mode finds them where they would be.
void TemporalVolume::push(uint32_t slot, uint64_t owner, uint32_t visible_targets) {
  history_.push(slot, owner, visible_targets);
  const auto records = history_.records(slot);
  for (size_t i = 0; i < records.size(); ++i)
    update(switches(slot)[i], records[i], history_.step(), steps_, settings_);
}

void TemporalVolume::push(const Lattice& lattice, std::span<const uint32_t> visible_targets) {
  const auto& addresses = lattice.addresses();
  assert(addresses.size() == visible_targets.size());
  for (size_t i = 0; i < addresses.size(); ++i)
    push(addresses[i], lattice.owner(addresses[i]), visible_targets[i]);
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

TemporalVolume::Verdict TemporalVolume::judge(uint32_t slot, uint32_t steered) {
  const auto records = history_.records(slot);
  if (settings_.mode == FilterMode::kPerTarget)
    return {switched_on(slot), known_within(records, steps_.window)};
  const Verdict now{visible_now(records), known_within(records, 1)};
  if (settings_.mode == FilterMode::kNone) return now;
  const JointState joint = joint_state(records, steered, settings_.n, settings_.alpha);
  return {(now.visible & ~steered) | joint.visible_targets,
          (now.known & ~steered) | (joint.known ? steered : 0)};
}

void TemporalVolume::filter(std::span<const uint32_t> slots, std::span<const uint32_t> visible_now,
                            uint32_t steered, FilteredSights& out) {
  assert(slots.size() == visible_now.size());
  const size_t targets = history_.target_count();
  const auto all = static_cast<uint32_t>(newest_steps(static_cast<int>(targets)));
  const int window = window_of(settings_, steps_);
  out.target_count = targets;
  out.visible_targets.assign(visible_now.begin(), visible_now.end());
  out.known_targets.assign(slots.size(), all);
  out.visible_shares.resize(slots.size() * targets);
  for (size_t i = 0; i < slots.size(); ++i) {
    float* shares = out.visible_shares.data() + i * targets;
    if (slots[i] == kNoSlot) {
      for (size_t t = 0; t < targets; ++t) shares[t] = visible_now[i] >> t & 1u ? 1.0f : 0.0f;
      continue;
    }
    const Verdict verdict = judge(slots[i], steered & all);
    out.visible_targets[i] = verdict.visible;
    out.known_targets[i] = verdict.known;
    const auto records = history_.records(slots[i]);
    for (size_t t = 0; t < targets; ++t) shares[t] = visible_share(records[t], window).share();
  }
}

}  // namespace sightline
