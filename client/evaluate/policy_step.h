// Sightline's own step as a policy: a session in this process, told what a game server would stream.
#pragma once

#include "client/evaluate/policy.h"
#include "server/step/step.h"

namespace sightline {

// Errors: what Session::open says.
Result<std::unique_ptr<CameraPolicy>> make_step_policy(const PolicySite& site, const StepSettings& settings);

// The same as a function of its own: what a PolicyEntry holds.
template <StepSettings (*settings)()>
Result<std::unique_ptr<CameraPolicy>> make_step(const PolicySite& site) {
  return make_step_policy(site, settings());
}

}  // namespace sightline
