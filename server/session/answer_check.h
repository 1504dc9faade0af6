// The last look at an answer before it goes out.
#pragma once

#include "server/base/error.h"
#include "server/session/session.h"

namespace sightline {

// Fails with kInternal, and a text that names the number, if one that a client may compute with is not finite. Cheap:
// it reads each number once and allocates nothing.
Status check_finite(const SessionAnswer& answer);

}  // namespace sightline
