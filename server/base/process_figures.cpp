#include "server/base/process_figures.h"

#include <sys/resource.h>
#include <unistd.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

namespace sightline {
namespace {

// The fields of /proc/self/stat behind the name of the program, which may itself hold spaces. The first is field 3 of
// proc(5).
std::vector<std::string> stat_fields() {
  std::ifstream file("/proc/self/stat");
  std::string line;
  std::getline(file, line);
  const size_t name_end = line.rfind(')');
  if (name_end == std::string::npos) return {};
  std::istringstream rest(line.substr(name_end + 1));
  std::vector<std::string> fields;
  for (std::string field; rest >> field;) fields.push_back(field);
  return fields;
}

double number(const std::vector<std::string>& fields, size_t proc_number) {
  const size_t index = proc_number - 3;
  return index < fields.size() ? std::stod(fields[index]) : 0.0;
}

double since_boot_s() {
  timespec now{};
  ::clock_gettime(CLOCK_BOOTTIME, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

// When the system started, in seconds since 1970; 0 when it is not known.
double boot_s() {
  std::ifstream file("/proc/stat");
  for (std::string word; file >> word;)
    if (double seconds = 0.0; word == "btime" && file >> seconds) return seconds;
  return 0.0;
}

uint64_t open_descriptors() {
  std::error_code error;
  uint64_t count = 0;
  for (std::filesystem::directory_iterator at("/proc/self/fd", error), end; !error && at != end; at.increment(error))
    ++count;
  return count > 0 ? count - 1 : 0;  // without the one that lists them
}

}  // namespace

std::chrono::nanoseconds busy_time_of_thread(int thread) {
  std::ifstream file("/proc/self/task/" + std::to_string(thread) + "/schedstat");
  int64_t ran = 0, waited = 0;
  return file >> ran >> waited ? std::chrono::nanoseconds(ran + waited) : std::chrono::nanoseconds(0);
}

ProcessFigures process_figures() {
  const std::vector<std::string> fields = stat_fields();
  const auto ticks_per_s = static_cast<double>(::sysconf(_SC_CLK_TCK));
  ProcessFigures figures;
  figures.cpu_s = (number(fields, 14) + number(fields, 15)) / ticks_per_s;
  figures.threads = static_cast<uint64_t>(number(fields, 20));
  const double started_s = number(fields, 22) / ticks_per_s;  // after the start of the system
  figures.uptime_s = since_boot_s() - started_s;
  figures.start_s = boot_s() + started_s;
  figures.virtual_bytes = static_cast<uint64_t>(number(fields, 23));
  figures.resident_bytes = static_cast<uint64_t>(number(fields, 24)) * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
  figures.open_descriptors = open_descriptors();
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) figures.max_descriptors = limit.rlim_cur;
  return figures;
}

}  // namespace sightline
