#include "server/move/predict.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "server/base/random.h"

namespace sightline {
namespace {

// A motion in closed form: p + v t + a t^2 / 2, and a turn about one axis by w t + b t^2 / 2.
struct ClosedForm {
  glm::dvec3 p{0.0}, v{0.0}, a{0.0}, axis{0, 1, 0};
  double w = 0, b = 0;
  glm::dquat start{1, 0, 0, 0};

  Pose at(double t) const {
    return {p + v * t + a * (t * t / 2), glm::normalize(glm::angleAxis(w * t + b * t * t / 2, axis) * start)};
  }
};

glm::dvec3 random_vector(CounterRandom& random, double size) {
  return {random.next_in(-size, size), random.next_in(-size, size), random.next_in(-size, size)};
}

ClosedForm random_motion(CounterRandom& random) {
  ClosedForm m;
  m.p = random_vector(random, 20), m.v = random_vector(random, 5), m.a = random_vector(random, 8);
  m.axis = glm::normalize(random_vector(random, 1) + glm::dvec3(0, 1e-3, 0));
  m.w = random.next_in(-4, 4), m.b = random.next_in(-4, 4);
  m.start = glm::normalize(glm::dquat(random.next_in(0.1, 1), random_vector(random, 1)));
  return m;
}

// Shows a predictor `samples` poses of a motion at irregular intervals. Returns the time of the last one.
double watch(MotionPredictor& predictor, const std::function<Pose(double)>& motion, int samples, CounterRandom& random,
             double shortest = 0.01, double longest = 0.05) {
  double t = 0;
  predictor.observe(0, motion(0));
  for (int i = 1; i < samples; ++i) {
    const double dt = random.next_in(shortest, longest);
    t += dt;
    predictor.observe(dt, motion(t));
  }
  return t;
}

void expect_same(const Pose& got, const Pose& want, double tolerance) {
  EXPECT_LT(glm::distance(got.position_m, want.position_m), tolerance);
  const double along = glm::dot(got.rotation, want.rotation) < 0 ? -1.0 : 1.0;
  EXPECT_LT(glm::length(got.rotation - want.rotation * along), tolerance);
}

// Settings under which an acceleration lasts as long as the longest prediction.
PredictionSettings lasting_acceleration() {
  PredictionSettings settings;
  settings.acceleration_lasts_s = kMaxPredictionS;
  return settings;
}

TEST(Predict, ConstantAccelerationAndTurnArePredictedExactlyAtAnyTimeSteps) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    const ClosedForm motion = random_motion(random);
    PredictionSettings settings = lasting_acceleration();
    settings.smoothing_s = seed % 4 == 0 ? 0.0 : random.next_in(0.02, 0.5);
    MotionPredictor predictor(settings);
    const int samples = 3 + static_cast<int>(random.next_below(80));
    const double t = watch(
        predictor, [&](double s) { return motion.at(s); }, samples, random);
    for (const double ahead : {0.0, 0.1, 0.3, 0.5}) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << " samples " << samples << " ahead " << ahead);
      expect_same(predictor.at(ahead).pose, motion.at(t + ahead), 1e-9);
    }
    SCOPED_TRACE(testing::Message() << "seed " << seed << " at the longest time");
    // From three samples 10 ms apart, an acceleration is known to (rounding of 20 m) / dt^2, about 1e-11 m/s^2.
    expect_same(predictor.at(2.0).pose, motion.at(t + 2.0), 1e-8);
    EXPECT_LT(glm::distance(predictor.acceleration_mps2(), motion.a), 1e-8);
    EXPECT_LT(glm::distance(predictor.angular_velocity_radps(), motion.axis * (motion.w + motion.b * t)), 1e-8);
  }
}

TEST(Predict, LongGapsBetweenSamplesKeepAParabolaExact) {
  CounterRandom random(5, 0, RandomPurpose::kTest);
  ClosedForm motion = random_motion(random);
  motion.w = 0.3, motion.b = 0.05;
  MotionPredictor predictor(lasting_acceleration());
  const double t = watch(
      predictor, [&](double s) { return motion.at(s); }, 6, random, 0.7, 2.0);
  expect_same(predictor.at(1.0).pose, motion.at(t + 1.0), 1e-9);
}

TEST(Predict, PerfectPredictionsAreTrustedFully) {
  CounterRandom random(6, 0, RandomPurpose::kTest);
  const ClosedForm motion = random_motion(random);
  MotionPredictor predictor(lasting_acceleration());
  watch(
      predictor, [&](double s) { return motion.at(s); }, 60, random);
  EXPECT_GT(predictor.confidence(2.0), 1 - 1e-9);
  EXPECT_EQ(predictor.usable_ahead_s(0.3), 0.3);
  EXPECT_EQ(predictor.usable_ahead_s(50.0), kMaxPredictionS);
}

