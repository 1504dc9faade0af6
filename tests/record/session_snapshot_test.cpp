// One tick for many: a session that receives the snapshot tick is in the same state as one that received every tick.
#include "server/record/session_snapshot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "client/recordings/local_session.h"
#include "client/scenario/scenario.h"
#include "client/scenario/scenario_session.h"
#include "scenes/hall.h"
#include "server/base/random.h"
#include "server/sample/embree_sampler.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

constexpr uint64_t kFirstShape = 500, kShapes = 6, kFirstSpawn = 1000, kSpawns = 8;

enum class Turning { kNever, kAlways, kAtTimes };

void set(v1::Vec3& out, double x, double y, double z) {
  out.set_x(x);
  out.set_y(y);
  out.set_z(z);
}

std::vector<double> flat(const StepSettings& s) {
  const auto& b = s.move.cost;
  const auto& f = s.aggregate.filter;
  return {static_cast<double>(s.bound.mode),
          s.bound.horizon_s,
          s.bound.target_reach_m,
          static_cast<double>(s.sample.points),
          static_cast<double>(s.sample.resolution),
          static_cast<double>(s.aggregate.volume),
          static_cast<double>(s.aggregate.candidates),
          static_cast<double>(f.mode),
          f.alpha,
          f.window_s,
          f.hold_s,
          static_cast<double>(s.move.strategy),
          static_cast<double>(s.move.follow),
          s.move.max_distance_m,
          s.move.prediction_s,
          b.occlusion,
          b.route,
          static_cast<double>(s.move.search_viewpoints),
          s.move.shot.height,
          s.framing.framing_margin,
          s.framing.min_vertical_fov_rad,
          s.framing.max_vertical_fov_rad};
}

std::vector<double> flat(const CameraLimits& l) {
  return {l.max_speed_mps, l.max_acceleration_mps2, l.max_angular_speed_radps, l.max_angular_acceleration_radps2,
          l.body_radius_m};
}

struct PlainTarget {
  uint64_t id;
  double weight;
  bool required;
  uint32_t layers;
  std::vector<uint64_t> attached, ignored, parts;
  bool operator==(const PlainTarget&) const = default;
};

// Leaves out ids of removed instances, which a target may still name.
std::vector<PlainTarget> targets_of(const Session& session) {
  const auto living = [&](std::vector<uint64_t> ids) {
    std::erase_if(ids, [&](uint64_t id) { return session.mirror().find(id) == nullptr; });
    return ids;
  };
  std::vector<PlainTarget> out;
  for (const Target& t : session.targets())
    out.push_back({t.instance_id, t.weight, t.required, t.layer_mask, living(t.attached_ids), living(t.ignored_ids),
                   living(t.part_ids)});
  return out;
}

class SnapshotTick : public testing::TestWithParam<std::tuple<Turning, v1::Convention::Preset, int>> {
 protected:
  SnapshotTick() {
    const auto glb = scenes::make_hall({.seed = 1, .duration_s = 1.0});
    asset_ = *world_.scenes.add_uploaded(glb);
    const auto scenario = Scenario::from_asset(asset_);
    open_ = open_request(*scenario, to_hex(asset_->hash), 3);
    for (uint64_t i = 0; i < kShapes; ++i) *open_.add_instances() = shape(kFirstShape + i);
    start(Turning::kAlways, v1::Convention::PRESET_GLTF, 1);
  }

  void start(Turning turning, v1::Convention::Preset convention, int seed) {
    turning_ = turning;
    dice_ = CounterRandom(static_cast<uint64_t>(seed), 0, RandomPurpose::kTest);
    open_.mutable_convention()->set_preset(convention);
    open_.mutable_lens()->Clear();
    truth_ = open_session();
    snapshot_.take_open(open_);
    sequence_ = 0;
    time_s_ = 10.0;
  }

  std::unique_ptr<LocalSession> open_session() {
    auto session = LocalSession::open(open_, world_);
    EXPECT_TRUE(session.has_value()) << to_string(session.error());
    return std::move(*session);
  }

  bool chance(double share) { return dice_.next_unit() < share; }

