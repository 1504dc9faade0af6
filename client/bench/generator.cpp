#include "client/bench/generator.h"

#include <sys/prctl.h>

#include <algorithm>
#include <chrono>

namespace sightline {
namespace {

// How late the kernel may wake a thread in order to wake several at once. Its default of 50 us would be part of every
// round trip.
constexpr unsigned long kTimerSlackNs = 1'000;
constexpr std::chrono::milliseconds kLongestSleep{50};  // after which stop() is noticed

}  // namespace

// The next tick of one peer: each session in turn, then the next tick of the first one.
struct BenchGenerator::Cursor {
  const BenchSchedule& schedule;
  const BenchPeer peer;
  const std::vector<BenchStream*>& streams;
  uint64_t k = 0;
  size_t session = 0;

  int64_t due_ns() const { return schedule.due_ns(peer, k, session); }
  void send(int64_t start_ns) {
    streams[session]->send_tick(start_ns + due_ns(), schedule.window_of(k, session));
    if (++session < streams.size()) return;
    session = 0;
    ++k;
  }
};

BenchGenerator::BenchGenerator(const BenchSchedule& schedule, std::vector<BenchStream*> daemon,
                               std::vector<BenchStream*> echo)
    : schedule_(schedule),
      daemon_(std::move(daemon)),
      echo_(std::move(echo)),
      start_ns_(BenchStream::monotonic_ns()),
      thread_([this] { send_all(); }) {}

BenchGenerator::~BenchGenerator() {
  stop();
}

void BenchGenerator::stop() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void BenchGenerator::sleep_until(int64_t due_ns) const {
  const std::chrono::steady_clock::time_point due{std::chrono::nanoseconds(due_ns)};
  for (auto now = std::chrono::steady_clock::now(); !stopping_ && now < due; now = std::chrono::steady_clock::now())
    std::this_thread::sleep_until(std::min(due, now + kLongestSleep));
}

void BenchGenerator::send_all() {
  prctl(PR_SET_TIMERSLACK, kTimerSlackNs);
  Cursor daemon{schedule_, BenchPeer::kDaemon, daemon_}, echo{schedule_, BenchPeer::kEcho, echo_};
  while (true) {
    Cursor& next = echo_.empty() || daemon.due_ns() <= echo.due_ns() ? daemon : echo;
    const int64_t due_ns = next.due_ns();
    sent_until_ns_ = due_ns;
    sleep_until(start_ns_ + due_ns);
    if (stopping_) return;
    next.send(start_ns_);
  }
}

}  // namespace sightline
