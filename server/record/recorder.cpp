// The end that writes: files of all sessions, from one thread.
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

const char* reason_text(v1::Gap::Reason reason) {
  switch (reason) {
    case v1::Gap::QUEUE_FULL:
      return "messages come faster than they can be written";
    case v1::Gap::TOO_LARGE:
      return "a message is larger than a recording can hold";
    case v1::Gap::NO_SPACE:
      return "there is no space for recordings";
    default:
      return "the recording cannot be written";
  }
}

// In the place of a folded tick that is too large. Its ticks are in the parts before, so they do not count as dropped.
v1::Gap unsaid(const SessionSnapshot& fold, const Session& session) {
  v1::Gap gap;
  add_to_gap(gap, v1::Gap::TOO_LARGE, fold.ticks(), session.info.start_time_ns(), fold.stamp().log_ns);
  gap.set_text("what these ticks changed is too much for the one that should stand for them");
  return gap;
}

}  // namespace

// Of one reason.
struct RecordWriter::Drops {
  uint64_t seen = 0;   // those that are in the counts
  bool lasts = false;  // there were some since the last time but one
};

struct RecordWriter::Book {
  explicit Book(std::shared_ptr<Session> of) : session(std::move(of)) {}

  const std::shared_ptr<Session> session;
  std::unique_ptr<SessionFile> file;  // null: none now
  std::string file_name;
  uint64_t counted_bytes = 0;  // of the file, that are in the counts
  uint32_t part = 0;
  uint64_t retry_ns = 0;                    // no new file before
  v1::Gap gap;                              // what was lost for want of a file
  bool warned = false;                      // of the trouble that lasts
  Drops queue_full, too_large;
  uint64_t viewers_too_large = 0;           // dropped here
  std::optional<std::string> open, opened;  // for the head of the next part
  SessionSnapshot fold;                            // for it too
  uint64_t head_bytes = 0;                  // of the file, with nothing in it yet
  uint64_t head_size = 0;                   // of the messages at its head, not packed
  uint64_t head_chunks = 0;                 // the same
  ViewerChannels viewers;
  std::array<uint32_t, kRecordTopics> sequences{};  // of what is made here
};

RecordWriter::RecordWriter(RecordSettings settings, RecordFileSystem& files, Clock now_ns, Warn warn)
    : settings_(std::move(settings)),
      now_ns_(std::move(now_ns)),
      warn_(std::move(warn)),
      folder_(settings_.folder, settings_.limits, files),
      bell_(std::make_shared<record_internal::Bell>()) {}

RecordWriter::~RecordWriter() {
  run_once();
  for (Book& book : books_) close_file(book);
}

std::unique_ptr<SessionRecorder> RecordWriter::open_session(v1::RecordingInfo info) {
  info.set_version(kLayoutVersion);
  info.set_start_time_ns(now_ns_());
  auto session = std::make_shared<Session>(std::move(info), settings_, bell_);
  const std::lock_guard lock(mutex_);
  new_sessions_.push_back(session);
  ++counts_.open_sessions;
  return std::make_unique<SessionRecorder>(std::move(session));
}

RecordCounts RecordWriter::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

void RecordWriter::wait(std::chrono::nanoseconds timeout) {
  bell_->wait(timeout);
}

void RecordWriter::wake() {
  bell_->ring_surely();
}

void RecordWriter::adopt_new_sessions() {
  const std::lock_guard lock(mutex_);
  for (auto& session : new_sessions_) books_.emplace_back(std::move(session));
  new_sessions_.clear();
}

void RecordWriter::run_once() {
  adopt_new_sessions();
  if (now_ns_() >= next_housekeeping_ns_ || bytes_since_housekeeping_ >= kHousekeepingBytes) keep_house();
  for (auto book = books_.begin(); book != books_.end();) {
    // Looked at before the queue is: what was put in before the end is then seen.
    const bool closed = book->session->closed.load(std::memory_order_acquire);
    serve(*book);
    if (closed) {
      close_file(*book);
      book = books_.erase(book);
    } else {
      ++book;
    }
  }
  uint64_t failing = 0;
  for (const Book& book : books_) failing += book.session->failing.load(std::memory_order_relaxed) ? 1 : 0;
  const std::lock_guard lock(mutex_);
  counts_.failing_sessions = failing;
  counts_.open_sessions = books_.size() + new_sessions_.size();
  counts_.removed_files = folder_.removed_files();
}

