#include "server/service/read_timeout.h"

namespace sightline {

ReadTimeout::ReadTimeout(grpc::ServerContext& context, std::chrono::milliseconds timeout)
    : context_(context), timeout_(timeout), state_(std::make_shared<State>()) {}

ReadTimeout::~ReadTimeout() {
  end();
}

void ReadTimeout::begin() {
  const uint64_t turn = take_turn();
  alarm_.emplace();
  alarm_->Set(std::chrono::system_clock::now() + timeout_, [state = state_, context = &context_, turn](bool went_off) {
    const std::lock_guard lock(state->mutex);
    if (!went_off || state->turns != turn) return;
    state->ran_out = true;
    context->TryCancel();
  });
}

void ReadTimeout::end() {
  take_turn();
  alarm_.reset();
}

uint64_t ReadTimeout::take_turn() {
  const std::lock_guard lock(state_->mutex);
  return ++state_->turns;
}

bool ReadTimeout::ran_out() const {
  const std::lock_guard lock(state_->mutex);
  return state_->ran_out;
}

}  // namespace sightline
