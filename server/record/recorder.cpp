// The writing half of the recorder: one thread writes the files of all sessions.
#include "server/record/recorder.h"

#include <google/protobuf/message_lite.h>

#include <algorithm>

#include "server/record/record_session.h"

namespace sightline {
namespace {

using record_internal::add_to_gap;
using record_internal::Session;

constexpr uint64_t kHousekeepingNs = 1'000'000'000;
constexpr uint64_t kHousekeepingBytes = uint64_t{16} << 20;
constexpr uint64_t kLeastPartBytes = uint64_t{1} << 20;
constexpr uint32_t kLayoutVersion = 1;
constexpr int kNameTries = 1000;
constexpr uint64_t kLastShare = 16;  // the last part of a file, in which a memory ends it

const char* reason_text(v1::Gap::Reason reason) {
  switch (reason) {
    case v1::Gap::REASON_QUEUE_FULL:
      return "messages come faster than they can be written";
    case v1::Gap::REASON_TOO_LARGE:
      return "a message is larger than a recording can hold";
    case v1::Gap::REASON_NO_SPACE:
      return "there is no space for recordings";
    default:
      return "the recording cannot be written";
  }
}

// Replaces a snapshot tick that is too large. Its ticks are in the parts before, so they do not count as dropped.
v1::Gap too_large_snapshot(const SessionSnapshot& snapshot, const Session& session) {
  v1::Gap gap;
  add_to_gap(gap, v1::Gap::REASON_TOO_LARGE, snapshot.ticks(), session.info.start_time_ns(), snapshot.stamp().log_ns);
  gap.set_text("the changes of these ticks are too large for one snapshot tick");
  return gap;
}

}  // namespace

// Drops for one reason.
struct RecordWriter::Drops {
  uint64_t seen = 0;   // those already in the counts
  bool lasts = false;  // there were drops in the last period
};

struct RecordWriter::ActiveSession {
  explicit ActiveSession(std::shared_ptr<Session> of) : session(std::move(of)) {}

