// Predict: where a target or a moving occluder will be, from its past velocities and accelerations, of
// translation and of rotation (paper 6.1, "Prediction").
//
// The past is fitted with one parabola an axis, samples weighted by exp(-age / smoothing), and the fit's
// velocity and acceleration carry the last pose forward. The rotation is treated alike: the steps between
// successive orientations, as rotation vectors in the world frame, are summed and fitted. So a motion of
// constant acceleration, and a turn about a fixed axis of constant angular acceleration, are foretold
// exactly, whatever the time steps.
//
// Each new pose is compared with what had been foretold for it. A mismatch of velocities, smoothed, that has
// been seen lately is expected again: over `ahead_s` it grows to an error of mismatch * ahead_s, and
// confidence and the usable time fall with that.
#pragma once

#include <array>
#include <cstddef>
#include <glm/glm.hpp>

#include "server/base/error.h"
#include "server/base/transform.h"

namespace sightline {

struct PredictionSettings {
  // How far ahead the camera looks. [0, 2]; 0 = no prediction. The paper's best is 0.3: at 0.1 the camera
  // learns of a corner too late to move, at 0.5 it is moved by turns that the targets never take.
  double ahead_s = 0.3;
  // Age at which a sample counts 1/e. [0, 1]; 0 = the last three samples alone. Small: noise of the poses
  // becomes velocity. Large: a turn is believed only after this time. Poses of a game carry no noise; poses
  // that were tracked or quantised want 0.1.
  double smoothing_s = 0.05;
  // How long the acceleration is believed to last; the velocity that it has then is kept. [0, 2]; 0 =
  // constant velocity. Small: bends are cut short. Large: a target that brakes is foretold to walk backwards.
  // For walkers between random places (3 m/s, 12 m/s^2) the error at 0.5 s is 0.36 m with 0, 0.34 m with 0.2,
  // 0.36 m with 0.3, 0.39 m with 0.5 and more.
  double acceleration_lasts_s = 0.3;
  // How long a wrong prediction is remembered: age at which it counts 1/e. [0.01, 10]. Small: one good tick
  // restores trust. Large: one turn makes the camera distrust a straight walk for long.
  double memory_s = 0.5;
  // Errors at which confidence is one half and beyond which a prediction is not used. (0, 100] m and (0, 3.2]
  // rad.
  double tolerance_m = 0.3;
  double tolerance_rad = 0.5;
  // What moves or turns faster than this has jumped: the past is forgotten. (0, 1000] m/s and (0, 1000]
  // rad/s.
  double max_speed_mps = 100.0;
  double max_turn_radps = 40.0;
};
// Fields are named "move.prediction_s" (ahead_s) and "move.prediction.smoothing_s" and so on for the others.
Status validate(const PredictionSettings& settings);

inline constexpr double kMaxPredictionS = 2.0;

struct Prediction {
  Pose pose;
  double confidence = 0.0;  // [0, 1]; see MotionPredictor::confidence
};

// The motion of one thing. A value: copied with its past, without allocation. Not thread-safe. Deterministic.
class MotionPredictor {
 public:
  explicit MotionPredictor(const PredictionSettings& settings = {}) : settings_(settings) {}

  // The next pose, dt_s seconds after the last one; finite, rotation of unit length, dt_s >= 0 (asserted).
  // The first dt_s is not used. With dt_s = 0 (a pause, a correction) the last pose is replaced and no motion
  // is read from it. A jump, faster than the settings allow or by more than the tolerance in no time, forgets
  // the past of what jumped: translation and rotation each for itself. A rotation turns by less than half a
  // turn between two samples: of the two ways the shorter is taken.
  void observe(double dt_s, const Pose& pose);

  // The pose ahead_s from the last one, clamped to [0, kMaxPredictionS]. at(0) is the last pose exactly. With
  // one sample it is at rest, with two at constant velocity. Before the first sample: the identity,
  // confidence 0.
  //
  // Bounded: with v and a the greatest speed and acceleration between samples that are still remembered,
  // |displacement| <= min(v ahead + a ahead (ahead + dt) / 2, max_speed_mps ahead), dt being the longest time
  // step remembered; the turn likewise. So a bad sample can throw a prediction no farther than it moved
  // itself.
  Prediction at(double ahead_s) const;

  // 1 / (1 + e^2), e being the expected error at ahead_s in tolerances, of translation or of rotation,
  // whichever is worse. 1 for ahead_s = 0; 0 while fewer than four samples are there to judge by.
  double confidence(double ahead_s) const;
  // The longest time up to wanted_s at which the confidence is at least one half.
  double usable_ahead_s(double wanted_s) const;

  // At the last sample, world frame, as fitted.
  const glm::dvec3& velocity_mps() const { return travel_.rate; }
  const glm::dvec3& acceleration_mps2() const { return travel_.acceleration; }
  const glm::dvec3& angular_velocity_radps() const { return turn_.rate; }

  void reset() { *this = MotionPredictor(settings_); }
  // New settings for the same past; they tell from the next sample on.
  void configure(const PredictionSettings& settings) { settings_ = settings; }

 private:
  static constexpr size_t kKept = 32;  // steps remembered: 0.5 s at 60 Hz, five times the default smoothing

  // When the samples were taken, the newest at 0, and what they count.
  struct SampleTimes {
    size_t count;
    std::array<double, kKept + 1> t, weight;
  };
  class Parabola;

  // Translation or rotation as a sum of steps in the world frame, the newest last.
  class Track {
   public:
    // Takes what was moved in dt_s, or forgets everything when that is a jump. `fit` comes next.
    void advance(double dt_s, const glm::dvec3& moved, double max_rate, double tolerance,
                 const PredictionSettings& settings);
    glm::dvec3 displacement(double ahead_s, double max_rate, const PredictionSettings& settings) const;
    // Expected mismatch of velocity; infinite while unknown.
    double mismatch() const;
    // Expected error at ahead_s, in tolerances.
    double error(double ahead_s, double tolerance) const { return mismatch() * ahead_s / tolerance; }
    void forget() { *this = Track(); }
    size_t count() const { return count_; }  // steps kept
    void list_times(double smoothing_s, SampleTimes& times) const;
    void fit(const SampleTimes& times);

    glm::dvec3 rate{0.0}, acceleration{0.0};

   private:
    struct Step {
      double dt_s = 0;
      glm::dvec3 moved{0.0};
    };
    const Step& recent(size_t k) const { return steps_[(next_ + kKept - 1 - k) % kKept]; }  // 0 = the newest
    void judge(double dt_s, const glm::dvec3& moved, double max_rate, const PredictionSettings& settings);
    struct Extremes {
      double rate = 0, acceleration = 0, dt_s = 0;
    };
    Extremes extremes_at(size_t k) const;
    void take_in(const Extremes& at);
    void measure_extremes(const Extremes& lost);

    std::array<Step, kKept> steps_{};
    size_t next_ = 0, count_ = 0;
    Extremes top_;           // over the steps kept
    glm::dvec3 drift_{0.0};  // low-passed mismatch of velocity
    double mismatch_ = 0;    // the greatest length of drift_, fading
    bool judged_ = false;
  };

  void fit();

  PredictionSettings settings_;
  Pose last_;
  bool seen_ = false;
  Track travel_, turn_;
};

}  // namespace sightline
