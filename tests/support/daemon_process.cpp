#include "tests/support/daemon_process.h"

#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

namespace sightline::test {

DaemonProcess::DaemonProcess(std::vector<std::string> flags) {
  const std::string ready_file = folder_ / "ready";
  std::vector<std::string> arguments{SIGHTLINED_PATH, "--ready-file", ready_file, "--log-level", "warning"};
  if (std::find(flags.begin(), flags.end(), "--listen") == flags.end())
    arguments.insert(arguments.end(), {"--listen", "127.0.0.1:0"});
  arguments.insert(arguments.end(), flags.begin(), flags.end());
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  if (posix_spawn(&pid_, SIGHTLINED_PATH, nullptr, nullptr, argv.data(), environ) != 0) pid_ = -1;
  wait_ready(ready_file);
}

void DaemonProcess::wait_ready(const std::string& ready_file) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (pid_ > 0 && std::chrono::steady_clock::now() < deadline) {
    if (std::ifstream in(ready_file); std::getline(in, address_)) return;
    if (waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = -1;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ADD_FAILURE() << SIGHTLINED_PATH << " did not come up";
}

void DaemonProcess::ask_to_stop() {
  if (pid_ > 0) kill(pid_, SIGTERM);
}

void DaemonProcess::kill_now() {
  if (pid_ > 0) kill(pid_, SIGKILL);
}

void DaemonProcess::hold() {
  if (pid_ > 0) kill(pid_, SIGSTOP);
}

void DaemonProcess::go_on() {
  if (pid_ > 0) kill(pid_, SIGCONT);
}

int DaemonProcess::stop() {
  if (pid_ <= 0) return -1;
  ask_to_stop();
  int status = 0;
  waitpid(pid_, &status, 0);
  pid_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

DaemonProcess::~DaemonProcess() {
  stop();
}

}  // namespace sightline::test
