// How many threads are worth starting: the share of the machine's CPUs that a container or a service manager grants.
#pragma once

#include <optional>
#include <string>

namespace sightline {

// Number of CPUs that this process may use, at least 1. It is the size of the affinity mask or the quota of the control group
// (version 2, or 1), rounded up, whichever is smaller.
int cpu_budget();

// The quota in CPUs of one `cpu.max` file ("200000 100000" is 2); nothing for "max" or malformed text.
std::optional<double> parse_cpu_max(const std::string& text);

}  // namespace sightline
