// The world that the sessions of a load play in: a scene with targets that walk through it, and boxes that circle near
// their path.
//
// The first targets are the scene's own; further ones are capsules that walk beside them. All walk the scene's path to
// its end and back, for as long as the load lasts. Each session walks a little faster or slower than the next, so that
// no two keep in step. Every session has its own boxes, of which `moving` circle and the rest stand. Everything follows
// from the seed and the session's number.
//
// Immutable; may be used by any thread. Frame: glTF's, metres, seconds.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "client/scenario/scenario.h"
#include "server/base/random.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

struct BenchWorldOptions {
  size_t targets = 2;     // of a session, [1, 32]
  size_t moving = 0;      // boxes of a session that circle
  size_t instances = 0;   // all boxes of a session; at least `moving`
  size_t sessions = 1;    // [1, 10000]
  double rate_hz = 60.0;  // of each session, (0, 1000]; the sessions' clocks advance by 1 / rate_hz with each tick
  uint64_t seed = 1;
};

class BenchWorld {
 public:
  // `scene`: the bytes of a scene file. Fails as the glTF reader and Scenario::from_asset do, and when there is no
  // target.
  static Result<BenchWorld> make(std::span<const std::byte> scene, const BenchWorldOptions& options);

  // The request that opens a session, without settings. `scene_hash` is what the upload answered.
  v1::OpenSession open(size_t session, const std::string& scene_hash) const;

  // Writes everything that moves into tick `sequence` = 1, 2, ... of a session. Passing the tick of the last call again
  // reuses its memory.
  void fill_tick(size_t session, uint64_t sequence, v1::Tick& tick) const;

 private:
  struct Walker {  // one target
    uint64_t id = 0;
    std::vector<Pose> path;    // at steps of kPathStepS, from the start of the scene's animation to its end
    glm::dvec3 beside_m{0.0};  // a capsule's offset from the path
  };
  struct Box {
    uint64_t id = 0;
    glm::dvec3 centre_m{0.0};
    glm::dvec3 half_extent_m{0.0};
    double radius_m = 0.0;  // of its circle; 0: the box stands
    double phase_rad = 0.0, speed_radps = 0.0;
  };

  BenchWorld(Scenario scenario, const BenchWorldOptions& options);
  void take_walkers();
  void place_boxes();
  Box make_box(uint64_t id, bool moves, CounterRandom& random) const;
  double path_time_s(size_t session, uint64_t sequence) const;  // in [0, duration], to the end and back

  BenchWorldOptions options_;
  Scenario scenario_;
  std::vector<Walker> walkers_;
  std::vector<std::vector<Box>> boxes_;  // for each session
};

}  // namespace sightline