void RecordWriter::serve(Book& book) {
  // No more than a queue can hold, so that one that is filled as fast as it is emptied does not keep the others
  // waiting.
  RecordEntry entry;
  for (size_t taken = 0; taken <= book.session->ring.capacity() && book.session->ring.front(entry);) {
    taken += sizeof(RecordHead) + entry.message.size();
    std::string large;
    if (entry.head.beside) entry.message = large = book.session->large.take();
    write_entry(book, entry);
    book.session->ring.pop();
  }
  write_attachments(book);
  if (book.file) check(book, book.file->tend(now_ns_()));

  const Session& session = *book.session;
  tell_drops(book, v1::Gap::QUEUE_FULL, session.dropped_queue_full.load(std::memory_order_relaxed),
             book.queue_full);
  tell_drops(book, v1::Gap::TOO_LARGE,
             session.dropped_too_large.load(std::memory_order_relaxed) + book.viewers_too_large,
             book.too_large);
}

void RecordWriter::tell_drops(const Book& book, v1::Gap::Reason reason, uint64_t dropped, Drops& known) {
  const std::string& session_id = book.session->info.session_id();
  const uint64_t more = dropped - std::exchange(known.seen, dropped);
  const bool lasted = std::exchange(known.lasts, more > 0);
  if (lasted && !known.lasts) warn_({reason, session_id, "messages are written again", true});
  if (!lasted && known.lasts) warn_({reason, session_id, reason_text(reason)});
  if (more == 0) return;
  const std::lock_guard lock(mutex_);
  counts_.dropped_messages += more;
}

void RecordWriter::write_entry(Book& book, const RecordEntry& entry) {
  const RecordHead& head = entry.head;
  const RecordMessage message{static_cast<RecordTopic>(head.topic), head.sequence, head.log_time_ns,
                              head.publish_time_ns, entry.message};
  // A file that begins here has all that came before at its head.
  const bool has_file = ensure_file(book);
  if (message.topic == RecordTopic::kOpen) book.open = entry.message;
  if (message.topic == RecordTopic::kOpened) book.opened = entry.message;
  const Status written = has_file ? book.file->write(message, now_ns_()) : Status{};
  // One message may be refused for its size; then the file goes on.
  if (!written && !book.file->status()) lose_file(book, written.error());
  take_in(book, message, has_file && written);
  if (!has_file || !written) return lose_messages(book, lost_with(message));
  {
    const std::lock_guard lock(mutex_);
    ++counts_.messages;
  }
  if (book.file) check(book, book.file->status());
  // Never so soon that parts would be heads alone.
  const uint64_t limit = std::max(part_limit(), 2 * book.head_size);
  if (!book.file || book.file->bytes() - book.session->attachment_bytes < limit) return;
  write_attachments(book);
  close_file(book);
}

// Once it is parsed: for the head of the next part, lost or not, and when it is in the file for viewers.
void RecordWriter::take_in(Book& book, const RecordMessage& message, bool written) {
  const uint64_t time_ns = message.log_time_ns;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    write_for_viewers(book, topic, time_ns, made);
  };
  const auto parsed = [&](auto wire, auto take, auto remember) {
    if (!wire.ParseFromArray(message.bytes.data(), static_cast<int>(message.bytes.size()))) return;
    if (written && settings_.for_viewers) (book.viewers.*take)(wire, time_ns, emit);
    remember(wire);
  };
  const auto forget = [](const auto&) {};
  const TickStamp stamp{message.sequence, message.log_time_ns, message.publish_time_ns};
  switch (message.topic) {
    case RecordTopic::kOpen:
      return parsed(v1::OpenSession(), &ViewerChannels::take_open,
                    [&](const v1::OpenSession& open) { book.fold.take_open(open); });
    case RecordTopic::kTick:
      return parsed(v1::Tick(), &ViewerChannels::take_tick,
                    [&](v1::Tick& tick) { book.fold.take_tick(std::move(tick), stamp); });
    case RecordTopic::kReply:
      return parsed(v1::CameraReply(), &ViewerChannels::take_reply,
                    [&](const v1::CameraReply& reply) { book.fold.take_reply(reply); });
    case RecordTopic::kRejection:
      return parsed(v1::Rejection(), &ViewerChannels::take_rejection,
                    [&](const v1::Rejection& rejection) { book.fold.take_rejection(rejection); });
    case RecordTopic::kFault:
      return parsed(v1::Fault(), &ViewerChannels::take_fault, forget);
    case RecordTopic::kGap:
      return parsed(v1::Gap(), &ViewerChannels::take_gap, forget);
    default:
      return;
  }
}

