// Compares the page of a recording with the recording and with the messages of its session.
#include "client/report/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>

#include "client/report/digest.h"
#include "client/report/placeholders.h"
#include "client/report/report_command.h"
#include "client/scenario/scenario_session.h"
#include "server/sample/embree_sampler.h"
#include "server/wire/short_name.h"
#include "tests/replay/recorded_hall.h"
#include "tests/report/recorded_yard.h"
#include "tests/support/temporary_folder.h"

namespace sightline::test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class ReportPage : public testing::Test {
 protected:
  const std::unique_ptr<SamplerDevice> sampler_ = make_embree_sampler_device();

  static Recording read(const std::string& bytes) {
    auto recording = Recording::open(std::make_shared<MemorySource>(bytes), "folder/memory.mcap");
    EXPECT_TRUE(recording.has_value()) << to_string(recording.error());
    return std::move(*recording);
  }

  // The same file with changed replies.
  static std::string rewritten(const std::string& bytes, const std::function<void(v1::CameraReply&)>& change) {
    const Recording recording = read(bytes);
    std::string out;
    RecordingWriter writer(std::make_unique<StringSink>(out), recording.info());
    EXPECT_TRUE(writer.write(recording.open_session(), recording.start_ns()));
    EXPECT_TRUE(writer.write(recording.opened(), recording.start_ns()));
    recording.read({}, [&](RecordedEvent& event) {
      if (auto* reply = std::get_if<v1::CameraReply>(&event.message)) {
        change(*reply);
        EXPECT_TRUE(writer.write(*reply, event.log_ns));
      } else {
        EXPECT_TRUE(writer.write(std::get<v1::Tick>(event.message), event.log_ns));
      }
      return true;
    });
    EXPECT_TRUE(writer.finish());
    return out;
  }

  static RecordingPageOptions plain() {
    RecordingPageOptions options;
    options.pictures = 0;
    return options;
  }

  SessionPage page_of(const std::string& bytes, const RecordingPageOptions& options = plain()) {
    const Recording recording = read(bytes);
    auto page = recording_page(recording, options, *sampler_);
    EXPECT_TRUE(page.has_value()) << to_string(page.error());
    EXPECT_TRUE(session_page(*page).has_value());
    return std::move(*page);
  }

  // Frame i is reply i: no frames are left out.
  static size_t frame_of(const RecordedYard& yard, int tick) {
    for (size_t i = 0; i < yard.replies.size(); ++i)
      if (yard.replies[i].sequence() >= static_cast<uint64_t>(tick) + 1) return i;
    return yard.replies.size();
  }

  static std::vector<const PageInstance*> instances_of(const SessionPage& page, uint64_t id) {
    std::vector<const PageInstance*> found;
    for (const PageInstance& instance : page.instances)
      if (instance.id == id) found.push_back(&instance);
    return found;
  }

  // Among the first `count` frames. Only decisions have cells.
  static size_t frames_with_cells(const SessionPage& page, size_t count = SIZE_MAX) {
    const auto frames = std::span(page.frames).first(std::min(count, page.frames.size()));
    return static_cast<size_t>(std::ranges::count_if(frames, [](const PageFrame& f) { return !f.cells.empty(); }));
  }

  static std::string figure(const SessionPage& page, const std::string& name) {
    for (const FigureRow& row : page.figures)
      if (row.label == name) return row.values.at(0);
    return "no figure " + name;
  }
};

TEST_F(ReportPage, FramesAreTheRepliesOfTheFile) {
  const RecordedYard yard = record_yard(*sampler_);
  const SessionPage page = page_of(yard.bytes);
  ASSERT_EQ(page.frames.size(), yard.replies.size());
  for (size_t i = 0; i < page.frames.size(); ++i) {
    const v1::CameraReply& reply = yard.replies[i];
    const PageFrame& frame = page.frames[i];
    EXPECT_EQ(frame.sequence, reply.sequence());
    EXPECT_EQ(frame.time_s, reply.pose_time_s());
    EXPECT_EQ(frame.merged_ticks, reply.merged_ticks());
    EXPECT_EQ(frame.stage_us[2], reply.stage_times().sample_us());
    EXPECT_EQ((frame.flags & 8u) != 0, reply.flags().degraded());
    EXPECT_EQ(frame.reason, short_name(reply.reason()));
    EXPECT_NEAR(frame.latency_ms, 1.5, 1e-6);
    // The client's world is offset by 1000 m, 20 m and -500 m; the page's world is relative to the world origin.
    EXPECT_NEAR(frame.camera.position_m.x, reply.pose().position().x() - 1000, 1e-9);
    EXPECT_NEAR(frame.camera.position_m.z, reply.pose().position().z() + 500, 1e-9);
  }
  EXPECT_THAT(page.facts, Contains(std::pair<std::string, std::string>("server", "1.2.3")));
  EXPECT_THAT(page.facts, Contains(std::pair<std::string, std::string>("start", "2023-11-14 22:13:20 UTC")));
  EXPECT_EQ(page.title, "yard");
}

