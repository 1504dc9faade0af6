#include "server/service/read_timeout.h"

namespace sightline {

ReadTimeout::ReadTimeout(Timers& timers, grpc::ServerContext& context, std::chrono::milliseconds timeout)
    : timers_(timers), context_(context), timeout_(timeout), state_(std::make_shared<State>()) {}

ReadTimeout::~ReadTimeout() {
  end();
}

void ReadTimeout::begin() {
  const uint64_t turn = take_turn();
  timer_ = timers_.start(timeout_, [state = state_, context = &context_, turn] {
    const MutexLock lock(state->mutex);
    if (state->turns != turn) return;
    state->ran_out = true;
    context->TryCancel();
  });
}

void ReadTimeout::end() {
  take_turn();
  if (timer_) timers_.cancel(*timer_);
  timer_.reset();
}

uint64_t ReadTimeout::take_turn() {
  const MutexLock lock(state_->mutex);
  return ++state_->turns;
}

bool ReadTimeout::ran_out() const {
  const MutexLock lock(state_->mutex);
  return state_->ran_out;
}

}  // namespace sightline