  const std::shared_ptr<Session> session;
  std::unique_ptr<SessionFile> file;  // null: there is none now
  std::string file_name;
  uint64_t counted_bytes = 0;  // bytes of the file that are in the counts
  uint32_t part = 0;
  uint64_t retry_ns = 0;  // no new file before this time
  v1::Gap gap;            // messages lost without a file
  bool warned = false;    // of the present trouble
  Drops queue_full, too_large;
  uint64_t viewers_too_large = 0;           // dropped here
  std::optional<std::string> open, opened;  // for the head of the next part
  SessionSnapshot snapshot;                 // for it too
  uint64_t head_bytes = 0;                  // size of the file with only its head
  uint64_t head_size = 0;                   // of the messages at its head, unpacked
  uint64_t head_chunks = 0;                 // chunks of the file with only its head
  // the newest message of the session, when it was a memory: for the next head
  std::optional<std::string> memory;
  TickStamp memory_stamp;
  ViewerChannels viewers{snapshot};
  std::array<uint32_t, kRecordTopics> sequences{};  // of messages made here
};

RecordWriter::RecordWriter(RecordSettings settings, RecordFileSystem& files, Clock now_ns, Warn warn)
    : settings_(std::move(settings)),
      now_ns_(std::move(now_ns)),
      warn_(std::move(warn)),
      folder_(settings_.folder, settings_.limits, files),
      waker_(std::make_shared<record_internal::Waker>()) {}

RecordWriter::~RecordWriter() {
  finish();
}

void RecordWriter::finish() {
  run_once();
  for (ActiveSession& active : active_) close_file(active);
}

std::unique_ptr<SessionRecorder> RecordWriter::open_session(v1::RecordingInfo info) {
  info.set_layout_version(kLayoutVersion);
  info.set_start_time_ns(now_ns_());
  auto session = std::make_shared<Session>(std::move(info), settings_, waker_);
  const MutexLock lock(mutex_);
  new_sessions_.push_back(session);
  ++counts_.open_sessions;
  return std::make_unique<SessionRecorder>(std::move(session));
}

RecordCounts RecordWriter::counts() const {
  const MutexLock lock(mutex_);
  return counts_;
}

void RecordWriter::wait(std::chrono::nanoseconds timeout) {
  waker_->wait(timeout);
}

void RecordWriter::wake() {
  waker_->wake_surely();
}

void RecordWriter::adopt_new_sessions() {
  const MutexLock lock(mutex_);
  for (auto& session : new_sessions_) active_.emplace_back(std::move(session));
  new_sessions_.clear();
}

void RecordWriter::run_once() {
  adopt_new_sessions();
  if (now_ns_() >= next_housekeeping_ns_ || bytes_since_housekeeping_ >= kHousekeepingBytes) housekeep();
  for (auto active = active_.begin(); active != active_.end();) {
    // Read before the queue, so that everything queued before the end is seen.
    const bool closed = active->session->closed.load(std::memory_order_acquire);
    serve(*active);
    if (closed) {
      close_file(*active);
      active = active_.erase(active);
    } else {
      ++active;
    }
  }
  uint64_t failing = 0;
  for (const ActiveSession& active : active_)
    failing += active.session->failing.load(std::memory_order_relaxed) ? 1 : 0;
  const MutexLock lock(mutex_);
  counts_.failing_sessions = failing;
  counts_.open_sessions = active_.size() + new_sessions_.size();
  counts_.removed_files = folder_.removed_files();
}

void RecordWriter::serve(ActiveSession& active) {
  // Takes at most what the queue can hold, so that a queue which fills as fast as it empties does not keep the others
  // waiting.
  RecordEntry entry;
  for (size_t taken = 0; taken <= active.session->ring.capacity() && active.session->ring.front(entry);) {
    taken += sizeof(RecordHead) + entry.message.size();
    std::string large;
    if (entry.head.beside) entry.message = large = active.session->large.take();
    write_entry(active, entry);
    active.session->ring.pop();
  }
  write_attachments(active);
  if (active.file) check(active, active.file->tend(now_ns_()));

  const Session& session = *active.session;
  report_drops(active, v1::Gap::REASON_QUEUE_FULL, session.dropped_queue_full.load(std::memory_order_relaxed),
               active.queue_full);
  report_drops(active, v1::Gap::REASON_TOO_LARGE,
               session.dropped_too_large.load(std::memory_order_relaxed) + active.viewers_too_large, active.too_large);
}

void RecordWriter::report_drops(const ActiveSession& active, v1::Gap::Reason reason, uint64_t dropped, Drops& known) {
  const std::string& session_id = active.session->info.session_id();
  const uint64_t more = dropped - std::exchange(known.seen, dropped);
  const bool lasted = std::exchange(known.lasts, more > 0);
  if (lasted && !known.lasts) warn_({reason, session_id, "messages are written again", true});
  if (!lasted && known.lasts) warn_({reason, session_id, reason_text(reason)});
  if (more == 0) return;
  const MutexLock lock(mutex_);
  counts_.dropped_messages += more;
}

void RecordWriter::write_entry(ActiveSession& active, const RecordEntry& entry) {
  const RecordHead& head = entry.head;
  const RecordMessage message{static_cast<RecordTopic>(head.topic), head.sequence, head.log_time_ns,
                              head.publish_time_ns, entry.message};
  // The head of a file that begins here covers all earlier messages.
  const bool has_file = ensure_file(active, message.log_time_ns);
  if (message.topic == RecordTopic::kOpen) active.open = entry.message;
  if (message.topic == RecordTopic::kOpened) active.opened = entry.message;
  const Status written = has_file ? write_through(active, message) : Status{};
  // When one message is refused for its size, the file continues.
  if (!written && !active.file->status()) lose_file(active, written.error());
  take_in(active, message, has_file && written);
  if (!has_file || !written) return lose_messages(active, lost_with(message));
  {
    const MutexLock lock(mutex_);
    ++counts_.messages;
  }
  if (active.file) check(active, active.file->status());
  // A part must be larger than its head.
  const uint64_t limit = std::max(part_limit(), 2 * active.head_size);
  if (!active.file) return;
  // A part that ends with a memory lets the next one begin with it. So a memory is asked for before the part is full.
  const uint64_t bytes = active.file->bytes() - active.session->attachment_bytes;
  const bool nearly_full = bytes >= limit - limit / kLastShare;
  if (nearly_full) active.session->wants_memory.store(true, std::memory_order_relaxed);
  if (bytes < limit && !(nearly_full && message.topic == RecordTopic::kMemory)) return;
  write_attachments(active);
  close_file(active);
}

// The opening goes to the disk at once, so that even a very short session leaves a recording when the process is
// killed.
Status RecordWriter::write_through(ActiveSession& active, const RecordMessage& message) {
  const Status written = active.file->write(message, now_ns_());
  return written && message.topic == RecordTopic::kOpened ? active.file->end_chunk() : written;
}

// For the head of the next part, lost or not; and for viewers, when the message is in the file.
void RecordWriter::take_in(ActiveSession& active, const RecordMessage& message, bool written) {
  const uint64_t time_ns = message.log_time_ns;
  active.memory.reset();  // it is of the moment before this message
  const bool shown = written && settings_.for_viewers;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    write_for_viewers(active, topic, time_ns, made);
  };
  const auto parsed = [&](auto wire, const auto& take) {
    if (wire.ParseFromArray(message.bytes.data(), static_cast<int>(message.bytes.size()))) take(wire);
  };
  switch (message.topic) {
    case RecordTopic::kOpen:
      return parsed(v1::OpenSession(), [&](const v1::OpenSession& open) {
        active.snapshot.take_open(open);
        active.viewers.take_open(open, active.session->level.get());
        if (shown) active.viewers.emit_still(time_ns, emit), active.viewers.emit_level(time_ns, emit);
      });
    case RecordTopic::kTick:
      return parsed(v1::Tick(), [&](v1::Tick& tick) {
        active.snapshot.take_tick(std::move(tick), {message.sequence, time_ns, message.publish_time_ns});
      });
    case RecordTopic::kReply:
      return parsed(v1::CameraReply(), [&](const v1::CameraReply& reply) {
        active.snapshot.take_reply(reply);
        if (shown) active.viewers.take_reply(reply, time_ns, emit);
      });
    case RecordTopic::kTickError:
      return parsed(v1::TickError(), [&](const v1::TickError& rejection) {
        active.snapshot.take_rejection(rejection);
        if (shown) active.viewers.take_rejection(rejection, time_ns, emit);
      });
    case RecordTopic::kFault:
      return parsed(v1::Fault(), [&](const v1::Fault& fault) {
        if (shown) active.viewers.take_fault(fault, time_ns, emit);
      });
    case RecordTopic::kGap:
      return parsed(v1::Gap(), [&](const v1::Gap& gap) {
        if (shown) active.viewers.take_gap(gap, time_ns, emit);
      });
    case RecordTopic::kMemory:
      active.memory = message.bytes;
      active.memory_stamp = {message.sequence, time_ns, message.publish_time_ns};
      active.session->wants_memory.store(false, std::memory_order_relaxed);
      return;
    default:
      return;
  }
}

