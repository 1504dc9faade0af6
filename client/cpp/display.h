// The camera that the player sees: the replies as sampled, a camera that follows the targets while none come, and the
// way back. No clock and no network: times are the game's, and the caller says whether the daemon is silent.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "client/cpp/following.h"
#include "client/cpp/live_camera.h"
#include "client/cpp/pose_sampler.h"

namespace sightline::live {

class Display {
 public:
  Display(const v1::OpenSession& opening, double blend_s);

  const std::optional<v1::CameraReply>& newest() const { return newest_; }
  bool follows() const { return follower_.has_value(); }

  void take_tick(const v1::Tick& tick);
  void take_reply(v1::CameraReply reply);
  // The daemon is silent. `counts_from`: the first tick whose reply ends the fallback.
  void follow(uint64_t counts_from);
  // The camera at a game time. `drawn`: positions of targets at that time, if they are newer than the newest tick.
  std::pair<CameraSample, LiveSource> show(double time_s, const Drawn& drawn);
  // The camera that the player sees, so that the daemon goes on from it.
  v1::ObservedCamera observed() const;

 private:
  // The fallback's pose minus the daemon's, where they met.
  struct Blend {
    double since_s;
    Vector shift, turn;
    double zoom;
  };
  void shift_world(uint64_t sequence, const Vector& by);
  v1::CameraReply in_this_world(v1::CameraReply reply);
  Vector offset() const;
  Vector relative_velocity() const;
  CameraSample followed(double time_s, const std::optional<Vector>& centre) const;
  void go_back(const CameraSample& followed, const CameraSample& daemon, double time_s);
  std::pair<CameraSample, LiveSource> blended(const CameraSample& daemon, double time_s);
  double share_left(double time_s) const;
  void remember(const CameraSample& sample, double time_s, const std::optional<Vector>& centre);

  const double blend_s_;
  TargetPlaces places_;
  std::optional<v1::CameraReply> newest_;
  PoseSampler sampler_;  // of the replies that count: while there is a follower, those that end the fallback
  CameraSample shown_;
  double shown_s_ = 0;
  std::optional<Vector> centre_;                    // of the targets when that was shown
  std::vector<std::pair<double, Vector>> offsets_;  // the camera minus the centre at the last two times
  std::optional<Follower> follower_;
  bool has_followed_ = false;  // since the follower began, it was shown
  uint64_t counts_from_ = 0;   // replies to ticks from this number on end the fallback
  std::optional<Blend> blend_;
  std::vector<std::pair<uint64_t, Vector>> shifts_;  // of the world, by ticks that no reply covers so far
  RecentMotion motion_;
};

}  // namespace sightline::live
