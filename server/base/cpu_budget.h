// How many threads are worth starting: the share of the machine's CPUs that a container or a service manager grants.
#pragma once

#include <optional>
#include <string>

namespace sightline {

// CPUs' worth of time that this process may use: the smaller of its affinity mask and the quota of its control group
// (version 2, or 1), rounded up, at least 1.
int cpu_budget();

// The quota in CPUs of one `cpu.max` file ("200000 100000" is 2); nothing for "max" or malformed text.
std::optional<double> parse_cpu_max(const std::string& text);

}  // namespace sightline
