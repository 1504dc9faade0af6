// Tables of figures against values worked out by hand.
#include "client/report/figures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace sightline {
namespace {

using Rows = std::vector<std::pair<std::string, std::vector<std::string>>>;

Rows plain(const std::vector<FigureRow>& rows) {
  Rows all;
  for (const FigureRow& row : rows) all.emplace_back(row.label, row.values);
  return all;
}

void expect_rows(const std::vector<FigureRow>& rows, const Rows& expected) {
  const Rows got = plain(rows);
  ASSERT_EQ(got.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(got[i].first, expected[i].first) << "row " << i;
    EXPECT_EQ(got[i].second, expected[i].second) << expected[i].first;
  }
}

v1::CameraReply reply_at(double time_s, double x_units) {
  v1::CameraReply reply;
  reply.set_pose_time_s(time_s);
  reply.mutable_pose()->mutable_position()->set_x(x_units);
  reply.mutable_pose()->mutable_rotation()->set_w(1.0);
  reply.set_field_of_view(0.8);
  reply.set_status(v1::TRACKING_STATUS_TRACKING);
  reply.set_reason(v1::MOVE_REASON_ON_TRAIL);
  return reply;
}

struct Sight {
  double visible, filtered, distance_units;
  v1::TargetState state;
  bool in_picture = true;
};

void see(v1::CameraReply& reply, uint64_t id, const Sight& sight) {
  v1::TargetVisibility& seen = *reply.add_targets();
  seen.set_id(id), seen.set_visible_share(sight.visible), seen.set_filtered_share(sight.filtered);
  seen.set_distance(sight.distance_units), seen.set_state(sight.state), seen.set_in_picture(sight.in_picture);
}

// Six replies at 2 Hz for a client whose unit is half a metre. The camera's speed rises by 2 m/s a step, from rest, to
// 6 m/s. Then it cuts. The last reply has no target.
ReplyFigures long_run(const Convention& convention) {
  ReplyFigures run(convention);
  const double x_units[] = {0, 2, 6, 12, 200, 200};
  const Sight sights[] = {{1.0, 1.0, 2, v1::TARGET_STATE_VISIBLE},
                          {0.5, 1.0, 4, v1::TARGET_STATE_PARTIAL},
                          {0.0, 0.5, 6, v1::TARGET_STATE_OCCLUDED},
                          {0.5, 0.5, 8, v1::TARGET_STATE_PARTIAL, false},
                          {1.0, 1.0, 5, v1::TARGET_STATE_VISIBLE}};
  for (int i = 0; i < 6; ++i) {
    v1::CameraReply reply = reply_at(0.5 * i, x_units[i]);
    if (i < 5) see(reply, 10, sights[i]);
    if (i == 4) reply.set_cut(true);
    if (i >= 3) reply.set_status(v1::TRACKING_STATUS_PARTIAL_VIEW);
    if (i == 5) reply.set_reason(v1::MOVE_REASON_AT_DESIRED_PLACE);
    reply.set_merged_ticks(i == 1 ? 2 : i == 2 ? 3 : 0);
    v1::StepFlags& flags = *reply.mutable_flags();
    flags.set_degraded(i == 0), flags.set_recording_degraded(i < 2), flags.set_body_overlap(i < 3);
    v1::StageTimes& times = *reply.mutable_stage_times();
    times.set_queue_us(1000.0f * static_cast<float>(i + 1));
    times.set_scene_us(100), times.set_bound_us(200), times.set_sample_us(300), times.set_aggregate_us(400);
    times.set_move_us(500), times.set_total_us(2000);
    run.add(reply);
  }
  return run;
}

TEST(ReplyRows, AreTheFiguresOfEachRun) {
  Convention convention;
  convention.metres_per_unit = 0.5;
  const ReplyFigures first = long_run(convention);
  ReplyFigures second(convention);
  v1::CameraReply only = reply_at(0.0, 0.0);
  see(only, 11, {0.25, 0.5, 4, v1::TARGET_STATE_PARTIAL});
  second.add(only);
  const ReplyFigures* const runs[] = {&first, &second};
  const std::string none = "p50 0.000  p99 0.000 ms";
  expect_rows(reply_rows(runs, {{10, "anna"}}), {
                                                    {"replies", {"6", "1"}},
                                                    {"visible share: anna", {"60.00 %", "-"}},
                                                    {"filtered share: anna", {"80.00 %", "-"}},
                                                    {"distance: anna", {"2.50 m", "-"}},
                                                    {"visible share: target 11", {"-", "25.00 %"}},
                                                    {"filtered share: target 11", {"-", "50.00 %"}},
                                                    {"distance: target 11", {"-", "2.00 m"}},
                                                    {"every target wholly seen", {"40.0 %", "0.0 %"}},
                                                    {"all targets seen", {"60.0 %", "100.0 %"}},
                                                    {"reason at desired place", {"16.7 %", "0.0 %"}},
                                                    {"reason on trail", {"83.3 %", "100.0 %"}},
                                                    {"status partial view", {"50.0 %", "0.0 %"}},
                                                    {"status tracking", {"50.0 %", "100.0 %"}},
                                                    {"camera travel", {"6.00 m", "0.00 m"}},
                                                    {"peak speed", {"6.00 m/s", "0.00 m/s"}},
                                                    {"rms speed", {"4.32 m/s", "0.00 m/s"}},
                                                    {"peak acceleration", {"4.00 m/s2", "0.00 m/s2"}},
                                                    {"rms acceleration", {"4.00 m/s2", "0.00 m/s2"}},
                                                    {"peak jerk", {"8.0 m/s3", "0.0 m/s3"}},
                                                    {"rms jerk", {"4.6 m/s3", "0.0 m/s3"}},
                                                    {"peak turn", {"0.000 rad/s", "0.000 rad/s"}},
                                                    {"cuts", {"1", "0"}},
                                                    {"ticks merged into a later reply", {"5", "0"}},
                                                    {"degraded steps", {"1", "0"}},
                                                    {"steps with a degraded recording", {"2", "0"}},
                                                    {"steps with the body in a collider", {"3", "0"}},
                                                    {"stage queue", {"p50 3.000  p99 6.000 ms", none}},
                                                    {"stage scene", {"p50 0.100  p99 0.100 ms", none}},
                                                    {"stage bound", {"p50 0.200  p99 0.200 ms", none}},
                                                    {"stage sample", {"p50 0.300  p99 0.300 ms", none}},
                                                    {"stage aggregate", {"p50 0.400  p99 0.400 ms", none}},
                                                    {"stage move", {"p50 0.500  p99 0.500 ms", none}},
                                                    {"stage all", {"p50 2.000  p99 2.000 ms", none}},
                                                });
}

TEST(ReplyRows, OfARunWithoutRepliesAreNoNumbersThatDivideByNothing) {
  const ReplyFigures empty{Convention{}};
  const ReplyFigures* const runs[] = {&empty};
  for (const FigureRow& row : reply_rows(runs)) {
    ASSERT_EQ(row.values.size(), 1u) << row.label;
    EXPECT_EQ(row.values[0].find("nan"), std::string::npos) << row.label;
    EXPECT_EQ(row.values[0] == "not known", row.label.starts_with("stage ")) << row.label << ": " << row.values[0];
  }
}

RunMetrics judged_run() {
  RunMetrics run;
  run.frames = 40, run.pictures = 20;
  run.targets = {{.id = 1, .name = "anna", .mean_visible_share = 0.5, .mean_whole_share = 0.45, .in_frame_share = 0.75},
                 {.id = 2, .name = "ben", .mean_visible_share = 1.0, .mean_whole_share = 0.55, .in_frame_share = 0.25}};
  run.r_n = 0.05, run.r_p = 0.6, run.r_p_tolerant = 0.15, run.all_seen = 0.9, run.joint_whole_share = 0.35;
  run.body_collisions = 3, run.least_clearance_m = 0.375, run.limit_violations = 4, run.d_c_m = 12.25;
  return run;
}

TEST(TruthRows, AreTheJudgedFiguresOfBothRuns) {
  const RunMetrics run = judged_run();
  RunMetrics other = judged_run();
  other.targets[1].mean_visible_share = 0.125, other.r_n = 0.25, other.body_collisions = 0, other.d_c_m = 1.0;
  const Rows expected = {{"mean visible share: anna", {"50.0 %", "50.0 %"}},
                         {"mean share of the whole body: anna", {"45.0 %", "45.0 %"}},
                         {"in frame: anna", {"75.0 %", "75.0 %"}},
                         {"mean visible share: ben", {"100.0 %", "12.5 %"}},
                         {"mean share of the whole body: ben", {"55.0 %", "55.0 %"}},
                         {"in frame: ben", {"25.0 %", "25.0 %"}},
                         {"r_N (no target visible)", {"5.0 %", "25.0 %"}},
                         {"r_P (partly hidden)", {"60.0 %", "60.0 %"}},
                         {"r_P with 5 % tolerance", {"15.0 %", "15.0 %"}},
                         {"all targets seen (a pixel of each)", {"90.0 %", "90.0 %"}},
                         {"all targets whole (95 % of each seen in the picture)", {"35.0 %", "35.0 %"}},
                         {"all targets clear (95 % of the part inside)", {"80.0 %", "60.0 %"}},
                         {"body collisions (frames)", {"3", "0"}},
                         {"least clearance", {"0.38 m", "0.38 m"}},
                         {"motion limit violations (frames)", {"4", "4"}},
                         {"path length d_c", {"12.2 m", "1.0 m"}}};
  expect_rows(truth_rows(run, other), expected);
  Rows alone = expected;
  for (auto& [label, values] : alone) values.pop_back();
  expect_rows(truth_rows(run, std::nullopt), alone);
}

TEST(TruthRows, WithoutAPictureAreOfTheBodyAndItsWay) {
  RunMetrics run = judged_run();
  run.pictures = 0;
  expect_rows(truth_rows(run, std::nullopt), {{"body collisions (frames)", {"3"}},
                                              {"least clearance", {"0.38 m"}},
                                              {"motion limit violations (frames)", {"4"}},
                                              {"path length d_c", {"12.2 m"}}});
}

TEST(PrintedRows, StandUnderTheNamesOfTheirColumns) {
  const std::vector<std::string> columns{"run", "follow"};
  const std::vector<FigureRow> rows{{"first", {"1", "22"}}, {"second", {"a value of many letters", "x"}}};
  const auto printed = [&](std::span<const std::string> names, std::span<const FigureRow> of) {
    std::ostringstream out;
    print_rows(out, names, of);
    return out.str();
  };
  const auto gap = [](size_t n) { return std::string(n, ' '); };
  EXPECT_EQ(printed(columns, rows), gap(46) + gap(22) + "run" + gap(19) + "follow\n" +            //
                                        "  first" + gap(39) + gap(24) + "1" + gap(23) + "22\n" +  //
                                        "  second" + gap(38) + "  a value of many letters" + gap(24) + "x\n");
  EXPECT_EQ(printed({}, std::span(rows).first(1)), "  first" + gap(39) + gap(13) + "1" + gap(12) + "22\n");
}

// Motion across a jump is no motion of the camera.
TEST(FrameOfAReply, IsAJumpAfterACutOrATickTooLongToFly) {
  v1::CameraReply plain, cut, capped;
  for (v1::CameraReply* reply : {&plain, &cut, &capped}) reply->mutable_pose()->mutable_rotation()->set_w(1);
  cut.set_cut(true);
  capped.mutable_flags()->set_dt_capped(true);
  EXPECT_FALSE(frame_of(plain, {}).jump);
  EXPECT_TRUE(frame_of(cut, {}).jump);
  EXPECT_TRUE(frame_of(capped, {}).jump);
}

}  // namespace
}  // namespace sightline
