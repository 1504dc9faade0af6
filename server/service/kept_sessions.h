// Sessions that can go on in another stream: those whose client asked for it (OpenSession.resumable).
//
// Each has a token. When its stream breaks, the session is kept for a grace time, and a stream of the same client that
// shows the token takes it. If the former stream is still up, it has to give the session up first. The usual cause is a
// connection whose other end is gone, which the server has not noticed so far.
//
// A kept session keeps its place in the registry of streams, so it counts in all limits. It ends when the grace time is
// over, when the server drains, and when its client may no longer have sessions.
//
// Locks. A stream calls `keep` and `forget` with its own lock held. They may call `take_session` of the stream that
// waits for the session, which takes the lock of that one. A session goes from older to newer streams only, so there is
// no cycle. No function of a stream is called with the lock of this class held.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "server/base/mutex.h"
#include "server/schedule/step_stats.h"
#include "server/schedule/tick_pace.h"
#include "server/service/log.h"
#include "server/service/session_driver.h"
#include "server/service/stream_registry.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// A session without a stream.
struct DetachedSession {
  std::string token;
  std::unique_ptr<SessionDriver> driver;
  TickPace pace;
  std::deque<v1::ControlResponse> answers;  // of the newest turn; its client may not have received them
};

class ResumableStream : public Drainable {
 public:
  // Calls `keep`, or `forget` if there is nothing to keep, as soon as no step is under way. From any thread; returns at
  // once.
  virtual void give_session_up() = 0;
  // Answers `claim`. Null: there is no such session for this client. Otherwise the stream takes the session, and its
  // place in the registry from `holder`. False: it cannot, because it has ended or because the server drains; `session`
  // is as it was.
  virtual bool take_session(std::unique_ptr<DetachedSession>& session, const Drainable* holder) = 0;
};

// Thread-safe.
class KeptSessions {
 public:
  // The arguments must outlive it. `grace` 0: nothing is kept.
  KeptSessions(std::chrono::milliseconds grace, StreamRegistry& streams, StepStats& stats, const Log& log);
  // Ends the sessions that are kept. All streams must be gone.
  ~KeptSessions();
  KeptSessions(const KeptSessions&) = delete;
  KeptSessions& operator=(const KeptSessions&) = delete;

  bool enabled() const { return grace_.count() > 0; }
  std::chrono::milliseconds grace() const { return grace_; }

  // Takes note of an open session, and returns its token. Only if enabled.
  std::string issue(const std::string& client, const std::shared_ptr<ResumableStream>& stream);
  // The stream of a session broke, or gives it up. False: the session cannot be kept, and is as it was; `forget` must
  // follow.
  bool keep(const Drainable* stream, std::unique_ptr<DetachedSession>& session);
  // The session has ended.
  void forget(const std::string& token);
  // `claimant` wants to go on with a session. `take_session` answers it, here or on another thread.
  void claim(const std::string& token, const std::string& client, const std::shared_ptr<ResumableStream>& claimant);

 private:
  using Secret = std::array<unsigned char, 16>;
  using Time = std::chrono::steady_clock::time_point;
  class Place;

  struct Entry {
    Secret secret;
    std::string client;
    std::weak_ptr<ResumableStream> stream;     // that has the session
    std::weak_ptr<ResumableStream> claimant;   // that waits until `stream` gives it up
    std::unique_ptr<DetachedSession> session;  // null: a stream has it
    std::shared_ptr<Place> place;              // of a session that is kept
    Time expires;
  };
  using Entries = std::map<uint64_t, Entry>;

  bool pass_on(uint64_t number, std::unique_ptr<DetachedSession>& session, const Drainable* holder);
  bool put_away(uint64_t number, std::unique_ptr<DetachedSession>& session, const Drainable* holder,
                std::shared_ptr<Place> place, Time expires);
  void deny(ResumableStream& claimant);
  Entries::iterator find(const std::string& token, const std::string* client) NEEDS(mutex_);
  void end(uint64_t number, const grpc::Status& status);
  void end_those_that_expire();
  std::optional<Time> first_to_expire() const NEEDS(mutex_);

  // Constant after construction.
  const std::chrono::milliseconds grace_;
  StreamRegistry& streams_;
  StepStats& stats_;
  const Log& log_;

  Mutex mutex_;
  ConditionVariable wake_;
  Entries entries_ GUARDED(mutex_);
  uint64_t last_number_ GUARDED(mutex_) = 0;
  bool stopping_ GUARDED(mutex_) = false;

  std::thread thread_;  // ends those that expire
};

}  // namespace sightline