  v1::NewInstance shape(uint64_t id) {
    v1::NewInstance out;
    out.set_id(id);
    if (chance(0.5))
      set(*out.mutable_shape()->mutable_box()->mutable_half_extent(), 0.5, 0.25, 1.0);
    else
      out.mutable_shape()->mutable_capsule()->set_radius(0.3 + 0.1 * dice_.next_below(3));
    if (chance(0.7)) *out.mutable_pose() = pose();
    if (chance(0.3)) set(*out.mutable_scale(), 1, 2, 0.5);
    if (chance(0.5)) *out.mutable_attributes() = attributes();
    return out;
  }
  v1::Attributes attributes() {
    v1::Attributes out;
    if (chance(0.5)) out.set_opacity(0.25f * static_cast<float>(dice_.next_below(5)));
    if (chance(0.5)) out.set_layers(dice_.next_below(16));
    if (chance(0.5)) out.set_occludes(chance(0.5));
    if (chance(0.5)) out.set_visible(chance(0.5));
    return out;
  }
  double coordinate() { return dice_.next_in(-20, 20); }
  std::array<double, 4> rotation() {
    std::array<double, 4> q{};
    double length = 0;
    while (length < 0.1) {
      length = 0;
      for (double& x : q) x = dice_.next_in(-1, 1), length += x * x;
      length = std::sqrt(length);
    }
    for (double& x : q) x /= length;
    return q;
  }
  v1::Pose3 pose() {
    v1::Pose3 out;
    set(*out.mutable_position(), coordinate(), coordinate(), coordinate());
    if (chance(0.3)) return out;
    const auto q = rotation();
    out.mutable_rotation()->set_x(q[0]);
    out.mutable_rotation()->set_y(q[1]);
    out.mutable_rotation()->set_z(q[2]);
    out.mutable_rotation()->set_w(q[3]);
    return out;
  }

  std::vector<uint64_t> living() {
    std::vector<uint64_t> ids;
    for (const Instance& instance : truth_->session().mirror().instances())
      if (instance.geometry) ids.push_back(instance.id);
    std::sort(ids.begin(), ids.end());
    return ids;
  }
  std::vector<uint64_t> some(const std::vector<uint64_t>& ids, double share) {
    std::vector<uint64_t> out;
    for (const uint64_t id : ids)
      if (chance(share)) out.push_back(id);
    return out;
  }
  static bool of_file(uint64_t id) { return id < kFirstShape || (id & kAssetIdBit) != 0; }

  void move(v1::Tick& tick, std::vector<uint64_t> ids) {
    const bool turns = turning_ == Turning::kAlways || (turning_ == Turning::kAtTimes && chance(0.5));
    const bool tells = chance(0.4);
    // The one input that a snapshot tick cannot reproduce.
    if (turning_ == Turning::kAtTimes && !turns) std::erase_if(ids, of_file);
    v1::Transforms& out = *tick.mutable_transforms();
    for (const uint64_t id : ids) {
      out.add_ids(id);
      const Instance* now = truth_->session().mirror().find(id);
      const bool stays = now != nullptr && chance(0.2) && last_.contains(id);
      if (!stays) last_[id] = {coordinate(), coordinate(), coordinate()};
      for (const double p : last_[id]) out.add_positions(p);
      if (turns)
        for (const double r : rotation()) out.add_rotations(static_cast<float>(r));
      for (int k = 0; tells && k < 3; ++k) out.add_velocities(static_cast<float>(dice_.next_in(-3, 3)));
    }
  }

  // All later positions are in the shifted world.
  void shift(v1::Tick& tick) {
    const std::array<double, 3> by{100 * coordinate(), 0, 100 * coordinate()};
    set(*tick.mutable_world_shift(), by[0], by[1], by[2]);
    for (auto& [id, position] : last_)
      for (size_t axis = 0; axis < 3; ++axis) position[axis] += by[axis];
  }

  void change_structure(v1::Tick& tick) {
    v1::SceneDelta& delta = *tick.mutable_delta();
    const std::vector<uint64_t> ids = living();
    if (chance(0.2)) delta.set_base_revision(truth_->session().mirror().revision());
    const std::vector<uint64_t> removed = some(ids, 0.1);
    for (const uint64_t id : removed) delta.add_removed_ids(id);
    for (uint64_t i = 0; i < kShapes + kSpawns; ++i) {
      const uint64_t id = i < kShapes ? kFirstShape + i : kFirstSpawn + i - kShapes;
      const bool taken = std::binary_search(ids.begin(), ids.end(), id) &&
                         std::find(removed.begin(), removed.end(), id) == removed.end();
      if (!taken && chance(0.4)) *delta.add_added_instances() = shape(id);
    }
    for (const uint64_t id : some(ids, 0.1)) {
      if (std::find(removed.begin(), removed.end(), id) != removed.end()) continue;
      v1::AttributeChange& change = *delta.add_changed_instances();
      change.set_id(id);
      *change.mutable_attributes() = attributes();
    }
  }

