#include "client/cpp/live_camera.h"

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

#include "client/cpp/client_error.h"
#include "client/cpp/display.h"
#include "client/cpp/waiting_ticks.h"

namespace sightline {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

// Between attempts, so that a daemon that is back is found soon.
constexpr milliseconds kShortestPause{40}, kLongestPause{200};

}  // namespace

// Both sides of a live camera: what the game calls, and the thread that owns the blocking Camera. The thread shares the
// ownership, because a daemon that is stopped while it opens a session can hold the thread longer than close() waits.
class LiveCamera::Worker : public std::enable_shared_from_this<Worker> {
 public:
  Worker(std::vector<std::string> addresses, v1::OpenSession opening, LiveOptions options)
      : addresses_(std::move(addresses)),
        opening_(std::move(opening)),
        options_(std::move(options)),
        display_(opening_, std::chrono::duration<double>(options_.blend).count()) {
    options_.camera.give_up_after = milliseconds(0);
    options_.camera.reply_timeout = options_.reply_timeout;
  }

  void start() {
    std::thread([self = shared_from_this()] { self->work(); }).detach();
  }

  Result<LiveView> tick(v1::Tick tick);
  Result<LiveView> sample(double time_s, const Drawn& drawn);
  void close();

  std::optional<v1::SessionOpened> opened() const {
    const std::lock_guard lock(mutex_);
    return opened_;
  }
  size_t resyncs() const {
    const std::lock_guard lock(mutex_);
    return resyncs_;
  }
  size_t resumes() const {
    const std::lock_guard lock(mutex_);
    return resumes_;
  }

 private:
  // On the game's thread; they need mutex_.
  Status check() const;
  Status take(v1::Tick& tick, bool idle);
  LiveView view(double time_s, const Drawn& drawn, uint64_t counts_from);

  // On the thread of its own.
  void work();
  void send_all();
  std::vector<v1::Tick> next();
  bool try_for_ever(const v1::Tick* tick);
  std::pair<std::string, size_t> stream_name() const;
  Result<Camera::Answer> try_once(const v1::Tick* tick);
  Status open_camera();
  bool pause(milliseconds pause);
  void take_answer(uint64_t sequence, Camera::Answer answer);

  // constant after construction
  const std::vector<std::string> addresses_;
  const v1::OpenSession opening_;
  LiveOptions options_;  // but for `camera`, which the thread completes

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // guarded by mutex_
  std::optional<Camera> camera_;  // set by the thread, which calls it without the mutex
  live::Display display_;
  live::WaitingTicks waiting_;
  uint64_t sequence_ = 0;  // of the newest tick
  uint64_t answered_ = 0;  // the newest one that was answered
  std::optional<double> first_s_;
  steady_clock::time_point silent_since_;  // counts while ticks are unanswered
  std::vector<v1::TickError> refusals_;
  std::optional<Error> fatal_, trouble_;
  std::optional<v1::SessionOpened> opened_;
  size_t resyncs_ = 0, resumes_ = 0;
  bool stopping_ = false, ended_ = false;
};

Result<LiveView> LiveCamera::Worker::tick(v1::Tick tick) {
  if (tick.step_control().merge_into_next())
    return invalid("tick.step_control.merge_into_next", "a camera waits for a reply to each tick");
  if (tick.sequence() != 0) return invalid("tick.sequence", "a LiveCamera numbers its ticks");
  if (!std::isfinite(tick.time_s())) return invalid("tick.time_s", "must be finite");
  std::unique_lock lock(mutex_);
  const bool idle = answered_ == sequence_;
  if (const Status taken = take(tick, idle); !taken) return tl::unexpected(taken.error());
  if (idle) changed_.wait_for(lock, options_.wait, [&] { return answered_ == sequence_ || fatal_; });
  if (const Status fine = check(); !fine) return tl::unexpected(fine.error());
  LiveView seen = view(tick.time_s(), {}, idle ? sequence_ + 1 : sequence_);
  if (display_.follows()) waiting_.suggest(display_.observed());
  return seen;
}

Result<LiveView> LiveCamera::Worker::sample(double time_s, const Drawn& drawn) {
  const std::lock_guard lock(mutex_);
  if (const Status fine = check(); !fine) return tl::unexpected(fine.error());
  return view(time_s, drawn, sequence_ + 1);
}

void LiveCamera::Worker::close() {
  std::unique_lock lock(mutex_);
  stopping_ = true;
  changed_.notify_all();
  if (changed_.wait_for(lock, options_.close_after, [this] { return ended_; })) return;
  if (camera_) camera_->interrupt();
  changed_.wait_for(lock, milliseconds(500), [this] { return ended_; });
}

Status LiveCamera::Worker::check() const {
  if (stopping_) return fail(ErrorCode::kFailedPrecondition, "camera", "it is closed");
  if (fatal_) return tl::unexpected(*fatal_);
  return {};
}

Status LiveCamera::Worker::take(v1::Tick& tick, bool idle) {
  if (const Status fine = check(); !fine) return fine;
  tick.set_sequence(sequence_ + 1);
  if (const Status added = waiting_.add(tick); !added) return added;
  display_.take_tick(tick);
  if (idle) silent_since_ = steady_clock::now();
  if (!first_s_) first_s_ = tick.time_s();
  sequence_ = tick.sequence();
  changed_.notify_all();
  return {};
}

