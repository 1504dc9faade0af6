// Ends a call of gRPC's synchronous API whose client has gone silent: its handler waits in Read, which takes no deadline.
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
class Patience {
 public:
  Patience(grpc::ServerContext& context, std::chrono::milliseconds timeout);
  ~Patience();
  Patience(const Patience&) = delete;
  Patience& operator=(const Patience&) = delete;

  // From here the client may say nothing for the timeout. Then the call is cancelled, so that Read returns false; the client sees
  // CANCELLED.
  void begin();
  // It spoke, or is no longer waited for.
  void end();
  bool ran_out() const;

 private:
  // An alarm that goes off while it is taken back tells the state, which outlives both.
  struct State {
    std::mutex mutex;
    // Guarded by mutex.
    grpc::ServerContext* waiting = nullptr;  // the call, while it is waited for
    uint64_t waits = 0;                      // so far; an alarm is of one of them
    bool ran_out = false;
  };

  grpc::ServerContext& context_;
  const std::chrono::milliseconds timeout_;
  const std::shared_ptr<State> state_;
  std::optional<grpc::Alarm> alarm_;
};

}  // namespace sightline
