// Loops over independent pieces on every CPU that the process may use (cpu_budget.h), for work such as loading.
// Repeated work below a millisecond is for ThreadPool (thread_pool.h).
#pragma once

#include <cstddef>
#include <functional>

namespace sightline {

// Calls visit(i) once for every i in [0, count), on as many threads as there are cores including this one, and returns
// when all calls have. Threads take pieces in any order, so results must not depend on it. When calls throw, all others
// are still made; then the exception of the lowest i is rethrown. When no thread can be started, this one makes all
// calls. May be called from within `visit`.
void parallel_for(size_t count, const std::function<void(size_t)>& visit);

}  // namespace sightline
