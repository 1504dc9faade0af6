// Sends the ticks of all sessions when they are due, however slow the server is.
#pragma once

#include <atomic>
#include <thread>
#include <vector>

#include "client/bench/schedule.h"
#include "client/bench/stream.h"

namespace sightline {

class BenchGenerator {
 public:
  // `daemon`: the sessions; `echo`: as many streams to the echo, or none. All must outlive the generator. Starts its
  // thread at once; due times count from now.
  BenchGenerator(const BenchSchedule& schedule, std::vector<BenchStream*> daemon, std::vector<BenchStream*> echo);
  ~BenchGenerator();  // stops
  BenchGenerator(const BenchGenerator&) = delete;
  BenchGenerator& operator=(const BenchGenerator&) = delete;

  // The start, on the clock of BenchStream::monotonic_ns.
  int64_t start_ns() const { return start_ns_; }
  // Every tick that was due before this time since the start has been sent.
  int64_t sent_until_ns() const { return sent_until_ns_; }
  // Stops sending; returns when the thread has ended.
  void stop();

 private:
  struct Cursor;
  void send_all();
  void sleep_until(int64_t due_ns) const;

  const BenchSchedule& schedule_;
  const std::vector<BenchStream*> daemon_, echo_;
  const int64_t start_ns_;
  std::atomic<bool> stopping_{false};
  std::atomic<int64_t> sent_until_ns_{0};
  std::thread thread_;
};

}  // namespace sightline
