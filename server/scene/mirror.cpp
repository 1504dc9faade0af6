#include "server/scene/mirror.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <unordered_set>
#include <utility>

namespace sightline {
namespace {

constexpr double kUnitTolerance = 1e-3;
constexpr double kMaxLinearEntry = 1e6;
constexpr double kMinAxisLength = 1e-9;
// A place that is 1e10 m away is then within 1e18 m in the frame of the instance, which Embree can compute with.
constexpr double kMaxInverseEntry = 1e8;

uint64_t next_identity() {
  static std::atomic<uint64_t> next{1};
  return next.fetch_add(1, std::memory_order_relaxed);
}

bool position_is_valid(const glm::dvec3& p) {
  const glm::dvec3 a = glm::abs(p);
  return a.x <= kMaxCoordinateM && a.y <= kMaxCoordinateM && a.z <= kMaxCoordinateM;  // false for NaN
}

bool rotation_is_valid(const glm::dquat& q) {
  return std::abs(glm::length(q) - 1.0) <= kUnitTolerance;
}

Status check_pose(const Pose& pose, const std::string& field) {
  if (!position_is_valid(pose.position_m))
    return invalid(field + ".position_m", "each coordinate must be finite and within 1e9 m");
  if (!rotation_is_valid(pose.rotation))
    return invalid(field + ".rotation", "must be a unit quaternion (length within 1e-3 of 1)");
  return {};
}

// How far the geometry lies from the instance's origin at most.
double reach_of(const Geometry& geometry, const glm::dmat3& linear) {
  const Affine map(linear[0], linear[1], linear[2], glm::dvec3(0.0));
  return glm::length(transform_point(map, geometry.center)) + geometry.radius_m * max_stretch(map);
}

Status check_attributes(const InstanceAttributes& attributes, const std::string& field) {
  if (attributes.opacity >= 0.0f && attributes.opacity <= 1.0f) return {};
  return invalid(field + ".opacity", "must lie in [0, 1]");
}

uint64_t hash_record(const Instance& instance) {
  static_assert(std::endian::native == std::endian::little, "the record is defined as little-endian words");
  const auto bits = [](double value) { return std::bit_cast<uint64_t>(value); };
  const InstanceAttributes& a = instance.attributes;
  const glm::dvec3& p = instance.pose.position_m;
  const glm::dquat& q = instance.pose.rotation;
  const glm::dmat3& m = instance.linear;
  const std::array<uint64_t, 21> record = {instance.id,
                                           instance.geometry->hash.high,
                                           instance.geometry->hash.low,
                                           uint64_t{std::bit_cast<uint32_t>(a.opacity)} << 32 | a.layers,
                                           uint64_t{a.occludes} | uint64_t{a.collides} << 1 | uint64_t{a.visible} << 2,
                                           bits(p.x),
                                           bits(p.y),
                                           bits(p.z),
                                           bits(q.x),
                                           bits(q.y),
                                           bits(q.z),
                                           bits(q.w),
                                           bits(m[0].x),
                                           bits(m[0].y),
                                           bits(m[0].z),
                                           bits(m[1].x),
                                           bits(m[1].y),
                                           bits(m[1].z),
                                           bits(m[2].x),
                                           bits(m[2].y),
                                           bits(m[2].z)};
  return hash64_bytes(std::as_bytes(std::span(record)));
}

// The turn in the world after `ahead_s`, of an instance that turns.
glm::dquat turn_of(const Instance& instance, double ahead_s) {
  const double rate_radps = glm::length(instance.angular_velocity_radps);
  return glm::angleAxis(rate_radps * ahead_s, instance.angular_velocity_radps / rate_radps);
}

}  // namespace

bool is_valid_linear(const glm::dmat3& linear) {
  double volume_at_most = 1.0;
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row)
      if (!(std::abs(linear[column][row]) <= kMaxLinearEntry)) return false;
    const double length = glm::length(linear[column]);
    if (length < kMinAxisLength) return false;
    volume_at_most *= length;
  }
  // Relative to the volume of a box with such edges, so that small is not taken for flat.
  if (!(std::abs(glm::determinant(linear)) > 1e-9 * volume_at_most)) return false;
  const glm::dmat3 inverse = glm::inverse(linear);
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row)
      if (!(std::abs(inverse[column][row]) <= kMaxInverseEntry)) return false;
  return true;
}