TEST_F(ReportPage, TheSameSessionInAnyConventionIsTheSamePage) {
  const auto told_in = [&](v1::Convention::Preset convention) {
    // The order of a shape's triangles decides which of its points are sampled; the aim point is the same in any
    // order.
    return page_of(record_yard(*sampler_, {.convention = convention, .points = 0}).bytes);
  };
  const SessionPage gltf = told_in(v1::Convention::PRESET_GLTF);
  for (const auto convention :
       {v1::Convention::PRESET_UNITY, v1::Convention::PRESET_UNREAL, v1::Convention::PRESET_ROS}) {
    SCOPED_TRACE(short_name(convention));
    const SessionPage other = told_in(convention);
    ASSERT_EQ(other.frames.size(), gltf.frames.size());
    ASSERT_EQ(other.instances.size(), gltf.instances.size());
    ASSERT_EQ(other.movers.size(), gltf.movers.size());
    for (size_t i = 0; i < gltf.frames.size(); ++i) {
      const PageFrame &a = gltf.frames[i], &b = other.frames[i];
      EXPECT_LT(glm::distance(a.camera.position_m, b.camera.position_m), 1e-6) << i;
      EXPECT_LT(angle_between(a.camera.rotation, b.camera.rotation), 1e-6) << i;
      EXPECT_LT(glm::distance(a.velocity_mps, b.velocity_mps), 1e-6) << i;
      EXPECT_NEAR(a.vertical_fov_rad, b.vertical_fov_rad, 1e-9);
      EXPECT_EQ(a.status, b.status) << i;
      EXPECT_EQ(a.counts.all_visible, b.counts.all_visible) << i;
      for (size_t k = 0; k < gltf.targets.size(); ++k) {
        EXPECT_LT(glm::distance(a.sights[k].aim_m, b.sights[k].aim_m), 1e-6);
        EXPECT_NEAR(a.sights[k].distance_m, b.sights[k].distance_m, 1e-6);
        EXPECT_EQ(a.sights[k].visible_share, b.sights[k].visible_share) << i;
      }
      ASSERT_EQ(a.cells.size(), b.cells.size());
      // Cells cross the wire in single precision, far from the origin in Unreal's centimetres.
      for (size_t c = 0; c < a.cells.size(); c += 50)
        EXPECT_LT(glm::distance(a.cells[c].position_m, b.cells[c].position_m), 0.01f);
    }
    for (size_t m = 0; m < gltf.movers.size(); ++m)
      for (size_t i = 0; i < gltf.movers[m].poses.size(); ++i) {
        EXPECT_LT(glm::distance(gltf.movers[m].poses[i].position_m, other.movers[m].poses[i].position_m), 1e-6);
        EXPECT_LT(angle_between(gltf.movers[m].poses[i].rotation, other.movers[m].poses[i].rotation), 1e-6);
      }
    for (size_t i = 0; i < gltf.instances.size(); ++i) {
      EXPECT_LT(glm::distance(gltf.instances[i].world_from_instance[3], other.instances[i].world_from_instance[3]),
                1e-6);
      EXPECT_LT(glm::distance(gltf.instances[i].geometry->bounds.max, other.instances[i].geometry->bounds.max), 1e-4f);
    }
  }
}