TEST(Predict, NothingSeenIsNotTrustedAndOneSampleIsAtRest) {
  MotionPredictor predictor;
  EXPECT_EQ(predictor.at(0.3).confidence, 0.0);
  EXPECT_EQ(predictor.usable_ahead_s(0.3), 0.0);
  const Pose pose{{1, 2, 3}, glm::angleAxis(0.5, glm::dvec3(0, 1, 0))};
  predictor.observe(0.1, pose);
  expect_same(predictor.at(2.0).pose, pose, 1e-15);
  EXPECT_EQ(predictor.usable_ahead_s(0.3), 0.0) << "nothing to judge by";
}

TEST(Predict, TwoSamplesAreConstantVelocity) {
  MotionPredictor predictor;
  predictor.observe(0, {{0, 0, 0}, {1, 0, 0, 0}});
  predictor.observe(0.1, {{0.2, 0, 0}, glm::angleAxis(0.1, glm::dvec3(0, 0, 1))});
  const Pose ahead = predictor.at(0.5).pose;
  expect_same(ahead, {{1.2, 0, 0}, glm::angleAxis(0.6, glm::dvec3(0, 0, 1))}, 1e-12);
  EXPECT_EQ(predictor.usable_ahead_s(0.3), 0.0);
}

TEST(Predict, NowIsTheLastPoseExactly) {
  CounterRandom random(7, 0, RandomPurpose::kTest);
  MotionPredictor predictor;
  Pose last;
  for (int i = 0; i < 20; ++i) {
    last = {random_vector(random, 1), glm::normalize(glm::dquat(1, random_vector(random, 0.1)))};
    predictor.observe(0.05, last);
    EXPECT_EQ(predictor.at(0).pose.position_m, last.position_m);
    EXPECT_EQ(predictor.at(-1).pose.rotation, last.rotation);
    EXPECT_EQ(predictor.at(0).confidence, 1.0);
  }
}

TEST(Predict, AJumpForgetsThePastAndDoesNotThrowThePrediction) {
  CounterRandom random(8, 0, RandomPurpose::kTest);
  ClosedForm motion;
  motion.v = {2, 0, 0};
  MotionPredictor predictor;
  watch(
      predictor, [&](double s) { return motion.at(s); }, 30, random);
  const Pose there{{400, 0, 0}, {1, 0, 0, 0}};
  predictor.observe(1.0 / 60, there);
  expect_same(predictor.at(1.0).pose, there, 1e-12);
  EXPECT_EQ(predictor.usable_ahead_s(0.3), 0.0);
  for (int i = 1; i <= 4; ++i) predictor.observe(1.0 / 60, {{400 + i * 0.05, 0, 0}, {1, 0, 0, 0}});
  expect_same(predictor.at(1.0).pose, {{400.2 + 3.0, 0, 0}, {1, 0, 0, 0}}, 1e-9);
  EXPECT_EQ(predictor.usable_ahead_s(0.3), 0.3) << "four samples after it, the motion is trusted again";
}

TEST(Predict, ASnappedRotationKeepsThePastOfTheTranslation) {
  MotionPredictor predictor;
  for (int i = 0; i < 20; ++i) predictor.observe(1.0 / 60, {{i * 0.05, 0, 0}, {1, 0, 0, 0}});
  const glm::dquat half_turn = glm::angleAxis(3.1, glm::dvec3(0, 1, 0));
  predictor.observe(1.0 / 60, {{20 * 0.05, 0, 0}, half_turn});
  expect_same(predictor.at(0.5).pose, {{1.0 + 1.5, 0, 0}, half_turn}, 1e-9);
}

TEST(Predict, APauseChangesNothing) {
  CounterRandom random(9, 0, RandomPurpose::kTest);
  const ClosedForm motion = random_motion(random);
  MotionPredictor predictor(lasting_acceleration());
  const double t = watch(
      predictor, [&](double s) { return motion.at(s); }, 30, random);
  for (int i = 0; i < 100; ++i) predictor.observe(0, motion.at(t));
  expect_same(predictor.at(0.5).pose, motion.at(t + 0.5), 1e-9);
}

