// Work over independent pieces on every core. For loading; what takes less than a millisecond is for a crew (thread_pool.h).
#pragma once

#include <cstddef>
#include <functional>

namespace sightline {

// Calls visit(i) once for every i in [0, count), on as many threads as there are cores, this one among them, and returns
// when all are done. Which thread takes which i, and when, is open: results must not depend on it. Of what `visit`
// throws, the exception of the least i is thrown again; the other calls are made all the same. Where no thread can be
// had, this one does it all. May be called from within `visit`.
void parallel_for(size_t count, const std::function<void(size_t)>& visit);

}  // namespace sightline