TEST_F(ReportPage, InstancesComeGoHideAndMoveInTheirFrames) {
  const RecordedYard yard = record_yard(*sampler_);
  const SessionPage page = page_of(yard.bytes);
  const auto crate = instances_of(page, kYardCrate);
  ASSERT_EQ(crate.size(), 1u);
  EXPECT_EQ(crate[0]->first_frame, frame_of(yard, kYardCrateComes));
  EXPECT_EQ(crate[0]->end_frame, frame_of(yard, kYardCrateGoes));
  const auto mover = std::find_if(page.movers.begin(), page.movers.end(),
                                  [&](const PageMover& m) { return page.instances[m.instance].id == kYardCrate; });
  ASSERT_NE(mover, page.movers.end());
  EXPECT_NEAR(mover->poses[0].position_m.x, 0, 1e-9);  // it stood still when it was added
  // 60 ticks after the first one, it stands at one metre.
  EXPECT_NEAR(mover->poses[frame_of(yard, 60) - crate[0]->first_frame].position_m.x, 1.0, 1e-9);

  const auto pillar = instances_of(page, kYardPillar);
  ASSERT_EQ(pillar.size(), 2u);
  EXPECT_EQ(pillar[0]->first_frame, 0u);
  EXPECT_EQ(pillar[0]->end_frame, frame_of(yard, kYardPillarHides));
  EXPECT_EQ(pillar[1]->first_frame, frame_of(yard, kYardPillarShows));
  EXPECT_GE(pillar[1]->end_frame, page.frames.size());
}

double distance_to_box_m(const glm::dvec3& point_m, const glm::dvec3& centre_m, const glm::dvec3& half_extent_m) {
  return glm::length(glm::max(glm::abs(point_m - centre_m) - half_extent_m, glm::dvec3(0)));
}

// The floor, the wall and the pillar of the yard, before anything else comes.
double distance_to_yard_m(const glm::dvec3& point_m) {
  return std::min({distance_to_box_m(point_m, {0, -0.1, 0}, {20, 0.1, 20}),
                   distance_to_box_m(point_m, {0, 2, -6}, {4, 2, 0.2}),
                   distance_to_box_m(point_m, {1.5, 2, 3}, {0.5, 2, 0.5})});
}

TEST_F(ReportPage, TheNearestColliderIsMeasuredFromTheCameraOfEachFrame) {
  const RecordedYard yard = record_yard(*sampler_);
  const SessionPage page = page_of(yard.bytes);
  for (size_t i = 0; i < frame_of(yard, kYardCrateComes); ++i)
    EXPECT_NEAR(page.frames[i].clearance_m, distance_to_yard_m(page.frames[i].camera.position_m), 1e-4) << i;
  for (const PageFrame& frame : page.frames) {
    EXPECT_GT(frame.clearance_m, 0);
    EXPECT_LT(frame.clearance_m, page.clearance_reach_m);
  }
}

TEST_F(ReportPage, TargetsThatChangeAreAllThereEachInItsFrames) {
  const RecordedYard yard = record_yard(*sampler_);
  const SessionPage page = page_of(yard.bytes);
  ASSERT_EQ(page.targets.size(), 3u);
  EXPECT_EQ(page.targets[0].id, kYardFirst);
  EXPECT_EQ(page.targets[2].id, kYardThird);
  const size_t change = frame_of(yard, kYardTargetsChange);
  for (size_t i = 0; i < page.frames.size(); ++i) {
    const auto& sights = page.frames[i].sights;
    ASSERT_EQ(sights.size(), 3u);
    EXPECT_TRUE(sights[0].present);
    EXPECT_EQ(sights[1].present, i < change);
    EXPECT_EQ(sights[2].present, i >= change);
  }
  // The reply's second target from then on is the page's first; its mask bit moves with it.
  const v1::CameraReply& after = yard.replies[change];
  EXPECT_EQ(after.targets(1).id(), kYardFirst);
  EXPECT_EQ(page.frames[change].sights[0].visible_share, after.targets(1).visible_share());
}

