// The trace of a drive, field by field against texts written by hand.
#include "client/drive/trace.h"

#include <gtest/gtest.h>

#include <sstream>

#include "tests/support/small_scenes.h"

namespace sightline {
namespace {

const std::string kColumns =
    "sequence,time_s,pose_time_s,x_m,y_m,z_m,qx,qy,qz,qw,vx_mps,vy_mps,vz_mps,vertical_fov_rad,candidates,s_v,s_p,s_n,"
    "status,reason,volume,"
    "pair_fallback,merged_ticks,cut,dt_capped,resampled_faces,body_overlap,latency_ms,queue_us,scene_us,bound_us,"
    "sample_us,aggregate_us,"
    "move_us,total_us,clearance_m,crossed,r_n,r_p,r_p_tolerant";

std::string columns_of(const std::string& target) {
  std::string columns;
  for (const char* column : {"state", "visible_share", "in_picture", "distance_m", "occluder", "occluder_share",
                             "true_alone_px", "true_visible_px", "true_visible_share"})
    columns += "," + target + "." + column;
  return columns;
}

// A reply in which every field differs from the others.
PlayedFrame full_frame() {
  PlayedFrame frame;
  v1::CameraReply& reply = frame.reply;
  reply.set_sequence(7), reply.set_time_s(1.5), reply.set_pose_time_s(1.625);
  v1::Vec3& place = *reply.mutable_pose()->mutable_position();
  place.set_x(0.1), place.set_y(2), place.set_z(-3);
  v1::Quat& rotation = *reply.mutable_pose()->mutable_rotation();
  rotation.set_x(0.5), rotation.set_y(-0.5), rotation.set_z(0.25), rotation.set_w(0.75);
  reply.mutable_velocity()->set_x(4), reply.mutable_velocity()->set_y(5), reply.mutable_velocity()->set_z(6);
  reply.set_field_of_view(0.875);
  v1::CandidateCounts& counts = *reply.mutable_candidate_counts();
  counts.set_total(100), counts.set_all_visible(60), counts.set_some_visible(30), counts.set_none_visible(10);
  reply.set_status(v1::TRACKING_STATUS_PARTIAL_VIEW), reply.set_reason(v1::MOVE_REASON_ON_TRAIL);
  reply.set_volume_used(v1::VOLUME_USED_PAIR), reply.set_pair_fallback(v1::PAIR_FALLBACK_ON_LINE);
  reply.set_merged_ticks(3), reply.set_cut(true);
  reply.mutable_flags()->set_used_cube_map(true);
  v1::StageTimes& times = *reply.mutable_stage_times();
  times.set_queue_us(11), times.set_scene_us(12), times.set_bound_us(13), times.set_sample_us(14);
  times.set_aggregate_us(15), times.set_move_us(16), times.set_total_us(81);
  frame.latency_ms = 1.0 / 3.0;
  return frame;
}

v1::TargetVisibility& see(PlayedFrame& frame, uint64_t id, v1::TargetState state, double share) {
  v1::TargetVisibility& seen = *frame.reply.add_targets();
  seen.set_id(id), seen.set_state(state), seen.set_visible_share(share), seen.set_in_picture(true),
      seen.set_distance(9.25);
  return seen;
}

// Two targets; the name of the second needs quotes.
class TraceTest : public testing::Test {
 protected:
  TraceTest()
      : place_(test::SmallScene(1.0, {0, 1, 8}).target("anna", {-1, 0, 0}).target("ben \"b\", late", {1, 0, 0})) {
    out_.precision(3);
  }
  std::string trace(const std::vector<PlayedFrame>& frames, const std::vector<FrameTruth>& truths) {
    out_.str("");
    write_trace(out_, place_.scenario, frames, truths);
    return out_.str();
  }
  uint64_t id(size_t k) const { return place_.scenario.targets().at(k).id; }

  const std::string header_ =
      kColumns + columns_of("anna") +
      ",\"ben \"\"b\"\", late.state\",\"ben \"\"b\"\", late.visible_share\",\"ben \"\"b\"\", late.in_picture\","
      "\"ben \"\"b\"\", late.distance_m\",\"ben \"\"b\"\", late.occluder\",\"ben \"\"b\"\", late.occluder_share\","
      "\"ben \"\"b\"\", late.true_alone_px\",\"ben \"\"b\"\", late.true_visible_px\","
      "\"ben \"\"b\"\", late.true_visible_share\"\n";
  const std::string reply_ =
      "7,1.5,1.625,0.10000000000000001,2,-3,0.5,-0.5,0.25,0.75,4,5,6,0.875,100,60,30,10,PARTIAL_VIEW,ON_TRAIL,PAIR,ON_"
      "LINE,3,1,0,1,0,"
      "0.333333,11,12,13,14,15,16,81";
  test::Place place_;
  std::ostringstream out_;
};

TEST_F(TraceTest, HasAHeaderWithTheColumnsOfEveryTarget) {
  EXPECT_EQ(trace({}, {}), header_);
}

TEST_F(TraceTest, HoldsWhatTheReplyAndTheTruthSay) {
  PlayedFrame frame = full_frame();
  see(frame, id(1), v1::TARGET_STATE_VISIBLE, 1.0);
  v1::Occluder& occluder = *see(frame, id(0), v1::TARGET_STATE_PARTIAL, 2.0 / 3.0).add_occluders();
  occluder.set_id(42), occluder.set_share(0.125);
  FrameTruth truth;
  truth.body.clearance_m = 2.5f, truth.body.crossed = true;
  truth.picture.emplace().targets = {{id(0), 300, 100, true}, {id(1), 50, 50, true}};
  EXPECT_EQ(trace({frame}, {truth}), header_ + reply_ +
                                         ",2.5,1,0,1,1,PARTIAL,0.666667,1,9.25,42,0.125,300,100,0.333333" +
                                         ",VISIBLE,1,1,9.25,,,50,50,1\n");
}

TEST_F(TraceTest, LeavesEmptyWhatIsNotKnown) {
  PlayedFrame with_one = full_frame();
  see(with_one, id(1), v1::TARGET_STATE_OFF_SCREEN, 0.0);
  FrameTruth body_only, with_picture;
  body_only.body.clearance_m = 4.0f;
  with_picture.picture.emplace().targets = {{id(1), 8, 0, true}};
  const std::string unseen = ",,,,,,", no_truth = ",,,", ben = ",OFF_SCREEN,0,1,9.25,,";
  EXPECT_EQ(trace({with_one}, {}), header_ + reply_ + ",,,,," + unseen + no_truth + ben + no_truth + "\n");
  EXPECT_EQ(trace({with_one}, {body_only}), header_ + reply_ + ",4,0,,," + unseen + no_truth + ben + no_truth + "\n");
  EXPECT_EQ(trace({with_one}, {with_picture}), header_ + reply_ + ",10,0,1,0,0" + unseen + no_truth + ben + ",8,0,0\n");
  const std::string two = trace({with_one, with_one}, {body_only, with_picture});
  EXPECT_EQ(two, trace({with_one}, {body_only}) + trace({with_one}, {with_picture}).substr(header_.size()));
}

TEST_F(TraceTest, LeavesThePrecisionOfTheStreamAsItWas) {
  trace({full_frame()}, {});
  EXPECT_EQ(out_.precision(), 3);
}

}  // namespace
}  // namespace sightline