TEST(Predict, ASmallCorrectionInNoTimeMovesThePredictionAndALargeOneIsAJump) {
  MotionPredictor predictor;
  for (int i = 0; i <= 20; ++i) predictor.observe(0.05, {{i * 0.1, 0, 0}, {1, 0, 0, 0}});
  predictor.observe(0, {{2.0, 0.01, 0}, {1, 0, 0, 0}});
  expect_same(predictor.at(0.5).pose, {{3.0, 0.01, 0}, {1, 0, 0, 0}}, 1e-9);
  predictor.observe(0, {{9.0, 0, 0}, {1, 0, 0, 0}});
  expect_same(predictor.at(0.5).pose, {{9.0, 0, 0}, {1, 0, 0, 0}}, 1e-12);
}

// The greatest speed and acceleration by finite differences over the last `kept` steps, as the header defines the
// bound.
struct Extremes {
  double speed = 0, acceleration = 0, longest = 0;
  Extremes(const std::vector<double>& dt, const std::vector<glm::dvec3>& step) {
    const size_t first = step.size() > 32 ? step.size() - 32 : 0;
    for (size_t i = first; i < step.size(); ++i) {
      speed = std::max(speed, glm::length(step[i]) / dt[i]);
      longest = std::max(longest, dt[i]);
      if (i > first)
        acceleration = std::max(acceleration,
                                glm::distance(step[i] / dt[i], step[i - 1] / dt[i - 1]) * 2 / (dt[i] + dt[i - 1]));
    }
  }
};

TEST(Predict, NoPredictionLeavesItsBoundHoweverWildThePast) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    CounterRandom random(seed, 1, RandomPurpose::kTest);
    PredictionSettings settings = lasting_acceleration();
    settings.smoothing_s = random.next_in(0.0, 0.3);
    MotionPredictor predictor(settings);
    std::vector<double> dt;
    std::vector<glm::dvec3> step;
    glm::dvec3 place = random_vector(random, 5);
    predictor.observe(0, {place, {1, 0, 0, 0}});
    for (int i = 0; i < 60; ++i) {
      dt.push_back(random.next_in(0.002, 0.1));
      step.push_back(random_vector(random, 50 * dt.back()) * static_cast<double>(random.next_unit()));
      place += step.back();
      predictor.observe(dt.back(), {place, {1, 0, 0, 0}});
      const Extremes seen(dt, step);
      for (const double ahead : {0.01, 0.3, 2.0, 7.0}) {
        const double h = std::min(ahead, kMaxPredictionS);
        const double bound = std::min(seen.speed * h + seen.acceleration * h * (h + seen.longest) / 2, 100.0 * h);
        ASSERT_LE(glm::distance(predictor.at(ahead).pose.position_m, place), bound * (1 + 1e-8)) << seed << " " << i;
      }
    }
  }
}

TEST(Predict, AccelerationIsBelievedOnlyForItsTime) {
  PredictionSettings settings;
  settings.acceleration_lasts_s = 0.2;
  MotionPredictor predictor(settings);
  CounterRandom random(10, 0, RandomPurpose::kTest);
  ClosedForm motion;
  motion.v = {1, 0, 0}, motion.a = {0, 0, 3};
  const double t = watch(
      predictor, [&](double s) { return motion.at(s); }, 20, random);
  expect_same(predictor.at(0.2).pose, motion.at(t + 0.2), 1e-9);
  const glm::dvec3 kept_velocity = motion.v + motion.a * (t + 0.2);
  EXPECT_LT(glm::distance(predictor.at(1.0).pose.position_m, motion.at(t + 0.2).position_m + kept_velocity * 0.8),
            1e-9);
}

glm::dvec3 noise(CounterRandom& random, double size) {
  return random_vector(random, size * std::sqrt(3.0));
}

double rms_error_under_noise(double smoothing_s, double ahead) {
  CounterRandom random(11, 0, RandomPurpose::kTest);
  PredictionSettings settings;
  settings.smoothing_s = smoothing_s;
  MotionPredictor predictor(settings);
  double squares = 0;
  int count = 0;
  for (int i = 0; i < 2000; ++i) {
    const double t = i / 60.0;
    predictor.observe(1 / 60.0, {glm::dvec3(2 * t, 0, 0) + noise(random, 0.002), {1, 0, 0, 0}});
    if (i < 60) continue;
    const glm::dvec3 off = predictor.at(ahead).pose.position_m - glm::dvec3(2 * (t + ahead), 0, 0);
    squares += glm::dot(off, off), ++count;
  }
  return std::sqrt(squares / count);
}

TEST(Predict, SmoothingTakesTheNoiseOutOfThePrediction) {
  const double none = rms_error_under_noise(0.0, 0.3), some = rms_error_under_noise(0.05, 0.3),
               more = rms_error_under_noise(0.1, 0.3), most = rms_error_under_noise(0.3, 0.3);
  EXPECT_GT(none, 4 * some);
  EXPECT_GT(some, more);
  EXPECT_GT(more, most);
  EXPECT_LT(more, 0.1) << "poses off by 2 mm, 0.3 s ahead";
}