TEST_F(ReportPage, MasksOfCellsFollowTheTargetsOfThePage) {
  const RecordedYard yard = record_yard(*sampler_, {.candidates = true});
  const SessionPage page = page_of(yard.bytes);
  // By the reply's target, before and after the change.
  const std::vector<std::vector<size_t>> page_targets = {{0, 1}, {2, 0}};
  for (size_t i = 0; i < page.frames.size(); ++i) {
    const v1::Candidates& candidates = yard.replies[i].candidates();
    ASSERT_EQ(page.frames[i].cells.size(), static_cast<size_t>(candidates.visible_masks_size()));
    EXPECT_EQ(page.frames[i].chosen_cell, candidates.chosen_index());
    const auto& places = page_targets[i < frame_of(yard, kYardTargetsChange) ? 0 : 1];
    for (size_t c = 0; c < page.frames[i].cells.size(); ++c)
      for (size_t k = 0; k < 2; ++k)
        ASSERT_EQ(page.frames[i].cells[c].visible_targets >> places[k] & 1u,
                  candidates.visible_masks(static_cast<int>(c)) >> k & 1u);
  }
}

TEST_F(ReportPage, StepsTakenAgainGiveTheCellsThatWereNotRecorded) {
  const SessionPage recorded = page_of(record_yard(*sampler_, {.candidates = true}).bytes);
  const SessionPage again = page_of(record_yard(*sampler_).bytes);
  ASSERT_EQ(again.frames.size(), recorded.frames.size());
  for (size_t i = 0; i < again.frames.size(); ++i) {
    ASSERT_EQ(again.frames[i].cells.size(), recorded.frames[i].cells.size()) << i;
    EXPECT_EQ(again.frames[i].chosen_cell, recorded.frames[i].chosen_cell);
    for (size_t c = 0; c < again.frames[i].cells.size(); ++c) {
      EXPECT_EQ(again.frames[i].cells[c].position_m, recorded.frames[i].cells[c].position_m);
      EXPECT_EQ(again.frames[i].cells[c].visible_targets, recorded.frames[i].cells[c].visible_targets);
    }
  }
  for (const PageCells cells : {PageCells::kRecorded, PageCells::kNone}) {
    RecordingPageOptions options = plain();
    options.cells = cells;
    EXPECT_EQ(frames_with_cells(page_of(record_yard(*sampler_).bytes, options)), 0u);
  }
}

// An invented reply in the middle.
TEST_F(ReportPage, CellsEndWhereTheRecordingDiffersFromTheStepsTakenAgain) {
  const RecordedYard yard = record_yard(*sampler_, {.eventful = false});
  const SessionPage page = page_of(rewritten(yard.bytes, [](v1::CameraReply& reply) {
    if (reply.sequence() == 100) reply.mutable_pose()->mutable_position()->set_x(reply.pose().position().x() + 1e-9);
  }));
  EXPECT_EQ(frames_with_cells(page), frames_with_cells(page_of(yard.bytes), 99));
  EXPECT_THAT(page.notices, ElementsAre(HasSubstr("differ from the recording from tick 100 on")));
}

TEST_F(ReportPage, ALevelOfEconomyThatThereIsNotEndsTheCells) {
  const RecordedYard yard = record_yard(*sampler_, {.ticks = 20, .eventful = false});
  for (const uint32_t level : {6u, 1u << 20, UINT32_MAX}) {
    const SessionPage page = page_of(rewritten(yard.bytes, [&](v1::CameraReply& reply) {
      if (reply.sequence() == 10) reply.mutable_degradation()->set_quality_level(level);
    }));
    EXPECT_EQ(frames_with_cells(page), frames_with_cells(page_of(yard.bytes), 9)) << level;
  }
}

