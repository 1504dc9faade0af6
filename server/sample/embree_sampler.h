// Depth maps by Embree rays: one ray a texel, through the same point as the EGL sampler's fragment. The cheap path on
// a node without a GPU, and the independent reference of the tests.
#pragma once

#include <memory>

#include "server/sample/sampler.h"

namespace sightline {

// `hands`: threads that each of its samplers takes the maps of a step on, at least 1, its caller's among them. The maps are the same
// bits for any. More than one is for who steps one session alone: those of many sessions fill the cores by themselves.
std::unique_ptr<SamplerDevice> make_embree_sampler_device(size_t hands = 1);

}  // namespace sightline
