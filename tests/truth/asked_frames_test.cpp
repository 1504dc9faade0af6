// Tests of what a shot asks for at each frame, in scenes where the directions are known.
#include "client/truth/asked_frames.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "server/base/transform.h"
#include "tests/support/small_scenes.h"

namespace sightline {
namespace {

constexpr double kDurationS = 4.0, kTick = 1.0 / 30, kRadiusM = 3.0, kTurnRadps = 1.0;

double rad(double degrees) {
  return degrees * std::numbers::pi / 180;
}

// Walks round the origin at 3 m/s, from (3, 0, 0) towards -z, and faces the way it goes.
scenes::Motion round_walk() {
  scenes::Motion motion;
  for (double time_s = 0; time_s <= kDurationS + 1e-9; time_s += 1.0 / 60) {
    const double turned = kTurnRadps * time_s;
    const double facing = std::numbers::pi + turned;  // the front is +z; it begins towards -z
    motion.add(time_s, {kRadiusM * std::cos(turned), 0, -kRadiusM * std::sin(turned)},
               glm::angleAxis(facing, glm::dvec3(0, 1, 0)));
  }
  return motion;
}
glm::dvec3 forward_at(double time_s) {
  const double turned = kTurnRadps * time_s;
  return {-std::sin(turned), 0, -std::cos(turned)};
}

class AskedFrames : public testing::Test {
 protected:
  AskedFrames()
      : place_(test::SmallScene(kDurationS, {3, 1.5, 6}).walker("anna", round_walk()).target("ben", {8, 0, 0})),
        world_(place_.world()) {
    anna_ = id_of("anna"), ben_ = id_of("ben");
  }
  uint64_t id_of(const std::string& name) const {
    for (const ScenarioActor& actor : place_.scenario.actors())
      if (actor.name == name) return actor.id;
    return 0;
  }
  AskedShot shot_of(ShotFrame frame) const {
    AskedShot shot;
    shot.number = 1, shot.frame = frame, shot.subject_ids = {anna_};
    return shot;
  }
  // A camera that is always at this offset from Anna's middle, and looks at it.
  std::vector<CameraFrame> filmed(const std::function<glm::dvec3(double time_s)>& offset_m) {
    std::vector<CameraFrame> frames;
    for (double time_s = 0; time_s < kDurationS; time_s += kTick) {
      world_->set_time(time_s);
      const glm::dvec3 middle_m = aim_point_m(*world_->mirror().find(anna_)), offset = offset_m(time_s);
      CameraFrame frame;
      frame.time_s = time_s;
      frame.camera = {middle_m + offset, look_rotation(-glm::normalize(offset), {0, 1, 0}, {1, 0, 0})};
      frames.push_back(frame);
    }
    return frames;
  }
  ShotDeviation mean_deviation(const AskedShot& shot, std::span<const CameraFrame> frames) {
    ShotDeviation sum;
    const auto shots = shots_as_asked(shot, *world_, frames);
    const double part = 1 / static_cast<double>(shots.size());
    for (const FrameShot& frame : shots) {
      const ShotDeviation now = deviation_between(frame.asked, frame.now, 0.0);
      sum.side += now.side * part, sum.height += now.height * part, sum.size += now.size * part;
    }
    return sum;
  }

