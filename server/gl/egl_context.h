// OpenGL without a window: EGL devices and contexts (EGL_EXT_device_enumeration, EGL_EXT_platform_device,
// EGL_MESA_platform_surfaceless, EGL_KHR_surfaceless_context).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline {

// The index of the surfaceless platform, which is not a device: Mesa chooses what renders.
inline constexpr int kSurfacelessIndex = -1;

// Properties of a context.
struct EglContextInfo {
  int index = kSurfacelessIndex;
  std::string platform;    // "device" or "surfaceless"
  std::string drm_node;    // "/dev/dri/renderD128"; empty when the device has none
  std::string renderer;    // GL_RENDERER
  std::string gl_version;  // GL_VERSION
  bool software = false;   // Mesa's llvmpipe, softpipe or swrast
  bool robust = false;     // the driver reports resets (lose_context_on_reset)
};

// Number of EGL devices; 0 also where devices cannot be enumerated. Valid indices are below it.
int egl_device_count();
// The DRM node of a device, empty when it has none or the index is not a device.
std::string egl_drm_node(int index);

// One OpenGL 4.5 core context with GL_ARB_shader_viewport_layer_array that is never bound to a surface. It is current
// on at most one thread at a time: see CurrentContext. Displays are shared and stay initialised for the life of the
// process, because eglTerminate would end every context of a display.
class EglContext {
 public:
  // `index` is a device or kSurfacelessIndex. kUnavailable, with the reason, when it has no such context.
  static Result<std::unique_ptr<EglContext>> create(int index);
  // Needs the context to be current nowhere.
  ~EglContext();
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  const EglContextInfo& info() const { return info_; }

  // Asks the driver whether the context was lost (needs it current). Always false when not robust.
  bool was_reset() const;

 private:
  friend class CurrentContext;
  EglContext(void* display, void* context) : display_(display), context_(context) {}
  bool bind() const;
  void unbind() const;
  Status learn_info(int index);

  void* const display_;  // EGLDisplay
  void* const context_;  // EGLContext
  EglContextInfo info_;
};

// Makes a context current on this thread for a scope.
class CurrentContext {
 public:
  explicit CurrentContext(const EglContext& context) : context_(context), bound_(context.bind()) {}
  ~CurrentContext() {
    if (bound_) context_.unbind();
  }
  CurrentContext(const CurrentContext&) = delete;
  CurrentContext& operator=(const CurrentContext&) = delete;
  // False when EGL refused.
  explicit operator bool() const { return bound_; }

 private:
  const EglContext& context_;
  const bool bound_;
};

}  // namespace sightline
