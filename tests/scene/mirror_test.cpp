#include "server/scene/mirror.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>

#include "server/base/random.h"
#include "server/scene/primitives.h"
#include "tests/support/count_allocations.h"

namespace sightline {
namespace {

std::shared_ptr<const Geometry> box() {
  static const auto geometry = build_geometry(tessellate(BoxShape{}).value()).value();
  return geometry;
}

Pose at(double x, double y = 0, double z = 0) {
  return {{x, y, z}, {1, 0, 0, 0}};
}

NewInstance instance(uint64_t id, const Pose& pose = {}) {
  NewInstance made;
  made.id = id;
  made.geometry = box();
  made.pose = pose;
  return made;
}

SceneDelta adding(std::vector<NewInstance> instances) {
  SceneDelta delta;
  delta.add = std::move(instances);
  return delta;
}

TransformUpdate moving(std::vector<uint64_t> ids, std::vector<Pose> poses) {
  return {std::move(ids), std::move(poses), {}, {}, {}};
}

SceneDelta changing(uint64_t id, const InstanceAttributes& attributes) {
  SceneDelta delta;
  delta.change = {{id, attributes}};
  return delta;
}

SceneDelta removing(std::vector<uint64_t> ids) {
  SceneDelta delta;
  delta.remove = std::move(ids);
  return delta;
}

// A mirror of instances 1..count in a row.
class MirrorTest : public ::testing::Test {
 protected:
  MirrorTest() {
    for (uint64_t id = 1; id <= 4; ++id) EXPECT_TRUE(mirror.apply(adding({instance(id, at(double(id)))}), {}));
  }

  struct Snapshot {
    uint64_t revision, hash, version, static_version, moving_version;
    size_t size, slots;
    std::vector<uint32_t> moving;
    bool operator==(const Snapshot&) const = default;
  };
  Snapshot snapshot() const {
    const auto slots = mirror.moving_slots();
    return {mirror.revision(),       mirror.hash(), mirror.version(),          mirror.static_version(),
            mirror.moving_version(), mirror.size(), mirror.instances().size(), {slots.begin(), slots.end()}};
  }

  void expect_refused(const SceneDelta& delta, const TransformUpdate& transforms, ErrorCode code,
                      const std::string& field) {
    const Snapshot before = snapshot();
    const Status status = mirror.apply(delta, transforms);
    ASSERT_FALSE(status) << field;
    EXPECT_EQ(status.error().code, code) << field;
    EXPECT_EQ(status.error().field, field);
    EXPECT_FALSE(status.error().message.empty());
    EXPECT_EQ(snapshot(), before) << field;
  }

