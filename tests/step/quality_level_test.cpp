// Each quality level is cheaper than the one before, valid, and an ordinary input of a step.
#include "server/step/quality_level.h"

#include <gtest/gtest.h>

#include <tuple>

#include "server/base/random.h"
#include "tests/session/game.h"

namespace sightline::test {
namespace {

// Random settings over their whole ranges, including both ends.
StepSettings any_settings(CounterRandom& random) {
  StepSettings s = preset_settings(random.next_below(2) == 0 ? Preset::kPaper : Preset::kSightline);
  const auto between = [&](int low, int high) {
    const uint32_t end = random.next_below(6);
    return end == 0   ? low
           : end == 1 ? high
                      : low + static_cast<int>(random.next_below(static_cast<uint32_t>(high - low + 1)));
  };
  s.sample.points = between(0, 16);
  s.sample.resolution = between(2, 64);
  s.move.viewpoint_search.resolution = between(2, 32);
  s.aggregate.candidates = between(27, 32768);
  s.move.turn_probability = random.next_below(2) * 0.25;
  s.move.prediction_s = random.next_below(2) * 0.5;
  return s;
}

TEST(QualityLevel, EveryLevelOfValidSettingsIsValidAndAsksForNoMoreThanTheOneBefore) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  for (int round = 0; round < 2000; ++round) {
    const StepSettings told = any_settings(random);
    ASSERT_TRUE(validate(told));
    StepSettings before = told;
    for (int level = 0; level <= kLowestQualityLevel; ++level) {
      const StepSettings less = degrade(told, level);
      EXPECT_TRUE(validate(less));
      EXPECT_LE(less.sample.points, before.sample.points);
      EXPECT_EQ(less.sample.points == 0, told.sample.points == 0);
      EXPECT_LE(less.sample.resolution, before.sample.resolution);
      EXPECT_LE(less.move.viewpoint_search.resolution, before.move.viewpoint_search.resolution);
      EXPECT_LE(less.aggregate.candidates, before.aggregate.candidates);
      EXPECT_LE(less.move.turn_probability, before.move.turn_probability);
      EXPECT_LE(less.move.prediction_s, before.move.prediction_s);
      EXPECT_EQ(degrades(told, level), !describe_degradation(told, level).empty());
      before = less;
    }
    EXPECT_FALSE(degrades(told, 0));
  }
}

TEST(QualityLevel, TheFirstGuessesFallToo) {
  EXPECT_EQ(expected_cost(0), 1.0);
  for (int level = 1; level <= kLowestQualityLevel; ++level) {
    EXPECT_LT(expected_cost(level), expected_cost(level - 1));
    EXPECT_GT(expected_cost(level), 0.0);
  }
}

TEST(QualityLevel, SaysWhatItLeavesOut) {
  const StepSettings settings = preset_settings(Preset::kSightline);
  EXPECT_EQ(describe_degradation(settings, 0), "");
  EXPECT_EQ(describe_degradation(settings, 1), "search resolution 8 -> 4");
  EXPECT_EQ(describe_degradation(settings, 2), "points 8 -> 4, search resolution 8 -> 4");
}

// The targets are sampled at points of their surfaces.
class QualityOfSteps : public testing::Test {
 protected:
  Game make_game(const StepSettings& settings = preset_settings(Preset::kSightline)) {
    return Game([&](SessionOptions& options) {
      options.settings = settings;
      options.settings.move.decide_every_s = 0;  // so that every step does all of its work
      options.extents = &extents_;
    });
  }

