#include "client/bench/generator.h"

#include <sys/prctl.h>

#include <algorithm>
#include <chrono>

namespace sightline {
namespace {

// The kernel may wake a sleeper this much late, to wake several at once; its default of 50 us would be part of every round trip.
constexpr unsigned long kTimerSlackNs = 1'000;
// How soon a stop is seen.
constexpr std::chrono::milliseconds kLongestSleep{50};

std::chrono::steady_clock::time_point at(int64_t ns) {
  return std::chrono::steady_clock::time_point(std::chrono::nanoseconds(ns));
}

}  // namespace

struct BenchGenerator::Cursor {
  const BenchSchedule& schedule;
  const BenchPeer peer;
  const std::vector<BenchStream*>& streams;
  const size_t first, stride;
  uint64_t k = 0;
  size_t session = first;

  bool none() const { return first >= streams.size(); }
  int64_t due_ns() const { return schedule.due_ns(peer, k, session); }
  void send(int64_t start_ns) {
    streams[session]->send_tick(start_ns + due_ns(), schedule.window_of(k, session));
    session += stride;
    if (session < streams.size()) return;
    session = first;
    ++k;
  }
};

BenchGenerator::BenchGenerator(const BenchSchedule& schedule, std::vector<BenchStream*> daemon,
                               std::vector<BenchStream*> echo, size_t threads)
    : schedule_(schedule),
      daemon_(std::move(daemon)),
      echo_(std::move(echo)),
      threads_wanted_(std::clamp<size_t>(threads, 1, daemon_.size())),
      start_ns_(BenchStream::monotonic_ns()),
      sent_until_ns_(new std::atomic<int64_t>[threads_wanted_]) {
  for (size_t i = 0; i < threads_wanted_; ++i) sent_until_ns_[i] = 0;
  for (size_t i = 0; i < threads_wanted_; ++i) threads_.emplace_back([this, i] { send_share(i); });
}

BenchGenerator::~BenchGenerator() {
  stop();
}

void BenchGenerator::stop() {
  stopping_ = true;
  for (std::thread& thread : threads_)
    if (thread.joinable()) thread.join();
}

int64_t BenchGenerator::sent_until_ns() const {
  int64_t until_ns = sent_until_ns_[0];
  for (size_t i = 1; i < threads_wanted_; ++i) until_ns = std::min<int64_t>(until_ns, sent_until_ns_[i]);
  return until_ns;
}

void BenchGenerator::sleep_until(int64_t due_ns) const {
  while (!stopping_) {
    const auto now = std::chrono::steady_clock::now();
    if (now >= at(due_ns)) return;
    std::this_thread::sleep_until(std::min(at(due_ns), now + kLongestSleep));
  }
}

void BenchGenerator::send_share(size_t thread) {
  prctl(PR_SET_TIMERSLACK, kTimerSlackNs);
  Cursor daemon{schedule_, BenchPeer::kDaemon, daemon_, thread, threads_wanted_};
  Cursor echo{schedule_, BenchPeer::kEcho, echo_, thread, threads_wanted_};
  while (true) {
    Cursor& next = echo.none() || daemon.due_ns() <= echo.due_ns() ? daemon : echo;
    const int64_t due_ns = next.due_ns();
    sent_until_ns_[thread] = due_ns;
    sleep_until(start_ns_ + due_ns);
    if (stopping_) return;
    next.send(start_ns_);
  }
}

}  // namespace sightline
