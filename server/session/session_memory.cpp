// What a session carries from step to step, as bytes (state_fields.h lists it), and a session that goes on from them.
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "server/session/state_fields.h"

namespace sightline {

StateFields::Scene StateFields::scene_of(const SceneMirror& mirror) {
  Scene scene{.revision = mirror.revision_,
              .hash = mirror.hash_,
              .slot_count = mirror.slots_.size(),
              .moved = {},
              .rearranged = {},
              .free_slots = mirror.free_slots_};
  for (const uint32_t slot : mirror.moving_slots_) {
    const Instance& instance = mirror.slots_[slot];
    scene.moved.push_back(
        {instance.id, instance.pose, instance.velocity_mps, instance.angular_velocity_radps, instance.correction_m});
  }
  for (const uint32_t slot : mirror.rearranged_slots_) scene.rearranged.push_back({slot, mirror.slots_[slot].id});
  return scene;
}

std::vector<uint64_t> StateFields::ids_by_slot(const SceneMirror& mirror, const Scene& scene) {
  std::vector<uint64_t> ids(std::min<uint64_t>(scene.slot_count, kMaxInstances), 0);
  size_t placed = 0;
  std::set<uint64_t> rearranged;
  for (const auto& [slot, id] : scene.rearranged) {
    if (slot >= ids.size() || (id != 0 && (!mirror.slot_of(id) || !rearranged.insert(id).second))) return {};
    ids[slot] = id;
    placed += id != 0;
  }
  for (const auto& [id, slot] : mirror.slot_by_id_) {
    if (rearranged.contains(id)) continue;
    if (slot >= ids.size() || ids[slot] != 0) return {};
    ids[slot] = id;
    ++placed;
  }
  std::vector<bool> is_free(ids.size(), false);
  for (const uint32_t slot : scene.free_slots) {
    if (slot >= ids.size() || ids[slot] != 0 || is_free[slot]) return {};
    is_free[slot] = true;
  }
  return placed == mirror.size() && placed + scene.free_slots.size() == ids.size() ? ids : std::vector<uint64_t>{};
}

bool StateFields::resume(SceneMirror& mirror, const Scene& scene) {
  constexpr double kMostCorrectionM = 1e3;  // a tenth of a second at the fastest motion is far less
  const std::vector<uint64_t> ids = ids_by_slot(mirror, scene);
  if (ids.empty() && scene.slot_count > 0) return false;
  for (const Moved& moved : scene.moved)
    if (!(glm::length(moved.correction_m) < kMostCorrectionM) || !mirror.find(moved.id) ||
        !(std::abs(glm::length(moved.pose.rotation) - 1.0) < 1e-3))
      return false;
  std::vector<Instance> slots(ids.size());
  for (size_t slot = 0; slot < ids.size(); ++slot)
    if (ids[slot] != 0) slots[slot] = std::move(mirror.slots_[mirror.slot_by_id_.at(ids[slot])]);
  mirror.slots_ = std::move(slots);
  mirror.slot_by_id_.clear();
  mirror.record_hashes_.assign(ids.size(), 0);
  mirror.named_in_.assign(ids.size(), 0);
  mirror.free_slots_ = scene.free_slots;
  mirror.rearranged_slots_.clear();
  for (const auto& place : scene.rearranged) mirror.rearranged_slots_.insert(place.slot);
  mirror.hash_ = 0;
  for (uint32_t slot = 0; slot < ids.size(); ++slot)
    if (ids[slot] != 0)
      mirror.slot_by_id_.emplace(ids[slot], slot), mirror.slots_[slot].moving = false, mirror.place(slot);
  mirror.moving_slots_.clear();
  for (const Moved& moved : scene.moved) move(mirror, mirror.slot_by_id_.at(moved.id), moved);
  mirror.tidy_moving_slots();
  mirror.revision_ = scene.revision;
  ++mirror.version_, ++mirror.static_version_, ++mirror.moving_version_;
  return mirror.hash_ == scene.hash;
}

void StateFields::move(SceneMirror& mirror, uint32_t slot, const Moved& moved) {
  Instance& instance = mirror.slots_[slot];
  instance.pose = moved.pose;
  instance.velocity_mps = moved.velocity_mps, instance.angular_velocity_radps = moved.angular_velocity_radps,
  instance.correction_m = moved.correction_m;
  instance.moving = true;
  mirror.moving_slots_.push_back(slot);
  mirror.place(slot);
}

namespace {

Status unfit(const char* why) {
  return invalid("memory", why);
}

}  // namespace

uint64_t Session::memory_layout() {
  static const uint64_t number = [] {
    FieldLayout<StateFields> layout;
    layout(StateFields::Memory{});
    layout(std::array<uint8_t, ViewpointMap::kViewpoints>{});  // shares of viewpoints have a meaning only among as many
    return layout.number();
  }();
  return number;
}

void Session::write_memory(std::string& out) const {
  std::vector<StateFields::TrackOf> tracks;
  for (const auto& [id, track] : tracks_) tracks.push_back({id, track});
  std::ranges::sort(tracks, {}, &StateFields::TrackOf::id);
  FieldWriter<StateFields> write(out);
  write(StateFields::scene_of(mirror_), options_.targets, options_.shot.number, ticked_, sequence_, steps_, time_s_,
        tracks, derived_moving_, former_ids_, stepper_.carried());
}

Status Session::resume(uint64_t layout, std::string_view memory) {
  if (layout != memory_layout()) return unfit("was written by a version of the program that carries other data");
  FieldReader<StateFields> read(memory);
  StateFields::Memory found;
  read(found);
  if (read.failed() || !read.at_end() || !StateFields::possible(found.carried)) return unfit("is damaged");
  for (const StateFields::TrackOf& of : found.tracks)
    if (!StateFields::possible(of.track)) return unfit("is damaged");
  for (const Target& target : found.targets)
    if (!mirror_.find(target.instance_id)) return unfit("is of a session with other targets");
  if (found.targets.size() > kMaxTargets) return unfit("is damaged");
  if (!StateFields::resume(mirror_, found.scene)) return unfit("is of another scene");
  options_.targets = std::move(found.targets);
  options_.shot.number = found.shot_number;
  take_extents();
  ticked_ = found.ticked;
  sequence_ = found.sequence;
  steps_ = found.steps;
  time_s_ = found.time_s;
  tracks_.clear();
  for (const StateFields::TrackOf& of : found.tracks)
    if (mirror_.find(of.id)) tracks_.emplace(of.id, of.track);
  derived_moving_ = std::move(found.derived_moving);
  former_ids_ = std::move(found.former_ids);
  pending_dt_s_ = 0.0;
  pending_ticks_ = 0;
  pending_cut_ = false;
  stepper_.resume(std::move(found.carried));
  return {};
}

}  // namespace sightline
