// Depth maps by Embree rays: one ray a texel, through the same point as the EGL sampler's fragment. The cheap path on
// a node without a GPU, and the independent reference of the tests.
#pragma once

#include <memory>

#include "server/sample/sampler.h"

namespace sightline {

std::unique_ptr<SamplerDevice> make_embree_sampler_device();

}  // namespace sightline
