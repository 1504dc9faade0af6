// How an instance moves, found from the positions that a client sends without velocities.
//
// Positions that change at every tick, without noise, are taken as they are: the velocity is the last change of
// position over its time. Games also send other positions. Physics at 30 Hz in ticks of 60 Hz holds each position for
// two ticks, so a runner seems to stand at every second one. Positions from a tracker, or in whole centimetres, are
// noisy: 1 cm at 60 Hz looks like 0.8 m/s. Then three motions are believed in parts, each by how well it has foretold
// the positions: to stand, to go on with hardly another velocity, and to change it as hard as a sprinter who stops (an
// interacting multiple model filter: Blom and Bar-Shalom 1988). The estimate goes on between held positions, and stops
// when a position is held for longer than the others were.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>

namespace sightline {

struct MotionEstimate {
  glm::dvec3 velocity_mps{0.0};
  glm::dvec3 correction_m{0.0};  // from the position that was sent to the one that is believed
};

// A value type. Not thread-safe. Deterministic.
class MotionTrack {
 public:
  MotionTrack() = default;
  // An instance that has stood there.
  explicit MotionTrack(const glm::dvec3& at_m) { restart(at_m); }

  // Adds the position after dt_s > 0. At the first one the instance is taken to stand. The same after a jump, which is
  // a motion faster than `jump_mps`.
  MotionEstimate observe(double dt_s, const glm::dvec3& at_m, double jump_mps);
  // For an instance whose velocity the client sends: only held positions are gone on from.
  MotionEstimate observe_sent(double dt_s, const glm::dvec3& at_m, const glm::dvec3& velocity_mps, double jump_mps);

  // The standard deviation of the positions by axis, metres, as measured; 0: none.
  double noise_m() const;
  // Positions are held for several ticks.
  bool is_held() const { return held_; }
  // The client sent the velocity with the last position.
  bool has_sent_velocity() const { return sent_; }

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)

  // One belief about position and velocity: means, and covariances that are the same for each axis.
  struct Belief {
    glm::dvec3 at_m{0.0}, velocity_mps{0.0};
    double position = 0.0, both = 0.0, velocity = 0.0;
    double share = 0.0;  // how much it is believed, [0, 1]; those of all beliefs together are 1
  };
  static void go_on(Belief& belief, double time_s, size_t motion);
  // returns the logarithm of its likelihood
  static double correct(Belief& belief, const glm::dvec3& at_m, double variance);

  void restart(const glm::dvec3& at_m);
  bool jumps(double dt_s, const glm::dvec3& at_m, double jump_mps) const;
  void take_interval(double dt_s);
  void measure_noise(const glm::dvec3& moved_m, double interval_s);
  bool is_noisy() const;
  double variance_m2() const;
  double newest_part(double interval_s, uint32_t known) const;
  double coast_s(double dt_s) const;
  MotionEstimate changed(double dt_s, const glm::dvec3& at_m);
  MotionEstimate unchanged(double dt_s);
  void begin_beliefs(const glm::dvec3& at_m, const glm::dvec3& velocity_mps, double interval_s);
  void mix_beliefs(double time_s);
  void update_beliefs(double time_s, const glm::dvec3& at_m);
  MotionEstimate estimate(double ahead_s) const;

  bool known_ = false, stands_ = true, held_ = false, filters_ = false, noisy_ = false, sent_ = false;
  glm::dvec3 last_m_{0.0};
  double since_s_ = 0.0;  // the position became last_m_
  uint32_t ticks_since_ = 0;
  std::array<double, 3> intervals_s_{};  // between the last changes, the newest first
  uint32_t intervals_ = 0;               // their number, up to the number that counts
  double held_share_ = 0.0;              // of the positions: sent in more than one tick
  double mean_interval_s_ = 0.0, interval_variance_s2_ = 0.0;
  glm::dvec3 last_mps_{0.0}, last_miss_m_{0.0};
  uint32_t misses_ = 0;           // number of positions that could be foretold, up to the number that counts
  double miss_product_m2_ = 0.0;  // mean product of successive misses
  std::array<Belief, 3> beliefs_{};
  double believed_s_ = 0.0;  // since the beliefs were corrected
};

}  // namespace sightline
