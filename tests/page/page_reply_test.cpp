// Replies as frames of a page: every field, for a client whose units are not metres.
#include "client/page/page_reply.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/session/convention.h"

namespace sightline {
namespace {

using testing::ElementsAre;

const std::vector<PageTarget> kTargets{{5, "anna", 1.0, true}, {6, "ben", 0.0, true}, {7, "carl", 1.0, true}};

v1::CameraReply full_reply() {
  v1::CameraReply reply;
  reply.set_sequence(3), reply.set_time_s(1.0), reply.set_pose_time_s(1.25);
  reply.mutable_pose()->mutable_position()->set_x(2), reply.mutable_pose()->mutable_position()->set_z(4);
  reply.mutable_pose()->mutable_rotation()->set_w(1);
  reply.mutable_velocity()->set_y(6);
  reply.set_field_of_view(0.75);
  v1::CandidateCounts& counts = *reply.mutable_candidate_counts();
  counts.set_total(24), counts.set_all_visible(7), counts.set_some_visible(8), counts.set_none_visible(9);
  reply.set_status(v1::TRACKING_STATUS_HOLDING), reply.set_reason(v1::MOVE_REASON_ON_TRAIL),
      reply.set_reason_text("a sentence");
  reply.set_cut(true), reply.set_merged_ticks(2);
  v1::StageTimes& times = *reply.mutable_stage_times();
  times.set_queue_us(1), times.set_scene_us(2), times.set_bound_us(3), times.set_sample_us(4),
      times.set_aggregate_us(5), times.set_move_us(6);
  times.set_total_us(99);
  v1::TargetVisibility& seen = *reply.add_targets();
  seen.set_id(6), seen.set_state(v1::TARGET_STATE_PARTIAL), seen.set_visible_share(0.5), seen.set_filtered_share(0.625),
      seen.set_distance(8);
  for (const uint64_t id : {40, 41}) {
    v1::Occluder& occluder = *seen.add_occluders();
    occluder.set_id(id), occluder.set_share(0.01 * static_cast<double>(id));
  }
  v1::TargetVisibility& open = *reply.add_targets();
  open.set_id(5), open.set_state(v1::TARGET_STATE_VISIBLE), open.set_visible_share(1.0);
  reply.add_targets()->set_id(99);  // none of the page's
  return reply;
}

Convention half_metres() {
  Convention convention;
  convention.metres_per_unit = 0.5;
  return convention;
}

TEST(PageReply, TheShotAndWhatWasWeighedAreInItsFrame) {
  v1::CameraReply reply = full_reply();
  EXPECT_FALSE(page_frame(reply, half_metres(), 1.5, kTargets).shot) << "a session may keep no shot";
  v1::ShotReport& shot = *reply.mutable_shot();
  const auto term = [](v1::ShotTerm& out, double asked, double now, double deviation) {
    out.set_asked(asked), out.set_now(now), out.set_deviation(deviation);
  };
  term(*shot.mutable_side(), 0.1, 0.2, 0.3), term(*shot.mutable_height(), 0.4, 0.5, 0.6),
      term(*shot.mutable_distance(), 8, 10, 0.7), term(*shot.mutable_place(), 0, 0.25, 0.8);
  shot.set_sight_loss(0.15), shot.set_worth(0.35);
  shot.mutable_position()->set_x(6);
  shot.mutable_next_obstruction()->set_target(5), shot.mutable_next_obstruction()->set_hidden_by(40),
      shot.mutable_next_obstruction()->set_in_s(0.9);
  reply.mutable_courses()->set_taken(v1::COURSE_FAR_WAY);
  reply.mutable_courses()->set_stay_loss(0.45);
  const PageShot got = page_frame(reply, half_metres(), 1.5, kTargets).shot.value();
  EXPECT_EQ(got.place_m, glm::dvec3(3, 0, 0));
  EXPECT_THAT(got.asked, ElementsAre(0.1, 0.4, 4.0));
  EXPECT_THAT(got.now, ElementsAre(0.2, 0.5, 5.0));
  EXPECT_THAT(got.deviation, ElementsAre(0.3, 0.6, 0.7, 0.8));
  EXPECT_EQ(got.sight_loss, 0.15);
  EXPECT_EQ(got.worth, 0.35);
  EXPECT_EQ(got.hidden_by, 40u);
  EXPECT_EQ(got.hidden_target, 5u);
  EXPECT_EQ(got.hidden_in_s, 0.9);
  EXPECT_EQ(got.course, "FAR_WAY");
  EXPECT_TRUE(std::isnan(got.losses[0]));
  EXPECT_EQ(got.losses[1], 0.45);
  shot.set_hidden_by(41), shot.set_hidden_target(7);
  const PageShot hidden = page_frame(reply, half_metres(), 1.5, kTargets).shot.value();
  EXPECT_EQ(hidden.hidden_by, 41u) << "what hides it now comes before what will";
  EXPECT_EQ(hidden.hidden_target, 7u);
  EXPECT_TRUE(std::isnan(hidden.hidden_in_s));
}

TEST(PageReply, EveryFieldOfAReplyIsInItsFrame) {
  const PageFrame frame = page_frame(full_reply(), half_metres(), 1.5, kTargets);
  EXPECT_EQ(frame.sequence, 3u);
  EXPECT_EQ(frame.time_s, 1.25) << "the time that the pose is meant for";
  EXPECT_EQ(frame.camera.position_m, glm::dvec3(1, 0, 2));
  EXPECT_EQ(frame.camera.rotation, glm::dquat(1, 0, 0, 0));
  EXPECT_EQ(frame.vertical_fov_rad, 0.75);
  EXPECT_EQ(frame.velocity_mps, glm::dvec3(0, 3, 0));
  EXPECT_EQ(frame.counts.all_visible, 7u);
  EXPECT_EQ(frame.counts.some_visible, 8u);
  EXPECT_EQ(frame.counts.none_visible, 9u);
  EXPECT_EQ(frame.status + " " + frame.reason + " " + frame.text, "HOLDING ON_TRAIL a sentence");
  EXPECT_TRUE(frame.cut);
  EXPECT_EQ(frame.merged_ticks, 2u);
  EXPECT_EQ(frame.queue_us, 1.0);
  EXPECT_THAT(frame.stage_us, ElementsAre(2, 3, 4, 5, 6));
  EXPECT_EQ(frame.stage_us.size(), page_stages().size());
}

TEST(PageReply, SightsAreThoseOfThePagesTargetsInTheirOrder) {
  const PageFrame frame = page_frame(full_reply(), half_metres(), 1.5, kTargets);
  ASSERT_EQ(frame.sights.size(), 3u);
  const PageSight &anna = frame.sights[0], &ben = frame.sights[1];
  EXPECT_TRUE(anna.present && anna.steered);
  EXPECT_EQ(anna.state, "VISIBLE");
  EXPECT_EQ(anna.visible_share, 1.0);
  EXPECT_EQ(anna.occluder_id, 0u);
  EXPECT_EQ(anna.occluder_share, 0.0);
  EXPECT_TRUE(ben.present);
  EXPECT_FALSE(ben.steered) << "its weight is 0";
  EXPECT_EQ(ben.state, "PARTIAL");
  EXPECT_EQ(ben.visible_share, 0.5);
  EXPECT_EQ(ben.filtered_share, 0.625);
  EXPECT_EQ(ben.distance_m, 4.0);
  EXPECT_EQ(ben.occluder_id, 40u) << "the first hides most";
  EXPECT_EQ(ben.occluder_share, 0.4);
  EXPECT_FALSE(frame.sights[2].present);
  EXPECT_TRUE(frame.sights[2].steered);
}

TEST(PageReply, EachFlagHasABitOfItsName) {
  const auto bits_after = [](void (*set)(v1::StepFlags&)) {
    v1::CameraReply reply;
    set(*reply.mutable_flags());
    return page_frame(reply, {}, 1.5, {}).flags;
  };
  const std::vector<std::string> names = page_flags();
  const std::vector<std::pair<std::string, void (*)(v1::StepFlags&)>> flags{
      {"dt capped", [](v1::StepFlags& f) { f.set_dt_capped(true); }},
      {"faces resampled", [](v1::StepFlags& f) { f.set_used_cube_map(true); }},
      {"body overlap", [](v1::StepFlags& f) { f.set_body_overlap(true); }},
      {"degraded", [](v1::StepFlags& f) { f.set_degraded(true); }},
      {"recording degraded", [](v1::StepFlags& f) { f.set_recording_degraded(true); }},
      {"evading", [](v1::StepFlags& f) { f.set_evading(true); }},
      {"deflected", [](v1::StepFlags& f) { f.set_deflected(true); }},
      {"new shot", [](v1::StepFlags& f) { f.set_new_shot(true); }},
      {"distance given up", [](v1::StepFlags& f) { f.set_distance_given_up(true); }},
      {"elevation given up", [](v1::StepFlags& f) { f.set_elevation_given_up(true); }}};
  ASSERT_EQ(names.size(), flags.size());
  for (size_t i = 0; i < flags.size(); ++i) {
    EXPECT_EQ(names[i], flags[i].first);
    EXPECT_EQ(bits_after(flags[i].second), 1u << i) << names[i];
  }
}

TEST(PageReply, CellsAreInMetresAndNameThePagesTargets) {
  v1::CameraReply reply = full_reply();  // its targets are ben, anna, and one that the page does not know
  v1::Candidates& candidates = *reply.mutable_candidates();
  for (const float value : {2.0f, 4.0f, 6.0f, -2.0f, 0.0f, 1.0f}) candidates.add_positions(value);
  candidates.add_visible_masks(0b101), candidates.add_visible_masks(0b010);
  candidates.set_chosen_index(1);
  PageFrame frame;
  add_page_cells(reply, half_metres(), kTargets, frame);
  ASSERT_EQ(frame.cells.size(), 2u);
  EXPECT_EQ(frame.cells[0].position_m, glm::vec3(1, 2, 3));
  EXPECT_EQ(frame.cells[1].position_m, glm::vec3(-1, 0, 0.5f));
  EXPECT_EQ(frame.cells[0].visible_targets, 0b010u);
  EXPECT_EQ(frame.cells[1].visible_targets, 0b001u);
  EXPECT_EQ(frame.chosen_cell, 1);
  for (const int chosen : {-1, -7, 2}) {
    candidates.set_chosen_index(chosen);
    PageFrame other;
    add_page_cells(reply, half_metres(), kTargets, other);
    EXPECT_EQ(other.chosen_cell, -1) << chosen;
  }
  PageFrame without;
  add_page_cells(full_reply(), half_metres(), kTargets, without);
  EXPECT_TRUE(without.cells.empty());
  EXPECT_EQ(without.chosen_cell, -1);
}

}  // namespace
}  // namespace sightline