 private:
  ExtentCache extents_;
};

TickMaker walk(Game& game, int i) {
  const double x = 0.02 * i;
  return game.tick().move(kAnn, {-1 + x, 1, 0.5 * x}).move(kBob, {1 + x, 1, 0});
}

// The work of a step: texels of all maps, and candidates judged.
struct Work {
  size_t texels = 0, candidates = 0;
};
Work work_at(Game game, int level) {
  Work work;
  for (int i = 0; i < 40; ++i) {
    game.apply(walk(game, i));
    EXPECT_TRUE(game.session->step(i < 30 ? 0 : level));
    if (i != 30) continue;  // every motion is predicted, and the camera is where it is at every other level
    for (const MapRequest& request : game.session->dump().plan.requests)
      work.texels += static_cast<size_t>(request.view.width * request.view.height);
    work.candidates += game.session->dump().sights.candidates.size();
  }
  return work;
}

TEST_F(QualityOfSteps, EveryLevelTakesLessWorkThanTheOneBefore) {
  Work before = work_at(make_game(), 0);
  for (int level = 1; level <= kLowestQualityLevel; ++level) {
    const Work work = work_at(make_game(), level);
    EXPECT_LT(work.texels, before.texels) << level;
    EXPECT_LE(work.candidates, before.candidates) << level;
    before = work;
  }
  const Work all = work_at(make_game(), 0);
  EXPECT_LT(before.texels, all.texels / 5);
  EXPECT_LT(before.candidates, all.candidates / 4);
}

// Everything that a client sees of an answer, except times.
auto seen(const SessionAnswer& answer) {
  const CameraState& camera = answer.step.camera;
  const glm::dvec3 p = camera.pose.position_m, v = camera.velocity_mps;
  const glm::dquat q = camera.pose.rotation;
  std::vector<double> shares;
  for (const TargetSight& target : answer.step.targets)
    shares.insert(shares.end(), {target.visible_share, target.filtered_share, target.distance_m});
  return std::tuple(p.x, p.y, p.z, v.x, v.y, v.z, q.x, q.y, q.z, q.w, answer.step.status, answer.step.chosen_candidate,
                    shares, answer.hash);
}

TEST_F(QualityOfSteps, ALevelIsTheSameAsTheSettingsThatItMakes) {
  for (int level = 0; level <= kLowestQualityLevel; ++level) {
    Game levelled = make_game(), told = make_game(degrade(preset_settings(Preset::kSightline), level));
    for (int i = 0; i < 40; ++i) {
      levelled.apply(walk(levelled, i)), told.apply(walk(told, i));
      const auto answer = levelled.session->step(level);
      ASSERT_TRUE(answer);
      EXPECT_EQ(seen(*answer), seen(told.answer())) << level;
      EXPECT_EQ(answer->degraded.has_value(), level > 0);
      EXPECT_EQ(answer->quality_level, level);
    }
  }
}

TEST_F(QualityOfSteps, LevelsThatChangeGiveTheSameAnswersWheneverTheyAreGivenAgain) {
  const auto play = [&] {
    Game game = make_game();
    CounterRandom random(9, 0, RandomPurpose::kTest);
    std::vector<decltype(seen(SessionAnswer{}))> answers;
    for (int i = 0; i < 80; ++i) {
      game.apply(walk(game, i));
      const auto answer = game.session->step(static_cast<int>(random.next_below(kLowestQualityLevel + 1)));
      EXPECT_TRUE(answer);
      if (answer) answers.push_back(seen(*answer));
    }
    return answers;
  };
  EXPECT_EQ(play(), play());
}

TEST_F(QualityOfSteps, ALevelHoldsForOneStepAndSettingsStayAsTold) {
  Game game = make_game();
  game.apply(walk(game, 0));
  ASSERT_TRUE(game.session->step(kLowestQualityLevel));
  EXPECT_EQ(game.session->dump().plan.now.sights_m.size(), 2u);
  EXPECT_EQ(game.session->settings().sample.points, 8);
  game.apply(walk(game, 1));
  EXPECT_FALSE(game.answer().degraded);
  EXPECT_EQ(game.session->dump().plan.now.sights_m.size(), 2u * 8u);
}

TEST_F(QualityOfSteps, ALevelThatLeavesNothingOutSaysNothing) {
  Game game = make_game(preset_settings(Preset::kPaper));
  game.apply(walk(game, 0));
  EXPECT_FALSE(game.session->step(1)->degraded);
}

}  // namespace
}  // namespace sightline::test