// Returns the bytes of the message. A message that is too large gets no number, since no Gap reports it: a session is
// complete without it.
size_t RecordWriter::write_for_viewers(ActiveSession& active, RecordTopic topic, uint64_t time_ns,
                                       const google::protobuf::MessageLite& made) {
  const std::string bytes = made.SerializeAsString();
  if (bytes.size() > settings_.max_message_bytes) {
    ++active.viewers_too_large;
    return 0;
  }
  const uint32_t sequence = ++active.sequences[static_cast<size_t>(topic)];
  // An error here repeats at the next message, which handles it.
  (void)active.file->write({topic, sequence, time_ns, time_ns, bytes}, now_ns_());
  return bytes.size();
}

void RecordWriter::write_attachments(ActiveSession& active) {
  Session& session = *active.session;
  // Attachments wait for a file instead of being lost.
  while (session.attachments_done < session.attached.count() &&
         ensure_file(active, session.attached.at(session.attachments_done)->head.log_time_ns)) {
    const auto attached = session.attached.at(session.attachments_done);
    const Status done = active.file->attach(attached->head);
    if (done) ++session.attachments_done, session.attachment_bytes += attached->data->size();
    check(active, done);
    if (!done) return;
  }
}

// Decides which attachments a new file gets. Large ones are only in the first part, since the ring of files is meant
// for messages.
void RecordWriter::begin_attachments(ActiveSession& active) {
  Session& session = *active.session;
  session.attachment_bytes = 0;
  const bool fits = active.part == 1 || session.attached.bytes() <= part_limit() / 2;
  session.attachments_done = fits ? 0 : session.attached.count();
}

