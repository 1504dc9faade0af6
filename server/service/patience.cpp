#include "server/service/patience.h"

namespace sightline {

Patience::Patience(grpc::ServerContext& context, std::chrono::milliseconds timeout)
    : context_(context), timeout_(timeout), state_(std::make_shared<State>()) {}

Patience::~Patience() {
  end();
}

void Patience::begin() {
  const uint64_t turn = take_turn();
  alarm_.emplace();
  alarm_->Set(std::chrono::system_clock::now() + timeout_, [state = state_, context = &context_, turn](bool went_off) {
    const std::lock_guard lock(state->mutex);
    if (!went_off || state->turns != turn) return;
    state->ran_out = true;
    context->TryCancel();
  });
}

void Patience::end() {
  take_turn();
  alarm_.reset();
}

uint64_t Patience::take_turn() {
  const std::lock_guard lock(state_->mutex);
  return ++state_->turns;
}

bool Patience::ran_out() const {
  const std::lock_guard lock(state_->mutex);
  return state_->ran_out;
}

}  // namespace sightline
