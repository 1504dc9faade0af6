#include "server/service/log_sink.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <deque>
#include <string>
#include <utility>

#include "server/base/mutex.h"

namespace sightline {
namespace {

using std::chrono::steady_clock;

// A pipe that is ready takes this much without making the writer wait.
constexpr size_t kAtOnce = 4096;
// How often a writer that waits for its reader looks whether it should end.
constexpr int kPollMs = 100;

}  // namespace

struct PatientSink::Queue {
  const int fd;
  Mutex mutex;
  ConditionVariable changed;
  std::deque<std::string> lines GUARDED(mutex);
  size_t bytes GUARDED(mutex) = 0;
  uint64_t dropped GUARDED(mutex) = 0;
  bool stopping GUARDED(mutex) = false, done GUARDED(mutex) = false;
  steady_clock::time_point end GUARDED(mutex){};

  explicit Queue(int to) : fd(to) {}

  // False when the thread should give up.
  bool may_go_on() {
    const MutexLock lock(mutex);
    return !stopping || steady_clock::now() < end;
  }

  bool write(std::string_view line) {
    while (!line.empty()) {
      pollfd ready{fd, POLLOUT, 0};
      const int count = ::poll(&ready, 1, kPollMs);
      if (!may_go_on()) return false;
      if (count <= 0) continue;
      const ssize_t size = ::write(fd, line.data(), std::min(line.size(), kAtOnce));
      if (size > 0) line.remove_prefix(static_cast<size_t>(size));
      if (size < 0 && errno != EINTR && errno != EAGAIN) return true;  // nobody can read it; the line is lost
    }
    return true;
  }

  void run() {
    MutexLock lock(mutex);
    for (;;) {
      changed.wait(lock, [this]() NEEDS(mutex) { return stopping || !lines.empty(); });
      if (lines.empty()) break;
      const std::string line = std::move(lines.front());
      lines.pop_front();
      lock.unlock();
      const bool on = write(line);
      lock.lock();
      bytes -= line.size();
      if (!on) break;
    }
    done = true;
    changed.notify_all();
  }
};

PatientSink::PatientSink(int fd, DropNote note)
    : note_(std::move(note)), queue_(std::make_shared<Queue>(fd)), thread_([queue = queue_] { queue->run(); }) {}

PatientSink::~PatientSink() {
  MutexLock lock(queue_->mutex);
  queue_->stopping = true;
  queue_->end = steady_clock::now() + kFarewell;
  queue_->changed.notify_all();
  // The thread may be in a write that never ends, in spite of `poll`, when other processes write to the same pipe.
  const bool ended = queue_->changed.wait_for(lock, 2 * kFarewell,
                                              [this]() NEEDS(queue_->mutex) { return queue_->done; });
  lock.unlock();
  ended ? thread_.join() : thread_.detach();
}

void PatientSink::sink_it_(const spdlog::details::log_msg& message) {
  const double now_s = std::chrono::duration<double>(steady_clock::now().time_since_epoch()).count();
  const bool refused = message.level < spdlog::level::err && !rate_.take(now_s);
  spdlog::memory_buf_t text;
  uint64_t dropped = 0;
  {
    const MutexLock lock(queue_->mutex);
    if (refused || queue_->bytes >= kMostWaitingBytes) {
      ++queue_->dropped;
      return;
    }
    dropped = std::exchange(queue_->dropped, 0);
  }
  std::string lines;
  const auto append = [&](const spdlog::details::log_msg& line) {
    text.clear();
    formatter_->format(line, text);
    lines.append(text.data(), text.size());
  };
  if (dropped > 0) {
    const std::string note = note_(dropped);
    append({message.logger_name, spdlog::level::warn, note});
  }
  append(message);
  const MutexLock lock(queue_->mutex);
  queue_->bytes += lines.size();
  queue_->lines.push_back(std::move(lines));
  queue_->changed.notify_one();
}

}  // namespace sightline
