// Ends a call of gRPC's synchronous API whose client sends nothing: its handler waits in Read, which takes no deadline.
#pragma once

#include <grpcpp/server_context.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>

#include "server/base/mutex.h"
#include "server/rpc/timers.h"

namespace sightline {

// The time limit of one call, used on its handler's thread. The arguments must outlive it.
class ReadTimeout {
 public:
  ReadTimeout(Timers& timers, grpc::ServerContext& context, std::chrono::milliseconds timeout);
  ~ReadTimeout();
  ReadTimeout(const ReadTimeout&) = delete;
  ReadTimeout& operator=(const ReadTimeout&) = delete;

  // Starts the timer. When it runs out the call is cancelled, so that Read returns false; the client sees CANCELLED.
  void begin();
  // Stops the timer: a message came, or none is expected.
  void end();
  // True when the call was cancelled by the timer.
  bool ran_out() const;

 private:
  // Shared with the timer, which can run out while it is being stopped.
  struct State {
    Mutex mutex;
    uint64_t turns GUARDED(mutex) = 0;  // number of starts and stops; a timer of an older turn is ignored
    bool ran_out GUARDED(mutex) = false;
  };

  uint64_t take_turn();

  Timers& timers_;
  grpc::ServerContext& context_;
  const std::chrono::milliseconds timeout_;
  const std::shared_ptr<State> state_;
  std::optional<Timers::Timer> timer_;
};

}  // namespace sightline