// `time_ns`: log time of what is to be written next.
bool RecordWriter::ensure_file(ActiveSession& active, uint64_t time_ns) {
  if (active.file) return true;
  const uint64_t now_ns = now_ns_();
  if (now_ns < active.retry_ns) return false;
  if (no_room_) {
    lose_file(active, *no_room_);
    return false;
  }
  v1::RecordingInfo info = active.session->info;
  Result<std::unique_ptr<ByteSink>> sink = fail(ErrorCode::kAlreadyExists, "", "");
  // A name may be taken by a session with the same id in the same millisecond; then the next part number is tried.
  for (int tries = 0; !sink && sink.error().code == ErrorCode::kAlreadyExists && tries < kNameTries; ++tries) {
    info.set_part(++active.part);
    active.file_name = recording_name(info.start_time_ns(), info.session_id(), info.part());
    sink = folder_.create(active.file_name);
  }
  if (!sink) {
    set_folder_trouble(sink.error());
    --active.part;
    lose_file(active, sink.error());
    return false;
  }
  set_folder_trouble({});
  McapWriterOptions options;
  options.library = "sightline " + info.server_version();
  options.chunk_bytes = settings_.chunk_bytes;
  options.chunk_time = settings_.chunk_time;
  options.zstd_level = settings_.zstd_level;
  options.max_message_bytes = settings_.max_message_bytes;
  // The info stands first, so the snapshot tick is made before it.
  const std::string snapshot = snapshot_tick(active);
  info.set_snapshot_ticks(snapshot.empty() ? 0 : active.snapshot.ticks());
  active.file = std::make_unique<SessionFile>(std::move(*sink), info, std::move(options));
  being_written_.insert(active.file_name);
  active.counted_bytes = 0;
  begin_attachments(active);
  write_head(active, snapshot, time_ns, now_ns);
  active.head_bytes = active.file->bytes();
  active.head_chunks = active.file->chunks();
  {
    const MutexLock lock(mutex_);
    ++counts_.files;
  }
  if (Status ok = active.file->status(); !ok) lose_file(active, ok.error());
  return active.file != nullptr;
}

// One tick for all ticks that were answered; empty: none were, or the tick is too large for a message.
std::string RecordWriter::snapshot_tick(const ActiveSession& active) const {
  if (active.snapshot.ticks() == 0) return {};
  std::string bytes = active.snapshot.tick().SerializeAsString();
  return bytes.size() <= settings_.max_message_bytes ? std::move(bytes) : std::string();
}

