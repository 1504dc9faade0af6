// Shader programs; what the compiler reports comes back as an Error.
#pragma once

#include <string>

#include "server/base/error.h"
#include "server/gl/gl_object.h"

namespace sightline {

// Compiles and links GLSL sources in the current context. Fails with kInternal, field "vertex shader", "fragment
// shader" or "program", and the driver's log as the message. A lost context also fails here.
Result<GlProgram> make_program(const std::string& vertex_source, const std::string& fragment_source);

}  // namespace sightline