struct SceneMirror::Pending {
  std::unordered_set<uint64_t> removed, added, added_and_moved;
};

Pose believed_pose(const Instance& instance) {
  return {instance.pose.position_m + instance.correction_m, instance.pose.rotation};
}

glm::dvec3 travel_m(const Instance& instance, double ahead_s) {
  return instance.moving ? instance.velocity_mps * ahead_s : glm::dvec3(0.0);
}

bool turns(const Instance& instance) {
  constexpr double kSlowestRadps = 1e-6;  // slower, no prediction turns it by anything that counts
  return instance.moving && glm::length(instance.angular_velocity_radps) > kSlowestRadps;
}

Affine world_from_instance_ahead(const Instance& instance, double ahead_s) {
  Affine placed = instance.world_from_instance;
  if (turns(instance)) {
    const glm::dmat3 turned = glm::mat3_cast(turn_of(instance, ahead_s));
    for (int column = 0; column < 3; ++column) placed[column] = turned * placed[column];
  }
  placed[3] += travel_m(instance, ahead_s);
  return placed;
}

glm::dvec3 center_ahead_m(const Instance& instance, double ahead_s) {
  const glm::dvec3 travelled_m = instance.center_m + travel_m(instance, ahead_s);
  if (!turns(instance)) return travelled_m;
  const glm::dvec3 from_origin_m = instance.center_m - instance.world_from_instance[3];
  return travelled_m + (turn_of(instance, ahead_s) * from_origin_m - from_origin_m);
}

SceneMirror::SceneMirror() : identity_(next_identity()) {}

Status SceneMirror::apply(const SceneDelta& delta, const TransformUpdate& transforms) {
  if (Status ok = check(delta, transforms); !ok) return ok;
  if (!delta.empty()) {
    apply_structure(delta);
    ++revision_;
  }
  for (size_t i = 0; i < transforms.ids.size(); ++i) move(slot_by_id_.find(transforms.ids[i])->second, transforms, i);
  if (moving_slots_untidy_) tidy_moving_slots();
  if (!delta.empty() || !transforms.ids.empty()) ++version_;
  return {};
}

std::optional<uint32_t> SceneMirror::slot_of(uint64_t id) const {
  const auto it = slot_by_id_.find(id);
  return it == slot_by_id_.end() ? std::nullopt : std::optional(it->second);
}

const Instance* SceneMirror::find(uint64_t id) const {
  const auto slot = slot_of(id);
  return slot ? &slots_[*slot] : nullptr;
}

Status SceneMirror::check(const SceneDelta& delta, const TransformUpdate& transforms) {
  if (delta.base_revision && *delta.base_revision != revision_)
    return fail(ErrorCode::kFailedPrecondition, "base_revision",
                "the mirror is at revision " + std::to_string(revision_) + ", the delta is against " +
                    std::to_string(*delta.base_revision) + ": send the scene again");
  Pending pending;
  if (Status ok = check_structure(delta, pending); !ok) return ok;
  return check_transforms(transforms, pending);
}

Status SceneMirror::check_structure(const SceneDelta& delta, Pending& pending) const {
  for (size_t i = 0; i < delta.remove.size(); ++i) {
    if (!slot_by_id_.contains(delta.remove[i]))
      return fail(ErrorCode::kNotFound, indexed("remove", i), "no such instance");
    if (!pending.removed.insert(delta.remove[i]).second) return invalid(indexed("remove", i), "named twice");
  }
  if (size() - delta.remove.size() + delta.add.size() > kMaxInstances)
    return fail(ErrorCode::kResourceExhausted, "add", "a mirror holds at most 1,000,000 instances");
  for (size_t i = 0; i < delta.add.size(); ++i) {
    const uint64_t id = delta.add[i].id;
    if (Status ok = check_add(delta.add[i], indexed("add", i), delta.asset_ids_allowed); !ok) return ok;
    if (slot_by_id_.contains(id) && !pending.removed.contains(id))
      return fail(ErrorCode::kAlreadyExists, indexed("add", i) + ".id", "the id is taken");
    if (!pending.added.insert(id).second) return invalid(indexed("add", i) + ".id", "named twice");
  }
  std::unordered_set<uint64_t> changed;
  for (size_t i = 0; i < delta.change.size(); ++i) {
    const AttributeChange& change = delta.change[i];
    if (!will_exist(change.id, pending))
      return fail(ErrorCode::kNotFound, indexed("change", i) + ".id", "no such instance");
    if (!changed.insert(change.id).second) return invalid(indexed("change", i) + ".id", "named twice");
    if (Status ok = check_attributes(change.attributes, indexed("change", i) + ".attributes"); !ok) return ok;
  }
  return {};
}

