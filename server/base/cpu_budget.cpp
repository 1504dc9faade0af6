#include "server/base/cpu_budget.h"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

namespace sightline {
namespace {

std::string read_all(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

// "/a/b" from the line "0::/a/b" of /proc/self/cgroup; empty under version 1.
std::string own_cgroup() {
  std::ifstream file("/proc/self/cgroup");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("0::")) return line.substr(3);
  return {};
}

}  // namespace

std::optional<double> cgroup_cpu_quota(const std::string& root, std::string group) {
  std::optional<double> tightest;
  const auto consider = [&](const std::optional<double>& quota) {
    if (quota && (!tightest || *quota < *tightest)) tightest = quota;
  };
  while (true) {
    consider(parse_cpu_max(read_all(root + group + "/cpu.max")));
    if (group.empty()) break;
    const size_t slash = group.find_last_of('/');
    group.resize(slash == std::string::npos ? 0 : slash);
  }
  consider(parse_cpu_max(read_all(root + "/cpu/cpu.cfs_quota_us") + " " + read_all(root + "/cpu/cpu.cfs_period_us")));
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
  const std::optional<double> quota = cgroup_cpu_quota("/sys/fs/cgroup", own_cgroup());
  const int by_quota = quota ? static_cast<int>(std::ceil(std::min(*quota, 1e6))) : by_affinity;
  return std::max(1, std::min(by_affinity, by_quota));
}

}  // namespace sightline