TEST_F(ReportPage, RepliesThatMakeNoSenseAreLeftOutOrShownAsFarAsTheyDo) {
  const RecordedYard yard = record_yard(*sampler_, {.ticks = 60, .eventful = false, .candidates = true});
  const SessionPage page = page_of(rewritten(yard.bytes, [](v1::CameraReply& reply) {
    const uint64_t i = reply.sequence();
    if (i == 10) reply.mutable_pose()->mutable_position()->set_y(NAN);
    if (i == 11) reply.clear_pose();  // the identity at the origin is a pose
    if (i == 12) reply.mutable_pose()->mutable_rotation()->set_w(7);
    if (i == 13) reply.set_field_of_view(INFINITY);
    if (i == 14) reply.set_pose_time_s(-1e300);
    if (i == 15) reply.set_status(static_cast<v1::TrackingStatus>(77));
    if (i == 16) reply.mutable_candidates()->set_chosen_index(1'000'000);
    if (i == 17) reply.mutable_candidates()->mutable_positions()->Truncate(4);
    if (i == 18) reply.mutable_candidates()->set_chosen_index(-7);
    if (i == 19) reply.mutable_targets(0)->set_visible_share(NAN);
    if (i == 20)
      for (uint64_t id = 100; id < 140; ++id) reply.add_targets()->set_id(id);
  }));
  EXPECT_THAT(page.notices, Contains(HasSubstr("replies have no pose that could be shown")));
  EXPECT_THAT(page.notices, Contains(HasSubstr("Only the first 32 targets are shown; 10 more")));
  EXPECT_GE(page.frames.size(), 56u);
  EXPECT_EQ(page.targets.size(), 32u);
  for (size_t i = 1; i < page.frames.size(); ++i) EXPECT_GE(page.frames[i].time_s, page.frames[i - 1].time_s);
  // An unknown instance has no aim point.
  EXPECT_TRUE(std::isnan(page.frames.back().sights[31].aim_m.x) || !page.frames.back().sights[31].present);
}

TEST_F(ReportPage, AnyTruncationIsAPageOrAnError) {
  const std::string bytes = record_yard(*sampler_, {.ticks = 12, .eventful = false}).bytes;
  RecordingPageOptions options = plain();
  options.cells = PageCells::kNone;
  size_t pages = 0, errors = 0;
  for (size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 150) {
    const std::string part = bytes.substr(0, size);  // which the source only refers to
    const auto recording = Recording::open(std::make_shared<MemorySource>(part), "cut");
    if (!recording) {
      EXPECT_FALSE(recording.error().message.empty());
      ++errors;
      continue;
    }
    const auto page = recording_page(*recording, options, *sampler_);
    if (page) {
      EXPECT_TRUE(session_page(*page).has_value());
    }
    ++(page ? pages : errors);
  }
  EXPECT_GT(pages, 0u);
  EXPECT_GT(errors, 0u);
}

TEST_F(ReportPage, WhatHappenedStandsOnTheTimeLine) {
  const RecordedYard yard = record_yard(*sampler_);
  const SessionPage page = page_of(yard.bytes);
  const auto at = [&](const std::string& kind) {
    std::vector<size_t> frames;
    for (const PageMark& mark : page.marks)
      if (mark.kind == kind) frames.push_back(mark.frame);
    return frames;
  };
  EXPECT_THAT(at("rejection"), ElementsAre(frame_of(yard, kYardRefused + 1)));
  EXPECT_THAT(at("fault"), ElementsAre(frame_of(yard, kYardFault)));
  EXPECT_THAT(at("gap"), ElementsAre(frame_of(yard, kYardGap)));
  const size_t settings = frame_of(yard, kYardSettings);
  EXPECT_THAT(at("change"), ElementsAre(frame_of(yard, kYardTargetsChange), settings, settings));
  EXPECT_THAT(page.marks[1].text, HasSubstr("the device was away <for a moment>"));
  EXPECT_EQ(figure(page, "ticks refused"), "1");
  EXPECT_EQ(figure(page, "faults"), "1");
  EXPECT_EQ(figure(page, "messages missing in the file"), "2");
}

TEST_F(ReportPage, EventsBeyondTheMostAreCounted) {
  const RecordedYard yard = record_yard(*sampler_, {.ticks = 2, .eventful = false});
  const Recording recording = read(yard.bytes);
  std::string bytes;
  RecordingWriter writer(std::make_unique<StringSink>(bytes), recording.info());
  ASSERT_TRUE(writer.write(recording.open_session(), recording.start_ns()));
  ASSERT_TRUE(writer.write(recording.opened(), recording.start_ns()));
  v1::Fault fault;
  fault.set_message("again");
  for (size_t i = 0; i < kMaxMarks + 5; ++i) ASSERT_TRUE(writer.write(fault, recording.start_ns()));
  recording.read({}, [&](RecordedEvent& event) {
    const auto* reply = std::get_if<v1::CameraReply>(&event.message);
    EXPECT_TRUE(!reply || writer.write(*reply, event.log_ns));
    return true;
  });
  ASSERT_TRUE(writer.finish());
  const SessionPage page = page_of(bytes);
  EXPECT_EQ(page.marks.size(), kMaxMarks);
  EXPECT_EQ(page.marks.front().text, "again");
  EXPECT_THAT(page.notices, Contains("5 more events are not listed."));
  EXPECT_EQ(figure(page, "faults"), std::to_string(kMaxMarks + 5));
}

