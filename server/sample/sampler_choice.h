// Which sampler a daemon takes depth maps with. EGL on a GPU is the fast one; where OpenGL renders in software, Embree's rays
// are (tests/bench/sample_bench), and they need no OpenGL at all.
#pragma once

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

// What EGL would use: choose_egl_device with the options at hand. Asked only for kAuto.
using FindEgl = std::function<Result<EglDeviceInfo>()>;

// kEgl and kEmbree are taken as asked. kAuto: EGL where its device is hardware, Embree where it is a software renderer or where
// there is none; but with `require_gpu`, or a device that was named and cannot be used, the error of `find`: an explicit wish is
// never passed over.
Result<SamplerDecision> decide_sampler(SamplerChoice asked, const EglOptions& options, const FindEgl& find);

struct ChosenSampler {
  std::unique_ptr<SamplerDevice> device;
  std::string reason;
};
// Decides and makes it. Fails as make_egl_sampler_device does. `hands`: see make_embree_sampler_device; EGL's device has but one.
Result<ChosenSampler> choose_sampler_device(SamplerChoice asked, const EglOptions& options, size_t hands = 1);

}  // namespace sightline
