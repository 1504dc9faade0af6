// Depth maps by OpenGL renders without a window (design 4, 11).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/gl/egl_context.h"
#include "server/sample/sampler.h"

namespace sightline {

struct EglOptions {
  int device_index = -1;     // of list_egl_devices(); -1: the first hardware device, else software, else surfaceless
  bool require_gpu = false;  // fail instead of rendering in software
};

// One line of the `devices` report.
struct EglDeviceInfo : EglContextInfo {
  std::string trouble;  // why it cannot be used, and then nothing is known of a context; empty when it can
  bool chosen = false;  // what the given options pick
};
std::vector<EglDeviceInfo> list_egl_devices(const EglOptions& options);
// The one of them that the options pick; fails as make_egl_sampler_device does.
Result<EglDeviceInfo> choose_egl_device(const EglOptions& options);

// The samplers of all sessions share one context; threads take turns. A lost context is rebuilt, and the take that met
// the loss is repeated once. The device keeps no geometry: the few triangles that a map shows are sent with each take.
class EglSamplerDevice : public SamplerDevice {
 public:
  // Makes the next take find its context lost. For tests and drills.
  virtual void simulate_context_loss() = 0;
  // How often a context was lost since the start.
  virtual uint64_t context_rebuilds() const = 0;
};

// In software, call prepare_software_rendering (server/gl/software_renderer.h) at the start of main.
// Fails with kUnavailable when no context of OpenGL 4.5 core can be made (field "--egl-device" or "--require-gpu").
Result<std::unique_ptr<EglSamplerDevice>> make_egl_sampler_device(const EglOptions& options);

}  // namespace sightline
