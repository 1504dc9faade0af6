// The camera at the time of drawing, from replies that come less often and late. client/SAMPLING.md states the rules.
//
//   sampler.add(reply);                                 // each reply, as it comes
//   auto shown = sampler.sample(time_s, target);        // each frame: game time, and where sampler.target_id() is
//   drawn
//
// It only computes: no clock, no network, no thread.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "sightline/v1/session.pb.h"

namespace sightline {

// A camera that can be drawn, in the client's frame.
struct CameraSample {
  std::array<double, 3> position{};
  std::array<double, 4> rotation{0, 0, 0, 1};  // x, y, z, w
  double field_of_view = 0;                    // as CameraReply.field_of_view
  bool cut = false;                            // it jumped since the former sample; reset what smooths over frames
};

class PoseSampler {
 public:
  // The target whose position `sample` takes; 0: none.
  uint64_t target_id() const { return newest_ ? newest_->target_id : 0; }

  // Takes a reply. False: it is not newer than the newest one, and is ignored.
  bool add(const v1::CameraReply& reply);

  // The client's world has a new origin: the replies that were added lie elsewhere now (Tick.world_shift).
  void shift(const std::array<double, 3>& by);

  // The camera at a game time; nothing: there is no reply so far. `target_position`: where target_id() is at that time;
  // without it, only velocities carry the camera on.
  std::optional<CameraSample> sample(double time_s, const std::optional<std::array<double, 3>>& target_position = {});

 private:
  // The part of a reply that the sampler needs.
  struct Newest {
    double time_s;
    CameraSample pose;
    std::array<double, 3> velocity, angular_velocity;
    uint64_t target_id;
    std::optional<std::array<double, 3>> target;  // where the target was

    void shift(const std::array<double, 3>& by);
    CameraSample at(double time, const std::optional<std::array<double, 3>>& target_position) const;
  };
  void fade(double time_s);

  uint64_t sequence_ = 0;
  std::optional<Newest> newest_;
  std::optional<Newest> former_;  // the one of the former sample, while a newer one waits to be shown
  bool cut_ = false;              // a reply since the former sample was a cut
  double time_s_ = -std::numeric_limits<double>::infinity();  // of the former sample
  // The remainder that fades away: the former sample minus the newest reply, at time_s_.
  std::array<double, 3> shift_{}, turn_{};
  double zoom_ = 0;
};

}  // namespace sightline