// Writes the head of a later part, which makes it readable by itself. The head has the opening, a snapshot of the
// answered ticks, the unanswered ticks, and a Gap for earlier losses. The log times never go back.
void RecordWriter::write_head(ActiveSession& active, const std::string& snapshot, uint64_t time_ns, uint64_t now_ns) {
  active.head_size = 0;
  const auto& waits = active.snapshot.waiting();
  const uint64_t first_ns = active.snapshot.ticks() > 0 ? active.snapshot.stamp().log_ns
                            : waits.empty()             ? time_ns
                                                        : waits.front().stamp.log_ns;
  const uint64_t last_ns = waits.empty() ? first_ns : waits.back().stamp.log_ns;
  const auto write = [&](RecordTopic topic, const TickStamp& stamp, const std::string& bytes) {
    active.head_size += bytes.size();
    return active.file->write({topic, stamp.sequence, stamp.log_ns, stamp.publish_ns, bytes}, now_ns);
  };
  const TickStamp again{1, first_ns, first_ns};
  if (active.open) (void)write(RecordTopic::kOpen, again, *active.open);
  if (active.opened) (void)write(RecordTopic::kOpened, again, *active.opened);
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    active.head_size += write_for_viewers(active, topic, first_ns, made);
  };
  if (active.open && settings_.for_viewers)
    active.viewers.emit_still(first_ns, emit), active.viewers.emit_level(first_ns, emit);
  if (!snapshot.empty())
    (void)write(RecordTopic::kTick, active.snapshot.stamp(), snapshot);
  else if (active.snapshot.ticks() > 0)
    (void)write(RecordTopic::kGap, again, too_large_snapshot(active.snapshot, *active.session).SerializeAsString());
  // A tick that waits was in no step, so the memory is of the snapshot.
  if (active.memory && !snapshot.empty()) (void)write(RecordTopic::kMemory, active.memory_stamp, *active.memory);
  // Otherwise a later memory tells the state from there on.
  active.session->wants_memory.store(active.snapshot.ticks() > 0 && !active.memory, std::memory_order_relaxed);
  for (const WaitingTick& waiting : waits)
    (void)write(RecordTopic::kTick, waiting.stamp, waiting.tick.SerializeAsString());
  if (active.gap.messages() > 0) (void)write(RecordTopic::kGap, {1, last_ns, last_ns}, active.gap.SerializeAsString());
  active.file->forget_waiting();
}

// Handles the result of a write, and counts the bytes.
void RecordWriter::check(ActiveSession& active, const Status& done) {
  const uint64_t more = active.file->bytes() - std::exchange(active.counted_bytes, active.file->bytes());
  bytes_since_housekeeping_ += more;
  {
    const MutexLock lock(mutex_);
    counts_.bytes += more;
  }
  if (done && active.file->chunks() > active.head_chunks) {
    // A message after the head is on the disk, and the gap with it.
    active.gap.Clear();
    if (std::exchange(active.warned, false))
      warn_({v1::Gap::REASON_UNSPECIFIED, active.session->info.session_id(), "it is written again", true});
    active.session->failing.store(false, std::memory_order_relaxed);
  }
  // A message that is refused for its size does not end the file.
  if (!done && !active.file->status()) lose_file(active, done.error());
}

void RecordWriter::close_file(ActiveSession& active) {
  if (!active.file) return;
  const Status done = active.file->finish();
  check(active, done);
  if (!active.file) return;  // lost while its last bytes were written
  active.file.reset();
  being_written_.erase(active.file_name);
}

void RecordWriter::lose_file(ActiveSession& active, const Error& error) {
  const bool full = error.code == ErrorCode::kResourceExhausted;
  LostMessages waiting;
  if (active.file) {
    waiting = active.file->waiting();
    const bool nothing_in_it = active.file->bytes() <= active.head_bytes;
    active.file.reset();
    being_written_.erase(active.file_name);
    // Empty files of failed attempts are removed from a disk that stays full.
    if (nothing_in_it && folder_.remove(active.file_name)) --active.part;
  }
  active.retry_ns = now_ns_() + kHousekeepingNs;
  active.session->failing.store(true, std::memory_order_relaxed);
  // What happens while it lasts, such as files that are closed for want of space, is no reason of its own.
  if (!active.warned) {
    active.gap.set_text(to_string(error));
    active.gap.set_reason(full ? v1::Gap::REASON_NO_SPACE : v1::Gap::REASON_WRITE_FAILED);
  }
  if (waiting.messages > 0) lose_messages(active, waiting);
  if (!std::exchange(active.warned, true)) {
    std::string text = reason_text(active.gap.reason());
    warn_({active.gap.reason(), active.session->info.session_id(), text.append(": ").append(to_string(error))});
  }
  const MutexLock lock(mutex_);
  ++counts_.write_failures;
}

