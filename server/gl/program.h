// Shader programs, with the compiler's complaints as values.
#pragma once

#include <string>

#include "server/base/error.h"
#include "server/gl/gl_object.h"

namespace sightline {

// Compiles and links GLSL sources in the current context. Fails with kInternal, field "vertex shader", "fragment
// shader" or "program", message = the driver's log (a lost context also fails here).
Result<GlProgram> make_program(const std::string& vertex_source, const std::string& fragment_source);

}  // namespace sightline
