// Depth maps by Embree: one ray for each texel, through the point that the EGL sampler's fragment shows. It is the fast sampler on
// machines without a GPU, and the tests compare the EGL sampler with it.
#pragma once

#include <memory>

#include "server/sample/sampler.h"

namespace sightline {

// `threads`: the number of threads, at least 1 and including the caller's, on which each sampler takes the maps of a step. The maps are
// the same bits for any number. More than one is for replaying one session alone; the sessions of a daemon fill the cores by themselves.
std::unique_ptr<SamplerDevice> make_embree_sampler_device(size_t threads = 1);

}  // namespace sightline
