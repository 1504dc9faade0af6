// The test that a daemon passes before it says that it is ready: one step of a small scene, whose answer is known.
#pragma once

#include "server/base/error.h"
#include "server/service/parts.h"

namespace sightline {

// Computes a step on this thread, with the daemon's sampler. One target stands free and one behind a wall, and the step
// must say so. Fails with the sampler's error, or with kInternal when the answer is wrong. It takes a few milliseconds,
// and the step is not counted.
Status compute_first_step(const ServiceParts& parts);

}  // namespace sightline
