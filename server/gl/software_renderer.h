// Recognises Mesa's software renderers, and sets the environment that they read.
#pragma once

#include <string_view>

namespace sightline {

// True for the GL_RENDERER of llvmpipe, softpipe and swrast.
bool is_software_renderer(std::string_view gl_renderer);

// Sets these variables unless the environment has a value:
//   LP_NUM_THREADS             0: the calling thread rasterises. Depth maps fit one or two of llvmpipe's 64 x 64 tiles,
//   and with more
//                              threads they were no faster beyond noise (tests/bench/sample_bench). By default Mesa
//                              starts a thread for each CPU of the machine and ignores quotas;
//   MESA_SHADER_CACHE_DISABLE  "true": a daemon with a read-only home must not write a cache.
// Call it at the start of main, before any thread and before EGL is used: it changes the environment, and Mesa reads
// the values once.
void prepare_software_rendering();

}  // namespace sightline
