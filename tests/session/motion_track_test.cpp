// How positions that are held, late or noisy are read, against motions that are known.
#include "server/session/motion_track.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "server/base/random.h"

namespace sightline {
namespace {

constexpr double kTick = 1.0 / 60, kJumpMps = 100.0;

// The target runs, turns by 90 degrees within 0.3 s, stops within 0.2 s, stands for 2 s and runs on.
glm::dvec3 velocity_at(double time_s, double speed_mps) {
  const double turned = std::clamp((time_s - 2) / 0.3, 0.0, 1.0) * std::numbers::pi / 2;
  if (time_s < 6) return speed_mps * glm::dvec3(std::cos(turned), 0, std::sin(turned));
  if (time_s < 8) return glm::dvec3(0, 0, speed_mps * std::max(0.0, 1 - (time_s - 6) / 0.2));
  return glm::dvec3(speed_mps * std::min(1.0, (time_s - 8) / 0.2), 0, 0);
}
class Course {
 public:
  explicit Course(double speed_mps) : speed_mps_(speed_mps) {
    glm::dvec3 at_m(0.0);
    for (int ms = 0; ms < 12'002; ++ms) at_m_.push_back(at_m), at_m += velocity_at(0.001 * ms, speed_mps) * 0.001;
  }
  glm::dvec3 at(double time_s) const {
    const auto k = static_cast<size_t>(time_s * 1000);
    return glm::mix(at_m_[k], at_m_[k + 1], time_s * 1000 - static_cast<double>(k));
  }
  glm::dvec3 velocity(double time_s) const { return velocity_at(time_s, speed_mps_); }

 private:
  double speed_mps_;
  std::vector<glm::dvec3> at_m_;
};

// Draws from a normal distribution, as the sum of twelve numbers.
double normal(CounterRandom& random) {
  double sum = -6;
  for (int k = 0; k < 12; ++k) sum += random.next_unit();
  return sum;
}

struct Errors {
  double position_m = 0, velocity_mps = 0;  // means over 11 s, the first second left out
  double raw_velocity_mps = 0;              // of the change between successive ticks
};
Errors errors_of(const Course& course, double rate_hz, double noise_m) {
  MotionTrack track;
  CounterRandom random(3, 0, RandomPurpose::kTest);
  Errors errors;
  glm::dvec3 sent_m(0.0), before_m(0.0);
  double next_s = 0;
  int count = 0;
  for (int k = 0; k < 720; ++k) {
    const double time_s = k * kTick;
    if (time_s + 1e-9 >= next_s) {
      sent_m = course.at(next_s) + noise_m * glm::dvec3(normal(random), normal(random), normal(random));
      next_s += 1 / rate_hz;
    }
    const MotionEstimate now = track.observe(kTick, sent_m, kJumpMps);
    if (time_s >= 1) {
      errors.position_m += glm::distance(sent_m + now.correction_m, course.at(time_s));
      errors.velocity_mps += glm::distance(now.velocity_mps, course.velocity(time_s));
      errors.raw_velocity_mps += glm::distance((sent_m - before_m) / kTick, course.velocity(time_s));
      ++count;
    }
    before_m = sent_m;
  }
  errors.position_m /= count, errors.velocity_mps /= count, errors.raw_velocity_mps /= count;
  return errors;
}

TEST(MotionTrack, CleanPositionsAreTakenAsTheyAre) {
  const Course course(5);
  MotionTrack track;
  glm::dvec3 before_m = course.at(0);
  track.observe(kTick, before_m, kJumpMps);
  for (int k = 1; k < 720; ++k) {
    const glm::dvec3 now_m = course.at(k * kTick);
    const MotionEstimate now = track.observe(kTick, now_m, kJumpMps);
    ASSERT_EQ(now.velocity_mps, now_m == before_m ? glm::dvec3(0.0) : (now_m - before_m) / kTick) << k;
    ASSERT_EQ(now.correction_m, glm::dvec3(0.0)) << k;
    before_m = now_m;
  }
  EXPECT_FALSE(track.is_held());
  EXPECT_LT(track.noise_m(), 1e-4);
}

// Physics at 10 to 55 Hz in ticks of 60 Hz, also at rates whose ticks are held for an uneven number of times.
TEST(MotionTrack, HeldPositionsAreGoneOnFrom) {
  for (const double speed_mps : {1.5, 5.0})
    for (const double rate_hz : {10.0, 20.0, 25.0, 30.0, 45.0, 50.0, 55.0}) {
      const Errors errors = errors_of(Course(speed_mps), rate_hz, 0.0);
      EXPECT_LT(errors.velocity_mps, 0.03 * speed_mps) << rate_hz;
      EXPECT_LT(errors.velocity_mps, 0.25 * errors.raw_velocity_mps) << rate_hz;
      EXPECT_LT(errors.position_m, 0.008 * speed_mps) << rate_hz;
    }
}

TEST(MotionTrack, NoiseIsMeasuredAndSmoothed) {
  for (const double rate_hz : {20.0, 60.0})
    for (const double noise_m : {0.003, 0.01, 0.05, 0.15})
      for (const double speed_mps : {0.0, 1.5, 5.0}) {
        const Errors errors = errors_of(Course(speed_mps), rate_hz, noise_m);
        EXPECT_LT(errors.velocity_mps, 0.12 + 0.12 * speed_mps + 3 * noise_m)
            << rate_hz << ' ' << noise_m << ' ' << speed_mps;
        EXPECT_LT(errors.velocity_mps, 0.3 * errors.raw_velocity_mps) << rate_hz << ' ' << noise_m << ' ' << speed_mps;
        EXPECT_LT(errors.position_m, 0.01 + 1.1 * noise_m) << rate_hz << ' ' << noise_m << ' ' << speed_mps;
      }
}

TEST(MotionTrack, TheNoiseThatItMeasuresIsTheNoiseThatIsThere) {
  for (const double noise_m : {0.003, 0.03}) {
    MotionTrack track;
    CounterRandom random(9, 0, RandomPurpose::kTest);
    double sum_m = 0;
    for (int k = 0; k < 1200; ++k) {
      const glm::dvec3 at_m(3 * k * kTick + noise_m * normal(random), noise_m * normal(random),
                            noise_m * normal(random));
      track.observe(kTick, at_m, kJumpMps);
      if (k >= 200) sum_m += track.noise_m() / 1000;
    }
    EXPECT_NEAR(sum_m / noise_m, 1.0, 0.15);
  }
}

// A runner who is filmed at 20 Hz stops. It is known to stand one tick after the position that did not come, and then
// it rests exactly.
TEST(MotionTrack, WhoIsHeldForLongerThanBeforeHasStopped) {
  MotionTrack track;
  const double speed_mps = 4;
  glm::dvec3 at_m(0.0);
  for (int k = 0; k < 60; ++k) {
    if (k % 3 == 0) at_m = {speed_mps * k * kTick, 0, 0};
    track.observe(kTick, at_m, kJumpMps);
  }
  MotionEstimate now;
  double farthest_m = 0;
  for (int k = 0; k < 30; ++k) {
    now = track.observe(kTick, at_m, kJumpMps);
    farthest_m = std::max(farthest_m, glm::length(now.correction_m));
  }
  EXPECT_LT(farthest_m, speed_mps * 0.07);
  EXPECT_EQ(now.velocity_mps, glm::dvec3(0.0));
  EXPECT_EQ(now.correction_m, glm::dvec3(0.0));
}

// At 10 Hz a car at 30 m/s leaps by 3 m in one tick of six: 180 m/s by that tick alone.
TEST(MotionTrack, HeldPositionsOfFastCarsAreNoJumps) {
  for (const double rate_ticks : {2.0, 3.0, 6.0}) {
    MotionTrack track;
    MotionEstimate now;
    double fastest_mps = 0, at_m = 0;
    for (int k = 0; k < 120; ++k) {
      at_m = 30 * kTick * rate_ticks * std::floor(k / rate_ticks);
      now = track.observe(kTick, {at_m, 0, 0}, kJumpMps);
      fastest_mps = std::max(fastest_mps, glm::length(now.velocity_mps));
    }
    EXPECT_NEAR(now.velocity_mps.x, 30, 0.1) << rate_ticks;
    EXPECT_NEAR(at_m + now.correction_m.x, 30 * 119 * kTick, 0.1) << rate_ticks;
    EXPECT_LE(fastest_mps, kJumpMps) << rate_ticks;
  }
}

TEST(MotionTrack, AJumpIsNoMotion) {
  MotionTrack track;
  for (int k = 0; k < 60; ++k) track.observe(kTick, {0.05 * (k / 2), 0, 0}, kJumpMps);
  ASSERT_TRUE(track.is_held());
  const MotionEstimate jumped = track.observe(kTick, {50, 0, 0}, kJumpMps);
  EXPECT_EQ(jumped.velocity_mps, glm::dvec3(0.0));
  EXPECT_EQ(jumped.correction_m, glm::dvec3(0.0));
  EXPECT_FALSE(track.is_held());
}

// Sent velocities count as they are; only the held position goes on with them.
TEST(MotionTrack, SentVelocitiesCarryHeldPositionsOn) {
  MotionTrack track;
  const glm::dvec3 velocity_mps(4, 0, 0);
  for (int k = 0; k < 90; ++k) {
    const double time_s = k * kTick, sent_s = (k / 3) * 3 * kTick;
    const MotionEstimate now = track.observe_sent(kTick, velocity_mps * sent_s, velocity_mps, kJumpMps);
    EXPECT_EQ(now.velocity_mps, velocity_mps);
    if (k > 12) {
      EXPECT_NEAR(sent_s * 4 + now.correction_m.x, time_s * 4, 1e-9) << k;
    }
  }
}

// A walker pauses again and again. Those pauses are not held positions, and the steps after them are taken as they are.
TEST(MotionTrack, PausesOfOneWhoStopsAndGoesAreNoHolds) {
  MotionTrack track;
  glm::dvec3 at_m(0.0);
  for (int k = 0; k < 600; ++k) {
    const bool walks = k % 60 < 40;
    const glm::dvec3 before_m = at_m;
    if (walks) at_m.x += 1.5 * kTick;
    const MotionEstimate now = track.observe(kTick, at_m, kJumpMps);
    if (k > 0) {
      EXPECT_EQ(now.velocity_mps, (at_m - before_m) / kTick) << k;
    }
  }
  EXPECT_FALSE(track.is_held());
}

}  // namespace
}  // namespace sightline