TEST_F(ReportPage, OneReplyIsEnough) {
  RecordingPageOptions options = plain();
  options.pictures = 1, options.picture_width = 64;
  const SessionPage page = page_of(record_yard(*sampler_, {.ticks = 1, .eventful = false}).bytes, options);
  EXPECT_EQ(page.frames.size(), 1u);
  ASSERT_EQ(page.pictures.size(), 1u);
  EXPECT_EQ(page.pictures[0].frame, 0u);
  EXPECT_THAT(page.notices, IsEmpty());
}

TEST_F(ReportPage, FiguresAreThoseOfAllReplies) {
  const RecordedYard yard = record_yard(*sampler_);
  RecordingPageOptions options = plain();
  options.max_frames = 20;
  const SessionPage page = page_of(yard.bytes, options);
  double visible = 0, travel = 0;
  uint32_t merged = 0;
  for (size_t i = 0; i < yard.replies.size(); ++i) {
    const v1::CameraReply& reply = yard.replies[i];
    for (const auto& seen : reply.targets()) visible += seen.id() == kYardFirst ? seen.visible_share() : 0;
    merged += reply.merged_ticks();
    if (i == 0) continue;
    const auto &a = yard.replies[i - 1].pose().position(), &b = reply.pose().position();
    travel += std::hypot(a.x() - b.x(), a.y() - b.y(), a.z() - b.z());
  }
  char text[64];
  std::snprintf(text, sizeof text, "%.2f %%", 100 * visible / static_cast<double>(yard.replies.size()));
  EXPECT_EQ(figure(page, "visible share: target 10"), text);
  std::snprintf(text, sizeof text, "%.2f m", travel);
  EXPECT_EQ(figure(page, "camera travel"), text);
  EXPECT_EQ(figure(page, "ticks merged into a later reply"), std::to_string(merged));
  EXPECT_GT(merged, 0u);
}

TEST_F(ReportPage, ThinnedFramesKeepEveryChange) {
  const RecordedYard yard = record_yard(*sampler_);
  const auto is_change = [&](size_t i) {
    const v1::CameraReply &before = yard.replies[i - 1], &now = yard.replies[i];
    return now.status() != before.status() || now.reason() != before.reason() || now.cut() ||
           now.flags().SerializeAsString() != before.flags().SerializeAsString();
  };
  RecordingPageOptions options = plain();
  options.max_frames = 90;
  const SessionPage page = page_of(yard.bytes, options);
  EXPECT_LE(page.frames.size(), 92u);  // the first and the last as well
  EXPECT_GT(page.frames.size(), 45u);
  std::set<uint64_t> kept;
  for (const PageFrame& frame : page.frames) kept.insert(frame.sequence);
  size_t changes = 0;
  for (size_t i = 1; i < yard.replies.size(); ++i) {
    if (!is_change(i)) continue;
    ++changes;
    EXPECT_TRUE(kept.contains(yard.replies[i].sequence())) << i;
  }
  EXPECT_GT(changes, 10u);
  EXPECT_TRUE(kept.contains(yard.replies.front().sequence()));
  EXPECT_TRUE(kept.contains(yard.replies.back().sequence()));
  EXPECT_THAT(page.notices, Contains(HasSubstr("of " + std::to_string(yard.replies.size()) + " replies are frames")));
}

TEST_F(ReportPage, MoreChangesThanFramesAreThinnedAndThePageSaysSo) {
  const RecordedYard yard = record_yard(*sampler_);
  RecordingPageOptions options = plain();
  options.max_frames = 6;
  const SessionPage page = page_of(yard.bytes, options);
  EXPECT_LE(page.frames.size(), 8u);
  EXPECT_EQ(page.frames.front().sequence, yard.replies.front().sequence());
  EXPECT_EQ(page.frames.back().sequence, yard.replies.back().sequence());
  EXPECT_THAT(page.notices, Contains(HasSubstr(": 4 of the ")));
  const std::string frames = std::to_string(page.frames.size()), replies = std::to_string(yard.replies.size());
  EXPECT_THAT(page.notices, Contains(HasSubstr(frames + " of " + replies + " replies are frames")));
}

