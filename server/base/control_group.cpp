#include "server/base/control_group.h"

#include <fstream>
#include <sstream>

namespace sightline {

std::string text_of_file(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

// A line is "0::/a/b" in version 2, and "4:memory:/a/b" or "4:cpu,memory:/a/b" in version 1.
ControlGroupPaths parse_control_groups(const std::string& text) {
  ControlGroupPaths paths;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    std::istringstream controllers(line.substr(first + 1, second - first - 1));
    if (second == first + 1) paths.unified = line.substr(second + 1);
    for (std::string controller; std::getline(controllers, controller, ',');)
      if (controller == "memory") paths.memory = line.substr(second + 1);
  }
  return paths;
}

ControlGroupPaths own_control_groups() {
  return parse_control_groups(text_of_file("/proc/self/cgroup"));
}

void visit_control_groups(const std::string& root, std::string group, const std::string& file,
                          const std::function<void(const std::string& text)>& visit) {
  while (true) {
    visit(text_of_file(root + group + "/" + file));
    if (group.empty()) return;
    const size_t slash = group.find_last_of('/');
    group.resize(slash == std::string::npos ? 0 : slash);
  }
}

}  // namespace sightline
