// The list of the devices that could render depth maps, on standard output: `sightlined devices`.
#pragma once

#include "server/sample/sampler_choice.h"

namespace sightline {

// Prints every device, which of them the daemon would use with these options, and why; as a table or as JSON. Returns
// the exit status.
int report_devices(SamplerChoice choice, const EglOptions& options, bool json);

}  // namespace sightline
