#include "server/record/session_snapshot.h"

#include <algorithm>
#include <utility>

#include "server/scene/mirror.h"
#include "server/session/session.h"

namespace sightline {
namespace {

std::array<float, 4> rotation_of(const v1::Pose3& pose) {
  if (!pose.has_rotation()) return {0, 0, 0, 1};
  const v1::Quat& q = pose.rotation();
  return {static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z()), static_cast<float>(q.w())};
}

void set_rotation(v1::Pose3& pose, const std::array<float, 4>& r) {
  v1::Quat& q = *pose.mutable_rotation();
  q.set_x(r[0]);
  q.set_y(r[1]);
  q.set_z(r[2]);
  q.set_w(r[3]);
}

void set_position(v1::Pose3& pose, const std::array<double, 3>& p) {
  pose.mutable_position()->set_x(p[0]);
  pose.mutable_position()->set_y(p[1]);
  pose.mutable_position()->set_z(p[2]);
}

template <typename Number, size_t N>
void put(google::protobuf::RepeatedField<Number>& out, const std::array<Number, N>& values) {
  for (const Number value : values) out.Add(value);
}

// Reads element i of a packed array, N numbers.
template <typename Number, size_t N>
void take(const google::protobuf::RepeatedField<Number>& packed, int i, std::array<Number, N>& out) {
  std::copy_n(packed.data() + static_cast<size_t>(i) * N, N, out.begin());
}

template <typename Message>
void merge(const Message& change, std::optional<Message>& into) {
  if (!into) into.emplace();
  into->MergeFrom(change);
}

}  // namespace

void SessionSnapshot::take_open(const v1::OpenSession& open) {
  *this = {};
  for (const v1::NodeBinding& binding : open.scene().bindings()) instances_[binding.id()].of_opening = true;
  for (const v1::NewInstance& given : open.instances()) {
    if (instances_.size() >= kMaxInstances) break;
    Instance& instance = instances_[given.id()];
    instance.of_opening = true;
    instance.given = std::make_unique<v1::NewInstance>(given);
    instance.rotation = rotation_of(given.pose());
  }
}

void SessionSnapshot::take_tick(v1::Tick tick, const TickStamp& stamp) {
  const size_t bytes = tick.ByteSizeLong();
  waiting_.push_back({std::move(tick), stamp, bytes});
  waiting_bytes_ += bytes;
  while (waiting_.size() > kMaxWaiting || (waiting_bytes_ > kMaxWaitingBytes && waiting_.size() > 1)) apply_oldest();
}

void SessionSnapshot::take_snapshot_tick(const v1::Tick& tick, uint64_t ticks, const TickStamp& stamp) {
  apply(tick, stamp);
  ticks_ += ticks > 0 ? ticks - 1 : 0;
}

// Rejections come before the reply that covers the ticks after them. So all ticks that still wait when the reply comes
// were applied.
void SessionSnapshot::take_reply(const v1::CameraReply& reply) {
  while (!waiting_.empty() && waiting_.front().tick.sequence() <= reply.sequence()) apply_oldest();
  if (!reply.has_pose()) return;
  camera_.emplace();
  *camera_->mutable_pose() = reply.pose();
  if (reply.has_velocity()) *camera_->mutable_velocity() = reply.velocity();
  if (reply.has_angular_velocity()) *camera_->mutable_angular_velocity() = reply.angular_velocity();
}

void SessionSnapshot::take_rejection(const v1::TickError& rejection) {
  const auto found = find_refused(waiting_, rejection,
                                  [](const WaitingTick& waiting) { return waiting.tick.sequence(); });
  if (found == waiting_.end()) return;
  waiting_bytes_ -= found->bytes;
  waiting_.erase(found);
}

void SessionSnapshot::apply_oldest() {
  const WaitingTick oldest = std::move(waiting_.front());
  waiting_.pop_front();
  waiting_bytes_ -= oldest.bytes;
  apply(oldest.tick, oldest.stamp);
}

