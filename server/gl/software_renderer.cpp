#include "server/gl/software_renderer.h"

#include <cstdlib>

namespace sightline {

bool is_software_renderer(std::string_view gl_renderer) {
  for (const std::string_view name : {"llvmpipe", "softpipe", "swrast", "Software Rasterizer"})
    if (gl_renderer.find(name) != std::string_view::npos) return true;
  return false;
}

void prepare_software_rendering() {
  setenv("LP_NUM_THREADS", "0", 0);
  setenv("MESA_SHADER_CACHE_DISABLE", "true", 0);
}

}  // namespace sightline