double usable_under_noise(double size) {
  CounterRandom random(12, 0, RandomPurpose::kTest);
  MotionPredictor predictor;
  double sum = 0;
  for (int i = 0; i < 600; ++i) {
    predictor.observe(1 / 60.0, {glm::dvec3(i / 30.0, 0, 0) + noise(random, size), {1, 0, 0, 0}});
    if (i >= 300) sum += predictor.usable_ahead_s(2.0) / 300;
  }
  return sum;
}

TEST(Predict, MoreNoiseShortensTheTimeThatIsUsed) {
  const double none = usable_under_noise(0), little = usable_under_noise(0.005), some = usable_under_noise(0.02),
               much = usable_under_noise(0.1);
  EXPECT_NEAR(none, kMaxPredictionS, 1e-9);
  EXPECT_GE(none, little);
  EXPECT_GT(little, some);
  EXPECT_GT(some, much);
  EXPECT_GT(little, 0.3) << "half a centimetre of noise leaves the paper's 300 ms";
}

// Walks along x, then turns a sharp corner and walks along z.
glm::dvec3 sharp_turn(double t) {
  return t < 2 ? glm::dvec3(3 * t, 0, 0) : glm::dvec3(6, 0, 3 * (t - 2));
}

TEST(Predict, ASharpTurnIsDistrustedAtOnceAndForgivenAfterwards) {
  MotionPredictor predictor;
  double before = 0, least = 10, after = 0;
  for (int i = 0; i < 360; ++i) {
    const double t = i / 60.0;
    predictor.observe(1 / 60.0, {sharp_turn(t), {1, 0, 0, 0}});
    if (t < 2) before = predictor.usable_ahead_s(0.5);
    if (t > 2 && t < 2.2) least = std::min(least, predictor.usable_ahead_s(0.5));
    after = predictor.usable_ahead_s(0.5);
  }
  EXPECT_EQ(before, 0.5);
  EXPECT_LT(least, 0.25);
  EXPECT_EQ(after, 0.5);
}

TEST(Predict, ConfidenceFallsWithTimeAheadAndIsOneHalfAtTheUsableTime) {
  CounterRandom random(13, 0, RandomPurpose::kTest);
  MotionPredictor predictor;
  for (int i = 0; i < 200; ++i)
    predictor.observe(1 / 60.0, {noise(random, 0.05), glm::normalize(glm::dquat(1, noise(random, 0.02)))});
  double last = 1.0;
  for (double ahead = 0; ahead <= 2; ahead += 0.05) {
    const double c = predictor.at(ahead).confidence;
    EXPECT_LE(c, last);
    EXPECT_GE(c, 0.0);
    last = c;
  }
  const double usable = predictor.usable_ahead_s(2.0);
  ASSERT_LT(usable, 2.0);
  ASSERT_GT(usable, 0.0);
  EXPECT_NEAR(predictor.confidence(usable), 0.5, 1e-12);
}

TEST(Predict, AnUnpredictableRotationShortensTheTimeToo) {
  CounterRandom random(14, 0, RandomPurpose::kTest);
  MotionPredictor predictor;
  for (int i = 0; i < 200; ++i)
    predictor.observe(1 / 60.0, {{i * 0.05, 0, 0}, glm::normalize(glm::dquat(1, noise(random, 0.2)))});
  EXPECT_LT(predictor.usable_ahead_s(0.5), 0.3);
}

TEST(Predict, AnUnpredictableRotationIsDistrustedAsAnUnpredictablePlaceIs) {
  const auto confidence = [](double turn, double shift) {
    CounterRandom random(15, 0, RandomPurpose::kTest);
    MotionPredictor predictor;
    for (int i = 0; i < 200; ++i)
      predictor.observe(1 / 60.0, {glm::dvec3(i * 0.05, 0, 0) + noise(random, shift),
                                   glm::normalize(glm::dquat(1, noise(random, turn)))});
    return predictor.confidence(0.4);
  };
  EXPECT_GT(confidence(0, 0), 0.99);
  EXPECT_LT(confidence(0.2, 0), 0.6);
  EXPECT_LT(confidence(0, 0.2), 0.6);
}

