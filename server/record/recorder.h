// Records sessions without ever making one wait. Every session serialises its messages into a bounded queue of its own.
// One thread empties all queues. It writes one MCAP file for each session, in parts, into a bounded ring of files.
//
//   RecordWriter writer(settings, *system_files(), wall_clock_ns, warn);
//   RecordThread thread(writer, std::chrono::milliseconds(50));
//   std::unique_ptr<SessionRecorder> recorder = writer.open_session(info);
//   recorder->record(RecordTopic::kTick, {arrived_ns, arrived_ns}, tick);
//
// Messages that cannot be written are dropped and counted. That happens when a queue is full (a slow disk) or there is
// no file (a full disk, a removed folder). The first drop causes one warning, and `degraded()` is true. Once writing
// works again, the file holds a Gap that counts the missing messages; their sequence numbers are missing too. A full
// disk and a removed folder are tried again every second.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/base/mutex.h"
#include "server/record/level_view.h"
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
  // A kill of the process loses at most this much time and the messages in the queue. Keep both together under a
  // second. The opening is written at once.
  std::chrono::nanoseconds chunk_time{500'000'000};
  uint64_t chunk_bytes = uint64_t{1} << 20;
  int zstd_level = 1;
  uint64_t max_message_bytes = kMaxMessageBytes;  // larger ones are dropped; tests set less
  bool for_viewers = true;                        // adds topics for ordinary viewers, made on the writing thread
};

// Nanoseconds since 1970 (UTC). Log time: when the message takes effect in the session; a message that is not later
// than the one before gets the next nanosecond, so that a file sorted by log time is in the order of recording. Publish
// time: when the server received or sent it.
struct RecordTimes {
  uint64_t log_ns = 0;
  uint64_t publish_ns = 0;
};

struct RecordWarning {
  v1::Gap::Reason reason = v1::Gap::REASON_UNSPECIFIED;
  std::string session_id;
  std::string text;   // for a person
  bool over = false;  // the trouble of an earlier warning has ended; the file says what is missing
};

// Since the start, of all sessions; for metrics.
struct RecordCounts {
  uint64_t messages = 0;          // written
  uint64_t bytes = 0;             // of files
  uint64_t dropped_messages = 0;  // includes messages for viewers over `max_message_bytes`
  uint64_t write_failures = 0;
  uint64_t files = 0;          // begun
  uint64_t removed_files = 0;  // by the limits
  uint64_t open_sessions = 0;
  uint64_t failing_sessions = 0;  // that have no file now
};

namespace record_internal {
struct Waker;
struct Session;
}  // namespace record_internal

// The session's end of the queue. Its calls must not overlap. None of them waits, or takes a lock that the writer holds
// while it works. A message larger than half of the queue (an opening with thousands of instances) goes into memory of
// its own. Nothing else allocates, except attach().
class SessionRecorder {
 public:
  explicit SessionRecorder(std::shared_ptr<record_internal::Session> session);
  // Everything recorded so far is still written, and the file is finished.
  ~SessionRecorder();
  SessionRecorder(const SessionRecorder&) = delete;
  SessionRecorder& operator=(const SessionRecorder&) = delete;

  // Takes topics up to kFault, and kMemory. Returns false when the message was dropped and counted: the queue is full,
  // or the message is over `max_message_bytes`. The message is serialised during the call.
  bool record(RecordTopic topic, RecordTimes times, const google::protobuf::MessageLite& message);
  // The same for a message that is serialised already.
  bool record(RecordTopic topic, RecordTimes times, std::string_view serialised);

  // Puts `data`, e.g. the scene, into the file and into every later part, as long as all attachments together take at
  // most half of a part. `data` is held as long as the session lives. Returns false, and takes nothing, when the
  // attachments of the session would be more than kMaxAttachments or over kMaxAttachmentBytes.
  bool attach(std::string name, std::string content_type, uint64_t log_time_ns,
              std::shared_ptr<const std::string> data);
  static constexpr size_t kMaxAttachments = 4096;

  // True when the file would soon end: a kMemory message that comes now ends it, and the next part begins with that
  // memory.
  bool wants_memory() const;

