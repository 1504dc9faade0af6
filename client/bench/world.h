// What the sessions of a load play: a scene with targets that walk through it and boxes that circle where they walk.
//
// The first targets are the scene's own; more are capsules that walk beside them. They go the scene's way to its end and back
// again, for as long as the load lasts, each session a little faster or slower than the next, so that no two stay in step. Of the
// boxes, `moving` circle and the rest stand; a session has its own. Everything follows from the seed and the session's number.
//
// Immutable once made; any thread. Frame: glTF's, metres, seconds.
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
  size_t targets = 2;    // [1, 32]
  size_t moving = 0;     // boxes that circle, a session
  size_t instances = 0;  // boxes in all, a session; at least `moving`
  size_t sessions = 1;
  double rate_hz = 60.0;  // the sessions' clocks go by 1 / rate_hz a tick
  uint64_t seed = 1;
};

class BenchWorld {
 public:
  // `scene`: the scene as a file. Fails as the glTF reader and Scenario::from_asset do, and when it has no target.
  static Result<BenchWorld> make(std::span<const std::byte> scene, const BenchWorldOptions& options);

  // What opens a session, but for its settings. `scene_hash`: as the upload answered.
  v1::OpenSession open(size_t session, const std::string& scene_hash) const;

  // Everything that moves, as tick `sequence` = 1, 2, ... of a session. `tick` should be the one of the last call: what does
  // not change in it is left.
  void fill_tick(size_t session, uint64_t sequence, v1::Tick& tick) const;

 private:
  struct Walker {  // one target at kPathStepS steps from 0 to the end of the way
    uint64_t id = 0;
    std::vector<Pose> path;
    glm::dvec3 beside_m{0.0};  // a capsule walks beside the path of which it has a copy
  };
  struct Box {
    uint64_t id = 0;
    glm::dvec3 centre_m{0.0};
    glm::dvec3 half_extent_m{0.0};
    double radius_m = 0.0;  // of its circle; 0: it stands
    double phase_rad = 0.0, speed_radps = 0.0;
  };

  BenchWorld(Scenario scenario, const BenchWorldOptions& options);
  void take_walkers();
  void place_boxes();
  Box make_box(uint64_t id, bool moves, CounterRandom& random) const;
  double way_time_s(size_t session, uint64_t sequence) const;  // in [0, duration], to the end and back
  void set_walker(const Walker& walker, int at, double time_s, double before_s, double dt_s,
                  v1::Transforms& transforms) const;

  BenchWorldOptions options_;
  Scenario scenario_;
  std::vector<Walker> walkers_;
  std::vector<std::vector<Box>> boxes_;  // by session
};

}  // namespace sightline