  test::Place place_;
  std::unique_ptr<ScenarioWorld> world_;
  uint64_t anna_ = 0, ben_ = 0;
};

// 4 m behind and 20 degrees up is what a chase asks for, whichever way she goes. A camera that keeps to a side of the
// world does not have it.
TEST_F(AskedFrames, AChaseIsBehindTheWalkerAtEveryMoment) {
  const auto behind = [](double time_s) {
    return 4.0 * (std::cos(rad(20)) * -forward_at(time_s) + glm::dvec3(0, std::sin(rad(20)), 0));
  };
  const auto fixed = [&](double) { return behind(0); };
  for (const ShotFrame frame : {ShotFrame::kHeading, ShotFrame::kTravel}) {
    AskedShot chase = shot_of(frame);
    chase.side_rad = std::numbers::pi, chase.height_rad = rad(20), chase.distance_m = 4;
    const ShotDeviation kept = mean_deviation(chase, filmed(behind));
    EXPECT_LT(kept.side, frame == ShotFrame::kHeading ? 0.005 : 0.03) << "travel is that of the last tick";
    EXPECT_LT(kept.height, 1e-6);
    EXPECT_LT(kept.size, 1e-6);
    EXPECT_GT(mean_deviation(chase, filmed(fixed)).side, 0.5);
  }
}

TEST_F(AskedFrames, WhatIsLeftOpenIsTakenFromTheFirstFrame) {
  const auto beside = [](double time_s) {
    return 5.0 * glm::cross(forward_at(time_s), glm::dvec3(0, 1, 0)) + glm::dvec3(0, 1, 0);
  };
  EXPECT_LT(mean_deviation(shot_of(ShotFrame::kHeading), filmed(beside)).side, 0.005);
  EXPECT_LT(mean_deviation(shot_of(ShotFrame::kHeading), filmed(beside)).height, 1e-6);
  EXPECT_GT(mean_deviation(shot_of(ShotFrame::kWorld), filmed(beside)).side, 0.5) << "the world does not turn with her";
  EXPECT_LT(mean_deviation(shot_of(ShotFrame::kWorld), filmed([&](double) { return beside(0); })).side, 1e-6);
}

TEST_F(AskedFrames, ALineLeadsFromTheOneToTheOther) {
  AskedShot across = shot_of(ShotFrame::kLine);
  across.frame_id = anna_, across.line_to_id = ben_, across.side_rad = std::numbers::pi / 2, across.height_rad = 0,
  across.distance_m = 6;
  const auto right_of_line = [&](double) {
    const glm::dvec3 way = world_->mirror().find(ben_)->center_m - world_->mirror().find(anna_)->center_m;
    return 6.0 * glm::normalize(glm::dvec3(-way.z, 0, way.x));
  };
  const ShotDeviation kept = mean_deviation(across, filmed(right_of_line));
  EXPECT_LT(kept.side, 1e-6);
  EXPECT_LT(kept.size, 1e-6);
}

TEST_F(AskedFrames, AnOrbitGoesOnAtItsSpeed) {
  AskedShot orbit = shot_of(ShotFrame::kWorld);
  orbit.orbit_radps = 0.5, orbit.height_rad = 0, orbit.distance_m = 5;
  const auto round = [](double time_s) {
    return 5.0 * glm::dvec3(std::sin(-0.5 * time_s), 0, std::cos(-0.5 * time_s));
  };
  const auto other_way = [&](double time_s) { return round(-time_s); };
  const double along = mean_deviation(orbit, filmed(round)).side,
               against = mean_deviation(orbit, filmed(other_way)).side;
  EXPECT_LT(std::min(along, against), 1e-6);
  EXPECT_GT(std::max(along, against), 0.5);
  EXPECT_LT(along, against) << "to the subject's right first: clockwise, seen from above";
}

// A body of 1.8 m that fills half of the picture's height is 1.8 / (2 * 0.5 * tan(20 degrees)) m away.
TEST_F(AskedFrames, ASizeIsADistance) {
  AskedShot half = shot_of(ShotFrame::kWorld);
  half.size = 0.5, half.side_rad = 0, half.height_rad = 0;
  const auto frames = filmed([](double) { return glm::dvec3(0, 0, 7); });
  for (const FrameShot& shot : shots_as_asked(half, *world_, frames)) {
    EXPECT_NEAR(std::exp2(shot.asked.size_log2) * 1.8, 0.5, 0.005);
    EXPECT_NEAR(std::exp2(shot.now.size_log2), 1 / (2 * 7 * std::tan(rad(20))), 1e-9);
  }
}

TEST_F(AskedFrames, ThePlaceIsOfAllTargetsAndTheMeanOfThoseAskedFor) {
  AskedShot shot = shot_of(ShotFrame::kWorld);
  shot.places = {{anna_, {-0.5, 0}}, {ben_, {0.3, 0.2}}};
  const auto frames = filmed([](double) { return glm::dvec3(0, 0, 9); });
  const FrameShot first = shots_as_asked(shot, *world_, frames)[0];
  EXPECT_NEAR(first.asked.place_half_pictures.x, -0.1, 1e-12);
  EXPECT_NEAR(first.asked.place_half_pictures.y, 0.1, 1e-12);
  // The centre of both is 2.5 m to the right of Anna, who is in the middle.
  EXPECT_NEAR(first.now.place_half_pictures.x, 2.5 / (9 * std::tan(rad(20)) * 16 / 9), 1e-6);
}

}  // namespace
}  // namespace sightline
