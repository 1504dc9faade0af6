// How many threads are worth starting: the share of the machine's CPUs that a container or a service manager grants.
#pragma once

#include <optional>
#include <string>

namespace sightline {

// Number of CPUs that this process may use, at least 1. It is the size of the affinity mask or the quota of the control
// group (version 2, or 1), rounded up, whichever is smaller.
int cpu_budget();

// The tightest quota, in CPUs, of the control group `group` ("/a/b"; empty under version 1) and of all its parents;
// nothing where none has one. `root` is the folder in which the control groups are mounted.
std::optional<double> cgroup_cpu_quota(const std::string& root, std::string group);

// The quota in CPUs of one `cpu.max` file ("200000 100000" is 2); nothing for "max" or malformed text.
std::optional<double> parse_cpu_max(const std::string& text);

}  // namespace sightline
