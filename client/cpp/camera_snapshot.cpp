#include "client/cpp/camera_snapshot.h"

#include <algorithm>

namespace sightline {
namespace {

void erase_id(google::protobuf::RepeatedField<uint64_t>& ids, uint64_t id) {
  ids.erase(std::remove(ids.begin(), ids.end(), id), ids.end());
}

void add(const v1::Vec3& shift, double sign, v1::Vec3& place) {
  place.set_x(place.x() + sign * shift.x()), place.set_y(place.y() + sign * shift.y()),
      place.set_z(place.z() + sign * shift.z());
}

}  // namespace

void CameraSnapshot::apply(const v1::Tick& tick) {
  if (tick.has_world_shift()) shift_world(tick.world_shift());
  apply_delta(tick.delta());
  move(tick.transforms());
  take_terms(tick);
  time_s_ = tick.time_s();
}

void CameraSnapshot::take_reply(const v1::CameraReply& reply) {
  camera_.emplace();
  *camera_->mutable_pose() = reply.pose();
  *camera_->mutable_velocity() = reply.velocity();
  *camera_->mutable_angular_velocity() = reply.angular_velocity();
  kept_ = reply.has_shot() ? std::optional(reply.shot()) : std::nullopt;
}

// The shot as it was asked for last, from where it is now.
void CameraSnapshot::go_on_with_shot(v1::OpenSession& request) const {
  if (request.has_shot()) request.mutable_shot()->clear_cut(), request.mutable_shot()->clear_blend_s();
  if (!kept_ || kept_->distance().asked() <= 0) return;
  v1::Shot& shot = *request.mutable_shot();
  if (!shot.has_side_rad() || shot.orbit_radps() != 0 || shot.either_side()) shot.set_side_rad(kept_->side().asked());
  shot.clear_either_side();
  if (!shot.has_height_rad()) shot.set_height_rad(kept_->height().asked());
  if (shot.far_case() == v1::Shot::FAR_NOT_SET) shot.set_distance(kept_->distance().asked());
  if (!shot.places().empty() || (kept_->place_x() == 0 && kept_->place_y() == 0)) return;
  v1::Shot::Place& place = *shot.add_places();
  place.set_x(kept_->place_x()), place.set_y(kept_->place_y());
}

// The opening is as it was before the world was shifted; the first tick shifts it.
v1::OpenSession CameraSnapshot::opening() const {
  v1::OpenSession request = first_;
  if (!camera_) return request;
  *request.mutable_camera() = camera_->pose();
  add(terms_.world_shift(), -1, *request.mutable_camera()->mutable_position());
  go_on_with_shot(request);
  return request;
}

void CameraSnapshot::shift_world(const v1::Vec3& shift) {
  add(shift, 1, *terms_.mutable_world_shift());
  for (auto& [id, change] : changes_) {
    if (change.added) add(shift, 1, *change.added->mutable_pose()->mutable_position());
    if (!change.position.empty())
      change.position[0] += shift.x(), change.position[1] += shift.y(), change.position[2] += shift.z();
  }
  if (camera_) add(shift, 1, *camera_->mutable_pose()->mutable_position());
}

std::vector<v1::Tick> CameraSnapshot::ticks(uint64_t next_sequence) const {
  if (!camera_) return {};
  std::vector<v1::Tick> ticks{terms_};
  *ticks[0].mutable_observed_camera() = *camera_;
  if (auto changed = delta()) *ticks[0].mutable_delta() = std::move(*changed);
  // Rotations are sent for all instances of a tick or for none.
  auto turned = transforms([](const Change& c) { return !c.rotation.empty(); });
  auto moved = transforms([](const Change& c) { return c.rotation.empty() && !c.position.empty(); });
  if (turned && moved) *ticks.emplace_back().mutable_transforms() = std::move(*moved);
  if (turned)
    *ticks[0].mutable_transforms() = std::move(*turned);
  else if (moved)
    *ticks[0].mutable_transforms() = std::move(*moved);
  for (size_t i = 0; i < ticks.size(); ++i) {
    ticks[i].set_sequence(next_sequence - (ticks.size() - i));
    ticks[i].set_time_s(time_s_);
    ticks[i].mutable_step_control()->set_merge_into_next(true);
  }
  return ticks;
}

CameraSnapshot::Change& CameraSnapshot::change(uint64_t id) {
  const auto [found, is_new] = changes_.try_emplace(id);
  if (is_new) found->second.order = orders_++;
  return found->second;
}

void CameraSnapshot::apply_delta(const v1::SceneDelta& delta) {
  for (const uint64_t id : delta.removed_ids()) {
    const auto known = changes_.find(id);
    const bool was_first = known == changes_.end() || known->second.removed || !known->second.added;
    if (known != changes_.end()) changes_.erase(known);
    if (was_first) change(id).removed = true;
    forget_in_targets(id);
  }
  for (const v1::NewInstance& added : delta.added_instances()) change(added.id()).added = added;
  for (const v1::AttributeChange& changed : delta.changed_instances())
    change(changed.id()).attributes = changed.attributes();
}

// A list of targets may name existing instances only.
void CameraSnapshot::forget_in_targets(uint64_t id) {
  if (!terms_.has_targets()) return;
  for (v1::Target& target : *terms_.mutable_targets()->mutable_targets()) {
    erase_id(*target.mutable_attached_ids(), id);
    erase_id(*target.mutable_ignored_ids(), id);
    erase_id(*target.mutable_part_ids(), id);
  }
}

void CameraSnapshot::move(const v1::Transforms& moved) {
  for (int i = 0; i < moved.ids_size(); ++i) {
    Change& changed = change(moved.ids(i));
    const double* position = moved.positions().data() + size_t{3} * static_cast<size_t>(i);
    changed.position.assign(position, position + 3);
    if (moved.rotations().empty()) continue;
    const float* rotation = moved.rotations().data() + size_t{4} * static_cast<size_t>(i);
    changed.rotation.assign(rotation, rotation + 4);
  }
}

void CameraSnapshot::take_terms(const v1::Tick& tick) {
  if (tick.has_targets()) *terms_.mutable_targets() = tick.targets();
  if (tick.has_lens()) *terms_.mutable_lens() = tick.lens();
  if (tick.has_shot()) *first_.mutable_shot() = tick.shot();
  if (tick.has_limits()) terms_.mutable_limits()->MergeFrom(tick.limits());
  // A preset resets the settings and the tuning.
  if (tick.settings().preset() != v1::Settings::PRESET_UNSPECIFIED) terms_.clear_settings(), terms_.clear_tuning();
  if (tick.has_settings()) terms_.mutable_settings()->MergeFrom(tick.settings());
  if (tick.has_tuning()) terms_.mutable_tuning()->MergeFrom(tick.tuning());
}

std::vector<CameraSnapshot::Entry> CameraSnapshot::in_order() const {
  std::vector<Entry> entries;
  for (const auto& [id, changed] : changes_) entries.emplace_back(id, &changed);
  std::ranges::sort(entries, {}, [](const Entry& entry) { return entry.second->order; });
  return entries;
}

std::optional<v1::SceneDelta> CameraSnapshot::delta() const {
  v1::SceneDelta delta;
  for (const auto& [id, changed] : in_order()) {
    if (changed->removed) delta.add_removed_ids(id);
    if (changed->added) *delta.add_added_instances() = *changed->added;
    if (!changed->attributes) continue;
    v1::AttributeChange& attributes = *delta.add_changed_instances();
    attributes.set_id(id);
    *attributes.mutable_attributes() = *changed->attributes;
  }
  if (delta.ByteSizeLong() == 0) return std::nullopt;
  return delta;
}

std::optional<v1::Transforms> CameraSnapshot::transforms(const std::function<bool(const Change&)>& takes) const {
  v1::Transforms moved;
  for (const auto& [id, changed] : in_order()) {
    if (!takes(*changed)) continue;
    moved.add_ids(id);
    moved.mutable_positions()->Add(changed->position.begin(), changed->position.end());
    moved.mutable_rotations()->Add(changed->rotation.begin(), changed->rotation.end());
  }
  if (moved.ids().empty()) return std::nullopt;
  return moved;
}

bool was_applied(const v1::TickError& error) {
  return (error.code() == v1::TickError::CODE_INTERNAL || error.code() == v1::TickError::CODE_UNAVAILABLE) &&
         error.field_violations().empty();
}

}  // namespace sightline
