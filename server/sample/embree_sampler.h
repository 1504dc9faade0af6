// Depth maps by Embree: one ray for each texel, through the point that the EGL sampler's fragment shows. It is the fast
// sampler on machines without a GPU, and the tests compare the EGL sampler with it.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>

#include "server/base/work_limit.h"
#include "server/sample/sampler.h"

namespace sightline {

// `threads`: the number of threads, at least 1 and including the caller's, on which each sampler takes the maps of a
// step. The maps are the same bits for any number. More than one is for replaying one session alone; the sessions of a
// daemon fill the cores by themselves.
//
// `most_time`: the longest processor time, of all threads together, that the maps of one step may take; 0: any. A take
// that is over it after one of its maps fails with kResourceExhausted, so that a step in a very heavy scene does not
// hold its thread for long. Time in which the threads do not run does not count. `clock` is what a thread has used; it
// must not run faster than the steady clock.
std::unique_ptr<SamplerDevice> make_embree_sampler_device(size_t threads = 1, std::chrono::nanoseconds most_time = {},
                                                          ThreadClock clock = thread_cpu_ns);

}  // namespace sightline
