#include "client/cpp/session_stream.h"

#include "client/cpp/client_error.h"

namespace sightline {

void show_token(grpc::ClientContext& context, const std::string& token) {
  if (!token.empty()) context.AddMetadata("authorization", "Bearer " + token);
}

ClientSession::Stream::Stream(std::shared_ptr<grpc::Channel> channel, const std::string& token,
                              v1::ControlRequest first, Handler handler)
    : channel_(std::move(channel)), stub_(v1::CameraControlService::NewStub(channel_)), handler_(std::move(handler)) {
  show_token(context_, token);
  stub_->async()->Control(&context_, this);
  // send() starts writes outside of gRPC's callbacks, so the stream is held open until the last write.
  AddHold();
  const std::lock_guard lock(mutex_);
  unsent_.push_back(std::move(first));
  start_next_write();
  StartRead(&reply_);
  StartCall();
}

ClientSession::Stream::~Stream() {
  cancel_and_wait();
}

void ClientSession::Stream::start_next_write() {
  writing_ = true;
  StartWrite(&unsent_.front());
}

void ClientSession::Stream::finish_writing() {
  if (writes_done_) return;
  writes_done_ = true;
  StartWritesDone();
  RemoveHold();
}

void ClientSession::Stream::OnWriteDone(bool ok) {
  const std::lock_guard lock(mutex_);
  writing_ = false;
  unsent_.pop_front();
  if (!ok) {
    closing_ = true;
    unsent_.clear();
  }
  if (!unsent_.empty())
    start_next_write();
  else if (closing_)
    finish_writing();
}

std::optional<SessionEvent> ClientSession::Stream::take_reply() {
  switch (reply_.message_case()) {
    case v1::ControlResponse::kOpened:
      opened_ = std::move(*reply_.mutable_opened());
      break;
    case v1::ControlResponse::kCamera:
      return std::move(*reply_.mutable_camera());
    case v1::ControlResponse::kTickError:
      return std::move(*reply_.mutable_tick_error());
    case v1::ControlResponse::kDrain:
      return std::move(*reply_.mutable_drain());
    case v1::ControlResponse::MESSAGE_NOT_SET:
      break;  // a message of a newer server, which this client does not know
  }
  return std::nullopt;
}

void ClientSession::Stream::deliver(SessionEvent event) {
  if (handler_) {
    handler_(event);
    return;
  }
  const std::lock_guard lock(mutex_);
  if (unread_.size() == kMaxUnread) {
    unread_.pop_front();
    ++dropped_;
  }
  unread_.push_back(std::move(event));
}

void ClientSession::Stream::OnReadDone(bool ok) {
  if (!ok) {
    // The server has ended the stream and answers nothing more.
    const std::lock_guard lock(mutex_);
    closing_ = true;
    if (!writing_) finish_writing();
    return;
  }
  std::optional<SessionEvent> event;
  {
    const std::lock_guard lock(mutex_);
    event = take_reply();
  }
  if (event) deliver(std::move(*event));
  changed_.notify_all();
  StartRead(&reply_);
}

void ClientSession::Stream::OnDone(const grpc::Status& status) {
  Error error;
  {
    const std::lock_guard lock(mutex_);
    end_status_ = status;
    closing_ = true;
    error = end_error();
  }
  if (handler_) handler_(tl::unexpected(error));
  // This must come last: the object may be destroyed afterwards, and its destructor takes the mutex.
  const std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

namespace {

// Merged as the server would apply them in turn: a preset resets all settings.
void put_over(const v1::Settings& settings, v1::Tick& changes) {
  if (settings.preset() != v1::Settings::PRESET_UNSPECIFIED) changes.clear_settings(), changes.clear_tuning();
  changes.mutable_settings()->MergeFrom(settings);
}

// Moves the waiting changes into the tick; its own settings, tuning and limits are applied on top.
void take_changes(v1::Tick& changes, v1::Tick& tick) {
  if (tick.has_settings()) put_over(tick.settings(), changes);
  if (changes.has_settings()) tick.mutable_settings()->Swap(changes.mutable_settings());
  if (changes.has_tuning()) {
    changes.mutable_tuning()->MergeFrom(tick.tuning());
    tick.mutable_tuning()->Swap(changes.mutable_tuning());
  }
  if (changes.has_limits()) {
    changes.mutable_limits()->MergeFrom(tick.limits());
    tick.mutable_limits()->Swap(changes.mutable_limits());
  }
  changes.Clear();
}

}  // namespace

void ClientSession::Stream::change(const v1::Settings& settings) {
  const std::lock_guard lock(mutex_);
  put_over(settings, changes_);
}

void ClientSession::Stream::change(const tuning::v1alpha1::Tuning& tuning) {
  const std::lock_guard lock(mutex_);
  changes_.mutable_tuning()->MergeFrom(tuning);
}

void ClientSession::Stream::change(const v1::CameraLimits& limits) {
  const std::lock_guard lock(mutex_);
  changes_.mutable_limits()->MergeFrom(limits);
}

Error ClientSession::Stream::end_error() const {
  if (end_status_.ok()) return {ErrorCode::kUnavailable, "session", "the session was closed"};
  return error_from_status(end_status_);
}

Result<v1::SessionOpened> ClientSession::Stream::wait_opened(std::chrono::nanoseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return opened_ || ended_; });
  if (opened_) return *opened_;
  if (ended_) return tl::unexpected(end_error());
  return fail(ErrorCode::kUnavailable, "deadline", "the server did not answer the open request in time");
}

Status ClientSession::Stream::send(const v1::Tick& tick) {
  const std::lock_guard lock(mutex_);
  if (ended_) return tl::unexpected(end_error());
  if (closing_) return fail(ErrorCode::kUnavailable, "session", "the stream is closing");
  if (unsent_.size() >= kMaxUnsent)
    return fail(ErrorCode::kResourceExhausted, "tick",
                std::to_string(unsent_.size()) + " ticks wait to be sent: the server does not take them");
  v1::Tick& queued = *unsent_.emplace_back().mutable_tick();
  queued = tick;
  take_changes(changes_, queued);
  if (!writing_) start_next_write();
  return {};
}

Result<std::optional<SessionEvent>> ClientSession::Stream::receive(std::chrono::nanoseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return !unread_.empty() || ended_; });
  if (!unread_.empty()) {
    SessionEvent event = std::move(unread_.front());
    unread_.pop_front();
    return event;
  }
  if (ended_) return tl::unexpected(end_error());
  return std::nullopt;
}

Status ClientSession::Stream::close(std::chrono::nanoseconds timeout) {
  {
    std::unique_lock lock(mutex_);
    closing_ = true;
    if (!writing_) finish_writing();
    if (changed_.wait_for(lock, timeout, [&] { return ended_; })) {
      if (end_status_.ok()) return {};
      return tl::unexpected(end_error());
    }
  }
  cancel_and_wait();
  return fail(ErrorCode::kUnavailable, "deadline", "the server did not end the session in time");
}

void ClientSession::Stream::cancel_and_wait() {
  context_.TryCancel();
  std::unique_lock lock(mutex_);
  closing_ = true;
  if (!writing_) finish_writing();
  changed_.wait(lock, [&] { return ended_; });
}

size_t ClientSession::Stream::dropped_events() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

}  // namespace sightline