  // What viewers see of the scene file. Call it before the first record().
  void show_level(std::shared_ptr<const LevelView> level);

  // Name of the first part, within the folder.
  std::string file_name() const;

  // True when something was dropped and nothing recorded since, or when there is no file to write to. For the flag in a
  // reply.
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
  uint64_t newest_ns_ = 0;  // log time of the last message
  v1::Gap gap_;             // messages dropped since the last one that was recorded
};

// The writer's end. Only open_session(), counts(), folder_trouble() and wake() may be called while another thread is in
// run_once() or finish().
class RecordWriter {
 public:
  using Clock = std::function<uint64_t()>;  // ns since 1970 (UTC)
  using Warn = std::function<void(const RecordWarning&)>;

  // `files` must outlive it. run_once() calls `warn` once when a session begins to lose messages for a reason, and once
  // when the session has recovered.
  RecordWriter(RecordSettings settings, RecordFileSystem& files, Clock now_ns, Warn warn);
  // Writes the queued messages and finishes every file. Recorders may outlive it; their later messages are lost.
  ~RecordWriter();

  // The info's `version`, `part`, `start_time_ns` and `snapshot_ticks` are filled here. May be called from any thread.
  std::unique_ptr<SessionRecorder> open_session(v1::RecordingInfo info);

  // Writes the queued messages and finishes every file, as at the end of its life. Nothing but the destructor may
  // follow on this thread.
  void finish();

  // Empties the queues into the files, closes chunks whose time has come, finishes the files of ended sessions and
  // keeps the folder within its limits. Never fails: failures are counted and warned of.
  void run_once();

  // Returns when a queue is half full, when woken, or after `timeout`.
  void wait(std::chrono::nanoseconds timeout);
  void wake();

  // From any thread.
  RecordCounts counts() const;

  // Finds out whether files can be made in the folder, and warns when they cannot. Called before the first run_once().
  void try_folder();
  // Why no file can be begun at present; empty: nothing is known to be in the way. From any thread.
  std::optional<Error> folder_trouble() const;

 private:
  struct ActiveSession;  // the writer's state of one session
  struct Drops;

  void adopt_new_sessions();
  void serve(ActiveSession& active);
  void write_entry(ActiveSession& active, const RecordEntry& entry);
  Status write_through(ActiveSession& active, const RecordMessage& message);
  void take_in(ActiveSession& active, const RecordMessage& message, bool written);
  size_t write_for_viewers(ActiveSession& active, RecordTopic topic, uint64_t time_ns,
                           const google::protobuf::MessageLite& made);
  void write_attachments(ActiveSession& active);
  void begin_attachments(ActiveSession& active);
  bool ensure_file(ActiveSession& active, uint64_t time_ns);
  std::string snapshot_tick(const ActiveSession& active) const;
  void write_head(ActiveSession& active, const std::string& snapshot, uint64_t time_ns, uint64_t now_ns);
  void close_file(ActiveSession& active);
  void lose_file(ActiveSession& active, const Error& error);
  void lose_messages(ActiveSession& active, const LostMessages& lost);
  void report_drops(const ActiveSession& active, v1::Gap::Reason reason, uint64_t dropped, Drops& known);
  void housekeep();
  void warn_of_stuck_files();
  void set_folder_trouble(std::optional<Error> trouble);
  void check(ActiveSession& active, const Status& done);
  uint64_t part_limit() const;

  const RecordSettings settings_;
  const Clock now_ns_;
  const Warn warn_;
  RecordFolder folder_;
  std::list<ActiveSession> active_;
  std::set<std::string> being_written_;
  std::optional<Error> no_room_;  // of the folder; no file is begun while it is set
  uint64_t next_housekeeping_ns_ = 0;
  uint64_t bytes_since_housekeeping_ = 0;
  size_t stuck_files_ = 0;  // that were warned of

  mutable Mutex mutex_;
  std::vector<std::shared_ptr<record_internal::Session>> new_sessions_ GUARDED(mutex_);
  RecordCounts counts_ GUARDED(mutex_);
  std::optional<Error> folder_trouble_ GUARDED(mutex_);

  const std::shared_ptr<record_internal::Waker> waker_;  // shared with the sessions, which wake the writer
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