// The bytes of the message. One that is too large has no number, for no Gap tells of it: a session is whole without it.
size_t RecordWriter::write_for_viewers(Book& book, RecordTopic topic, uint64_t time_ns,
                                       const google::protobuf::MessageLite& made) {
  const std::string bytes = made.SerializeAsString();
  if (bytes.size() > settings_.max_message_bytes) {
    ++book.viewers_too_large;
    return 0;
  }
  const uint32_t sequence = ++book.sequences[static_cast<size_t>(topic)];
  // What cannot be written here cannot be written at the next message either, which tells.
  (void)book.file->write({topic, sequence, time_ns, time_ns, bytes}, now_ns_());
  return bytes.size();
}

void RecordWriter::write_attachments(Book& book) {
  Session& session = *book.session;
  // They wait for a file rather than being lost.
  while (session.attachments_done < session.attached.count() && ensure_file(book)) {
    const auto attached = session.attached.at(session.attachments_done);
    const Status done = book.file->attach(attached->head);
    if (done) ++session.attachments_done, session.attachment_bytes += attached->data->size();
    check(book, done);
    if (!done) return;
  }
}

// Of a new file. Large ones are in the first part alone: the ring of files is there for what happened.
void RecordWriter::begin_attachments(Book& book) {
  Session& session = *book.session;
  session.attachment_bytes = 0;
  const bool fits = book.part == 1 || session.attached.bytes() <= part_limit() / 2;
  session.attachments_done = fits ? 0 : session.attached.count();
}

bool RecordWriter::ensure_file(Book& book) {
  if (book.file) return true;
  const uint64_t now_ns = now_ns_();
  if (now_ns < book.retry_ns) return false;
  if (no_room_) {
    lose_file(book, *no_room_);
    return false;
  }
  v1::RecordingInfo info = book.session->info;
  Result<std::unique_ptr<ByteSink>> sink = fail(ErrorCode::kAlreadyExists, "", "");
  // A name that is taken, by a session with the same id in the same millisecond, is passed over.
  for (int tries = 0; !sink && sink.error().code == ErrorCode::kAlreadyExists && tries < kNameTries;
       ++tries) {
    info.set_part(++book.part);
    book.file_name = recording_name(info.start_time_ns(), info.session_id(), info.part());
    sink = folder_.create(book.file_name);
  }
  if (!sink) {
    --book.part;
    lose_file(book, sink.error());
    return false;
  }
  McapWriterOptions options;
  options.library = "sightline " + info.server_version();
  options.chunk_bytes = settings_.chunk_bytes;
  options.chunk_time = settings_.chunk_time;
  options.zstd_level = settings_.zstd_level;
  options.max_message_bytes = settings_.max_message_bytes;
  // The info comes first, and must not tell of a tick that does not follow.
  const std::string folded = folded_tick(book);
  info.set_folded_ticks(folded.empty() ? 0 : book.fold.ticks());
  book.file = std::make_unique<SessionFile>(std::move(*sink), info, now_ns, std::move(options));
  being_written_.insert(book.file_name);
  book.counted_bytes = 0;
  begin_attachments(book);
  write_head(book, folded, now_ns);
  book.head_bytes = book.file->bytes();
  book.head_chunks = book.file->chunks();
  {
    const std::lock_guard lock(mutex_);
    ++counts_.files;
  }
  if (Status ok = book.file->status(); !ok) lose_file(book, ok.error());
  return book.file != nullptr;
}

// All ticks that were answered, in one; empty: none were, or one message cannot say it.
std::string RecordWriter::folded_tick(const Book& book) const {
  if (book.fold.ticks() == 0) return {};
  std::string bytes = book.fold.tick().SerializeAsString();
  return bytes.size() <= settings_.max_message_bytes ? std::move(bytes) : std::string();
}

// So that a part which begins within a session can be read by itself, and says what is missing before it: the opening,
// what all ticks since then have changed, and those that are not answered yet.
void RecordWriter::write_head(Book& book, const std::string& folded, uint64_t now_ns) {
  book.head_size = 0;
  const auto write = [&](RecordTopic topic, const TickStamp& stamp, const std::string& bytes) {
    book.head_size += bytes.size();
    return book.file->write({topic, stamp.sequence, stamp.log_ns, stamp.publish_ns, bytes}, now_ns);
  };
  const TickStamp again{1, now_ns, now_ns};
  if (book.open) (void)write(RecordTopic::kOpen, again, *book.open);
  if (book.opened) (void)write(RecordTopic::kOpened, again, *book.opened);
  if (book.open && settings_.for_viewers)
    book.viewers.emit_still(now_ns, [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
      book.head_size += write_for_viewers(book, topic, now_ns, made);
    });
  if (!folded.empty())
    (void)write(RecordTopic::kTick, book.fold.stamp(), folded);
  else if (book.fold.ticks() > 0)
    (void)write(RecordTopic::kGap, again, unsaid(book.fold, *book.session).SerializeAsString());
  for (const WaitingTick& waiting : book.fold.waiting())
    (void)write(RecordTopic::kTick, waiting.stamp, waiting.tick.SerializeAsString());
  if (book.gap.messages() > 0) (void)write(RecordTopic::kGap, again, book.gap.SerializeAsString());
  book.file->forget_waiting();
}