// Messages in lost Gaps were counted when they were dropped. They must be reported again, but not counted.
void RecordWriter::lose_messages(ActiveSession& active, const LostMessages& lost) {
  add_to_gap(active.gap, active.gap.reason(), lost.messages + lost.reported, lost.first_time_ns, lost.last_time_ns);
  active.session->dropped_by_writer.fetch_add(lost.messages, std::memory_order_relaxed);
  const MutexLock lock(mutex_);
  counts_.dropped_messages += lost.messages;
}

void RecordWriter::housekeep() {
  next_housekeeping_ns_ = now_ns_() + kHousekeepingNs;
  bytes_since_housekeeping_ = 0;
  // A removed file can still be written to, but no one could read it.
  for (ActiveSession& active : active_)
    if (active.file && !folder_.exists(active.file_name))
      lose_file(active, Error{ErrorCode::kNotFound, active.file_name, "was removed while it was written"});
  const bool had_room = !no_room_.has_value();
  no_room_.reset();
  Status room = folder_.make_room(now_ns_(), being_written_);
  warn_of_stuck_files();
  if (room && !had_room) set_folder_trouble({});
  if (room) return;
  // Files that were being written become old files, which may be removed; the sessions continue in their next parts.
  for (ActiveSession& active : active_) close_file(active);
  room = folder_.make_room(now_ns_(), being_written_);
  if (room) return;
  no_room_ = room.error();
  set_folder_trouble(room.error());
  for (ActiveSession& active : active_) lose_file(active, room.error());
}

void RecordWriter::warn_of_stuck_files() {
  const std::vector<Error>& stuck = folder_.stuck_files();
  if (stuck.size() > stuck_files_)
    warn_({v1::Gap::REASON_UNSPECIFIED, "",
           "an old recording cannot be deleted, and no longer counts: " + to_string(stuck.back())});
  stuck_files_ = stuck.size();
}

void RecordWriter::try_folder() {
  const Status usable = folder_.try_out();
  if (usable) return;
  set_folder_trouble(usable.error());
  warn_({v1::Gap::REASON_WRITE_FAILED, "", "nothing can be recorded: " + to_string(usable.error())});
}

std::optional<Error> RecordWriter::folder_trouble() const {
  const MutexLock lock(mutex_);
  return folder_trouble_;
}

void RecordWriter::set_folder_trouble(std::optional<Error> trouble) {
  const MutexLock lock(mutex_);
  folder_trouble_ = std::move(trouble);
}

// All sessions together stay within the total even when the folder holds nothing else: half of it for the parts being
// written, half for the parts before.
uint64_t RecordWriter::part_limit() const {
  const uint64_t share = settings_.limits.max_total_bytes / (2 * std::max<uint64_t>(active_.size(), 1));
  return std::min(settings_.limits.max_file_bytes, std::max(share, kLeastPartBytes));
}

RecordThread::RecordThread(RecordWriter& writer, std::chrono::nanoseconds period)
    : writer_(writer), thread_([this, period] {
        while (!stopping_.load()) {
          writer_.run_once();
          writer_.wait(period);
        }
        writer_.run_once();
      }) {}

RecordThread::~RecordThread() {
  stopping_.store(true);
  writer_.wake();
  thread_.join();
}

}  // namespace sightline