  void change_targets(v1::Tick& tick) {
    const std::vector<uint64_t> ids = living();
    v1::TargetList& list = *tick.mutable_targets();
    const std::vector<uint64_t> targets = some(ids, 0.1);
    std::vector<uint64_t> free = ids;  // that belong to no body yet
    std::erase_if(free, [&](uint64_t id) { return std::find(targets.begin(), targets.end(), id) != targets.end(); });
    for (const uint64_t id : targets) {
      v1::Target& target = *list.add_targets();
      target.set_id(id);
      if (chance(0.5)) target.set_weight(dice_.next_in(0, 5));
      if (chance(0.5)) target.set_required(chance(0.5));
      for (const uint64_t other : some(ids, 0.1)) target.add_attached_ids(other);
      for (const uint64_t other : some(ids, 0.1)) target.add_ignored_ids(other);
      for (const uint64_t other : some(free, 0.2)) target.add_part_ids(other), std::erase(free, other);
    }
  }

  void change_terms(v1::Tick& tick) {
    if (chance(0.2)) tick.mutable_lens()->set_aspect(dice_.next_in(1, 2));
    if (chance(0.2)) tick.mutable_limits()->set_max_speed_mps(dice_.next_in(1, 20));
    if (chance(0.2)) tick.mutable_limits()->set_body_radius_m(dice_.next_in(0.25, 0.5));
    v1::Settings& s = *tick.mutable_settings();
    tuning::v1alpha1::Tuning& t = *tick.mutable_tuning();
    if (chance(0.2)) s.set_preset(chance(0.5) ? v1::Settings::PRESET_PAPER : v1::Settings::PRESET_SIGHTLINE);
    if (chance(0.2)) t.mutable_bound()->set_horizon_s(dice_.next_in(0.1, 1));
    if (chance(0.2)) t.mutable_sample()->set_resolution(2 + dice_.next_below(9));
    if (chance(0.2)) t.mutable_aggregate()->set_candidates(27 + dice_.next_below(300));
    if (chance(0.2)) t.mutable_aggregate()->mutable_filter()->set_hold_s(dice_.next_in(0, 1));
    if (chance(0.2))
      t.mutable_move()->set_strategy(chance(0.5) ? tuning::v1alpha1::STRATEGY_BASIC
                                                 : tuning::v1alpha1::STRATEGY_MIN_COST);
    if (chance(0.2)) t.mutable_move()->mutable_cost()->set_occlusion(dice_.next_in(0, 100));
    if (chance(0.2)) s.set_framing_margin(dice_.next_in(0, 0.5));
    if (chance(0.1)) {
      s.set_min_vertical_fov_rad(dice_.next_in(0.4, 0.6));
      s.set_max_vertical_fov_rad(dice_.next_in(0.7, 0.8));
    }
  }

  void spoil(v1::Tick& tick) {
    switch (dice_.next_below(5)) {
      case 0:
        return tick.set_sequence(sequence_ - 1);
      case 1:
        return tick.mutable_delta()->add_removed_ids(987654);
      case 2:
        return tick.mutable_limits()->set_max_speed_mps(-1);
      case 3:
        return tick.mutable_transforms()->add_ids(3);
      default:
        return tick.mutable_delta()->set_base_revision(77777);
    }
  }

  v1::Tick next(bool calm = false) {
    v1::Tick tick;
    const bool paused = !calm && chance(0.15);
    if (!paused) time_s_ += 1.0 / 60;
    tick.set_sequence(++sequence_);
    tick.set_time_s(time_s_);
    if (chance(0.2)) tick.set_dt_s(paused ? 0.0 : 1.0 / 60);
    if (chance(0.3)) change_structure(tick);
    std::vector<uint64_t> ids = living();
    std::erase_if(ids, [&](uint64_t id) {
      const auto& removed = tick.delta().removed_ids();
      return std::find(removed.begin(), removed.end(), id) != removed.end();
    });
    for (const v1::NewInstance& added : tick.delta().added_instances()) ids.push_back(added.id());
    if (shifts_ && chance(0.1)) shift(tick);
    if (chance(0.8)) move(tick, some(ids, 0.3));
    if (chance(0.15)) change_targets(tick);
    if (chance(0.3)) change_terms(tick);
    if (!calm && chance(0.15)) spoil(tick);
    return tick;
  }

