#include "server/gl/program.h"

namespace sightline {
namespace {

// The log of a shader or a program, by the functions that OpenGL has for its kind.
template <typename GetValue, typename GetLog>
std::string log_of(GLuint name, GetValue get_value, GetLog get_log) {
  GLint length = 0;
  get_value(name, GL_INFO_LOG_LENGTH, &length);
  std::string log(length > 0 ? static_cast<size_t>(length) : 0, '\0');
  if (length > 0) get_log(name, length, nullptr, log.data());
  return log;
}

Result<GlShader> compile(GLenum stage, const char* stage_name, const std::string& source) {
  GlShader shader(glCreateShader(stage));
  const char* text = source.c_str();
  glShaderSource(shader.name(), 1, &text, nullptr);
  glCompileShader(shader.name());
  GLint compiled = GL_FALSE;
  glGetShaderiv(shader.name(), GL_COMPILE_STATUS, &compiled);
  if (compiled != GL_TRUE)
    return fail(ErrorCode::kInternal, stage_name, log_of(shader.name(), glGetShaderiv, glGetShaderInfoLog));
  return shader;
}

}  // namespace

Result<GlProgram> make_program(const std::string& vertex_source, const std::string& fragment_source) {
  Result<GlShader> vertex = compile(GL_VERTEX_SHADER, "vertex shader", vertex_source);
  if (!vertex) return tl::unexpected(vertex.error());
  Result<GlShader> fragment = compile(GL_FRAGMENT_SHADER, "fragment shader", fragment_source);
  if (!fragment) return tl::unexpected(fragment.error());
  GlProgram program = GlProgram::create();
  glAttachShader(program.name(), vertex->name());
  glAttachShader(program.name(), fragment->name());
  glLinkProgram(program.name());
  GLint linked = GL_FALSE;
  glGetProgramiv(program.name(), GL_LINK_STATUS, &linked);
  if (linked != GL_TRUE)
    return fail(ErrorCode::kInternal, "program", log_of(program.name(), glGetProgramiv, glGetProgramInfoLog));
  return program;
}

}  // namespace sightline
