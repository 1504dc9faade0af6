// Ends a call of gRPC's synchronous API whose client has gone silent: its handler waits in Read, which takes no deadline. It goes by a
// timer of gRPC's, not by its callback API (server/README.md says why none uses that).
#pragma once

#include <grpcpp/alarm.h>
#include <grpcpp/server_context.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>

namespace sightline {

// Of one call, on its handler's thread. `context` must outlive it.
class ReadTimeout {
 public:
  ReadTimeout(grpc::ServerContext& context, std::chrono::milliseconds timeout);
  ~ReadTimeout();
  ReadTimeout(const ReadTimeout&) = delete;
  ReadTimeout& operator=(const ReadTimeout&) = delete;

  // From here the client may say nothing for the timeout. Then the call is cancelled, so that Read returns false; the client sees
  // CANCELLED.
  void begin();
  // It spoke, or is no longer waited for.
  void end();
  // Whether the call was cancelled so.
  bool ran_out() const;

 private:
  // An alarm that goes off while it is taken back tells the state, which outlives both.
  struct State {
    std::mutex mutex;
    // Guarded by mutex.
    uint64_t turns = 0;  // how often a wait began or ended: an alarm that was set at another is of no account
    bool ran_out = false;
  };

  uint64_t take_turn();

  grpc::ServerContext& context_;
  const std::chrono::milliseconds timeout_;
  const std::shared_ptr<State> state_;
  std::optional<grpc::Alarm> alarm_;
};

}  // namespace sightline
