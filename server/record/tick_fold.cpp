#include "server/record/tick_fold.h"

#include <algorithm>
#include <utility>

#include "server/scene/mirror.h"
#include "server/session/session.h"

namespace sightline {
namespace {

std::array<float, 4> rotation_of(const v1::Pose3& pose) {
  if (!pose.has_rotation()) return {0, 0, 0, 1};
  const v1::Quat& q = pose.rotation();
  return {static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z()),
          static_cast<float>(q.w())};
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

// Numbers n * i to n * i + n - 1 of a packed array.
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

void TickFold::take_open(const v1::OpenSession& open) {
  *this = {};
  for (const v1::NodeBinding& binding : open.scene().bindings()) entries_[binding.id()].of_opening = true;
  for (const v1::NewInstance& instance : open.instances()) {
    if (entries_.size() >= kMaxInstances) break;
    Entry& entry = entries_[instance.id()];
    entry.of_opening = true;
    entry.rotation = rotation_of(instance.pose());
  }
}

void TickFold::take_tick(v1::Tick tick, const TickStamp& stamp) {
  const size_t bytes = tick.ByteSizeLong();
  waiting_.push_back({std::move(tick), stamp, bytes});
  waiting_bytes_ += bytes;
  while (waiting_.size() > kMaxWaiting || (waiting_bytes_ > kMaxWaitingBytes && waiting_.size() > 1))
    fold_oldest();
}

void TickFold::take_folded(const v1::Tick& tick, uint64_t ticks, const TickStamp& stamp) {
  fold(tick, stamp);
  ticks_ += ticks > 0 ? ticks - 1 : 0;
}

// Refusals come before the answer that covers the ticks after them, so what still waits up to it was applied.
void TickFold::take_reply(const v1::CameraReply& reply) {
  while (!waiting_.empty() && waiting_.front().tick.sequence() <= reply.sequence()) fold_oldest();
  if (!reply.has_pose()) return;
  camera_.emplace();
  *camera_->mutable_pose() = reply.pose();
  if (reply.has_velocity()) *camera_->mutable_velocity() = reply.velocity();
}

void TickFold::take_rejection(const v1::TickError& rejection) {
  const auto found =
      find_refused(waiting_, rejection, [](const WaitingTick& waiting) { return waiting.tick.sequence(); });
  if (found == waiting_.end()) return;
  waiting_bytes_ -= found->bytes;
  waiting_.erase(found);
}

void TickFold::fold_oldest() {
  const WaitingTick oldest = std::move(waiting_.front());
  waiting_.pop_front();
  waiting_bytes_ -= oldest.bytes;
  fold(oldest.tick, oldest.stamp);
}

void TickFold::fold(const v1::Tick& tick, const TickStamp& stamp) {
  // No session takes it, whoever failed to say so.
  if (ticks_ > 0 && tick.sequence() <= sequence_) return;
  if (tick.has_delta()) fold_delta(tick.delta());
  fold_transforms(tick.transforms(), is_paused(tick));
  fold_terms(tick);
  ++ticks_;
  sequence_ = tick.sequence();
  time_s_ = tick.time_s();
  stamp_ = stamp;
}

// As Session::step_length_s: no time passes with it.
bool TickFold::is_paused(const v1::Tick& tick) const {
  const double passed_s = ticks_ > 0 ? tick.time_s() - time_s_ : 0.0;
  return !((tick.has_dt_s() ? tick.dt_s() : passed_s) >= kShortestStepS);
}

TickFold::Entry* TickFold::find(uint64_t id) {
  const auto found = entries_.find(id);
  if (found != entries_.end()) return found->second.there() ? &found->second : nullptr;
  // Nodes of the scene file need not have been named before.
  if ((id & kAssetIdBit) == 0 || entries_.size() >= kMaxInstances) return nullptr;
  Entry& node = entries_[id];
  node.of_opening = true;
  return &node;
}

bool TickFold::there(uint64_t id) const {
  const auto found = entries_.find(id);
  return found == entries_.end() ? (id & kAssetIdBit) != 0 : found->second.there();
}

void TickFold::fold_delta(const v1::SceneDelta& delta) {
  for (const uint64_t id : delta.removed_ids()) {
    Entry* entry = find(id);
    if (entry == nullptr) continue;
    const bool of_opening = entry->of_opening;
    *entry = {};
    entry->of_opening = entry->removed = of_opening;
    if (!of_opening) entries_.erase(id);
  }
  for (const v1::NewInstance& instance : delta.added_instances()) {
    if (there(instance.id()) || entries_.size() >= kMaxInstances) continue;
    Entry& entry = entries_[instance.id()];
    entry.added = std::make_unique<v1::NewInstance>(instance);
    entry.rotation = rotation_of(instance.pose());
  }
  for (const v1::AttributeChange& change : delta.changed_instances())
    if (Entry* entry = find(change.id()))
      entry->attributes = std::make_unique<v1::Attributes>(change.attributes());
}

void TickFold::fold_transforms(const v1::Transforms& wire, bool paused) {
  const int n = wire.ids_size();
  if (wire.positions_size() != 3 * n) return;
  const bool turns = n > 0 && wire.rotations_size() == 4 * n, tells = n > 0 && wire.velocities_size() == 3 * n;
  for (int i = 0; i < n; ++i) {
    Entry* entry = find(wire.ids(i));
    if (entry == nullptr) continue;
    const std::array<double, 3> before = entry->position;
    take(wire.positions(), i, entry->position);
    if (turns) take(wire.rotations(), i, entry->rotation);
    if (tells) take(wire.velocities(), i, entry->velocity);
    entry->turned |= turns;
    // While paused, what stands where it stood keeps its velocity: see Session.
    const bool keeps = paused && entry->moved && before == entry->position;
    entry->has_velocity = tells || (keeps && entry->has_velocity);
    entry->moved = true;
  }
}

void TickFold::fold_terms(const v1::Tick& tick) {
  if (tick.has_targets()) targets_ = tick.targets();
  if (tick.has_observed_camera()) camera_ = tick.observed_camera();
  if (tick.has_lens()) lens_ = tick.lens();
  if (tick.has_limits()) merge(tick.limits(), limits_);
  // A preset starts anew. Enums that are UNSPECIFIED and absent fields keep what there is, as merging does.
  if (tick.settings().preset() != v1::Settings::PRESET_UNSPECIFIED) settings_.reset(), tuning_.reset();
  if (tick.has_settings()) merge(tick.settings(), settings_);
  if (tick.has_tuning()) merge(tick.tuning(), tuning_);
}

std::vector<std::pair<uint64_t, const TickFold::Entry*>> TickFold::sorted() const {
  std::vector<std::pair<uint64_t, const Entry*>> all;
  all.reserve(entries_.size());
  for (const auto& [id, entry] : entries_)
    if (entry.moved || entry.removed || entry.added || entry.attributes) all.emplace_back(id, &entry);
  std::sort(all.begin(), all.end());
  return all;
}

v1::Tick TickFold::tick() const {
  v1::Tick out;
  out.set_sequence(sequence_);
  out.set_time_s(time_s_);
  const auto entries = sorted();
  // Rotations and velocities are told for all that move or for none. What is added brings its rotation with it.
  bool tells_rotations = false, tells_velocities = false;
  for (const auto& [id, entry] : entries) {
    tells_rotations |= entry->turned && !entry->added;
    tells_velocities |= entry->has_velocity && entry->velocity != std::array<float, 3>{};
  }
  for (const auto& [id, entry] : entries) {
    if (entry->removed) out.mutable_delta()->add_removed_ids(id);
    if (entry->added) {
      v1::NewInstance& added = *out.mutable_delta()->add_added_instances();
      added = *entry->added;
      if (entry->moved) set_position(*added.mutable_pose(), entry->position);
      if (entry->turned) set_rotation(*added.mutable_pose(), entry->rotation);
      if (entry->attributes) *added.mutable_attributes() = *entry->attributes;
    } else if (entry->attributes) {
      v1::AttributeChange& change = *out.mutable_delta()->add_changed_instances();
      change.set_id(id);
      *change.mutable_attributes() = *entry->attributes;
    }
    if (!entry->moved) continue;
    v1::Transforms& moved = *out.mutable_transforms();
    moved.add_ids(id);
    put(*moved.mutable_positions(), entry->position);
    if (tells_rotations) put(*moved.mutable_rotations(), entry->rotation);
    if (tells_velocities)
      put(*moved.mutable_velocities(), entry->has_velocity ? entry->velocity : std::array<float, 3>{});
  }
  tell_targets(out);
  if (lens_) *out.mutable_lens() = *lens_;
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

// Whatever a list names must be there when it is told; what it ignores may have gone since.
void TickFold::tell_targets(v1::Tick& out) const {
  if (!targets_) return;
  v1::TargetList& list = *out.mutable_targets();
  const auto keep = [this](const auto& ids, auto& kept) {
    for (const uint64_t id : ids)
      if (there(id)) kept.Add(id);
  };
  for (const v1::Target& target : targets_->targets()) {
    if (!there(target.id())) continue;
    v1::Target& told = *list.add_targets();
    told = target;
    told.clear_attached_ids();
    told.clear_ignored_ids();
    keep(target.attached_ids(), *told.mutable_attached_ids());
    keep(target.ignored_ids(), *told.mutable_ignored_ids());
  }
}

}  // namespace sightline
