#include "server/base/work_limit.h"

#include <ctime>

namespace sightline {

int64_t thread_cpu_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

void WorkLimit::Part::charge() {
  const int64_t now_ns = limit_->rules_.clock();
  limit_->spent_ns_ += now_ns - charged_ns_;
  charged_ns_ = now_ns;
}

void WorkLimit::Part::look() {
  units_ = 0;
  charge();
  if (limit_->ended()) return;
  if (limit_->unwanted_ && limit_->unwanted_())
    limit_->end_ = End::kUnwanted;
  else if (limit_->rules_.most_ns > 0 && limit_->spent_ns_ > limit_->rules_.most_ns)
    limit_->end_ = End::kTooLong;
}

Error WorkLimit::error() const {
  if (end_ == End::kTooLong) return {ErrorCode::kResourceExhausted, "", rules_.refusal};
  return {ErrorCode::kUnavailable, "", "it was given up, since nobody waits for it any more"};
}

}  // namespace sightline
