#include "client/bench/stream.h"

#include <chrono>

#include "client/cpp/client_error.h"

namespace sightline {
namespace {

double us_between(int64_t from_ns, int64_t to_ns) {
  return 1e-3 * static_cast<double>(to_ns - from_ns);
}

}  // namespace

int64_t BenchStream::monotonic_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

BenchStream::BenchStream(EventLoop& loop, std::shared_ptr<grpc::Channel> channel,
                         std::unique_ptr<BenchDialect> dialect, int64_t late_ns)
    : dialect_(std::move(dialect)),
      late_ns_(late_ns),
      channel_(std::move(channel)),
      stub_(channel_),
      call_(stub_.PrepareCall(&context_, dialect_->method(), &loop.queue())) {
  const std::lock_guard lock(mutex_);
  if (!dialect_->opening(unsent_.emplace_back())) {
    unsent_.pop_back();
    opened_.emplace();
  }
  writing_ = true;  // until it has started
  under_way_ = 1;
  call_->StartCall(&start_);
}

BenchStream::~BenchStream() {
  context_.TryCancel();
  std::unique_lock lock(mutex_);
  closing_ = true;
  if (!writing_) finish_writing();
  changed_.wait(lock, [&] { return ended_; });
}

void BenchStream::on_start(bool ok) {
  const std::lock_guard lock(mutex_);
  ++under_way_;
  call_->Read(&reply_, &read_);  // fails when the call did not start
  write_on(ok);
  over();
}

// What comes after an operation that kept others from writing.
void BenchStream::write_on(bool ok) {
  writing_ = false;
  if (!ok) {
    closing_ = true;
    unsent_.clear();
  }
  if (!unsent_.empty())
    start_next_write();
  else if (closing_)
    finish_writing();
}

void BenchStream::start_next_write() {
  writing_ = true;
  ++under_way_;
  call_->Write(unsent_.front(), &written_);
}

void BenchStream::finish_writing() {
  if (writes_done_) return;
  writes_done_ = true;
  ++under_way_;
  call_->WritesDone(&writes_done_event_);
}

void BenchStream::over() {
  if (--under_way_ > 0) return;
  ended_ = true;
  closing_ = true;
  ledger_.give_up();
  changed_.notify_all();
}

Result<BenchOpened> BenchStream::wait_opened(std::chrono::nanoseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return opened_ || ended_; });
  if (opened_) return *opened_;
  if (ended_ && !end_status_.ok()) return tl::unexpected(error_from_status(end_status_));
  return fail(ErrorCode::kUnavailable, "deadline", "the server did not answer the open request in time");
}

void BenchStream::send_tick(int64_t due_ns, int window) {
  grpc::ByteBuffer message;
  const uint64_t sequence = next_sequence_.load(std::memory_order_relaxed);
  dialect_->tick(sequence, message);
  const size_t bytes = message.Length();
  last_tick_bytes_.store(bytes, std::memory_order_relaxed);
  const std::lock_guard lock(mutex_);
  next_sequence_.store(sequence + 1, std::memory_order_relaxed);
  ledger_.sent(sequence, due_ns, window);
  if (window >= first_window_) {
    window_at(window).add(BenchMetric::kSend, us_between(due_ns, monotonic_ns()));
    window_at(window).tick_bytes += bytes;
  }
  if (ended_) ledger_.give_up();
  if (closing_) return;  // not ended yet: it is given up then
  unsent_.push_back(std::move(message));
  if (!writing_) start_next_write();
}

void BenchStream::on_write(bool ok) {
  const std::lock_guard lock(mutex_);
  unsent_.pop_front();
  write_on(ok);
  over();
}

void BenchStream::on_writes_done(bool) {
  const std::lock_guard lock(mutex_);
  over();
}

void BenchStream::on_end(bool) {
  const std::lock_guard lock(mutex_);
  over();
}

