// The sample tables of the shapes of targets (server/sample/extent.h), built before a session needs them: that may take
// seconds, and must be able to end.
#pragma once

#include "server/base/error.h"
#include "server/base/work_limit.h"
#include "server/session/session.h"

namespace sightline {

// Builds the tables that Session::open needs, and those that Session::apply needs. They stay in `tables` as long as
// their geometries live. Fail with the error of `work`, field "open.targets" or "tick.targets".
Status build_target_tables(const SessionOptions& options, ExtentCache& tables, WorkLimit& work);
Status build_target_tables(const Session& session, const TickInput& tick, ExtentCache& tables, WorkLimit& work);

}  // namespace sightline
