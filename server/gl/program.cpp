#include "server/gl/program.h"

namespace sightline {
namespace {

std::string shader_log(GLuint shader) {
  GLint length = 0;
  glGetShaderiv(shader, GL_INFO_LOG_LENGTH, &length);
  std::string log(length > 0 ? static_cast<size_t>(length) : 0, '\0');
  if (length > 0) glGetShaderInfoLog(shader, length, nullptr, log.data());
  return log;
}

std::string program_log(GLuint program) {
  GLint length = 0;
  glGetProgramiv(program, GL_INFO_LOG_LENGTH, &length);
  std::string log(length > 0 ? static_cast<size_t>(length) : 0, '\0');
  if (length > 0) glGetProgramInfoLog(program, length, nullptr, log.data());
  return log;
}

Result<GlShader> compile(GLenum stage, const char* stage_name, const std::string& source) {
  GlShader shader(glCreateShader(stage));
  const char* text = source.c_str();
  glShaderSource(shader.name(), 1, &text, nullptr);
  glCompileShader(shader.name());
  GLint compiled = GL_FALSE;
  glGetShaderiv(shader.name(), GL_COMPILE_STATUS, &compiled);
  if (compiled != GL_TRUE) return fail(ErrorCode::kInternal, stage_name, shader_log(shader.name()));
  return shader;
}

}  // namespace

Result<GlProgram> make_program(const std::string& vertex_source, const std::string& fragment_source,
                               const std::string& geometry_source) {
  Result<GlShader> vertex = compile(GL_VERTEX_SHADER, "vertex shader", vertex_source);
  if (!vertex) return tl::unexpected(vertex.error());
  Result<GlShader> fragment = compile(GL_FRAGMENT_SHADER, "fragment shader", fragment_source);
  if (!fragment) return tl::unexpected(fragment.error());
  GlProgram program = GlProgram::create();
  glAttachShader(program.name(), vertex->name());
  glAttachShader(program.name(), fragment->name());
  if (!geometry_source.empty()) {
    const Result<GlShader> geometry = compile(GL_GEOMETRY_SHADER, "geometry shader", geometry_source);
    if (!geometry) return tl::unexpected(geometry.error());
    glAttachShader(program.name(), geometry->name());
  }
  glLinkProgram(program.name());
  GLint linked = GL_FALSE;
  glGetProgramiv(program.name(), GL_LINK_STATUS, &linked);
  if (linked != GL_TRUE) return fail(ErrorCode::kInternal, "program", program_log(program.name()));
  return program;
}

}  // namespace sightline