void SessionSnapshot::apply(const v1::Tick& tick, const TickStamp& stamp) {
  // A session refuses such a tick; its rejection was lost.
  if (ticks_ > 0 && tick.sequence() <= sequence_) return;
  if (tick.has_world_shift()) shift_world({tick.world_shift().x(), tick.world_shift().y(), tick.world_shift().z()});
  if (tick.has_delta()) ++deltas_, apply_delta(tick.delta());
  apply_transforms(tick.transforms(), is_paused(tick));
  apply_terms(tick);
  ++ticks_;
  sequence_ = tick.sequence();
  time_s_ = tick.time_s();
  stamp_ = stamp;
}

// Nodes and instances of the opening that have not moved since are shifted by the session that the tick opens.
void SessionSnapshot::shift_world(const std::array<double, 3>& shift) {
  const auto move = [&](v1::Pose3& pose) {
    const v1::Vec3& p = pose.position();
    set_position(pose, {p.x() + shift[0], p.y() + shift[1], p.z() + shift[2]});
  };
  for (size_t axis = 0; axis < 3; ++axis) shift_[axis] += shift[axis];
  for (auto& [id, instance] : instances_) {
    if (instance.moved)
      for (size_t axis = 0; axis < 3; ++axis) instance.position[axis] += shift[axis];
    if (instance.added) move(*instance.given->mutable_pose());
  }
  if (camera_) move(*camera_->mutable_pose());
}

// As in Session::step_length_s: the tick's step is too short to count as time.
bool SessionSnapshot::is_paused(const v1::Tick& tick) const {
  const double passed_s = ticks_ > 0 ? tick.time_s() - time_s_ : 0.0;
  return !((tick.has_dt_s() ? tick.dt_s() : passed_s) >= kShortestStepS);
}

SessionSnapshot::Instance* SessionSnapshot::find(uint64_t id) {
  const auto found = instances_.find(id);
  if (found != instances_.end()) return found->second.there() ? &found->second : nullptr;
  // A node of the scene file need not have been named before.
  if ((id & kAssetIdBit) == 0 || instances_.size() >= kMaxInstances) return nullptr;
  Instance& node = instances_[id];
  node.of_opening = true;
  return &node;
}

bool SessionSnapshot::there(uint64_t id) const {
  const auto found = instances_.find(id);
  return found == instances_.end() ? (id & kAssetIdBit) != 0 : found->second.there();
}

void SessionSnapshot::apply_delta(const v1::SceneDelta& delta) {
  for (const uint64_t id : delta.removed_ids()) {
    Instance* instance = find(id);
    if (instance == nullptr) continue;
    const bool of_opening = instance->of_opening;
    *instance = {};
    instance->of_opening = instance->removed = of_opening;
    if (!of_opening) instances_.erase(id);
  }
  for (const v1::NewInstance& given : delta.added_instances()) {
    if (there(given.id()) || instances_.size() >= kMaxInstances) continue;
    Instance& instance = instances_[given.id()];
    instance.added = true;
    instance.given = std::make_unique<v1::NewInstance>(given);
    instance.rotation = rotation_of(given.pose());
  }
  for (const v1::AttributeChange& change : delta.changed_instances())
    if (Instance* instance = find(change.id()))
      instance->attributes = std::make_unique<v1::Attributes>(change.attributes());
}

void SessionSnapshot::apply_transforms(const v1::Transforms& wire, bool paused) {
  const int n = wire.ids_size();
  if (wire.positions_size() != 3 * n) return;
  const bool has_rotations = n > 0 && wire.rotations_size() == 4 * n;
  const bool has_velocities = n > 0 && wire.velocities_size() == 3 * n;
  const bool has_turns = n > 0 && wire.angular_velocities_size() == 3 * n;
  for (int i = 0; i < n; ++i) {
    Instance* instance = find(wire.ids(i));
    if (instance == nullptr) continue;
    const std::array<double, 3> before = instance->position;
    take(wire.positions(), i, instance->position);
    if (has_rotations) take(wire.rotations(), i, instance->rotation);
    if (has_velocities) take(wire.velocities(), i, instance->velocity);
    instance->angular_velocity = {};
    if (has_turns) take(wire.angular_velocities(), i, instance->angular_velocity);
    instance->turned |= has_rotations;
    // While the session is paused, an instance that did not move keeps its velocity: see Session.
    const bool keeps = paused && instance->moved && before == instance->position;
    instance->has_velocity = has_velocities || (keeps && instance->has_velocity);
    instance->moved = true;
  }
}