  // Feeds the session and the snapshot as a daemon does: some ticks, then their rejections, then one reply.
  void play(int ticks) {
    std::vector<v1::TickError> refused;
    for (int i = 0; i < ticks; ++i) {
      const v1::Tick tick = next();
      v1::TickError rejection;
      ++stamps_;
      snapshot_.take_tick(tick, {static_cast<uint32_t>(stamps_), stamps_ * 10, stamps_ * 10 - 1});
      if (truth_->apply(tick, rejection)) {
        newest_ = tick.sequence();
        newest_stamp_ = stamps_;
        ++applied_;
      } else {
        refused.push_back(rejection);
      }
    }
    refusals_ += refused.size();
    for (const v1::TickError& rejection : refused) snapshot_.take_rejection(rejection);
    reply_.set_sequence(newest_);
    *reply_.mutable_pose() = pose();
    set(*reply_.mutable_velocity(), 0.5, 0.25, -0.5);
    if (applied_ > 0) snapshot_.take_reply(reply_);
  }

  // The rotation of an instance is normalised at every move, also when the move keeps it. An instance that was never
  // turned gets its rotation in single precision when others are turned.
  double rotations_within() const { return turning_ == Turning::kAtTimes ? 2e-7 : 1e-15; }

  // `velocities`: those of instances that have one in `b`, which were sent. Derived ones depend on earlier positions,
  // which only StepMemory holds.
  void expect_same(const Session& a, const Session& b, bool velocities) {
    EXPECT_EQ(a.mirror().size(), b.mirror().size());
    size_t differ_in_bits = 0;
    for (const Instance& x : a.mirror().instances()) {
      if (!x.geometry) continue;
      const Instance* y = b.mirror().find(x.id);
      ASSERT_NE(y, nullptr) << x.id;
      EXPECT_EQ(x.geometry->hash, y->geometry->hash);
      EXPECT_EQ(x.attributes, y->attributes) << x.id;
      EXPECT_EQ(x.linear, y->linear) << x.id;
      EXPECT_EQ(x.moving, y->moving) << x.id;
      EXPECT_LE(glm::distance(x.pose.position_m, y->pose.position_m), shifts_ ? 1e-9 : 0.0) << x.id;
      EXPECT_LE(glm::length(x.pose.rotation - y->pose.rotation), rotations_within()) << x.id;
      differ_in_bits += x.pose.rotation != y->pose.rotation;
      const bool derived = y->velocity_mps == glm::dvec3(0.0) || !velocities;
      EXPECT_TRUE(derived || x.velocity_mps == y->velocity_mps) << x.id;
    }
    EXPECT_LE(glm::distance(a.convention().origin_m, b.convention().origin_m), 1e-9);
    if (differ_in_bits == 0 && !shifts_) {
      EXPECT_EQ(a.mirror().hash(), b.mirror().hash());
    }
    EXPECT_EQ(targets_of(a), targets_of(b));
    EXPECT_EQ(flat(a.settings()), flat(b.settings()));
    EXPECT_EQ(flat(a.limits()), flat(b.limits()));
    EXPECT_EQ(a.lens().aspect, b.lens().aspect);
    EXPECT_EQ(a.lens().vertical_fov_rad, b.lens().vertical_fov_rad);
    EXPECT_EQ(a.lens().near_m, b.lens().near_m);
  }

  static v1::Tick without_revision(v1::Tick tick) {
    tick.mutable_delta()->clear_base_revision();
    return tick;
  }
  static std::vector<uint64_t> sequences(const SessionSnapshot& snapshot) {
    std::vector<uint64_t> out;
    for (const WaitingTick& waiting : snapshot.waiting()) out.push_back(waiting.tick.sequence());
    return out;
  }
  static v1::Tick numbered(uint64_t sequence) {
    v1::Tick tick;
    tick.set_sequence(sequence);
    tick.set_time_s(static_cast<double>(sequence) / 60);
    return tick;
  }
  static v1::CameraReply answer(uint64_t sequence) {
    v1::CameraReply reply;
    reply.set_sequence(sequence);
    return reply;
  }
  static v1::TickError refusal(uint64_t sequence, const char* field) {
    v1::TickError rejection;
    rejection.set_sequence(sequence);
    if (field) rejection.add_field_violations()->set_field(field);
    return rejection;
  }