Status SceneMirror::check_add(const NewInstance& instance, const std::string& field, bool asset_ids_allowed) const {
  if (instance.id == 0) return invalid(field + ".id", "0 is not an id");
  if (!asset_ids_allowed && (instance.id & kAssetIdBit) != 0)
    return invalid(field + ".id", "ids from 2^63 up belong to the nodes of a loaded scene");
  if (!instance.geometry) return invalid(field + ".geometry", "is missing");
  if (Status ok = check_pose(instance.pose, field + ".pose"); !ok) return ok;
  if (!is_valid_linear(instance.linear))
    return invalid(field + ".linear",
                   "must be finite and invertible, no entry beyond 1e6, and none of the inverse beyond 1e8");
  if (const double reach_m = reach_of(*instance.geometry, instance.linear); !(reach_m <= kMaxCoordinateM))
    return invalid(field + ".linear", "makes the instance too large: it must lie within 1e9 m of its own origin");
  return check_attributes(instance.attributes, field + ".attributes");
}

Status SceneMirror::check_transforms(const TransformUpdate& transforms, Pending& pending) {
  const auto& [ids, poses, velocities, turns, corrections] = transforms;
  if (poses.size() != ids.size()) return invalid("poses", "must be as many as ids");
  if (!velocities.empty() && velocities.size() != ids.size())
    return invalid("velocities_mps", "must be none or as many as ids");
  if (!turns.empty() && turns.size() != ids.size())
    return invalid("angular_velocities_radps", "must be none or as many as ids");
  if (!corrections.empty() && corrections.size() != ids.size())
    return invalid("corrections_m", "must be none or as many as ids");
  ++message_;
  for (size_t i = 0; i < ids.size(); ++i) {
    const auto slot = slot_by_id_.find(ids[i]);
    const bool stays = slot != slot_by_id_.end() && !pending.removed.contains(ids[i]);
    if (!stays && !pending.added.contains(ids[i]))
      return fail(ErrorCode::kNotFound, indexed("ids", i), "no such instance");
    const bool is_first = slot == slot_by_id_.end() ? pending.added_and_moved.insert(ids[i]).second
                                                    : std::exchange(named_in_[slot->second], message_) != message_;
    if (!is_first) return invalid(indexed("ids", i), "named twice");
    if (!position_is_valid(poses[i].position_m) || !rotation_is_valid(poses[i].rotation))
      return check_pose(poses[i], indexed("poses", i));
    if (!velocities.empty() && !is_finite(velocities[i]))
      return invalid(indexed("velocities_mps", i), "must be finite");
    if (!turns.empty() && !is_finite(turns[i]))
      return invalid(indexed("angular_velocities_radps", i), "must be finite");
  }
  return {};
}

bool SceneMirror::will_exist(uint64_t id, const Pending& pending) const {
  return pending.added.contains(id) || (slot_by_id_.contains(id) && !pending.removed.contains(id));
}

void SceneMirror::apply_structure(const SceneDelta& delta) {
  // A whole scene at once: as much memory as it takes, not the next power of two.
  if (delta.add.size() > 2 * slots_.size()) {
    slots_.reserve(slots_.size() + delta.add.size());
    record_hashes_.reserve(slots_.size() + delta.add.size());
    named_in_.reserve(slots_.size() + delta.add.size());
    slot_by_id_.reserve(slot_by_id_.size() + delta.add.size());
  }
  for (const uint64_t id : delta.remove) remove(id);
  for (const NewInstance& instance : delta.add) add(instance);
  for (const AttributeChange& attributes : delta.change) change(attributes);
}

