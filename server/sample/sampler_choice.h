// Chooses the sampler. That is Embree, which needs no OpenGL. It was faster on every machine measured, also on one with
// an NVIDIA H100 (tests/results/speed/gpu.md). A map has so few texels that finding the triangles to draw takes longer
// than all its rays.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "server/sample/egl_sampler.h"
#include "server/sample/sampler.h"

namespace sightline {

enum class SamplerChoice { kAuto, kEgl, kEmbree };

struct SamplerDecision {
  SamplerChoice sampler = SamplerChoice::kEmbree;  // never kAuto
  std::string reason;                              // for people: a clause, without a full stop
};

// Returns the device that EGL would use, as choose_egl_device does.
using FindEgl = std::function<Result<EglDeviceInfo>()>;

// kEgl and kEmbree are taken as asked. kAuto takes Embree, unless `options` name a device or require a GPU: then it
// takes EGL, and returns the error of `find` when that device cannot be used. `find` is called only then.
Result<SamplerDecision> decide_sampler(SamplerChoice asked, const EglOptions& options, const FindEgl& find);

struct ChosenSampler {
  std::unique_ptr<SamplerDevice> device;
  std::string reason;
};
// Decides and makes it. Fails as make_egl_sampler_device does. `threads` and
// `most_time` are for make_embree_sampler_device.
Result<ChosenSampler> choose_sampler_device(SamplerChoice asked, const EglOptions& options, size_t threads = 1,
                                            std::chrono::nanoseconds most_time = {});

}  // namespace sightline
