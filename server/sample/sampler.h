// The interface of the samplers, which take depth maps: EGL/OpenGL renders them, Embree casts rays. Both give the same
// maps within a tolerance (tests/sample): distances differ by at most 1e-4 relative, and texels only where a silhouette
// passes through them.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/sample/depth_map.h"
#include "server/scene/mirror.h"

namespace sightline {

// Takes maps of one session's mirror. Not thread-safe, but not bound to a thread. Keeps data derived from the mirror
// between calls and updates only what has changed.
class Sampler {
 public:
  virtual ~Sampler() = default;

  // Takes maps[i] for requests[i]. Every instance that occludes (Instance::occludes) appears at its current transform,
  // two-sided. `maps` is resized and its memory reused. On Error (kUnavailable: the device was lost and could not be
  // rebuilt) `maps` is unspecified, and the next call may succeed. All calls of one sampler must use the same mirror.
  virtual Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) = 0;

  // Derives what it can from the mirror, so that the next take need not: with very many triangles that takes long. Does
  // nothing by default.
  virtual void prepare(const SceneMirror&) {}

  // Maps taken since creation. Tests use it to show that shared maps are taken once.
  uint64_t maps_taken() const { return maps_taken_; }

 protected:
  uint64_t maps_taken_ = 0;
};

// One sampler's part of SamplerDevice::take_all.
struct TakeJob {
  Sampler* sampler = nullptr;  // of the device that takes it
  const SceneMirror* mirror = nullptr;
  std::span<const MapRequest> requests;
  std::vector<DepthMap>* maps = nullptr;
  Status taken;  // as Sampler::take would have returned
};

// A device shared by all sessions. It makes their samplers and must outlive them. Thread-safe.
class SamplerDevice {
 public:
  virtual ~SamplerDevice() = default;
  virtual std::unique_ptr<Sampler> make_sampler() = 0;
  // Like Sampler::take for every job, in any order; no two jobs may have the same sampler. A device on which
  // submissions are expensive takes them together.
  virtual void take_all(std::span<TakeJob> jobs) {
    for (TakeJob& job : jobs) job.taken = job.sampler->take(*job.mirror, job.requests, *job.maps);
  }
  // The number of jobs that are worth taking together; 1 when together is no faster.
  virtual size_t best_batch() const { return 1; }
  // "egl" or "embree".
  virtual std::string kind() const = 0;
  // The device's name for logs and reports: "llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5, EGL surfaceless".
  virtual std::string renderer() const = 0;
  // Bytes of geometry that the device keeps, shared by all samplers.
  virtual size_t geometry_bytes() const = 0;
  // Gives up what it keeps of geometries that no session has any more. Called now and then.
  virtual void forget_unused() {}
};

}  // namespace sightline