  SceneMirror mirror;
};

TEST_F(MirrorTest, HoldsWhatItWasTold) {
  EXPECT_EQ(mirror.size(), 4u);
  ASSERT_NE(mirror.find(3), nullptr);
  EXPECT_EQ(mirror.find(3)->pose.position_m.x, 3.0);
  EXPECT_EQ(&mirror.instances()[*mirror.slot_of(3)], mirror.find(3));
  EXPECT_EQ(mirror.find(9), nullptr);
  EXPECT_FALSE(mirror.slot_of(9));
}

TEST_F(MirrorTest, RevisionCountsStructuralDeltasOnly) {
  EXPECT_EQ(mirror.revision(), 4u);
  ASSERT_TRUE(mirror.apply({}, moving({1}, {at(5)})));
  ASSERT_TRUE(mirror.apply({}, {}));
  EXPECT_EQ(mirror.revision(), 4u);
  ASSERT_TRUE(mirror.apply(removing({1, 2}), {}));
  EXPECT_EQ(mirror.revision(), 5u);
}

TEST_F(MirrorTest, AnEmptyMessageChangesNothing) {
  const Snapshot before = snapshot();
  ASSERT_TRUE(mirror.apply({}, {}));
  EXPECT_EQ(snapshot(), before);
}

TEST_F(MirrorTest, ADeltaAgainstAnotherRevisionAsksForAResync) {
  SceneDelta delta = removing({1});
  for (const uint64_t wrong : {uint64_t{3}, uint64_t{5}, uint64_t{0}}) {
    delta.base_revision = wrong;
    expect_refused(delta, {}, ErrorCode::kFailedPrecondition, "base_revision");
  }
  delta.base_revision = 4;
  EXPECT_TRUE(mirror.apply(delta, {}));
}

TEST_F(MirrorTest, UnknownIdsAreNotFound) {
  expect_refused(removing({1, 9}), {}, ErrorCode::kNotFound, "remove[1]");
  expect_refused(changing(9, {}), {}, ErrorCode::kNotFound, "change[0].id");
  expect_refused({}, moving({1, 9}, {at(1), at(2)}), ErrorCode::kNotFound, "ids[1]");
  expect_refused({}, moving({0}, {at(1)}), ErrorCode::kNotFound, "ids[0]");
}

TEST_F(MirrorTest, WhatADeltaRemovesIsGoneForTheRestOfIt) {
  SceneDelta delta = removing({1});
  delta.change = {{1, {}}};
  expect_refused(delta, {}, ErrorCode::kNotFound, "change[0].id");
  expect_refused(removing({1}), moving({1}, {at(1)}), ErrorCode::kNotFound, "ids[0]");
}

TEST_F(MirrorTest, AnIdNamedTwiceInOneListIsRefused) {
  expect_refused(removing({1, 2, 1}), {}, ErrorCode::kInvalidArgument, "remove[2]");
  expect_refused(adding({instance(7), instance(8), instance(7)}), {}, ErrorCode::kInvalidArgument, "add[2].id");
  SceneDelta twice = changing(1, {});
  twice.change.push_back({1, {}});
  expect_refused(twice, {}, ErrorCode::kInvalidArgument, "change[1].id");
  expect_refused({}, moving({1, 2, 1}, {at(1), at(2), at(3)}), ErrorCode::kInvalidArgument, "ids[2]");
  expect_refused(adding({instance(7)}), moving({7, 7}, {at(1), at(2)}), ErrorCode::kInvalidArgument, "ids[1]");
  EXPECT_TRUE(mirror.apply({}, moving({1, 2}, {at(1), at(2)})));  // and a refusal leaves no trace
}

TEST_F(MirrorTest, ATakenIdIsRefused) {
  expect_refused(adding({instance(7), instance(2)}), {}, ErrorCode::kAlreadyExists, "add[1].id");
}

TEST_F(MirrorTest, ReservedIdsAreRefusedExceptForWhatASceneFileBrings) {
  expect_refused(adding({instance(0)}), {}, ErrorCode::kInvalidArgument, "add[0].id");
  SceneDelta delta = adding({instance(kAssetIdBit | 5)});
  expect_refused(delta, {}, ErrorCode::kInvalidArgument, "add[0].id");
  delta.asset_ids_allowed = true;
  ASSERT_TRUE(mirror.apply(delta, {}));
  EXPECT_TRUE(mirror.apply({}, moving({kAssetIdBit | 5}, {at(1)})));
  EXPECT_TRUE(mirror.apply(removing({kAssetIdBit | 5}), {}));
}

const double kBad[] = {NAN, INFINITY, -INFINITY, 2e9};

TEST_F(MirrorTest, BadPosesAreRefused) {
  for (const double bad : kBad) {
    const Pose misplaced = at(0, bad, 0), turned{{0, 0, 0}, {1, bad, 0, 0}};
    expect_refused({}, moving({1, 2}, {at(1), misplaced}), ErrorCode::kInvalidArgument, "poses[1].position_m");
    expect_refused({}, moving({1}, {turned}), ErrorCode::kInvalidArgument, "poses[0].rotation");
    expect_refused(adding({instance(7, misplaced)}), {}, ErrorCode::kInvalidArgument, "add[0].pose.position_m");
    expect_refused(adding({instance(7, turned)}), {}, ErrorCode::kInvalidArgument, "add[0].pose.rotation");
  }
  for (const glm::dquat& q : {glm::dquat(0, 0, 0, 0), glm::dquat(1.002, 0, 0, 0), glm::dquat(0.998, 0, 0, 0)})
    expect_refused({}, moving({1}, {{{0, 0, 0}, q}}), ErrorCode::kInvalidArgument, "poses[0].rotation");
}

TEST_F(MirrorTest, ANearlyUnitRotationIsNormalised) {
  ASSERT_TRUE(mirror.apply({}, moving({1}, {{{0, 0, 0}, {0.0, 1.0009, 0, 0}}})));
  EXPECT_EQ(mirror.find(1)->pose.rotation.x, 1.0);
}

TEST_F(MirrorTest, ArraysMustAgreeInLength) {
  expect_refused({}, moving({1, 2}, {at(1)}), ErrorCode::kInvalidArgument, "poses");
  expect_refused({}, moving({1}, {at(1), at(2)}), ErrorCode::kInvalidArgument, "poses");
  TransformUpdate update = moving({1, 2}, {at(1), at(2)});
  update.velocities_mps = {{1, 0, 0}};
  expect_refused({}, update, ErrorCode::kInvalidArgument, "velocities_mps");
  update.velocities_mps.clear(), update.corrections_m = {{1, 0, 0}};
  expect_refused({}, update, ErrorCode::kInvalidArgument, "corrections_m");
  update.corrections_m.clear();
  update.velocities_mps = {{1, 0, 0}, {0, NAN, 0}};
  expect_refused({}, update, ErrorCode::kInvalidArgument, "velocities_mps[1]");
}

TEST_F(MirrorTest, OpacityMustBeAShare) {
  for (const float bad : {-0.1f, 1.1f, NAN, INFINITY}) {
    InstanceAttributes attributes;
    attributes.opacity = bad;
    NewInstance added = instance(7);
    added.attributes = attributes;
    expect_refused(adding({added}), {}, ErrorCode::kInvalidArgument, "add[0].attributes.opacity");
    expect_refused(changing(1, attributes), {}, ErrorCode::kInvalidArgument, "change[0].attributes.opacity");
  }
}

TEST_F(MirrorTest, LinearMustBeInvertibleAndFinite) {
  const glm::dmat3 flat(1, 0, 0, 0, 0, 0, 0, 0, 1), parallel(1, 1, 0, 2, 2, 0, 0, 0, 1), huge(1e7);
  // Each column is long enough, but places far away would be 1e9 times as far in the frame of the instance.
  const glm::dmat3 sheared(1, 0, 0, 1, 1e-9, 0, 0, 0, 10);
  for (const glm::dmat3& bad :
       {flat, parallel, huge, glm::dmat3(NAN), glm::dmat3(0.0), glm::dmat3(1e-200), glm::dmat3(9e-9), sheared}) {
    NewInstance added = instance(7);
    added.linear = bad;
    expect_refused(adding({added}), {}, ErrorCode::kInvalidArgument, "add[0].linear");
  }
  for (const glm::dmat3& good :
       {glm::dmat3(1e-6), glm::dmat3(1e5), glm::dmat3(-1), glm::dmat3(1, 0, 0, 5, 1, 0, 0, 0, 1e-3)})
    EXPECT_TRUE(is_valid_linear(good));
}

TEST_F(MirrorTest, AnInstanceLiesWithin1e9MetresOfItsOrigin) {
  NewInstance added = instance(7);
  added.geometry = *build_geometry(*tessellate(SphereShape{1e5f}));
  added.linear = glm::dmat3(1.1e4);
  expect_refused(adding({added}), {}, ErrorCode::kInvalidArgument, "add[0].linear");
  added.linear = glm::dmat3(0.9e4);
  EXPECT_TRUE(mirror.apply(adding({added}), {}));
}

TEST_F(MirrorTest, AnInstanceNeedsGeometry) {
  NewInstance added = instance(7);
  added.geometry = nullptr;
  expect_refused(adding({added}), {}, ErrorCode::kInvalidArgument, "add[0].geometry");
}

TEST_F(MirrorTest, NothingIsHalfAppliedWhenTheLastItemIsBad) {
  SceneDelta delta = removing({1});
  delta.add = {instance(7)};
  delta.change = {{2, {.visible = false}}};
  expect_refused(delta, moving({3, 9}, {at(30), at(90)}), ErrorCode::kNotFound, "ids[1]");
  EXPECT_NE(mirror.find(1), nullptr);
  EXPECT_EQ(mirror.find(7), nullptr);
  EXPECT_TRUE(mirror.find(2)->attributes.visible);
  EXPECT_EQ(mirror.find(3)->pose.position_m.x, 3.0);
}

TEST_F(MirrorTest, OneMessageRemovesAddsChangesAndMovesInThatOrder) {
  SceneDelta delta = removing({1});
  delta.add = {instance(1, at(10)), instance(7, at(70))};
  delta.change = {{7, {.layers = 4}}};
  ASSERT_TRUE(mirror.apply(delta, moving({1, 7}, {at(11), at(71)})));
  EXPECT_EQ(mirror.find(1)->pose.position_m.x, 11.0);
  EXPECT_EQ(mirror.find(7)->pose.position_m.x, 71.0);
  EXPECT_EQ(mirror.find(7)->attributes.layers, 4u);
  EXPECT_EQ(mirror.size(), 5u);
}

TEST_F(MirrorTest, MoreThanAMillionInstancesAreRefused) {
  SceneDelta delta;
  delta.add.assign(kMaxInstances - 3, instance(100));
  expect_refused(delta, {}, ErrorCode::kResourceExhausted, "add");
}

TEST_F(MirrorTest, SlotsAreStableAndReused) {
  const uint32_t kept = *mirror.slot_of(4), freed = *mirror.slot_of(2);
  ASSERT_TRUE(mirror.apply(removing({2}), {}));
  EXPECT_EQ(mirror.instances()[freed].geometry, nullptr);
  EXPECT_EQ(mirror.slot_of(4), kept);
  ASSERT_TRUE(mirror.apply(adding({instance(50)}), {}));
  EXPECT_EQ(mirror.slot_of(50), freed);
  EXPECT_EQ(mirror.instances().size(), 4u);
}

TEST_F(MirrorTest, GeometryIsLetGoWithItsLastInstance) {
  auto own = build_geometry(tessellate(SphereShape{}).value()).value();
  const std::weak_ptr<const Geometry> watch = own;
  NewInstance added = instance(7);
  added.geometry = std::move(own);
  ASSERT_TRUE(mirror.apply(adding({std::move(added)}), {}));
  added.geometry = nullptr;
  EXPECT_FALSE(watch.expired());
  ASSERT_TRUE(mirror.apply(removing({7}), {}));
  EXPECT_TRUE(watch.expired());
}

TEST_F(MirrorTest, TheFirstTransformMakesAnInstanceMoving) {
  const Snapshot before = snapshot();
  ASSERT_TRUE(mirror.apply({}, moving({3}, {at(30)})));
  EXPECT_TRUE(mirror.find(3)->moving);
  EXPECT_NE(mirror.static_version(), before.static_version);
  EXPECT_NE(mirror.moving_version(), before.moving_version);
  EXPECT_NE(mirror.version(), before.version);
  EXPECT_EQ(snapshot().moving, (std::vector<uint32_t>{*mirror.slot_of(3)}));
}

TEST_F(MirrorTest, LaterTransformsTouchOnlyTheVersionAndTheHash) {
  ASSERT_TRUE(mirror.apply({}, moving({3}, {at(30)})));
  const Snapshot before = snapshot();
  ASSERT_TRUE(mirror.apply({}, moving({3}, {at(31)})));
  EXPECT_EQ(mirror.static_version(), before.static_version);
  EXPECT_EQ(mirror.moving_version(), before.moving_version);
  EXPECT_NE(mirror.version(), before.version);
  EXPECT_NE(mirror.hash(), before.hash);
}

TEST_F(MirrorTest, ATickOfTransformsAllocatesNothing) {
  const SceneDelta none;
  const TransformUpdate update = moving({1, 2, 3}, {at(1), at(2), at(3)});
  ASSERT_TRUE(mirror.apply(none, update));  // they become moving
  const size_t before = allocations;
  const bool applied = mirror.apply(none, update).has_value();
  EXPECT_EQ(allocations, before);
  EXPECT_TRUE(applied);
}

TEST_F(MirrorTest, AttributesTouchTheSetThatTheInstanceIsIn) {
  ASSERT_TRUE(mirror.apply({}, moving({3}, {at(30)})));
  const Snapshot before = snapshot();
  ASSERT_TRUE(mirror.apply(changing(3, {.visible = false}), {}));
  EXPECT_EQ(mirror.static_version(), before.static_version);
  EXPECT_NE(mirror.moving_version(), before.moving_version);
  const Snapshot between = snapshot();
  ASSERT_TRUE(mirror.apply(changing(1, {.layers = 2}), {}));
  EXPECT_NE(mirror.static_version(), between.static_version);
  EXPECT_EQ(mirror.moving_version(), between.moving_version);
}

TEST_F(MirrorTest, MovingSlotsStayAscendingThroughRemovalAndReuse) {
  ASSERT_TRUE(mirror.apply({}, moving({4, 1, 3}, {at(1), at(2), at(3)})));
  EXPECT_EQ(snapshot().moving, (std::vector<uint32_t>{0, 2, 3}));
  NewInstance mover = instance(20), still = instance(21);
  mover.moving = true;
  SceneDelta delta = removing({1, 3});
  delta.add = {mover, still};  // reuse both freed slots
  ASSERT_TRUE(mirror.apply(delta, {}));
  std::vector<uint32_t> expected = {*mirror.slot_of(20), *mirror.slot_of(4)};
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(snapshot().moving, expected);
}

TEST_F(MirrorTest, AHiddenInstanceCanBeMovedAndShownAgain) {
  ASSERT_TRUE(mirror.apply(changing(2, {.visible = false}), {}));
  EXPECT_FALSE(mirror.find(2)->occludes() || mirror.find(2)->collides());
  ASSERT_TRUE(mirror.apply({}, moving({2}, {at(20)})));
  ASSERT_TRUE(mirror.apply(changing(2, {}), {}));
  EXPECT_TRUE(mirror.find(2)->occludes() && mirror.find(2)->collides());
  EXPECT_EQ(mirror.find(2)->pose.position_m.x, 20.0);
}

TEST_F(MirrorTest, LowOpacityStopsOccludingButNotColliding) {
  ASSERT_TRUE(mirror.apply(changing(2, {.opacity = 0.74f}), {}));
  EXPECT_FALSE(mirror.find(2)->occludes());
  EXPECT_TRUE(mirror.find(2)->collides());
  ASSERT_TRUE(mirror.apply(changing(2, {.opacity = 0.75f}), {}));
  EXPECT_TRUE(mirror.find(2)->occludes());
}

TEST_F(MirrorTest, VelocityStandsUntilToldAnew) {
  TransformUpdate update = moving({1}, {at(1)});
  update.velocities_mps = {{1, 2, 3}};
  ASSERT_TRUE(mirror.apply({}, update));
  ASSERT_TRUE(mirror.apply({}, moving({1}, {at(2)})));
  EXPECT_EQ(mirror.find(1)->velocity_mps, glm::dvec3(1, 2, 3));
  EXPECT_EQ(mirror.find(2)->velocity_mps, glm::dvec3(0));
}

// The pose stays as it was sent, and so does the hash that clients compare. The body is where it is believed to be.
TEST_F(MirrorTest, ACorrectionMovesTheBodyAndNothingThatTheClientKnows) {
  TransformUpdate update = moving({1}, {at(1)});
  ASSERT_TRUE(mirror.apply({}, update));
  const uint64_t hash = mirror.hash();
  const glm::dvec3 center_m = mirror.find(1)->center_m, correction_m(0.25, 0, -1);
  update.corrections_m = {correction_m};
  ASSERT_TRUE(mirror.apply({}, update));
  EXPECT_EQ(mirror.hash(), hash);
  EXPECT_EQ(mirror.find(1)->pose.position_m, at(1).position_m);
  EXPECT_LT(glm::distance(mirror.find(1)->center_m, center_m + correction_m), 1e-12);
  EXPECT_EQ(believed_pose(*mirror.find(1)).position_m, at(1).position_m + correction_m);
  update.corrections_m.clear();
  ASSERT_TRUE(mirror.apply({}, update));
  EXPECT_EQ(mirror.find(1)->center_m, center_m) << "without corrections there is none";
}

TEST_F(MirrorTest, TheBoundingSphereFollowsPoseAndLinear) {
  NewInstance added = instance(7);
  added.linear = glm::dmat3(3, 0, 0, 1, 2, 0, 0, 0, 0.5);  // sheared
  ASSERT_TRUE(mirror.apply(adding({added}), {}));
  const glm::dquat turn = glm::normalize(glm::dquat(0.3, 0.5, -0.7, 0.2));
  ASSERT_TRUE(mirror.apply({}, moving({7}, {{{5, 6, 7}, turn}})));
  const Instance& i = *mirror.find(7);
  for (const glm::vec3& p : i.geometry->positions) {
    const glm::dvec3 world = glm::dvec3(5, 6, 7) + turn * (added.linear * glm::dvec3(p));
    EXPECT_LT(glm::distance(transform_point(i.world_from_instance, p), world), 1e-12);
    EXPECT_LE(glm::distance(world, i.center_m), i.radius_m);
  }
}

TEST(MirrorIdentity, IsUnique) {
  EXPECT_NE(SceneMirror().identity(), SceneMirror().identity());
}

// Random walks of several instances of a mirror, in any order.
TEST(MirrorHash, DoesNotDependOnTheOrderOfUpdates) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  std::vector<NewInstance> all;
  for (uint64_t id = 1; id <= 50; ++id) {
    all.push_back(instance(id, at(random.next_in(-10, 10))));
    all.back().attributes.layers = random.next_u32();
  }
  SceneMirror forward, backward;
  ASSERT_TRUE(forward.apply(adding(all), {}));
  for (auto it = all.rbegin(); it != all.rend(); ++it) ASSERT_TRUE(backward.apply(adding({*it}), {}));
  EXPECT_EQ(forward.hash(), backward.hash());

