#include "server/sample/sampler_choice.h"

#include "server/sample/embree_sampler.h"

namespace sightline {

Result<SamplerDecision> decide_sampler(SamplerChoice asked, const EglOptions& options, const FindEgl& find) {
  if (asked != SamplerChoice::kAuto) return SamplerDecision{asked, "asked for with --sampler"};
  if (!options.require_gpu && options.device_index < 0)
    return SamplerDecision{SamplerChoice::kEmbree,
                           "it was faster than OpenGL on every machine measured, also on a GPU"};
  const Result<EglDeviceInfo> egl = find();
  if (!egl) return tl::unexpected(egl.error());
  return SamplerDecision{
      SamplerChoice::kEgl,
      (options.require_gpu ? "--require-gpu asks for OpenGL: " : "--egl-device asks for OpenGL: ") + egl->renderer};
}

Result<ChosenSampler> choose_sampler_device(SamplerChoice asked, const EglOptions& options, size_t threads,
                                            std::chrono::nanoseconds most_time) {
  auto decision = decide_sampler(asked, options, [&] { return choose_egl_device(options); });
  if (!decision) return tl::unexpected(std::move(decision.error()));
  if (decision->sampler == SamplerChoice::kEmbree)
    return ChosenSampler{make_embree_sampler_device(threads, most_time), std::move(decision->reason)};
  auto device = make_egl_sampler_device(options);
  if (!device) return tl::unexpected(std::move(device.error()));
  return ChosenSampler{std::move(*device), std::move(decision->reason)};
}

}  // namespace sightline