// Looks after what a write said, and keeps count of bytes.
void RecordWriter::check(Book& book, const Status& done) {
  const uint64_t more = book.file->bytes() - std::exchange(book.counted_bytes, book.file->bytes());
  bytes_since_housekeeping_ += more;
  {
    const std::lock_guard lock(mutex_);
    counts_.bytes += more;
  }
  if (done && book.file->chunks() > book.head_chunks) {
    // Something beyond the head is on the disk, and with it the gap.
    book.gap.Clear();
    if (std::exchange(book.warned, false))
      warn_({v1::Gap::REASON_UNSPECIFIED, book.session->info.session_id(), "it is written again", true});
    book.session->failing.store(false, std::memory_order_relaxed);
  }
  // A refusal of one message (too large for the format's readers) is not the file's end.
  if (!done && !book.file->status()) lose_file(book, done.error());
}

void RecordWriter::close_file(Book& book) {
  if (!book.file) return;
  const Status done = book.file->finish();
  check(book, done);
  if (!book.file) return;  // lost on its last bytes
  book.file.reset();
  being_written_.erase(book.file_name);
}

void RecordWriter::lose_file(Book& book, const Error& error) {
  const bool full = error.code == ErrorCode::kResourceExhausted;
  LostMessages waiting;
  if (book.file) {
    waiting = book.file->waiting();
    const bool nothing_in_it = book.file->bytes() <= book.head_bytes;
    book.file.reset();
    being_written_.erase(book.file_name);
    // A disk that stays full is not to be littered with a file at every try.
    if (nothing_in_it && folder_.remove(book.file_name)) --book.part;
  }
  book.retry_ns = now_ns_() + kHousekeepingNs;
  book.session->failing.store(true, std::memory_order_relaxed);
  book.gap.set_text(to_string(error));
  book.gap.set_reason(full ? v1::Gap::NO_SPACE : v1::Gap::WRITE_FAILED);
  if (waiting.messages > 0) lose_messages(book, waiting);
  if (!std::exchange(book.warned, true)) {
    std::string text = reason_text(book.gap.reason());
    warn_({book.gap.reason(), book.session->info.session_id(), text.append(": ").append(to_string(error))});
  }
  const std::lock_guard lock(mutex_);
  ++counts_.write_failures;
}

// What lost Gaps told of was counted where it was dropped, and must be told again.
void RecordWriter::lose_messages(Book& book, const LostMessages& lost) {
  add_to_gap(book.gap, book.gap.reason(), lost.messages + lost.told_of, lost.first_time_ns, lost.last_time_ns);
  book.session->dropped_by_writer.fetch_add(lost.messages, std::memory_order_relaxed);
  const std::lock_guard lock(mutex_);
  counts_.dropped_messages += lost.messages;
}

void RecordWriter::keep_house() {
  next_housekeeping_ns_ = now_ns_() + kHousekeepingNs;
  bytes_since_housekeeping_ = 0;
  // A file whose name is gone can be written to for ever, and nobody will ever see it.
  for (Book& book : books_)
    if (book.file && !folder_.exists(book.file_name))
      lose_file(book, Error{ErrorCode::kNotFound, book.file_name, "was removed while it was written"});
  no_room_.reset();
  Status room = folder_.make_room(now_ns_(), being_written_);
  if (room) return;
  // What was being written becomes the past, the oldest of which may go; the sessions go on in their next parts.
  for (Book& book : books_) close_file(book);
  room = folder_.make_room(now_ns_(), being_written_);
  if (room) return;
  no_room_ = room.error();
  for (Book& book : books_) lose_file(book, room.error());
}

// All sessions together stay within the total even when the ring of files holds nothing else: half of it for the
// parts being written, half for those before.
uint64_t RecordWriter::part_limit() const {
  const uint64_t share = settings_.limits.max_total_bytes / (2 * std::max<uint64_t>(books_.size(), 1));
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