  const std::unique_ptr<SamplerDevice> sampler_ = make_embree_sampler_device();
  LocalWorld world_{"", *sampler_};
  std::shared_ptr<const SceneAsset> asset_;
  v1::OpenSession open_;
  Turning turning_ = Turning::kAlways;
  bool shifts_ = false;  // the world gets a new origin now and then
  CounterRandom dice_{1, 0, RandomPurpose::kTest};
  std::unique_ptr<LocalSession> truth_;
  SessionSnapshot snapshot_;
  uint64_t sequence_ = 0, newest_ = 0, newest_stamp_ = 0, stamps_ = 0, applied_ = 0, refusals_ = 0;
  double time_s_ = 0;
  v1::CameraReply reply_;
  std::map<uint64_t, std::array<double, 3>> last_;
};

TEST_P(SnapshotTick, GivesASessionTheStateOfOneThatReceivedEveryTick) {
  const auto [turning, convention, seed] = GetParam();
  start(turning, convention, seed);
  for (int batch = 0; batch < 60; ++batch) play(1 + static_cast<int>(dice_.next_below(4)));
  ASSERT_GT(applied_, 60u);
  ASSERT_GT(refusals_, 5u);
  EXPECT_EQ(snapshot_.ticks(), applied_);
  EXPECT_EQ(snapshot_.stamp().log_ns, newest_stamp_ * 10);

  const auto restored = open_session();
  v1::TickError rejection;
  const v1::Tick tick = snapshot_.tick();
  ASSERT_TRUE(restored->apply(tick, rejection)) << rejection.message();
  EXPECT_FALSE(tick.delta().has_base_revision());
  expect_same(truth_->session(), restored->session(), true);

  // The camera is where the newest reply put it.
  EXPECT_TRUE(tick.observed_camera().cut());
  EXPECT_EQ(tick.observed_camera().pose().SerializeAsString(), reply_.pose().SerializeAsString());

  // Both receive the same ticks from here on.
  for (int i = 0; i < 10; ++i) {
    const v1::Tick more = next(true);
    const bool applied = truth_->apply(more, rejection);
    EXPECT_EQ(restored->apply(without_revision(more), rejection), applied) << rejection.message();
    expect_same(truth_->session(), restored->session(), false);
  }
}

TEST_P(SnapshotTick, GivesASessionTheStateOfOneWhoseWorldWasShifted) {
  const auto [turning, convention, seed] = GetParam();
  start(turning, convention, seed);
  shifts_ = true;
  for (int batch = 0; batch < 60; ++batch) play(1 + static_cast<int>(dice_.next_below(4)));
  EXPECT_GT(glm::length(truth_->session().convention().origin_m), 1.0);
  const auto restored = open_session();
  v1::TickError rejection;
  ASSERT_TRUE(restored->apply(snapshot_.tick(), rejection)) << rejection.message();
  expect_same(truth_->session(), restored->session(), true);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SnapshotTick,
                         testing::Combine(testing::Values(Turning::kNever, Turning::kAlways, Turning::kAtTimes),
                                          testing::Values(v1::Convention::PRESET_GLTF, v1::Convention::PRESET_UNREAL),
                                          testing::Range(1, 9)));

TEST_F(SnapshotTick, LeavesOutTicksThatAreNotAnswered) {
  SessionSnapshot snapshot;
  snapshot.take_open(open_);
  for (uint64_t i = 1; i <= 5; ++i) snapshot.take_tick(numbered(i), {static_cast<uint32_t>(i), i, i});
  EXPECT_EQ(snapshot.ticks(), 0u);
  snapshot.take_rejection(refusal(2, "tick.transforms"));
  snapshot.take_reply(answer(3));
  EXPECT_EQ(snapshot.ticks(), 2u);
  EXPECT_EQ(snapshot.tick().sequence(), 3u);
  EXPECT_EQ(snapshot.stamp().sequence, 3u);
  EXPECT_THAT(sequences(snapshot), ElementsAre(4, 5));
  snapshot.take_rejection(refusal(5, nullptr));  // its step failed: it was applied
  snapshot.take_reply(answer(5));
  EXPECT_EQ(snapshot.ticks(), 4u);
  EXPECT_THAT(snapshot.waiting(), SizeIs(0));
}

TEST_F(SnapshotTick, LeavesOutTheRefusedOneOfTwoTicksWithOneNumber) {
  const auto told = [&](const char* field) {
    SessionSnapshot snapshot;
    snapshot.take_open(open_);
    v1::Tick first = numbered(4), second = numbered(4);
    first.mutable_lens()->set_aspect(1);
    second.mutable_lens()->set_aspect(2);
    snapshot.take_tick(first, {});
    snapshot.take_tick(second, {});
    snapshot.take_rejection(refusal(4, field));
    snapshot.take_reply(answer(4));
    EXPECT_EQ(snapshot.ticks(), 1u);
    return snapshot.tick().lens().aspect();
  };
  EXPECT_EQ(told("tick.sequence"), 1);
  EXPECT_EQ(told("tick.delta.removed_ids[0]"), 2);
}

