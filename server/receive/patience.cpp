#include "server/receive/patience.h"

namespace sightline {

Patience::Patience(grpc::ServerContext& context, std::chrono::milliseconds timeout)
    : context_(context), timeout_(timeout), state_(std::make_shared<State>()) {}

Patience::~Patience() {
  end();
}

void Patience::begin() {
  end();
  uint64_t wait = 0;
  {
    const std::lock_guard lock(state_->mutex);
    state_->waiting = &context_;
    wait = ++state_->waits;
  }
  alarm_.emplace();
  alarm_->Set(std::chrono::system_clock::now() + timeout_, [state = state_, wait](bool went_off) {
    const std::lock_guard lock(state->mutex);
    if (!went_off || !state->waiting || state->waits != wait) return;
    state->ran_out = true;
    state->waiting->TryCancel();
  });
}

void Patience::end() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->waiting = nullptr;
  }
  alarm_.reset();
}

bool Patience::ran_out() const {
  const std::lock_guard lock(state_->mutex);
  return state_->ran_out;
}

}  // namespace sightline
