#include "client/bench/process.h"

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
constexpr size_t kMostSaid = 800;  // of what a failed program said, bytes

std::string last_words(const std::string& path) {
  std::ifstream in(path);
  std::string text(std::istreambuf_iterator<char>(in), {});
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text.size() > kMostSaid ? text.substr(text.size() - kMostSaid) : text;
}

// Between fork and exec: only what is safe in a process that has threads.
[[noreturn]] void become(const char* program, char* const* argv, pid_t parent, int input, int output,
                         int errors) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(127);
  dup2(input, STDIN_FILENO);
  dup2(output, STDOUT_FILENO);
  dup2(errors, STDERR_FILENO);
  execv(program, argv);
  _exit(127);
}

int new_file(const std::string& path) {
  return open(path.c_str(), O_CREAT | O_WRONLY | O_TRUNC | O_CLOEXEC, 0600);
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
  std::string path = (std::filesystem::temp_directory_path() / "sightline-bench-XXXXXX").string();
  if (mkdtemp(path.data())) path_ = path;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
}

Result<std::unique_ptr<ChildProcess>> ChildProcess::start(const std::string& program,
                                                          std::vector<std::string> arguments,
                                                          const std::string& output,
                                                          const std::string& errors) {
  if (access(program.c_str(), X_OK) != 0) return fail(ErrorCode::kNotFound, program, std::strerror(errno));
  arguments.insert(arguments.begin(), program);
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  int input[2] = {-1, -1};
  const int out = new_file(output), err = new_file(errors);
  const bool ready = out >= 0 && err >= 0 && pipe2(input, O_CLOEXEC) == 0;
  const pid_t parent = getpid();
  const pid_t pid = ready ? fork() : -1;
  if (pid == 0) become(program.c_str(), argv.data(), parent, input[0], out, err);
  const std::string why = std::strerror(errno);
  for (const int fd : {out, err, input[0]})
    if (fd >= 0) close(fd);
  if (pid > 0) return std::unique_ptr<ChildProcess>(new ChildProcess(program, errors, pid, input[1]));
  if (input[1] >= 0) close(input[1]);
  return fail(ErrorCode::kUnavailable, program, "cannot be started: " + why);
}

ChildProcess::ChildProcess(std::string program, std::string errors, pid_t pid, int input)
    : program_(std::move(program)), errors_(std::move(errors)), pid_(pid), input_(input) {}

ChildProcess::~ChildProcess() {
  stop(kStopGrace);
  close(input_);
}

bool ChildProcess::ended() {
  int status = 0;
  if (!status_ && waitpid(pid_, &status, WNOHANG) == pid_) status_ = status;
  return status_.has_value();
}

Result<std::string> ChildProcess::wait_for_line(const std::string& file, std::chrono::nanoseconds timeout) {
  const auto deadline = steady_clock::now() + timeout;
  while (steady_clock::now() < deadline) {
    std::ifstream in(file);
    if (std::string line; std::getline(in, line) && !in.eof()) return line;
    if (ended()) return fail(ErrorCode::kUnavailable, program_, "ended at once: " + last_words(errors_));
    std::this_thread::sleep_for(kPoll);
  }
  return fail(ErrorCode::kUnavailable, program_, "did not come up in time: " + last_words(errors_));
}

int ChildProcess::stop(std::chrono::nanoseconds grace) {
  if (ended()) return -1;
  kill(pid_, SIGTERM);
  const auto deadline = steady_clock::now() + grace;
  while (!ended() && steady_clock::now() < deadline) std::this_thread::sleep_for(kPoll);
  if (!ended()) {
    kill(pid_, SIGKILL);
    int status = 0;
    waitpid(pid_, &status, 0);
    status_ = status;
  }
  return WIFEXITED(*status_) ? WEXITSTATUS(*status_) : -1;
}

}  // namespace sightline