TEST_F(SnapshotTick, KeepsABoundedNumberOfWaitingTicks) {
  SessionSnapshot snapshot;
  snapshot.take_open(open_);
  for (uint64_t i = 1; i <= 2000; ++i) snapshot.take_tick(numbered(i), {});
  EXPECT_THAT(snapshot.waiting(), SizeIs(SessionSnapshot::kMaxWaiting));
  EXPECT_EQ(snapshot.ticks(), 2000 - SessionSnapshot::kMaxWaiting);
  v1::Tick large = numbered(2001);
  for (int i = 0; i < 400'000; ++i) large.mutable_transforms()->add_positions(i);
  for (uint64_t i = 0; i < 10; ++i) {
    large.set_sequence(2001 + i);
    snapshot.take_tick(large, {});
  }
  EXPECT_LE(snapshot.waiting().size(), SessionSnapshot::kMaxWaitingBytes / large.ByteSizeLong() + 1);
}

TEST_F(SnapshotTick, HoldsNothingOfInstancesThatCameAndWent) {
  SessionSnapshot snapshot;
  snapshot.take_open(open_);
  for (uint64_t i = 1; i <= 100; ++i) {
    v1::Tick tick = numbered(i);
    if (i > 1) tick.mutable_delta()->add_removed_ids(kFirstSpawn + i - 1);
    *tick.mutable_delta()->add_added_instances() = shape(kFirstSpawn + i);
    tick.mutable_transforms()->add_ids(kFirstSpawn + i);
    for (int k = 0; k < 3; ++k) tick.mutable_transforms()->add_positions(k);
    snapshot.take_tick(tick, {});
  }
  snapshot.take_reply(answer(100));
  const v1::Tick tick = snapshot.tick();
  EXPECT_EQ(tick.delta().removed_ids_size(), 0);
  ASSERT_EQ(tick.delta().added_instances_size(), 1);
  EXPECT_EQ(tick.delta().added_instances(0).id(), kFirstSpawn + 100);
  EXPECT_THAT(tick.transforms().ids(), ElementsAre(kFirstSpawn + 100));
}

TEST_F(SnapshotTick, IsAcceptedBySessionsAfterLostTicks) {
  v1::Tick tick = numbered(9);
  for (const uint64_t unknown : {uint64_t{4242}, kFirstShape}) {
    tick.mutable_transforms()->add_ids(unknown);
    for (int k = 0; k < 3; ++k) tick.mutable_transforms()->add_positions(k);
    v1::AttributeChange& change = *tick.mutable_delta()->add_changed_instances();
    change.set_id(unknown);
    change.mutable_attributes()->set_layers(2);
    tick.mutable_targets()->add_targets()->set_id(unknown);
  }
  tick.mutable_delta()->add_removed_ids(4343);
  snapshot_.take_tick(tick, {});
  snapshot_.take_reply(answer(9));
  v1::TickError rejection;
  ASSERT_TRUE(truth_->apply(snapshot_.tick(), rejection)) << rejection.message();
  EXPECT_EQ(truth_->session().mirror().find(kFirstShape)->attributes.layers, 2u);
  EXPECT_THAT(truth_->session().targets(), SizeIs(1));
}

TEST_F(SnapshotTick, CanItselfBeginASnapshot) {
  for (int batch = 0; batch < 20; ++batch) play(3);
  const v1::Tick first = snapshot_.tick();
  SessionSnapshot second;
  second.take_open(open_);
  second.take_snapshot_tick(first, snapshot_.ticks(), {});
  EXPECT_EQ(second.ticks(), snapshot_.ticks());
  EXPECT_EQ(second.tick().SerializeAsString(), first.SerializeAsString());
  std::swap(second, snapshot_);
  for (int batch = 0; batch < 20; ++batch) play(3);
  EXPECT_EQ(snapshot_.ticks(), applied_);
  const auto restored = open_session();
  v1::TickError rejection;
  ASSERT_TRUE(restored->apply(snapshot_.tick(), rejection)) << rejection.message();
  expect_same(truth_->session(), restored->session(), true);
}

}  // namespace
}  // namespace sightline
