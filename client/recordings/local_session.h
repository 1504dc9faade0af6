// A session in this process that answers as a daemon does: wire messages in, wire messages out, no network, no clock.
// Replays and reports step it.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/sample/extent.h"
#include "server/sample/sampler.h"
#include "server/scene/scene_folder.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// Shared by the sessions of a process. The sampler device must outlive it.
struct LocalWorld {
  // `scene_folder` may be empty: then scenes can only be named by hash (bring).
  LocalWorld(std::string scene_folder, SamplerDevice& sampler_device)
      : sampler(sampler_device), scenes(std::move(scene_folder), GltfLimits{}, geometry) {}

  // Takes one scene file, complete in itself, and returns its hash. It is kept, for ticks that name it later.
  Result<std::string> bring(std::span<const std::byte> file);

  SamplerDevice& sampler;
  GeometryStore geometry;
  ExtentCache extents;
  SceneLibrary scenes;
  std::vector<std::shared_ptr<const SceneAsset>> brought;
};

// Single-threaded.
class LocalSession {
 public:
  // Fails as opening a session at a daemon does, with the same field paths. `world` must outlive it. Without a clock
  // stage times are 0.
  static Result<std::unique_ptr<LocalSession>> open(const v1::OpenSession& request, LocalWorld& world,
                                                    StageClock clock = {});

  // The same message as a daemon's, without an id.
  const v1::SessionOpened& opened() const { return opened_; }

  // Applies a whole tick and returns true; or changes nothing, fills `rejection` as a daemon would, and returns false.
  bool apply(const v1::Tick& tick, v1::TickError& rejection);

  // Takes one step for the newest applied tick, at the given level of degradation. Clears and fills `reply`. Fails only
  // when the sampler does.
  Status step(int quality_level, v1::CameraReply& reply);

  // Every reply from now on has candidates, in addition to what the opening asked for.
  void want_candidates() { wanted_.candidates = true; }

  // Writes the session's memory after a step, as a daemon records it, and takes one over (Session::resume).
  void write_memory(v1::StepMemory& memory) const;
  Status resume(const v1::StepMemory& memory);

  const Session& session() const { return *session_; }

 private:
  LocalSession(LocalWorld& world, std::unique_ptr<Session> session) : world_(world), session_(std::move(session)) {}

  LocalWorld& world_;
  const std::unique_ptr<Session> session_;
  v1::SessionOpened opened_;
  DiagnosticsWanted wanted_;
};

}  // namespace sightline