// The bounds of a prediction come from the steps that are remembered, 32 of them. What a predictor saw before makes no
// difference.
TEST(Predict, OlderStepsAreForgotten) {
  CounterRandom random(16, 0, RandomPurpose::kTest);
  constexpr int kRemembered = 32;
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<std::pair<double, Pose>> seen;
    glm::dvec3 at(0.0);
    for (int i = 0; i < 120; ++i) {
      // Bursts of speed, so that the maxima leave the memory again and again.
      const double speed = random.next_below(10) == 0 ? 8.0 : 0.5,
                   dt = random.next_in(0.01, random.next_below(8) == 0 ? 0.1 : 0.02);
      at += random_vector(random, speed) * dt;
      seen.emplace_back(dt, Pose{at, glm::dquat(1, 0, 0, 0)});
    }
    for (size_t now = kRemembered + 1; now <= seen.size(); ++now) {
      MotionPredictor whole, recent;
      for (size_t i = 0; i < now; ++i) whole.observe(seen[i].first, seen[i].second);
      for (size_t i = now - kRemembered - 1; i < now; ++i) recent.observe(seen[i].first, seen[i].second);
      for (const double ahead : {0.1, 0.5, 1.2})
        ASSERT_LT(glm::distance(whole.at(ahead).pose.position_m, recent.at(ahead).pose.position_m), 1e-9)
            << trial << ' ' << now;
    }
  }
}

TEST(Predict, TheSignOfAQuaternionIsNoMotion) {
  MotionPredictor predictor;
  const glm::dquat q = glm::angleAxis(1.0, glm::dvec3(0, 1, 0));
  for (int i = 0; i < 20; ++i) predictor.observe(0.02, {{0, 0, 0}, i % 2 == 0 ? q : -q});
  expect_same(predictor.at(1.0).pose, {{0, 0, 0}, q}, 1e-12);
  EXPECT_EQ(predictor.usable_ahead_s(0.3), 0.3);
}

TEST(Predict, TheSignOfAQuaternionIsNoPartOfATurn) {
  MotionPredictor predictor;
  for (int i = 0; i <= 20; ++i) {
    const glm::dquat q = glm::angleAxis(0.04 * i, glm::dvec3(0, 1, 0));
    predictor.observe(0.02, {{0, 0, 0}, i % 2 == 0 ? q : -q});
  }
  expect_same(predictor.at(0.5).pose, {{0, 0, 0}, glm::angleAxis(0.8 + 1.0, glm::dvec3(0, 1, 0))}, 1e-9);
}

TEST(Predict, PredictedRotationsHaveUnitLength) {
  CounterRandom random(15, 0, RandomPurpose::kTest);
  MotionPredictor predictor;
  for (int i = 0; i < 100; ++i) {
    predictor.observe(0.02, {random_vector(random, 1), glm::normalize(glm::dquat(1, random_vector(random, 0.3)))});
    ASSERT_NEAR(glm::length(predictor.at(1.3).pose.rotation), 1.0, 1e-12);
  }
}

TEST(Predict, SettingsOutsideTheirRangeAreNamed) {
  const auto field_of = [](auto change) {
    PredictionSettings s;
    change(s);
    const Status status = validate(s);
    return status ? std::string("accepted") : status.error().field;
  };
  EXPECT_EQ(field_of([](auto&) {}), "accepted");
  EXPECT_EQ(field_of([](auto& s) { s.ahead_s = 0; }), "accepted");
  EXPECT_EQ(field_of([](auto& s) { s.ahead_s = 2; }), "accepted");
  EXPECT_EQ(field_of([](auto& s) { s.ahead_s = 2.001; }), "move.prediction_s");
  EXPECT_EQ(field_of([](auto& s) { s.ahead_s = -0.1; }), "move.prediction_s");
  EXPECT_EQ(field_of([](auto& s) { s.ahead_s = NAN; }), "move.prediction_s");
  EXPECT_EQ(field_of([](auto& s) { s.smoothing_s = 1.1; }), "move.prediction.smoothing_s");
  EXPECT_EQ(field_of([](auto& s) { s.acceleration_lasts_s = -1; }), "move.prediction.acceleration_lasts_s");
  EXPECT_EQ(field_of([](auto& s) { s.memory_s = 0; }), "move.prediction.memory_s");
  EXPECT_EQ(field_of([](auto& s) { s.tolerance_m = 0; }), "move.prediction.tolerance_m");
  EXPECT_EQ(field_of([](auto& s) { s.tolerance_rad = 4; }), "move.prediction.tolerance_rad");
  EXPECT_EQ(field_of([](auto& s) { s.max_speed_mps = 0; }), "move.prediction.max_speed_mps");
  EXPECT_EQ(field_of([](auto& s) { s.max_turn_radps = 1e6; }), "move.prediction.max_turn_radps");
}

}  // namespace
}  // namespace sightline