  std::vector<uint64_t> ids;
  std::vector<Pose> poses;
  for (uint64_t id = 1; id <= 50; id += 3) ids.push_back(id), poses.push_back(at(random.next_in(-10, 10), 1, 2));
  ASSERT_TRUE(forward.apply({}, moving(ids, poses)));
  EXPECT_NE(forward.hash(), backward.hash());
  for (size_t i = ids.size(); i-- > 0;) ASSERT_TRUE(backward.apply({}, moving({ids[i]}, {poses[i]})));
  EXPECT_EQ(forward.hash(), backward.hash());

  ASSERT_TRUE(forward.apply(removing({4, 9}), {}));
  for (const uint64_t id : {uint64_t{9}, uint64_t{4}}) ASSERT_TRUE(backward.apply(removing({id}), {}));
  EXPECT_EQ(forward.hash(), backward.hash());
}

TEST(MirrorHash, IsTheSameAfterAWayThereAndBack) {
  SceneMirror mirror;
  EXPECT_EQ(mirror.hash(), 0u);
  ASSERT_TRUE(mirror.apply(adding({instance(1), instance(2)}), {}));
  const uint64_t before = mirror.hash();
  ASSERT_TRUE(mirror.apply(changing(1, {.occludes = false}), moving({2}, {at(5)})));
  ASSERT_TRUE(mirror.apply(adding({instance(3)}), {}));
  EXPECT_NE(mirror.hash(), before);
  ASSERT_TRUE(mirror.apply(removing({3}), {}));
  ASSERT_TRUE(mirror.apply(changing(1, {}), moving({2}, {at(0)})));
  EXPECT_EQ(mirror.hash(), before);
  ASSERT_TRUE(mirror.apply(removing({1, 2}), {}));
  EXPECT_EQ(mirror.hash(), 0u);
}

// A plain reference for a mirror, and the next random message for both.
struct Model {
  std::map<uint64_t, NewInstance> by_id;
  CounterRandom random{3, 0, RandomPurpose::kTest};

