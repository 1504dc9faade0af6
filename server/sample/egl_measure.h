// Which way to take maps is fast on the device at hand, found out by taking some.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/base/error.h"
#include "server/sample/egl_variant.h"
#include "server/sample/map_renderer.h"

namespace sightline {

struct EglTiming {
  EglVariant variant;
  // Medians of wall-clock time, milliseconds.
  double alone_ms = 0.0;  // kMeasuredMaps maps of one session
  double round_ms = 0.0;  // those of kMeasuredSessions sessions together
  // What a session costs, half of them alone and half in a round.
  double cost_ms() const;
};
inline constexpr size_t kMeasuredMaps = 8, kMeasuredSessions = 8;

// Times the variants on a made-up scene of a few thousand triangles, frame by frame in turn; one that is far behind is dropped
// early. About 0.1 s in all, at most 0.3 s by `clock_ns` (nanoseconds, never running back). Needs the renderer's context current.
// Fails as a take does.
Result<std::vector<EglTiming>> measure_egl_variants(MapRenderer& renderer, std::span<const EglVariant> variants,
                                                    const std::function<int64_t()>& clock_ns);

// The first that is about as cheap as the cheapest. `timings` is not empty.
const EglTiming& fastest(std::span<const EglTiming> timings);

// Sessions that are worth taking together: as many as bring the cost of a submission down to a tenth of that of the maps
// themselves, [1, 64].
size_t best_batch(const EglTiming& timing);

}  // namespace sightline
