// Mesa's software renderers: recognising them, and the environment that they read.
#pragma once

#include <string_view>

namespace sightline {

// True for the GL_RENDERER of llvmpipe, softpipe and swrast.
bool is_software_renderer(std::string_view gl_renderer);

// Sets, where the environment has no value yet,
//   LP_NUM_THREADS             what rasterises: kMapRasterThreads, never more than the CPU budget. Mesa would start one
//                              thread for each CPU of the machine, whatever the quota;
//   MESA_SHADER_CACHE_DISABLE  "true": a daemon with a read-only home must not write a cache.
// Changes the environment, so it belongs at the start of main, before any thread and before EGL is touched; Mesa
// reads the values once.
void prepare_software_rendering();

// Depth maps are a few thousand texels: they fit one or two of llvmpipe's 64 x 64 tiles, and more threads brought no gain
// that could be told from noise (tests/bench/sample_bench). 0 = the calling thread rasterises.
inline constexpr int kMapRasterThreads = 0;

}  // namespace sightline
