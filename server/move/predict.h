// Predicts the pose of a target from its past velocities and accelerations, of translation and rotation (paper 6.1,
// "Prediction").
//
// One parabola for each axis is fitted to the past, with sample weights exp(-age / smoothing). The fitted velocity and
// acceleration carry the last pose forward. Rotation is handled in the same way: the steps between successive
// orientations, as rotation vectors in the world frame, are summed and fitted. So constant acceleration, and constant
// angular acceleration about a fixed axis, are predicted exactly for all time steps.
//
// Each new pose is compared with its prediction. The recent mismatch of velocity, smoothed, is expected again: over
// `ahead_s` it grows to an error of mismatch * ahead_s, which lowers the confidence and the usable time.
#pragma once

#include <array>
#include <cstddef>
#include <glm/glm.hpp>

#include "server/base/error.h"
#include "server/base/transform.h"

namespace sightline {

struct PredictionSettings {
  // How far ahead the camera looks. [0, 2]; 0 = no prediction. The paper's best is 0.3. At 0.1 the camera learns of a
  // corner too late to react. At 0.5 it reacts to turns that the targets never take.
  double ahead_s = 0.3;
  // Age at which a sample counts 1/e. [0, 1]; 0 = the last three samples alone. Small: noise of the poses
  // becomes velocity. Large: a turn is believed only after this time. Poses of a game carry no noise; poses
  // that were tracked or quantised want 0.1.
  double smoothing_s = 0.05;
  // How long the acceleration is believed to last; the velocity that it has then is kept. [0, 2]; 0 =
  // constant velocity. Small: bends are cut short. Large: a braking target is predicted to walk backwards. Measured for
  // walkers between random points (3 m/s, 12 m/s^2): the error at 0.5 s is 0.36 m with 0, 0.34 m with 0.2, 0.36 m with
  // 0.3, and 0.39 m with 0.5 and more.
  double acceleration_lasts_s = 0.3;
  // How long a wrong prediction is remembered: age at which it counts 1/e. [0.01, 10]. Small: one good tick
  // restores trust. Large: one turn makes the camera distrust a straight walk for long.
  double memory_s = 0.5;
  // Errors at which confidence is one half and beyond which a prediction is not used. (0, 100] m and (0, 3.2]
  // rad.
  double tolerance_m = 0.3;
  double tolerance_rad = 0.5;
  // A target that moves or turns faster than this has jumped, and its past is dropped. (0, 1000] m/s and (0, 1000]
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

// The motion of one object. A value type: copies include the past and allocate nothing. Not thread-safe. Deterministic.
class MotionPredictor {
 public:
  explicit MotionPredictor(const PredictionSettings& settings = {}) : settings_(settings) {}

  // Adds the next pose, dt_s seconds after the last one; finite, rotation of unit length, dt_s >= 0 (asserted). The
  // first dt_s is not used. dt_s = 0 (a pause or a correction) replaces the last pose without reading a motion from it.
  // A jump is a motion faster than the settings allow, or by more than the tolerance in no time. It clears the past of
  // translation or rotation, whichever jumped. Between two samples a rotation is taken to turn the shorter way.
  void observe(double dt_s, const Pose& pose);

  // The predicted pose at ahead_s, clamped to [0, kMaxPredictionS], after the last one. at(0) is exactly the last pose.
  // One sample is taken to be at rest, two to move at constant velocity. Without a sample: the identity with confidence
  // 0.
  //
  // The displacement is at most min(v ahead + a ahead (ahead + dt) / 2, max_speed_mps ahead). Here v, a and dt are the
  // greatest speed, acceleration and time step among the remembered samples. The same holds for the rotation. So a bad
  // sample moves a prediction no farther than it moved itself.
  Prediction at(double ahead_s) const;

  // 1 / (1 + e^2), where e is the expected error at ahead_s, in tolerances, of translation or rotation, whichever is
  // larger. It is 1 for ahead_s = 0, and 0 with fewer than four samples.
  double confidence(double ahead_s) const;
  // The longest time up to wanted_s at which the confidence is at least one half.
  double usable_ahead_s(double wanted_s) const;

  // The fitted values at the last sample, world frame.
  const glm::dvec3& velocity_mps() const { return travel_.rate; }
  const glm::dvec3& acceleration_mps2() const { return travel_.acceleration; }
  const glm::dvec3& angular_velocity_radps() const { return turn_.rate; }

  void reset() { *this = MotionPredictor(settings_); }
  // Replaces the settings and keeps the past. They take effect with the next sample.
  void configure(const PredictionSettings& settings) { settings_ = settings; }

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  static constexpr size_t kKept = 32;  // steps remembered: 0.5 s at 60 Hz, five times the default smoothing

  // Times and weights of the samples; the newest is at time 0.
  struct SampleTimes {
    size_t count;
    std::array<double, kKept + 1> t, weight;
  };
  class Parabola;

  // Translation or rotation as a series of steps in the world frame, the newest last.
  class Track {
   public:
    // Adds a step of dt_s, or clears everything when the step is a jump. Call `fit` next.
    void advance(double dt_s, const glm::dvec3& moved, double max_rate, double tolerance,
                 const PredictionSettings& settings);
    glm::dvec3 displacement(double ahead_s, double max_rate, const PredictionSettings& settings) const;
    // Expected mismatch of velocity; infinity while unknown.
    double mismatch() const;
    // Expected error at ahead_s, in tolerances.
    double error(double ahead_s, double tolerance) const { return mismatch() * ahead_s / tolerance; }
    void forget() { *this = Track(); }
    size_t count() const { return count_; }  // steps kept
    void list_times(double smoothing_s, SampleTimes& times) const;
    void fit(const SampleTimes& times);

    glm::dvec3 rate{0.0}, acceleration{0.0};

   private:
    friend struct StateFields;
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