LiveView LiveCamera::Worker::view(double time_s, const Drawn& drawn, uint64_t counts_from) {
  if (answered_ != sequence_ && steady_clock::now() - silent_since_ >= options_.fallback_after)
    display_.follow(counts_from);
  LiveView seen;
  std::tie(seen.shown, seen.source) = display_.show(time_s, drawn);
  seen.reply = display_.newest();
  if (seen.source == LiveSource::kPredicted && seen.reply && seen.reply->sequence() == sequence_)
    seen.source = LiveSource::kReply;
  seen.age_s = std::max(time_s - (seen.reply ? seen.reply->time_s() : first_s_.value_or(time_s)), 0.0);
  seen.sequence = sequence_;
  seen.refusals = std::exchange(refusals_, {});
  seen.trouble = trouble_;
  return seen;
}

void LiveCamera::Worker::work() {
  send_all();
  const std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

void LiveCamera::Worker::send_all() {
  if (!try_for_ever(nullptr)) return;
  for (auto ticks = next(); !ticks.empty(); ticks = next())
    for (const v1::Tick& tick : ticks)
      if (!try_for_ever(&tick)) return;
  (void)camera_->close();  // the session is over in any case
}

// None: the camera was closed, and no tick is left.
std::vector<v1::Tick> LiveCamera::Worker::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stopping_ || !waiting_.empty(); });
  return waiting_.empty() ? std::vector<v1::Tick>{} : waiting_.take();
}

// Opens the session if need be, and gets the answer to the tick. False: the camera was closed, or no daemon takes the
// opening.
bool LiveCamera::Worker::try_for_ever(const v1::Tick* tick) {
  for (milliseconds between = kShortestPause;; between = std::min(2 * between, kLongestPause)) {
    const auto stream = stream_name();
    auto answer = try_once(tick);
    if (answer && tick) take_answer(tick->sequence(), std::move(*answer));
    if (answer) return true;
    if (tick && stream_name() != stream && !is_lost(answer.error(), false)) {
      // It would end the call of the next stream too.
      take_answer(tick->sequence(), to_refusal(answer.error(), tick->sequence()));
      return true;
    }
    {
      const std::lock_guard lock(mutex_);
      trouble_ = answer.error();
      if (!camera_ && !is_lost(answer.error(), true)) fatal_ = answer.error();
      changed_.notify_all();
      if (fatal_) return false;
    }
    if (!pause(between)) return false;
  }
}

// Another one after each opening and each resumption. A session that cannot be resumed goes on under another id.
std::pair<std::string, size_t> LiveCamera::Worker::stream_name() const {
  const std::lock_guard lock(mutex_);
  return {opened_ ? opened_->session_id() : std::string(), resumes_};
}

// Without a tick: an empty reply.
Result<Camera::Answer> LiveCamera::Worker::try_once(const v1::Tick* tick) {
  if (const Status opened = open_camera(); !opened) return tl::unexpected(opened.error());
  if (!tick) return Camera::Answer{};
  auto answer = camera_->tick(*tick);
  const std::lock_guard lock(mutex_);
  opened_ = camera_->opened();
  resyncs_ = camera_->resyncs();
  resumes_ = camera_->resumes();
  return answer;
}

Status LiveCamera::Worker::open_camera() {
  if (camera_) return {};
  // Only once, however often the opening is tried.
  if (const Status read = read_scene(options_.camera); !read) return read;
  auto camera = Camera::open(addresses_, opening_, options_.camera);
  if (!camera) return tl::unexpected(camera.error());
  const std::lock_guard lock(mutex_);
  camera_ = std::move(*camera);
  opened_ = camera_->opened();
  return {};
}

// False: the camera was closed.
bool LiveCamera::Worker::pause(milliseconds pause) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, pause, [this] { return stopping_; });
}

void LiveCamera::Worker::take_answer(uint64_t sequence, Camera::Answer answer) {
  const std::lock_guard lock(mutex_);
  answered_ = sequence;
  trouble_.reset();
  silent_since_ = steady_clock::now();
  if (auto* reply = std::get_if<v1::CameraReply>(&answer)) display_.take_reply(std::move(*reply));
  if (auto* refusal = std::get_if<v1::TickError>(&answer); refusal && refusals_.size() < live::WaitingTicks::kMost)
    refusals_.push_back(std::move(*refusal));
  changed_.notify_all();
}

LiveCamera::LiveCamera(std::shared_ptr<Worker> worker) : worker_(std::move(worker)) {}
LiveCamera::LiveCamera(LiveCamera&&) noexcept = default;

LiveCamera& LiveCamera::operator=(LiveCamera&& other) noexcept {
  if (this != &other && worker_) worker_->close();
  worker_ = std::move(other.worker_);
  return *this;
}

LiveCamera::~LiveCamera() {
  if (worker_) worker_->close();
}

LiveCamera LiveCamera::open(std::vector<std::string> addresses, v1::OpenSession opening, LiveOptions options) {
  auto worker = std::make_shared<Worker>(std::move(addresses), std::move(opening), std::move(options));
  worker->start();
  return LiveCamera(std::move(worker));
}

Result<LiveView> LiveCamera::tick(v1::Tick tick) {
  return worker_->tick(std::move(tick));
}

Result<LiveView> LiveCamera::sample(double time_s, const Drawn& drawn) {
  return worker_->sample(time_s, drawn);
}

std::optional<v1::SessionOpened> LiveCamera::opened() const {
  return worker_->opened();
}

size_t LiveCamera::resyncs() const {
  return worker_->resyncs();
}

size_t LiveCamera::resumes() const {
  return worker_->resumes();
}

void LiveCamera::close() {
  worker_->close();
}

}  // namespace sightline
