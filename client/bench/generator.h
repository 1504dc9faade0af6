// Sends the ticks of all sessions when they are due, whatever the server does.
#pragma once

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "client/bench/schedule.h"
#include "client/bench/stream.h"

namespace sightline {

class BenchGenerator {
 public:
  // The sessions of the daemon, and as many of the echo or none; they must outlive it. `threads` send, each for its share of the
  // sessions; >= 1. Starts at once: due times are counted from now.
  BenchGenerator(const BenchSchedule& schedule, std::vector<BenchStream*> daemon,
                 std::vector<BenchStream*> echo, size_t threads);
  ~BenchGenerator();  // as stop
  BenchGenerator(const BenchGenerator&) = delete;
  BenchGenerator& operator=(const BenchGenerator&) = delete;

  // The start on the clock of BenchStream::monotonic_ns.
  int64_t start_ns() const { return start_ns_; }
  // Every tick that was due before this, since the start, has been sent.
  int64_t sent_until_ns() const;
  // Sends no more ticks. Returns once no thread does.
  void stop();

 private:
  // The next tick of one peer for one thread: its sessions in turn, then the next tick of each.
  struct Cursor;
  void send_share(size_t thread);
  void sleep_until(int64_t due_ns) const;

  const BenchSchedule& schedule_;
  const std::vector<BenchStream*> daemon_, echo_;
  const size_t threads_wanted_;
  const int64_t start_ns_;
  std::atomic<bool> stopping_{false};
  std::unique_ptr<std::atomic<int64_t>[]> sent_until_ns_;  // by thread
  std::vector<std::thread> threads_;
};

}  // namespace sightline