TEST_F(ReportPage, ARangeHasItsOwnRepliesAndTheSceneOfThatTime) {
  const RecordedYard yard = record_yard(*sampler_);
  const SessionPage whole = page_of(yard.bytes);
  RecordingPageOptions options = plain();
  options.range = {1.0, 1.5};
  const SessionPage page = page_of(yard.bytes, options);
  size_t first = 0;
  while (whole.frames[first].sequence != page.frames[0].sequence) ++first;
  EXPECT_GT(first, 50u);
  EXPECT_NEAR(static_cast<double>(page.frames.size()), 30, 2);
  for (size_t i = 0; i < page.frames.size(); ++i) {
    EXPECT_EQ(page.frames[i].camera.position_m, whole.frames[first + i].camera.position_m);
    EXPECT_EQ(page.frames[i].cells.size(), whole.frames[first + i].cells.size());
    EXPECT_EQ(page.frames[i].sights[0].aim_m, whole.frames[first + i].sights[0].aim_m);
  }
  options.range = {100.0, 200.0};
  const auto nothing = recording_page(read(yard.bytes), options, *sampler_);
  ASSERT_FALSE(nothing.has_value());
  EXPECT_EQ(nothing.error().code, ErrorCode::kNotFound);
}

TEST_F(ReportPage, SettingsAreTheWholeOfWhatWasInEffect) {
  const SessionPage page = page_of(record_yard(*sampler_).bytes);
  const auto json_of = [&](const std::string& title) {
    for (const PageSettings& settings : page.settings)
      if (settings.title == title) return nlohmann::json::parse(settings.json);
    return nlohmann::json();
  };
  EXPECT_EQ(json_of("Settings in effect at the start")["move_response_s"], 0.2);
  EXPECT_EQ(json_of("Settings in effect at the end")["move_response_s"], 0.3);
  EXPECT_EQ(json_of("Tuning in effect at the start")["aggregate"]["candidates"], 700);
  EXPECT_EQ(json_of("Limits in effect at the start")["max_speed_mps"], 10.0);
  EXPECT_EQ(json_of("Limits in effect at the end")["max_speed_mps"], 4.0);
  EXPECT_TRUE(json_of("Lens: radians, vertical at the end").is_null());  // the lens did not change
}

TEST_F(ReportPage, PicturesComeWithTheTruthOfTheirFrames) {
  RecordingPageOptions options = plain();
  options.pictures = 3, options.picture_width = 64;
  const SessionPage page = page_of(record_yard(*sampler_, {.eventful = false}).bytes, options);
  ASSERT_EQ(page.pictures.size(), 3u);
  EXPECT_EQ(page.pictures[0].frame, 0u);
  EXPECT_EQ(page.pictures[2].frame, page.frames.size() - 1);
  for (const PagePicture& picture : page.pictures) {
    EXPECT_GT(picture.bytes.size(), 100u);
    EXPECT_FALSE(std::isnan(page.frames[picture.frame].sights[0].true_share));
  }
  EXPECT_TRUE(std::isnan(page.frames[1].sights[0].true_share));
  // Nothing stands in front of the targets at the start.
  EXPECT_EQ(page.frames[0].sights[1].true_share, 1.0);
}

TEST_F(ReportPage, AMissingSceneLeavesWhatIsKnown) {
  const RecordedHall hall = record_hall(*sampler_, {.ticks = 30, .attach_scene = false});
  const SessionPage whole = page_of(record_hall(*sampler_, {.ticks = 30}).bytes);
  const SessionPage page = page_of(hall.bytes);
  ASSERT_EQ(page.frames.size(), 30u);
  EXPECT_THAT(page.notices, Contains(HasSubstr("A scene file is missing")));
  EXPECT_EQ(frames_with_cells(page), 0u);
  EXPECT_NEAR(static_cast<double>(frames_with_cells(whole)), 15, 2) << "every second reply is of a decision";
  ASSERT_EQ(page.targets.size(), whole.targets.size());
  for (size_t k = 0; k < page.targets.size(); ++k) {
    EXPECT_EQ(page.targets[k].name, whole.targets[k].name);
    const auto balls = instances_of(page, page.targets[k].id);
    ASSERT_EQ(balls.size(), 1u);
    EXPECT_NEAR(balls[0]->geometry->radius_m, kPlaceholderRadiusM, 1e-3);
  }
  EXPECT_EQ(page.frames[20].camera.position_m, whole.frames[20].camera.position_m);
}

