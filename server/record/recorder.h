// Records sessions without ever making one wait. Every session puts its messages, serialised, into a bounded queue of
// its own; one thread takes them out of all queues and writes one MCAP file a session, in parts, into a bounded ring
// of files.
//
//   RecordWriter writer(settings, *system_files(), wall_clock_ns, warn);
//   RecordThread thread(writer, std::chrono::milliseconds(50));
//   std::unique_ptr<SessionRecorder> recorder = writer.open_session(info);
//   recorder->record(RecordTopic::kTick, {arrived_ns, arrived_ns}, tick);
//
// What cannot be written is dropped and counted: when a queue is full (a slow disk), and when there is no file (a
// full disk, a folder that was removed). Then a warning is given once, `degraded()` is true, and once writing works
// again the file holds a Gap that says what is missing, as do the sequence numbers. A full disk and a removed folder
// are tried again every second.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/record/record_folder.h"
#include "server/record/record_ring.h"
#include "server/record/session_file.h"
#include "server/record/session_snapshot.h"
#include "server/record/viewer_channels.h"

namespace google::protobuf {
class MessageLite;
}

namespace sightline {

struct RecordSettings {
  std::string folder = {};
  RecordLimits limits = {};
  size_t queue_bytes = size_t{1} << 20;  // a session; rounded up to a power of two
  // A kill loses at most this and what stands in the queue: keep both together under a second.
  std::chrono::nanoseconds chunk_time{500'000'000};
  uint64_t chunk_bytes = uint64_t{1} << 20;
  int zstd_level = 1;
  uint64_t max_message_bytes = kMaxMessageBytes;  // larger ones are dropped; tests have less
  bool for_viewers = true;  // also topics that ordinary viewers understand, made on the writing thread
};

// Nanoseconds since 1970 (UTC). Log time: when the server had it. Publish time: when its sender sent it, where that
// is known.
struct RecordTimes {
  uint64_t log_ns = 0;
  uint64_t publish_ns = 0;
};

struct RecordWarning {
  v1::Gap::Reason reason = v1::Gap::REASON_UNSPECIFIED;
  std::string session_id;
  std::string text;   // for a person
  bool over = false;  // the trouble that was warned of has ended; the file says what is missing
};

// Since the start, of all sessions; for metrics.
struct RecordCounts {
  uint64_t messages = 0;  // written
  uint64_t bytes = 0;     // of files
  uint64_t dropped_messages = 0;  // those for viewers too that are over `max_message_bytes`
  uint64_t write_failures = 0;
  uint64_t files = 0;          // begun
  uint64_t removed_files = 0;  // by the limits
  uint64_t open_sessions = 0;
  uint64_t failing_sessions = 0;  // that have no file now
};

namespace record_internal {
struct Bell;
struct Session;
}

// One session's end of the queue. Its calls must not overlap each other; a session's never do. None of them waits or
// takes a lock that the writer holds while it works. What is larger than half of the queue (an opening with thousands
// of instances) goes beside it, in memory of its own; nothing else allocates but attach().
class SessionRecorder {
 public:
  explicit SessionRecorder(std::shared_ptr<record_internal::Session> session);
  // What was recorded is still written, and the file finished.
  ~SessionRecorder();
  SessionRecorder(const SessionRecorder&) = delete;
  SessionRecorder& operator=(const SessionRecorder&) = delete;

  // Of the topics only those up to kFault. False: dropped, and counted: the queue is full, or the message is over
  // `max_message_bytes`. The message is serialised here and not held.
  bool record(RecordTopic topic, RecordTimes times, const google::protobuf::MessageLite& message);
  // The same with the bytes at hand.
  bool record(RecordTopic topic, RecordTimes times, std::string_view serialised);

  // Puts `data` into the file, e.g. the scene, and into every later part while all of them together take at most half
  // of one: so it is held as long as the session lasts. False, and not taken, when all of a session would be more than
  // kMaxAttachments or over kMaxAttachmentBytes.
  bool attach(std::string name, std::string content_type, uint64_t log_time_ns,
              std::shared_ptr<const std::string> data);
  static constexpr size_t kMaxAttachments = 4096;