  Pose pose() { return at(random.next_in(-9, 9), random.next_in(-9, 9), random.next_in(-9, 9)); }
  uint64_t some_id() { return 1 + random.next_below(30); }

  void tell(SceneMirror& mirror) {
    SceneDelta delta;
    TransformUpdate update;
    if (const uint64_t id = some_id(); by_id.erase(id)) delta.remove = {id};
    if (const uint64_t id = some_id(); !by_id.contains(id)) {
      delta.add = {instance(id, pose())};
      by_id[id] = delta.add[0];
    }
    if (const auto it = by_id.find(some_id()); it != by_id.end()) {
      it->second.attributes.layers = random.next_u32();
      delta.change = {{it->first, it->second.attributes}};
    }
    if (const auto it = by_id.find(some_id()); it != by_id.end()) {
      it->second.pose = pose();
      update = moving({it->first}, {it->second.pose});
    }
    ASSERT_TRUE(mirror.apply(delta, update));
  }
};

TEST(MirrorHash, ALongHistoryEqualsAFreshMirrorOfItsOutcome) {
  Model model;
  SceneMirror mirror;
  for (int i = 0; i < 500; ++i) {
    model.tell(mirror);
    SceneMirror fresh;
    SceneDelta all;
    for (const auto& [id, made] : model.by_id) all.add.push_back(made);
    ASSERT_TRUE(fresh.apply(all, {}));
    ASSERT_EQ(mirror.hash(), fresh.hash()) << i;
    ASSERT_EQ(mirror.size(), model.by_id.size());
    for (const auto& [id, made] : model.by_id) {
      ASSERT_EQ(mirror.find(id)->pose.position_m, made.pose.position_m);
      ASSERT_EQ(mirror.find(id)->attributes, made.attributes);
    }
  }
}

uint64_t hash_of(const NewInstance& only) {
  SceneMirror mirror;
  EXPECT_TRUE(mirror.apply(adding({only}), {}));
  return mirror.hash();
}

TEST(MirrorHash, EveryPartOfTheRecordCounts) {
  const NewInstance base = instance(1, at(1, 2, 3));
  std::vector<uint64_t> hashes = {hash_of(base)};
  const auto vary = [&](const std::function<void(NewInstance&)>& change) {
    NewInstance varied = base;
    change(varied);
    hashes.push_back(hash_of(varied));
  };
  vary([](NewInstance& i) { i.id = 2; });
  vary([](NewInstance& i) { i.geometry = build_geometry(tessellate(SphereShape{}).value()).value(); });
  vary([](NewInstance& i) { i.pose.position_m.x = std::nextafter(1.0, 2.0); });
  vary([](NewInstance& i) { i.pose.position_m.y = std::nextafter(2.0, 3.0); });
  vary([](NewInstance& i) { i.pose.position_m.z = std::nextafter(3.0, 4.0); });
  vary([](NewInstance& i) { i.pose.rotation.x = 1e-12; });
  vary([](NewInstance& i) { i.pose.rotation.y = 1e-12; });
  vary([](NewInstance& i) { i.pose.rotation.z = 1e-12; });
  vary([](NewInstance& i) { i.pose.rotation = {0, 1, 0, 0}; });
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) vary([=](NewInstance& i) { i.linear[column][row] += 0x1p-52; });
  vary([](NewInstance& i) { i.attributes.layers = 2; });
  vary([](NewInstance& i) { i.attributes.opacity = 0.5f; });
  vary([](NewInstance& i) { i.attributes.occludes = false; });
  vary([](NewInstance& i) { i.attributes.collides = false; });
  vary([](NewInstance& i) { i.attributes.visible = false; });
  std::sort(hashes.begin(), hashes.end());
  EXPECT_EQ(std::unique(hashes.begin(), hashes.end()), hashes.end());
}

TEST(MirrorHash, TwoInstancesDoNotCancelOrSwap) {
  SceneMirror a, b;
  ASSERT_TRUE(a.apply(adding({instance(1, at(1)), instance(2, at(2))}), {}));
  ASSERT_TRUE(b.apply(adding({instance(1, at(2)), instance(2, at(1))}), {}));
  EXPECT_NE(a.hash(), b.hash());
}

}  // namespace
}  // namespace sightline
