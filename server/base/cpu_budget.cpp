#include "server/base/cpu_budget.h"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "server/base/control_group.h"

namespace sightline {

std::optional<double> cgroup_cpu_quota(const std::string& root, std::string group) {
  std::optional<double> tightest;
  const auto consider = [&](const std::optional<double>& quota) {
    if (quota && (!tightest || *quota < *tightest)) tightest = quota;
  };
  visit_control_groups(root, std::move(group), "cpu.max",
                       [&](const std::string& text) { consider(parse_cpu_max(text)); });
  consider(parse_cpu_max(text_of_file(root + "/cpu/cpu.cfs_quota_us") + " " +
                         text_of_file(root + "/cpu/cpu.cfs_period_us")));
  return tightest;
}

std::optional<double> parse_cpu_max(const std::string& text) {
  std::istringstream words(text);
  double quota_us = 0, period_us = 0;
  if (!(words >> quota_us >> period_us) || quota_us <= 0 || period_us <= 0) return std::nullopt;
  return quota_us / period_us;
}

int cpu_budget() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  // Fails on machines with more CPUs than the fixed-size set holds; then only the quota limits.
  const int by_affinity = sched_getaffinity(0, sizeof allowed, &allowed) == 0 ? CPU_COUNT(&allowed) : CPU_SETSIZE;
  const std::optional<double> quota = cgroup_cpu_quota(kControlGroupRoot, own_control_groups().unified);
  const int by_quota = quota ? static_cast<int>(std::ceil(std::min(*quota, 1e6))) : by_affinity;
  return std::max(1, std::min(by_affinity, by_quota));
}

}  // namespace sightline
