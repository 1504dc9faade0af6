// A daemon of its own for a test: started on a free port, stopped when the test is over.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace sightline::test {

class DaemonProcess {
 public:
  // Starts sightlined with `flags`, on a free loopback port unless they say where it listens, and waits until it
  // reports that it is ready. If the daemon does not start, the test fails and address() is empty.
  explicit DaemonProcess(std::vector<std::string> flags = {"--sampler", "embree"});
  ~DaemonProcess();
  DaemonProcess(const DaemonProcess&) = delete;
  DaemonProcess& operator=(const DaemonProcess&) = delete;

  // "127.0.0.1:41234"
  const std::string& address() const { return address_; }

  void ask_to_stop();  // SIGTERM
  void kill_now();     // SIGKILL
  void hold();         // SIGSTOP: it hangs
  void go_on();        // SIGCONT
  // Asks it to stop and waits; the exit status, or -1 when a signal ended it.
  int stop();

 private:
  void wait_ready(const std::string& ready_file);

  pid_t pid_ = -1;
  const TemporaryFolder folder_;
  std::string address_;
};

}  // namespace sightline::test
