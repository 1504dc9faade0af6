// Depth maps by OpenGL renders without a window (design 4, 11).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/sample/egl_variant.h"
#include "server/sample/sampler.h"

namespace sightline {

struct EglOptions {
  int device_index =
      -1;  // of list_egl_devices(); -1: the first hardware device, else software, else surfaceless
  bool require_gpu = false;  // fail instead of rendering in software
  // How maps are taken; nothing: measured when the device is made, and the fastest taken. Changes no bit of a map.
  std::optional<EglVariant> variant = {};
  // As on devices that cannot choose layers in the vertex shader: for tests.
  bool layers_by_geometry_shader = false;
};

// One line of the `devices` report.
struct EglDeviceInfo {
  int index = -1;        // -1: the surfaceless platform, which is not a device
  std::string platform;  // "device" or "surfaceless"
  std::string drm_node;  // "/dev/dri/renderD128"; empty when the device has none
  std::string renderer;  // GL_RENDERER; empty when no context could be made
  std::string gl_version;
  bool software = false;  // Mesa's llvmpipe, softpipe or swrast
  bool robust = false;    // a context with reset notification can be made
  std::string trouble;    // why it cannot be used; empty when it can
  bool chosen = false;    // what the given options pick
};
std::vector<EglDeviceInfo> list_egl_devices(const EglOptions& options);
// The one of them that the options pick; fails as make_egl_sampler_device does.
Result<EglDeviceInfo> choose_egl_device(const EglOptions& options);

// Samplers of many sessions share one context and one copy of each geometry; threads take turns. A lost context is made
// anew, with everything in it, and the take that met the loss is repeated once.
class EglSamplerDevice : public SamplerDevice {
 public:
  // How maps are taken, and why: "triangles+at-once+direct, the fastest of 8: 0.21 ms, next 0.22 ms" or "..., as asked for".
  virtual std::string variant_reason() const = 0;
  // The next take finds its context lost. For tests and drills.
  virtual void simulate_context_loss() = 0;
  // How often a context was lost since the start.
  virtual uint64_t context_rebuilds() const = 0;
};

// In software, call prepare_software_rendering (server/gl/software_renderer.h) at the start of main.
// Fails with kUnavailable when no context of OpenGL 4.5 core can be made (field "--egl-device" or "--require-gpu").
Result<std::unique_ptr<EglSamplerDevice>> make_egl_sampler_device(const EglOptions& options);

}  // namespace sightline
