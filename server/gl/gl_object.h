// Owners of OpenGL names. The context in which an object was made must be current when its owner is destroyed, also
// after a context loss, when deleting does nothing.
#pragma once

#include <epoxy/gl.h>

#include <utility>

namespace sightline {

template <typename Kind>
class GlObject {
 public:
  GlObject() = default;
  static GlObject create() { return GlObject(Kind::create()); }
  explicit GlObject(GLuint name) : name_(name) {}
  GlObject(GlObject&& other) noexcept : name_(std::exchange(other.name_, 0)) {}
  GlObject& operator=(GlObject&& other) noexcept {
    std::swap(name_, other.name_);
    return *this;
  }
  ~GlObject() {
    if (name_ != 0) Kind::destroy(name_);
  }

  GLuint name() const { return name_; }
  explicit operator bool() const { return name_ != 0; }

 private:
  GLuint name_ = 0;
};

namespace gl_kind {

struct Buffer {
  static GLuint create() {
    GLuint name = 0;
    glCreateBuffers(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteBuffers(1, &name); }
};
struct VertexArray {
  static GLuint create() {
    GLuint name = 0;
    glCreateVertexArrays(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteVertexArrays(1, &name); }
};
struct Texture2dArray {
  static GLuint create() {
    GLuint name = 0;
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteTextures(1, &name); }
};
struct Framebuffer {
  static GLuint create() {
    GLuint name = 0;
    glCreateFramebuffers(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteFramebuffers(1, &name); }
};
struct Program {
  static GLuint create() { return glCreateProgram(); }
  static void destroy(GLuint name) { glDeleteProgram(name); }
};
struct Shader {
  static void destroy(GLuint name) { glDeleteShader(name); }
};

}  // namespace gl_kind

using GlBuffer = GlObject<gl_kind::Buffer>;
using GlVertexArray = GlObject<gl_kind::VertexArray>;
using GlTexture2dArray = GlObject<gl_kind::Texture2dArray>;
using GlFramebuffer = GlObject<gl_kind::Framebuffer>;
using GlProgram = GlObject<gl_kind::Program>;
using GlShader = GlObject<gl_kind::Shader>;

// An owner of a fence, under the same rules.
class GlSync {
 public:
  GlSync() = default;
  static GlSync create() { return GlSync(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0)); }
  GlSync(GlSync&& other) noexcept : sync_(std::exchange(other.sync_, nullptr)) {}
  GlSync& operator=(GlSync&& other) noexcept {
    std::swap(sync_, other.sync_);
    return *this;
  }
  ~GlSync() {
    if (sync_) glDeleteSync(sync_);
  }

  GLsync get() const { return sync_; }
  explicit operator bool() const { return sync_ != nullptr; }

 private:
  explicit GlSync(GLsync sync) : sync_(sync) {}
  GLsync sync_ = nullptr;
};

}  // namespace sightline
