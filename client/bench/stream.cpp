#include "client/bench/stream.h"

#include "client/cpp/client_error.h"
#include "client/cpp/session_stream.h"

namespace sightline {
namespace {

double us_between(int64_t from_ns, int64_t to_ns) {
  return 1e-3 * static_cast<double>(to_ns - from_ns);
}

// The metadata must be there before the call is made.
grpc::ClientContext* with_token(grpc::ClientContext& context, const std::string& token) {
  show_token(context, token);
  return &context;
}

}  // namespace

int64_t BenchStream::monotonic_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

BenchStream::BenchStream(EventLoop& loop, std::shared_ptr<grpc::Channel> channel, BenchProtocol protocol,
                         int64_t late_ns, const std::string& token)
    : protocol_(std::move(protocol)),
      late_ns_(late_ns),
      channel_(std::move(channel)),
      stub_(channel_),
      call_(stub_.PrepareCall(with_token(context_, token), protocol_.method, &loop.queue())) {
  const std::lock_guard lock(mutex_);
  if (protocol_.opening)
    unsent_.push_back(*protocol_.opening);
  else
    opened_.emplace();
  writing_ = true;  // until the call has started
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
  write_next(ok);
  operation_over();
}

// After an operation that kept others from writing.
void BenchStream::write_next(bool ok) {
  writing_ = false;
  if (!ok) {
    closing_ = true;
    unsent_.clear();
  }
  if (!unsent_.empty())
    start_write();
  else if (closing_)
    finish_writing();
}

void BenchStream::start_write() {
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

void BenchStream::operation_over() {
  if (--under_way_ > 0) return;
  ended_ = true;
  closing_ = true;
  log_.give_up();
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
  protocol_.write_tick(next_sequence_, message);
  const size_t bytes = message.Length();
  last_tick_bytes_ = bytes;
  const std::lock_guard lock(mutex_);
  log_.sent(next_sequence_++, due_ns, window);
  if (BenchWindow* const open = open_window(window)) {
    open->add(BenchMetric::kSend, us_between(due_ns, monotonic_ns()));
    open->tick_bytes += bytes;
  }
  if (ended_) log_.give_up();
  if (closing_) return;  // when the stream has not ended yet, its end gives the tick up
  unsent_.push_back(std::move(message));
  if (!writing_) start_write();
}

void BenchStream::on_write(bool ok) {
  const std::lock_guard lock(mutex_);
  unsent_.pop_front();
  write_next(ok);
  operation_over();
}

void BenchStream::on_last(bool) {
  const std::lock_guard lock(mutex_);
  operation_over();
}

void BenchStream::on_read(bool ok) {
  const int64_t now_ns = monotonic_ns();
  if (!ok) {
    const std::lock_guard lock(mutex_);
    closing_ = true;
    if (!writing_) finish_writing();
    ++under_way_;
    call_->Finish(&end_status_, &end_event_);
    return operation_over();
  }
  const size_t bytes = reply_.Length();
  const BenchAnswer answer = protocol_.read(reply_);
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
      last_reply_bytes_ = bytes;
      count_reply(answer, bytes, now_ns);
      break;
    case BenchAnswer::Kind::kRejection:
      log_.tick_error(answer.sequence);
      [[fallthrough]];
    case BenchAnswer::Kind::kOther:
      if (trouble_.empty()) trouble_ = answer.trouble;
      break;
  }
}

void BenchStream::count_reply(const BenchAnswer& answer, size_t bytes, int64_t now_ns) {
  settled_.clear();
  log_.answered(answer.sequence, answer.merged, settled_);
  for (const SettledTick& tick : settled_)
    if (BenchWindow* const open = open_window(tick.window)) {
      open->add(BenchMetric::kRoundTrip, us_between(tick.due_ns, now_ns));
      open->late += now_ns - tick.due_ns > late_ns_;
    }
  BenchWindow* const open = settled_.empty() ? nullptr : open_window(settled_.back().window);
  if (!open) return;
  ++open->replies;
  open->degraded += answer.degraded;
  open->reply_bytes += bytes;
  if (!answer.stages_us) return;
  const auto& stages_us = *answer.stages_us;
  open->add(BenchMetric::kTransport, us_between(settled_.back().due_ns, now_ns) - stages_us.front() - stages_us.back());
  for (size_t i = 0; i < stages_us.size(); ++i)
    open->add(static_cast<BenchMetric>(static_cast<size_t>(BenchMetric::kQueue) + i), stages_us[i]);
}

// Null when the tick does not count, or when its window was taken already.
BenchWindow* BenchStream::open_window(int window) {
  return window < first_window_ ? nullptr : &windows_[window];
}

BenchWindow BenchStream::take_window(int window) {
  const std::lock_guard lock(mutex_);
  first_window_ = window + 1;
  auto taken = windows_.extract(window);
  return taken ? std::move(taken.mapped()) : BenchWindow();
}

int64_t BenchStream::oldest_pending_ns() const {
  const std::lock_guard lock(mutex_);
  return log_.oldest_pending_ns();
}

TickCounts BenchStream::counts() const {
  const std::lock_guard lock(mutex_);
  return log_.counts();
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