void SceneMirror::remove(uint64_t id) {
  const auto it = slot_by_id_.find(id);
  const uint32_t slot = it->second;
  touch(slots_[slot]);
  moving_slots_untidy_ |= slots_[slot].moving;
  hash_ -= std::exchange(record_hashes_[slot], 0);
  slots_[slot] = Instance{};
  rearranged_slots_.insert(slot);
  free_slots_.push_back(slot);
  slot_by_id_.erase(it);
}

void SceneMirror::add(const NewInstance& instance) {
  if (free_slots_.empty()) {
    free_slots_.push_back(static_cast<uint32_t>(slots_.size()));
    slots_.emplace_back();
    record_hashes_.push_back(0);
    named_in_.push_back(0);
  }
  const uint32_t slot = free_slots_.back();
  free_slots_.pop_back();
  slot_by_id_.emplace(instance.id, slot);
  if (revision_ > 0) rearranged_slots_.insert(slot);
  Instance& added = slots_[slot];
  added.id = instance.id;
  added.geometry = instance.geometry;
  added.pose = {instance.pose.position_m, glm::normalize(instance.pose.rotation)};
  added.linear = instance.linear;
  added.attributes = instance.attributes;
  added.moving = instance.moving;
  added.radius_m = added.geometry->radius_m *
                   max_stretch(Affine(added.linear[0], added.linear[1], added.linear[2], glm::dvec3(0.0)));
  place(slot);
  touch(added);
  if (added.moving) moving_slots_.push_back(slot), moving_slots_untidy_ = true;
}

void SceneMirror::change(const AttributeChange& change) {
  const uint32_t slot = slot_by_id_.find(change.id)->second;
  Instance& instance = slots_[slot];
  if (instance.attributes == change.attributes) return;
  instance.attributes = change.attributes;
  refresh_hash(slot);
  touch(instance);
}

void SceneMirror::move(uint32_t slot, const TransformUpdate& transforms, size_t i) {
  Instance& instance = slots_[slot];
  instance.correction_m = transforms.corrections_m.empty() ? glm::dvec3(0.0) : transforms.corrections_m[i];
  instance.pose = {transforms.poses[i].position_m, glm::normalize(transforms.poses[i].rotation)};
  if (!transforms.velocities_mps.empty()) instance.velocity_mps = transforms.velocities_mps[i];
  if (!transforms.angular_velocities_radps.empty())
    instance.angular_velocity_radps = transforms.angular_velocities_radps[i];
  place(slot);
  if (instance.moving) return;
  touch(instance);  // it leaves the static set ...
  instance.moving = true;
  touch(instance);  // ... and enters the moving one
  moving_slots_.push_back(slot);
  moving_slots_untidy_ = true;
}

void SceneMirror::touch(const Instance& instance) {
  ++(instance.moving ? moving_version_ : static_version_);
}

void SceneMirror::place(uint32_t slot) {
  Instance& instance = slots_[slot];
  const glm::dmat3 linear = glm::mat3_cast(instance.pose.rotation) * instance.linear;
  instance.world_from_instance = Affine(linear[0], linear[1], linear[2],
                                        instance.pose.position_m + instance.correction_m);
  instance.center_m = transform_point(instance.world_from_instance, instance.geometry->center);
  refresh_hash(slot);
}

void SceneMirror::refresh_hash(uint32_t slot) {
  const uint64_t record = hash_record(slots_[slot]);
  hash_ += record - std::exchange(record_hashes_[slot], record);
}

// Only after the set of moving instances changed: a slot may have been freed, reused or named twice since.
void SceneMirror::tidy_moving_slots() {
  std::erase_if(moving_slots_, [this](uint32_t slot) { return !slots_[slot].moving; });
  std::sort(moving_slots_.begin(), moving_slots_.end());
  moving_slots_.erase(std::unique(moving_slots_.begin(), moving_slots_.end()), moving_slots_.end());
  moving_slots_untidy_ = false;
}

}  // namespace sightline
