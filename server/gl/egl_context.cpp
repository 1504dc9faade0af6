#include "server/gl/egl_context.h"

#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <string_view>

#include "server/gl/software_renderer.h"

namespace sightline {
namespace {

constexpr EGLint kMaxDevices = 64;
// EGL_DRM_RENDER_NODE_FILE_EXT of EGL_EXT_device_drm_render_node, which epoxy 1.5.10 does not name.
constexpr EGLint kDrmRenderNodeFile = 0x3377;

// Lets the vertex shader choose the layer and the viewport. GPUs that have OpenGL 4.5 and lack it are from before 2014.
constexpr const char* kLayersInVertexShader = "GL_ARB_shader_viewport_layer_array";

// epoxy ends the process when a function of EGL is called and there is no EGL, so every way in asks first.
bool has_egl() {
  void* const library = ::dlopen("libEGL.so.1", RTLD_LAZY | RTLD_LOCAL);
  if (library) ::dlclose(library);
  return library != nullptr;
}

std::vector<EGLDeviceEXT> devices() {
  if (!has_egl()) return {};
  if (!epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_device_enumeration") &&
      !epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_device_base"))
    return {};
  std::vector<EGLDeviceEXT> found(kMaxDevices);
  EGLint count = 0;
  if (!eglQueryDevicesEXT(kMaxDevices, found.data(), &count)) count = 0;
  found.resize(static_cast<size_t>(count));
  return found;
}

// True when the space-separated `words` include `word`.
bool has_word(const char* words, std::string_view word) {
  for (std::string_view rest = words ? words : ""; !rest.empty();) {
    const size_t length = std::min(rest.find(' '), rest.size());
    if (rest.substr(0, length) == word) return true;
    rest.remove_prefix(std::min(length + 1, rest.size()));
  }
  return false;
}

tl::unexpected<Error> unavailable(const std::string& what) {
  std::array<char, 16> code;
  std::snprintf(code.data(), code.size(), "0x%04x", static_cast<unsigned>(eglGetError()));
  return fail(ErrorCode::kUnavailable, "", what + " (EGL error " + code.data() + ")");
}

EGLDisplay platform_display(int index) {
  if (index == kSurfacelessIndex) {
    if (!epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless")) return EGL_NO_DISPLAY;
    return eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  }
  const std::vector<EGLDeviceEXT> all = devices();
  if (index < 0 || static_cast<size_t>(index) >= all.size()) return EGL_NO_DISPLAY;
  return eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, all[static_cast<size_t>(index)], nullptr);
}

// Robust where the driver can, plain otherwise.
EGLContext create_native(EGLDisplay display) {
  const std::array<EGLint, 11> robust{EGL_CONTEXT_MAJOR_VERSION,
                                      4,
                                      EGL_CONTEXT_MINOR_VERSION,
                                      5,
                                      EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                      EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                      EGL_CONTEXT_OPENGL_ROBUST_ACCESS,
                                      EGL_TRUE,
                                      EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY,
                                      EGL_LOSE_CONTEXT_ON_RESET,
                                      EGL_NONE};
  const std::array<EGLint, 7> plain{
      EGL_CONTEXT_MAJOR_VERSION,           4,       EGL_CONTEXT_MINOR_VERSION, 5, EGL_CONTEXT_OPENGL_PROFILE_MASK,
      EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
  const EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, robust.data());
  if (context != EGL_NO_CONTEXT) return context;
  return eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, plain.data());
}

std::string gl_text(GLenum name) {
  const GLubyte* text = glGetString(name);
  return text ? reinterpret_cast<const char*>(text) : "";
}

}  // namespace

int egl_device_count() {
  return static_cast<int>(devices().size());
}

std::string egl_drm_node(int index) {
  const std::vector<EGLDeviceEXT> all = devices();
  if (index < 0 || static_cast<size_t>(index) >= all.size()) return {};
  const EGLDeviceEXT device = all[static_cast<size_t>(index)];
  const char* words = eglQueryDeviceStringEXT(device, EGL_EXTENSIONS);
  const char* node = nullptr;
  if (has_word(words, "EGL_EXT_device_drm_render_node")) node = eglQueryDeviceStringEXT(device, kDrmRenderNodeFile);
  if (!node && has_word(words, "EGL_EXT_device_drm")) node = eglQueryDeviceStringEXT(device, EGL_DRM_DEVICE_FILE_EXT);
  return node ? node : "";
}

Result<std::unique_ptr<EglContext>> EglContext::create(int index) {
  if (!has_egl()) return fail(ErrorCode::kUnavailable, "", "libEGL.so.1 is not installed");
  const EGLDisplay display = platform_display(index);
  if (display == EGL_NO_DISPLAY)
    return unavailable(index == kSurfacelessIndex ? "no surfaceless platform"
                                                  : "no EGL device " + std::to_string(index));
  if (!eglInitialize(display, nullptr, nullptr)) return unavailable("the EGL display cannot be initialised");
  for (const char* needed : {"EGL_KHR_surfaceless_context", "EGL_KHR_no_config_context"})
    if (!epoxy_has_egl_extension(display, needed)) return unavailable(std::string("the display lacks ") + needed);
  if (!eglBindAPI(EGL_OPENGL_API)) return unavailable("the display has no OpenGL");
  const EGLContext native = create_native(display);
  if (native == EGL_NO_CONTEXT) return unavailable("no OpenGL 4.5 core context can be made");
  std::unique_ptr<EglContext> context(new EglContext(display, native));
  if (Status learned = context->learn_info(index); !learned) return tl::unexpected(learned.error());
  return context;
}

EglContext::~EglContext() {
  eglDestroyContext(display_, context_);
}

Status EglContext::learn_info(int index) {
  const CurrentContext current(*this);
  if (!current) return unavailable("the context cannot be made current without a surface");
  info_.index = index;
  info_.platform = index == kSurfacelessIndex ? "surfaceless" : "device";
  info_.drm_node = egl_drm_node(index);
  info_.renderer = gl_text(GL_RENDERER);
  info_.gl_version = gl_text(GL_VERSION);
  info_.software = is_software_renderer(info_.renderer);
  if (!epoxy_has_gl_extension(kLayersInVertexShader))
    return unavailable(info_.renderer + " lacks " + kLayersInVertexShader);
  GLint strategy = 0;
  glGetIntegerv(GL_RESET_NOTIFICATION_STRATEGY, &strategy);
  info_.robust = strategy == GL_LOSE_CONTEXT_ON_RESET;
  return {};
}

bool EglContext::bind() const {
  // The bound API is a setting of the thread.
  return eglBindAPI(EGL_OPENGL_API) && eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_);
}

void EglContext::unbind() const {
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

bool EglContext::was_reset() const {
  return info_.robust && glGetGraphicsResetStatus() != GL_NO_ERROR;
}

}  // namespace sightline
