#include "client/base/process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

namespace sightline {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kPoll{5};
constexpr std::chrono::seconds kStopGrace{5};
constexpr size_t kMostQuoted = 800;  // bytes of a failed program's log

std::string end_of_file(const std::string& path) {
  std::ifstream in(path);
  std::string text(std::istreambuf_iterator<char>(in), {});
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text.size() > kMostQuoted ? text.substr(text.size() - kMostQuoted) : text;
}

// Runs between fork and exec, so it calls only what is safe in a process that had threads.
[[noreturn]] void become(const char* program, char* const* argv, pid_t parent, int log) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(127);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  execv(program, argv);
  _exit(127);
}

}  // namespace

Result<ProcessUsage> usage_of(pid_t pid) {
  clockid_t clock{};
  timespec used{};
  size_t total_pages = 0, resident_pages = 0;
  std::ifstream statm("/proc/" + std::to_string(pid) + "/statm");
  if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &used) != 0 ||
      !(statm >> total_pages >> resident_pages))
    return fail(ErrorCode::kUnavailable, "pid", "there is no process " + std::to_string(pid) + " to watch");
  return ProcessUsage{used.tv_sec * int64_t{1'000'000'000} + used.tv_nsec,
                      resident_pages * static_cast<size_t>(sysconf(_SC_PAGESIZE))};
}

ScratchFolder::ScratchFolder() {
  std::string path = (std::filesystem::temp_directory_path() / "sightline-daemon-XXXXXX").string();
  if (mkdtemp(path.data())) path_ = path;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
}

Result<std::unique_ptr<ChildProcess>> ChildProcess::start(const std::string& program,
                                                          std::vector<std::string> arguments, const std::string& log) {
  if (access(program.c_str(), X_OK) != 0) return fail(ErrorCode::kNotFound, program, std::strerror(errno));
  arguments.insert(arguments.begin(), program);
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  const int log_file = open(log.c_str(), O_CREAT | O_WRONLY | O_TRUNC | O_CLOEXEC, 0600);
  const pid_t parent = getpid(), pid = log_file < 0 ? -1 : fork();
  if (pid == 0) become(program.c_str(), argv.data(), parent, log_file);
  const std::string why = std::strerror(errno);
  if (log_file >= 0) close(log_file);
  if (pid < 0) return fail(ErrorCode::kUnavailable, program, "cannot be started: " + why);
  return std::unique_ptr<ChildProcess>(new ChildProcess(program, log, pid));
}

ChildProcess::~ChildProcess() {
  if (!has_ended()) kill(pid_, SIGTERM);
  const auto deadline = steady_clock::now() + kStopGrace;
  while (!has_ended() && steady_clock::now() < deadline) std::this_thread::sleep_for(kPoll);
  if (!has_ended()) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
}

bool ChildProcess::has_ended() {
  if (!ended_) ended_ = waitpid(pid_, nullptr, WNOHANG) == pid_;
  return ended_;
}

Result<std::string> ChildProcess::wait_for_line(const std::string& file, std::chrono::nanoseconds timeout) {
  const auto deadline = steady_clock::now() + timeout;
  while (steady_clock::now() < deadline) {
    std::ifstream in(file);
    if (std::string line; std::getline(in, line) && !in.eof()) return line;
    if (has_ended()) return fail(ErrorCode::kUnavailable, program_, "ended at once: " + end_of_file(log_));
    std::this_thread::sleep_for(kPoll);
  }
  return fail(ErrorCode::kUnavailable, program_, "did not come up in time: " + end_of_file(log_));
}

}  // namespace sightline
