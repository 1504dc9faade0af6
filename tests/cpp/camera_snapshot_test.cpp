// What a session is opened with when it goes on in another daemon, against ticks worked out by hand.
#include "client/cpp/camera_snapshot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sightline {
namespace {

using ::testing::ElementsAre;

v1::CameraReply reply_at(double x) {
  v1::CameraReply reply;
  reply.mutable_pose()->mutable_position()->set_x(x);
  return reply;
}

// After a first reply, which the snapshot waits for.
CameraSnapshot snapshot() {
  CameraSnapshot made{v1::OpenSession()};
  made.take_reply(reply_at(0));
  return made;
}

void add(v1::Tick& tick, uint64_t id, uint32_t layers = 1) {
  v1::NewInstance& added = *tick.mutable_delta()->add_added_instances();
  added.set_id(id);
  added.mutable_attributes()->set_layers(layers);
}

void move(v1::Tick& tick, uint64_t id, double x, bool turned = false) {
  v1::Transforms& moved = *tick.mutable_transforms();
  moved.add_ids(id);
  for (const double value : {x, 0.0, 0.0}) moved.add_positions(value);
  if (turned)
    for (const float value : {0.0f, 0.0f, 0.0f, 1.0f}) moved.add_rotations(value);
}

std::vector<uint64_t> ids_of(const auto& instances) {
  std::vector<uint64_t> ids;
  for (const auto& instance : instances) ids.push_back(instance.id());
  return ids;
}

TEST(CameraSnapshotTest, BeforeTheFirstReplyThereIsNothingToTell) {
  CameraSnapshot fresh{v1::OpenSession()};
  v1::Tick tick;
  add(tick, 1);
  fresh.apply(tick);
  EXPECT_TRUE(fresh.ticks(9).empty());
}

TEST(CameraSnapshotTest, InstancesAreAddedInTheOrderInWhichTheyFirstCame) {
  CameraSnapshot known = snapshot();
  v1::Tick first, second, third;
  add(first, 20), add(first, 10);
  add(second, 5);
  v1::AttributeChange& changed = *third.mutable_delta()->add_changed_instances();
  changed.set_id(20);
  changed.mutable_attributes()->set_occludes(false);
  move(third, 20, 1);
  for (const v1::Tick& tick : {first, second, third}) known.apply(tick);
  const std::vector<v1::Tick> ticks = known.ticks(7);
  ASSERT_EQ(ticks.size(), 1u);
  EXPECT_THAT(ids_of(ticks[0].delta().added_instances()), ElementsAre(20u, 10u, 5u));
  EXPECT_THAT(ids_of(ticks[0].delta().changed_instances()), ElementsAre(20u));
}

TEST(CameraSnapshotTest, WhatWasAddedAndRemovedIsForgotten) {
  CameraSnapshot known = snapshot();
  v1::Tick first, second;
  add(first, 20);
  second.mutable_delta()->add_removed_ids(20);
  second.mutable_delta()->add_removed_ids(3);  // of the opening
  known.apply(first), known.apply(second);
  const v1::SceneDelta delta = known.ticks(1)[0].delta();
  EXPECT_TRUE(delta.added_instances().empty());
  EXPECT_THAT(delta.removed_ids(), ElementsAre(3u));
}

TEST(CameraSnapshotTest, AnInstanceThatIsReplacedIsRemovedAndAdded) {
  CameraSnapshot known = snapshot();
  v1::Tick tick, again;
  tick.mutable_delta()->add_removed_ids(3);
  add(tick, 3, 2);
  again.mutable_delta()->add_removed_ids(3);
  add(again, 3, 4);
  known.apply(tick), known.apply(again);
  const v1::SceneDelta delta = known.ticks(1)[0].delta();
  EXPECT_THAT(delta.removed_ids(), ElementsAre(3u));
  ASSERT_EQ(delta.added_instances_size(), 1);
  EXPECT_EQ(delta.added_instances(0).attributes().layers(), 4u);
}

TEST(CameraSnapshotTest, TurnedInstancesAndMovedOnesHaveATickEachAndTheNumbersEndBeforeTheNext) {
  CameraSnapshot known = snapshot();
  v1::Tick turned, moved;
  move(turned, 4, 1, true), turned.set_time_s(2.5);
  move(moved, 8, 2), moved.set_time_s(3.5);
  known.apply(turned), known.apply(moved);
  const std::vector<v1::Tick> ticks = known.ticks(100);
  ASSERT_EQ(ticks.size(), 2u);
  EXPECT_EQ(ticks[0].sequence(), 98u);
  EXPECT_EQ(ticks[1].sequence(), 99u);
  EXPECT_THAT(ticks[0].transforms().ids(), ElementsAre(4u));
  EXPECT_EQ(ticks[0].transforms().rotations_size(), 4);
  EXPECT_THAT(ticks[1].transforms().ids(), ElementsAre(8u));
  EXPECT_THAT(ticks[1].transforms().positions(), ElementsAre(2.0, 0.0, 0.0));
  EXPECT_EQ(ticks[1].transforms().rotations_size(), 0);
  for (const v1::Tick& tick : ticks) {
    EXPECT_TRUE(tick.step_control().merge_into_next());
    EXPECT_EQ(tick.time_s(), 3.5);
  }
}

TEST(CameraSnapshotTest, TheNewestPositionOfAnInstanceCounts) {
  CameraSnapshot known = snapshot();
  v1::Tick first, second;
  move(first, 4, 1), move(first, 6, 2);
  move(second, 4, 3);
  known.apply(first), known.apply(second);
  const v1::Tick tick = known.ticks(1)[0];
  EXPECT_THAT(tick.transforms().ids(), ElementsAre(4u, 6u));
  EXPECT_THAT(tick.transforms().positions(), ElementsAre(3.0, 0.0, 0.0, 2.0, 0.0, 0.0));
}

TEST(CameraSnapshotTest, TheCameraOpensWhereItsNewestReplyHadIt) {
  v1::OpenSession open;
  open.mutable_camera()->mutable_position()->set_x(1);
  CameraSnapshot known{open};
  EXPECT_EQ(known.opening().camera().position().x(), 1.0);
  known.take_reply(reply_at(5));
  known.take_reply(reply_at(6));
  EXPECT_EQ(known.opening().camera().position().x(), 6.0);
  EXPECT_EQ(known.ticks(1)[0].observed_camera().pose().position().x(), 6.0);
}

TEST(CameraSnapshotTest, LaterTermsReplaceOrJoinFormerOnes) {
  CameraSnapshot known = snapshot();
  v1::Tick first, second;
  first.mutable_targets()->add_targets()->set_id(1);
  first.mutable_limits()->set_max_speed_mps(5);
  first.mutable_lens()->set_near_m(0.2);
  second.mutable_targets()->add_targets()->set_id(2);
  second.mutable_limits()->set_max_acceleration_mps2(9);
  known.apply(first), known.apply(second);
  const v1::Tick tick = known.ticks(1)[0];
  EXPECT_THAT(ids_of(tick.targets().targets()), ElementsAre(2u));
  EXPECT_EQ(tick.limits().max_speed_mps(), 5.0);
  EXPECT_EQ(tick.limits().max_acceleration_mps2(), 9.0);
  EXPECT_EQ(tick.lens().near_m(), 0.2);
}

TEST(CameraSnapshotTest, TheShotGoesOnFromWhereItIsNow) {
  CameraSnapshot known = snapshot();
  v1::CameraReply reply = reply_at(5);
  reply.mutable_shot()->mutable_side()->set_asked(0.5), reply.mutable_shot()->mutable_height()->set_asked(0.2);
  reply.mutable_shot()->mutable_distance()->set_asked(7), reply.mutable_shot()->mutable_distance()->set_now(3);
  known.take_reply(reply);
  v1::Shot first = known.opening().shot();
  EXPECT_EQ(first.side_rad(), 0.5) << "the shot of the first pose, not the present pose";
  EXPECT_EQ(first.distance(), 7.0);
  v1::Tick tick;
  tick.mutable_shot()->set_frame(v1::Shot::FRAME_HEADING), tick.mutable_shot()->set_size(0.4),
      tick.mutable_shot()->set_cut(true);
  known.apply(tick), known.take_reply(reply);
  const v1::Shot chase = known.opening().shot();
  EXPECT_EQ(chase.frame(), v1::Shot::FRAME_HEADING);
  EXPECT_EQ(chase.size(), 0.4);
  EXPECT_EQ(chase.height_rad(), 0.2);
  EXPECT_FALSE(chase.cut()) << "it has been there";
  EXPECT_FALSE(known.ticks(1)[0].has_shot());
}

TEST(CameraSnapshotTest, APresetResetsTheSettingsBeforeIt) {
  CameraSnapshot known = snapshot();
  v1::Tick first, preset;
  first.mutable_settings()->set_move_response_s(0.4);
  first.mutable_tuning()->mutable_move()->mutable_cost()->set_occlusion(70);
  preset.mutable_settings()->set_preset(v1::Settings::PRESET_PAPER);
  known.apply(first);
  EXPECT_EQ(known.ticks(1)[0].settings().move_response_s(), 0.4);
  known.apply(preset);
  const v1::Tick tick = known.ticks(1)[0];
  EXPECT_EQ(tick.settings().preset(), v1::Settings::PRESET_PAPER);
  EXPECT_FALSE(tick.settings().has_move_response_s());
  EXPECT_FALSE(tick.has_tuning());
}

TEST(CameraSnapshotTest, TargetsForgetInstancesThatAreGone) {
  CameraSnapshot known = snapshot();
  v1::Tick first, second;
  v1::Target& target = *first.mutable_targets()->add_targets();
  target.set_id(1);
  for (const uint64_t id : {7, 8}) target.add_attached_ids(id), target.add_ignored_ids(id), target.add_part_ids(id);
  second.mutable_delta()->add_removed_ids(7);
  known.apply(first), known.apply(second);
  const v1::Target left = known.ticks(1)[0].targets().targets(0);
  EXPECT_THAT(left.attached_ids(), ElementsAre(8u));
  EXPECT_THAT(left.ignored_ids(), ElementsAre(8u));
  EXPECT_THAT(left.part_ids(), ElementsAre(8u));
}

TEST(CameraSnapshotTest, AnErrorOfTheServerWithoutAFieldComesAfterTheTickWasApplied) {
  v1::TickError error;
  error.set_code(v1::TickError::CODE_INTERNAL);
  EXPECT_TRUE(was_applied(error));
  error.set_code(v1::TickError::CODE_UNAVAILABLE);
  EXPECT_TRUE(was_applied(error));
  error.add_field_violations()->set_field("tick.lens");
  EXPECT_FALSE(was_applied(error));
  error.clear_field_violations();
  error.set_code(v1::TickError::CODE_INVALID_ARGUMENT);
  EXPECT_FALSE(was_applied(error));
}

}  // namespace
}  // namespace sightline