TEST_F(ReportPage, ASceneByHandIsAsGoodAsAnAttachedOne) {
  const RecordedHall attached = record_hall(*sampler_, {.ticks = 10});
  const auto files = read(attached.bytes).files();
  ASSERT_TRUE(files.has_value());
  const TemporaryFolder folder;
  std::ofstream(folder / "any.glb", std::ios::binary) << files->at(0).bytes;
  const std::string lost = record_hall(*sampler_, {.ticks = 10, .attach_scene = false}).bytes;
  RecordingPageOptions by_file = plain(), by_folder = plain();
  by_file.scenes.files = {folder / "any.glb"};
  by_folder.scenes.folder = folder.path();
  for (const RecordingPageOptions& options : {by_file, by_folder}) {
    const SessionPage page = page_of(lost, options);
    EXPECT_THAT(page.notices, IsEmpty());
    EXPECT_EQ(*session_page(page), *session_page(page_of(attached.bytes)));
  }
}

TEST_F(ReportPage, AnUnfinishedFileIsShownAsFarAsItGoes) {
  std::string bytes = record_yard(*sampler_, {.finished = false}).bytes;
  bytes.resize(bytes.size() - 100);
  const SessionPage page = page_of(bytes);
  EXPECT_GT(page.frames.size(), 30u);
  EXPECT_THAT(page.notices, Contains(HasSubstr("has no end")));
}

TEST_F(ReportPage, AFoldedFileHasNoCellsOfStepsTakenAgain) {
  const SessionPage page = page_of(record_yard(*sampler_, {.snapshot_ticks = 7}).bytes);
  EXPECT_EQ(frames_with_cells(page), 0u);
  EXPECT_THAT(page.notices, Contains(HasSubstr("after 7 ticks")));
  EXPECT_THAT(page.notices, Contains(HasSubstr("does not begin with its session")));
}

class OtherSampler final : public SamplerDevice {
 public:
  explicit OtherSampler(SamplerDevice& like) : like_(like) {}
  std::string kind() const override { return "other"; }
  std::string renderer() const override { return like_.renderer(); }
  size_t geometry_bytes() const override { return like_.geometry_bytes(); }
  std::unique_ptr<Sampler> make_sampler() override { return like_.make_sampler(); }

 private:
  SamplerDevice& like_;
};

TEST_F(ReportPage, AnotherSamplerTakesNoStepAgain) {
  OtherSampler other(*sampler_);
  const auto page = recording_page(read(record_yard(*sampler_).bytes), plain(), other);
  ASSERT_TRUE(page.has_value());
  EXPECT_EQ(frames_with_cells(*page), 0u);
  EXPECT_THAT(page->notices, Contains(HasSubstr("the sampler embree is not to be had here")));
}

TEST_F(ReportPage, TheCommandWritesThePageAndNamesWhatIsWrong) {
  const TemporaryFolder folder;
  const std::string file = folder / "command.mcap", text = folder / "text.mcap";
  std::ofstream(file, std::ios::binary) << record_yard(*sampler_, {.ticks = 5, .eventful = false}).bytes;
  std::ofstream(text) << "no recording";
  std::ostringstream out, err;
  ReportOptions options;
  options.recording = file, options.page = plain();
  EXPECT_EQ(run_report_command(options, out, err), 0) << err.str();
  EXPECT_THAT(out.str(), HasSubstr("page    " + (folder / "command.html").string()));
  EXPECT_TRUE(std::filesystem::exists(folder / "command.html"));
  EXPECT_EQ(err.str(), "");
  options.recording = text;
  EXPECT_EQ(run_report_command(options, out, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("text.mcap"));
  EXPECT_FALSE(std::filesystem::exists(folder / "text.html"));
  options.recording = file, options.out = folder / "no" / "such" / "page.html", err.str("");
  EXPECT_EQ(run_report_command(options, out, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("page.html"));
}

}  // namespace
}  // namespace sightline::test