void SessionSnapshot::apply_terms(const v1::Tick& tick) {
  if (tick.has_targets()) targets_ = tick.targets();
  if (tick.has_observed_camera()) camera_ = tick.observed_camera();
  if (tick.has_lens()) lens_ = tick.lens();
  if (tick.has_shot()) shot_ = tick.shot();
  if (tick.has_limits()) merge(tick.limits(), limits_);
  // A preset resets settings and tuning. UNSPECIFIED enums and absent fields keep the former values, as merging does.
  if (tick.settings().preset() != v1::Settings::PRESET_UNSPECIFIED) settings_.reset(), tuning_.reset();
  if (tick.has_settings()) merge(tick.settings(), settings_);
  if (tick.has_tuning()) merge(tick.tuning(), tuning_);
}

v1::Tick SessionSnapshot::tick() const {
  v1::Tick out;
  out.set_sequence(sequence_);
  out.set_time_s(time_s_);
  if (shift_ != std::array<double, 3>{}) {
    v1::Vec3& shift = *out.mutable_world_shift();
    shift.set_x(shift_[0]), shift.set_y(shift_[1]), shift.set_z(shift_[2]);
  }
  // Rotations and velocities are sent for all moved instances or for none. The rotation of an added instance is in its
  // pose.
  bool any_rotation = false, any_velocity = false, any_turn = false;
  for (const auto& [id, instance] : instances_) {
    any_rotation |= instance.turned && !instance.added;
    any_turn |= instance.angular_velocity != std::array<float, 3>{};
    any_velocity |= instance.has_velocity && instance.velocity != std::array<float, 3>{};
  }
  for (const auto& [id, instance] : instances_) {
    if (instance.removed) out.mutable_delta()->add_removed_ids(id);
    if (instance.added) {
      v1::NewInstance& added = *out.mutable_delta()->add_added_instances();
      added = *instance.given;
      if (instance.moved) set_position(*added.mutable_pose(), instance.position);
      if (instance.turned) set_rotation(*added.mutable_pose(), instance.rotation);
      if (instance.attributes) *added.mutable_attributes() = *instance.attributes;
    } else if (instance.attributes) {
      v1::AttributeChange& change = *out.mutable_delta()->add_changed_instances();
      change.set_id(id);
      *change.mutable_attributes() = *instance.attributes;
    }
    if (!instance.moved) continue;
    v1::Transforms& moved = *out.mutable_transforms();
    moved.add_ids(id);
    put(*moved.mutable_positions(), instance.position);
    if (any_rotation) put(*moved.mutable_rotations(), instance.rotation);
    if (any_velocity)
      put(*moved.mutable_velocities(), instance.has_velocity ? instance.velocity : std::array<float, 3>{});
    if (any_turn) put(*moved.mutable_angular_velocities(), instance.angular_velocity);
  }
  add_targets(out);
  if (lens_) *out.mutable_lens() = *lens_;
  if (shot_) *out.mutable_shot() = *shot_;
  if (settings_) *out.mutable_settings() = *settings_;
  if (tuning_) *out.mutable_tuning() = *tuning_;
  if (limits_) *out.mutable_limits() = *limits_;
  if (camera_) {
    *out.mutable_observed_camera() = *camera_;
    out.mutable_observed_camera()->set_cut(true);
  }
  out.mutable_step_control()->set_merge_into_next(true);
  return out;
}

// A list of targets may only name existing instances, but its parts, and instances that it attaches or ignores, may
// have been removed since.
void SessionSnapshot::add_targets(v1::Tick& out) const {
  if (!targets_) return;
  v1::TargetList& list = *out.mutable_targets();
  const auto keep = [this](const auto& ids, auto& kept) {
    for (const uint64_t id : ids)
      if (there(id)) kept.Add(id);
  };
  for (const v1::Target& target : targets_->targets()) {
    if (!there(target.id())) continue;
    v1::Target& listed = *list.add_targets();
    listed = target;
    listed.clear_attached_ids();
    listed.clear_ignored_ids();
    listed.clear_part_ids();
    keep(target.attached_ids(), *listed.mutable_attached_ids());
    keep(target.ignored_ids(), *listed.mutable_ignored_ids());
    keep(target.part_ids(), *listed.mutable_part_ids());
  }
}

}  // namespace sightline
