// The targets' data before the first stage, and the functions by which the stages read it.
#include <algorithm>
#include <cassert>

#include "server/base/hash.h"
#include "server/move/sight_weight.h"
#include "server/step/opening.h"

namespace sightline {
namespace {

// A target slower than this counts as standing.
constexpr double kStandingMps = 0.2;

// Takes the world box of an instance into the extents of a target's body. The box of a thing that turns swings, so its
// two sides are averaged.
void include(const Instance& instance, TrackedTarget& view) {
  const Aabb& bounds = instance.geometry->bounds;
  const glm::dvec3 from_aim_m = transform_point(instance.world_from_instance, glm::dvec3(bounds.center())) - view.aim_m;
  glm::dvec3 half_m(0.0);
  for (int axis = 0; axis < 3; ++axis)
    half_m += glm::abs(instance.world_from_instance[axis]) * static_cast<double>(bounds.half_extent()[axis]);
  view.low_m = std::max(view.low_m, half_m.y - from_aim_m.y);
  view.high_m = std::max(view.high_m, half_m.y + from_aim_m.y);
  view.aside_m = std::max(view.aside_m, std::hypot(from_aim_m.x, from_aim_m.z) + (half_m.x + half_m.z) / 2);
}

// The aim point stays on the target's own instance: the middle of all pieces would swing with every limb.
TrackedTarget view_of(const StepInput& input, const Target& target, std::span<const TargetPiece> pieces) {
  const Instance& instance = *input.scene.find(target.instance_id);
  TrackedTarget view;
  const glm::dvec3 aim = target.aim_offset_m.value_or(glm::dvec3(instance.geometry->bounds.center()));
  view.aim_m = transform_point(instance.world_from_instance, aim);
  for (const TargetPiece& piece : pieces) {
    const Instance& of = input.scene.instances()[piece.slot];
    const double aside_m = &of == &instance ? 0.0 : glm::distance(view.aim_m, of.center_m);
    view.radius_m = std::max(view.radius_m, aside_m + of.radius_m);
    include(of, view);
  }
  view.velocity_mps = instance.velocity_mps;
  view.weight = target.weight;
  view.required = target.required;
  return view;
}

void add_slot(const SceneMirror& scene, uint64_t id, std::vector<uint32_t>& slots) {
  if (const auto slot = scene.slot_of(id)) slots.push_back(*slot);
}

// Skips ids that the mirror no longer holds, because a part or an attached instance may be removed before the client
// sends a new list.
void list_ignored_slots(const SceneMirror& scene, const Target& target, std::vector<uint32_t>& slots) {
  slots.clear();
  add_slot(scene, target.instance_id, slots);
  for (const uint64_t id : target.attached_ids) add_slot(scene, id, slots);
  for (const uint64_t id : target.ignored_ids) add_slot(scene, id, slots);
  for (const uint64_t id : target.part_ids) add_slot(scene, id, slots);
  std::sort(slots.begin(), slots.end());
  slots.erase(std::unique(slots.begin(), slots.end()), slots.end());
}

// Lists the target's own instance and its parts, without those that the mirror no longer holds and those that are
// switched off. The own instance alone counts even then. `part_extents` are those of this target, or empty.
void list_pieces(const StepInput& input, size_t target, std::span<const ExtentTable* const> part_extents,
                 std::vector<TargetPiece>& pieces) {
  pieces.clear();
  const Target& of = input.targets[target];
  const TargetPiece own{*input.scene.slot_of(of.instance_id),
                        target < input.extents.size() ? input.extents[target] : nullptr};
  if (of.part_ids.empty()) return pieces.push_back(own);
  if (input.scene.instances()[own.slot].attributes.visible) pieces.push_back(own);
  for (size_t j = 0; j < of.part_ids.size(); ++j)
    if (const auto slot = input.scene.slot_of(of.part_ids[j]);
        slot && input.scene.instances()[*slot].attributes.visible)
      pieces.push_back({*slot, j < part_extents.size() ? part_extents[j] : nullptr});
  if (pieces.empty()) pieces.push_back(own);
}

}  // namespace

void look_at_targets(const StepInput& input, TargetsNow& now) {
  now.tracked_targets.clear();
  now.ids.clear();
  now.weighted = 0;
  now.ignored_slots.resize(input.targets.size());
  now.pieces.resize(input.targets.size());
  auto part_extents = input.part_extents;
  for (size_t i = 0; i < input.targets.size(); ++i) {
    const Target& target = input.targets[i];
    const size_t parts = std::min(target.part_ids.size(), part_extents.size());
    list_pieces(input, i, part_extents.first(parts), now.pieces[i]);
    part_extents = part_extents.subspan(parts);
    now.tracked_targets.push_back(view_of(input, target, now.pieces[i]));
    now.ids.push_back(target.instance_id);
    if (target.weight > 0) now.weighted |= 1u << i;
    list_ignored_slots(input.scene, target, now.ignored_slots[i]);
  }
  now.steered = now.weighted;
}

TrackedTarget view_of_instance(const StepInput& input, uint64_t id) {
  const TargetPiece own{*input.scene.slot_of(id), nullptr};
  Target target;
  target.instance_id = id;
  return view_of(input, target, std::span(&own, 1));
}

void set_sight_weights(TargetsNow& now) {
  now.sight_weights.clear();
  const double optional = optional_share(now.tracked_targets);
  for (const TrackedTarget& target : now.tracked_targets) now.sight_weights.push_back(sight_weight(target, optional));
}

// Runs at every step, so that a prediction is available at once when it is switched on.
void observe_targets(const StepInput& input, const std::vector<TargetPast>& before, std::vector<TargetPast>& now) {
  now.clear();
  for (const Target& target : input.targets) {
    const auto known = std::ranges::find(before, target.instance_id, &TargetPast::id);
    TargetPast& past = now.emplace_back(known != before.end() ? *known
                                                              : TargetPast{target.instance_id, MotionPredictor()});
    past.predictor.configure({.ahead_s = input.settings.move.prediction_s});
    past.predictor.observe(input.dt_s, believed_pose(*input.scene.find(target.instance_id)));
  }
}

uint64_t hash_of(const TargetsNow& now, uint32_t mask) {
  uint64_t hash = 0;
  for (size_t i = 0; i < now.ids.size(); ++i)
    if (mask >> i & 1u) hash += hash64_bytes(std::as_bytes(std::span(&now.ids[i], 1)));
  return hash;
}

uint32_t kept_before(const TargetsNow& now, const TargetIds& dropped) {
  uint32_t kept = now.steered;
  for (size_t i = 0; i < now.ids.size(); ++i)
    if (std::ranges::find(dropped, now.ids[i]) != dropped.end()) kept &= ~(1u << i);
  return kept;
}

TargetIds dropped_ids(const TargetsNow& now, uint32_t kept) {
  TargetIds dropped;
  for (size_t i = 0; i < now.ids.size(); ++i)
    if ((now.steered & ~kept) >> i & 1u) dropped.push_back(now.ids[i]);
  return dropped;
}

const TargetPast& past_of(std::span<const TargetPast> pasts, uint64_t id) {
  const auto found = std::ranges::find(pasts, id, &TargetPast::id);
  assert(found != pasts.end());
  return *found;
}

uint32_t seen_of_late(const StepContext& step, const CarriedState& carried) {
  uint32_t seen = 0;
  for (size_t i = 0; i < step.target_count(); ++i)
    if (step.is_steered(i) && carried.shares.share(i).value_or(0.0) > kGlimpse) seen |= 1u << i;
  return seen;
}

bool targets_stand(const StepContext& step) {
  return std::ranges::none_of(step.targets.tracked_targets, [](const TrackedTarget& target) {
    return target.steered() && glm::length(target.velocity_mps) > kStandingMps;
  });
}

glm::dvec3 group_velocity_mps(const StepContext& step) {
  glm::dvec3 sum(0.0);
  double weight = 0;
  for (const TrackedTarget& t : step.targets.tracked_targets) sum += t.weight * t.velocity_mps, weight += t.weight;
  return weight > 0 ? sum / weight : sum;
}

}  // namespace sightline
