// Chooses the sampler. On a GPU that is EGL. Where OpenGL renders in software Embree is faster (tests/bench/sample_bench), and it needs
// no OpenGL at all.
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

// Returns the device that EGL would use, as choose_egl_device does. Called only for kAuto.
using FindEgl = std::function<Result<EglDeviceInfo>()>;

// kEgl and kEmbree are taken as asked. kAuto takes EGL when its device is hardware, and Embree when it is a software renderer or missing.
// With `require_gpu`, or when the named device cannot be used, kAuto returns the error of `find`: an explicit wish is never ignored.
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
