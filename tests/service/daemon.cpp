#include "tests/service/daemon.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>
#include <utility>

namespace sightline {
namespace {

// Paths are made before the fork: nothing may allocate between it and exec.
pid_t spawn(const std::vector<std::string>& arguments, const std::string& output, const std::string& errors) {
  std::vector<char*> argv{const_cast<char*>(SIGHTLINED_PATH)};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const pid_t pid = ::fork();
  if (pid != 0) return pid;
  const int out = ::open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  const int err = ::open(errors.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  ::dup2(out, STDOUT_FILENO);
  ::dup2(err, STDERR_FILENO);
  ::execv(argv[0], argv.data());
  ::_exit(127);
}

int exit_code_of(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace

std::string read_text(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

RunResult run_sightlined(const std::vector<std::string>& arguments) {
  const test::TemporaryFolder folder;
  int status = 0;
  ::waitpid(spawn(arguments, folder / "out", folder / "err"), &status, 0);
  return {exit_code_of(status), read_text(folder / "out"), read_text(folder / "err")};
}

Daemon::Daemon(std::vector<std::string> arguments) {
  const std::string ready = folder_ / "ready";
  if (std::find(arguments.begin(), arguments.end(), "--sampler") == arguments.end())
    arguments.insert(arguments.end(), {"--sampler", "embree"});
  arguments.insert(arguments.end(), {"--ready-file", ready});
  pid_ = spawn(arguments, folder_ / "out", folder_ / "err");
}

Daemon::~Daemon() {
  if (pid_ < 0) return;
  signal(SIGKILL);
  wait();
}

bool Daemon::wait_until_ready() {
  while (!ready_file_exists()) {
    int status = 0;
    if (::waitpid(pid_, &status, WNOHANG) == pid_) {
      pid_ = -1;
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

std::vector<std::string> Daemon::addresses() const {
  std::istringstream text(read_text(folder_ / "ready"));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

bool Daemon::ready_file_exists() const {
  return std::filesystem::exists(folder_ / "ready");
}

void Daemon::signal(int number) const {
  ::kill(pid_, number);
}

int Daemon::wait() {
  int status = 0;
  ::waitpid(std::exchange(pid_, -1), &status, 0);
  return exit_code_of(status);
}

std::string Daemon::errors() const {
  return read_text(folder_ / "err");
}

}  // namespace sightline