  // Of its first part, within the folder.
  std::string file_name() const;

  // Something was dropped and nothing has been taken since, or there is no file to write to. For the flag in a reply.
  bool degraded() const;
  uint64_t dropped() const;

 private:
  char* reserve(RecordTopic topic, RecordTimes times, size_t size);
  void commit(RecordTopic topic, RecordTimes times, size_t size, bool beside = false);
  bool record_beside(RecordTopic topic, RecordTimes times, std::string serialised);
  bool record_gap(RecordTimes times);
  void drop(RecordTimes times, v1::Gap::Reason reason);

  const std::shared_ptr<record_internal::Session> session_;
  std::array<uint32_t, kRecordTopics> sequences_{};
  v1::Gap gap_;  // what was dropped since the last message that was taken
};

// The writing end. Only open_session(), counts() and wake() may be called while another thread is in run_once().
class RecordWriter {
 public:
  using Clock = std::function<uint64_t()>;  // ns since 1970 (UTC)
  using Warn = std::function<void(const RecordWarning&)>;

  // `files` must outlive it. `warn` is called by run_once(): once when a session begins to lose messages for a
  // reason, once when it has recovered, and again only after that.
  RecordWriter(RecordSettings settings, RecordFileSystem& files, Clock now_ns, Warn warn);
  // Writes what is queued and finishes every file. Recorders may outlive it; what they take then goes nowhere.
  ~RecordWriter();

  // The info's `version`, `part`, `start_time_ns` and `folded_ticks` are filled here. May be called from any thread.
  std::unique_ptr<SessionRecorder> open_session(v1::RecordingInfo info);

  // Takes what stands in the queues, writes it, closes chunks whose time has come, finishes the files of sessions
  // that ended and keeps the folder within its limits. Never fails: what fails is counted and warned of.
  void run_once();

  // Returns when a queue is half full, when woken, or after `timeout`.
  void wait(std::chrono::nanoseconds timeout);
  void wake();

  // From any thread.
  RecordCounts counts() const;

 private:
  struct Book;  // what the writer knows of one session
  struct Drops;

  void adopt_new_sessions();
  void serve(Book& book);
  void write_entry(Book& book, const RecordEntry& entry);
  void take_in(Book& book, const RecordMessage& message, bool written);
  size_t write_for_viewers(Book& book, RecordTopic topic, uint64_t time_ns,
                           const google::protobuf::MessageLite& made);
  void write_attachments(Book& book);
  void begin_attachments(Book& book);
  bool ensure_file(Book& book);
  std::string folded_tick(const Book& book) const;
  void write_head(Book& book, const std::string& folded, uint64_t now_ns);
  void close_file(Book& book);
  void lose_file(Book& book, const Error& error);
  void lose_messages(Book& book, const LostMessages& lost);
  void tell_drops(const Book& book, v1::Gap::Reason reason, uint64_t dropped, Drops& known);
  void keep_house();
  void check(Book& book, const Status& done);
  uint64_t part_limit() const;

  const RecordSettings settings_;
  const Clock now_ns_;
  const Warn warn_;
  RecordFolder folder_;
  std::list<Book> books_;
  std::set<std::string> being_written_;
  std::optional<Error> no_room_;  // of the folder; files are not begun while it stands
  uint64_t next_housekeeping_ns_ = 0;
  uint64_t bytes_since_housekeeping_ = 0;

  mutable std::mutex mutex_;
  // guarded by mutex_
  std::vector<std::shared_ptr<record_internal::Session>> new_sessions_;
  RecordCounts counts_;

  const std::shared_ptr<record_internal::Bell> bell_;  // shared with sessions: one of them asks for the writer
};

// Runs a writer until it is destroyed.
class RecordThread {
 public:
  RecordThread(RecordWriter& writer, std::chrono::nanoseconds period);
  ~RecordThread();

 private:
  RecordWriter& writer_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace sightline
