// The control groups of Linux that this process is in: what a container or a service manager grants it.
#pragma once

#include <functional>
#include <string>

namespace sightline {

// The folder in which control groups are mounted.
inline constexpr char kControlGroupRoot[] = "/sys/fs/cgroup";

// The paths of the process's groups, such as "/a/b"; empty when it is in none.
struct ControlGroupPaths {
  std::string unified;  // version 2
  std::string memory;   // of the controller "memory" in version 1
};
// `text` is that of /proc/self/cgroup.
ControlGroupPaths parse_control_groups(const std::string& text);
ControlGroupPaths own_control_groups();

// The text of a file; empty when it cannot be read.
std::string text_of_file(const std::string& path);

// Calls `visit` with the text of `file` in the folder of the group and in those of all its parents, `root` included.
void visit_control_groups(const std::string& root, std::string group, const std::string& file,
                          const std::function<void(const std::string& text)>& visit);

}  // namespace sightline