void BenchStream::on_read(bool ok) {
  const int64_t now_ns = monotonic_ns();
  if (!ok) {
    const std::lock_guard lock(mutex_);
    closing_ = true;
    if (!writing_) finish_writing();
    ++under_way_;
    call_->Finish(&end_status_, &end_event_);
    return over();
  }
  const size_t bytes = reply_.Length();
  const BenchAnswer answer = dialect_->read(reply_);
  {
    const std::lock_guard lock(mutex_);
    take_answer(answer, bytes, now_ns);
  }
  reply_.Clear();
  call_->Read(&reply_, &read_);
}

void BenchStream::take_answer(const BenchAnswer& answer, size_t bytes, int64_t now_ns) {
  switch (answer.kind) {
    case BenchAnswer::Kind::kOpened:
      opened_ = answer.opened;
      changed_.notify_all();
      break;
    case BenchAnswer::Kind::kReply:
      last_reply_bytes_.store(bytes, std::memory_order_relaxed);
      count_reply(answer, bytes, now_ns);
      break;
    case BenchAnswer::Kind::kRejection:
      ledger_.tick_error(answer.sequence);
      [[fallthrough]];
    case BenchAnswer::Kind::kOther:
      if (trouble_.empty()) trouble_ = answer.trouble;
      break;
  }
}

void BenchStream::count_reply(const BenchAnswer& answer, size_t bytes, int64_t now_ns) {
  settled_.clear();
  ledger_.answered(answer.sequence, answer.merged, settled_);
  for (const SettledTick& tick : settled_) {
    if (tick.window < first_window_) continue;  // not counted, or taken already
    BenchWindow& window = window_at(tick.window);
    window.add(BenchMetric::kRoundTrip, us_between(tick.due_ns, now_ns));
    if (now_ns - tick.due_ns > late_ns_) ++window.late;
  }
  if (settled_.empty() || settled_.back().window < first_window_) return;
  BenchWindow& window = window_at(settled_.back().window);
  ++window.replies;
  window.degraded += answer.degraded;
  window.reply_bytes += bytes;
  if (!answer.stages) return;
  const BenchStages& stages = *answer.stages;
  window.add(BenchMetric::kTransport,
             us_between(settled_.back().due_ns, now_ns) - stages.queue - stages.step);
  window.add(BenchMetric::kQueue, stages.queue);
  window.add(BenchMetric::kScene, stages.scene);
  window.add(BenchMetric::kBound, stages.bound);
  window.add(BenchMetric::kSample, stages.sample);
  window.add(BenchMetric::kAggregate, stages.aggregate);
  window.add(BenchMetric::kMove, stages.move);
  window.add(BenchMetric::kStep, stages.step);
}

BenchWindow& BenchStream::window_at(int window) {
  const auto at = static_cast<size_t>(window - first_window_);
  if (windows_.size() <= at) windows_.resize(at + 1);
  return windows_[at];
}

int64_t BenchStream::oldest_pending_ns() const {
  const std::lock_guard lock(mutex_);
  return ledger_.oldest_pending_ns();
}

BenchWindow BenchStream::take_window(int window) {
  const std::lock_guard lock(mutex_);
  BenchWindow taken;
  for (; first_window_ <= window; ++first_window_) {
    if (windows_.empty()) continue;
    if (first_window_ == window) taken = std::move(windows_.front());
    windows_.pop_front();
  }
  return taken;
}

TickCounts BenchStream::counts() const {
  const std::lock_guard lock(mutex_);
  return ledger_.counts();
}

std::string BenchStream::trouble() const {
  const std::lock_guard lock(mutex_);
  return trouble_;
}

std::optional<Error> BenchStream::end() const {
  const std::lock_guard lock(mutex_);
  if (!ended_) return std::nullopt;
  if (end_status_.ok()) return Error{ErrorCode::kUnavailable, "session", "the server closed the session"};
  return error_from_status(end_status_);
}

Status BenchStream::close(std::chrono::nanoseconds timeout) {
  std::unique_lock lock(mutex_);
  closing_ = true;
  if (!writing_) finish_writing();
  const bool in_time = changed_.wait_for(lock, timeout, [&] { return ended_; });
  if (in_time && end_status_.ok()) return {};
  if (in_time) return tl::unexpected(error_from_status(end_status_));
  return fail(ErrorCode::kUnavailable, "deadline", "the server did not end the session in time");
}

}  // namespace sightline
