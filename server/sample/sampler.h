// The one contract behind which depth maps are taken: by EGL/OpenGL renders, or by Embree rays. Both give the same
// maps within a stated tolerance (tests/sample): distances to 1e-4 relative, and texels may differ only where a
// silhouette passes through them.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/sample/depth_map.h"
#include "server/scene/mirror.h"

namespace sightline {

// Takes maps of one session's mirror. Not thread-safe; may be used from any one thread at a time. Keeps what it
// derived from the mirror between calls and updates only what changed.
class Sampler {
 public:
  virtual ~Sampler() = default;

  // Takes maps[i] for requests[i], every instance that occludes (Instance::occludes) drawn at its current transform,
  // two-sided. `maps` is resized and its memory reused. On Error (kUnavailable: the device was lost and could not be
  // rebuilt) `maps` is unspecified and the next call may succeed. Always the same mirror for one sampler.
  virtual Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) = 0;

  // Maps taken since creation: what a test counts to show that a shared render happens once.
  uint64_t maps_taken() const { return maps_taken_; }

 protected:
  uint64_t maps_taken_ = 0;
};

// One sampler's part of a take for many.
struct TakeJob {
  Sampler* sampler = nullptr;  // of the device that takes it
  const SceneMirror* mirror = nullptr;
  std::span<const MapRequest> requests;
  std::vector<DepthMap>* maps = nullptr;
  Status taken;  // what Sampler::take would have answered
};

// A device shared by all sessions; makes their samplers. Thread-safe. Outlives its samplers.
class SamplerDevice {
 public:
  virtual ~SamplerDevice() = default;
  virtual std::unique_ptr<Sampler> make_sampler() = 0;
  // As Sampler::take for every job, in any order; no two of one sampler. A device on which every submission costs much takes
  // them together.
  virtual void take_all(std::span<TakeJob> jobs) {
    for (TakeJob& job : jobs) job.taken = job.sampler->take(*job.mirror, job.requests, *job.maps);
  }
  // Jobs that are worth taking together; 1: nothing is gained by it.
  virtual size_t best_batch() const { return 1; }
  // "egl" or "embree".
  virtual std::string kind() const = 0;
  // What takes the maps, for logs and reports: "llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5, EGL surfaceless".
  virtual std::string renderer() const = 0;
  // Bytes that the device keeps for geometry, shared by all samplers.
  virtual size_t geometry_bytes() const = 0;
};

}  // namespace sightline
