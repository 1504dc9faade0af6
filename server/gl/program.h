// Shader programs, with the compiler's complaints as values.
#pragma once

#include <string>

#include "server/base/error.h"
#include "server/gl/gl_object.h"

namespace sightline {

// Compiles and links GLSL sources in the current context; without a geometry shader when its source is empty. Fails with
// kInternal, field "vertex shader", "fragment shader", "geometry shader" or "program", message = the driver's log (a lost
// context also fails here).
Result<GlProgram> make_program(const std::string& vertex_source, const std::string& fragment_source,
                               const std::string& geometry_source = "");

}  // namespace sightline
