#include "server/base/work_limit.h"

#include <ctime>

namespace sightline {

int64_t thread_cpu_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

WorkLimit::Part::Part(WorkLimit* limit) : limit_(limit) {
  if (!limit_) return;
  const MutexLock lock(limit_->mutex_);
  OfThread& thread = limit_->threads_[std::this_thread::get_id()];
  if (thread.parts++ == 0) thread.charged_ns = limit_->rules_.clock();
}

WorkLimit::Part::~Part() {
  if (!limit_) return;
  limit_->charge_this_thread();
  const MutexLock lock(limit_->mutex_);
  const auto thread = limit_->threads_.find(std::this_thread::get_id());
  if (--thread->second.parts == 0) limit_->threads_.erase(thread);
}

void WorkLimit::charge_this_thread() {
  const int64_t now_ns = rules_.clock();
  const MutexLock lock(mutex_);
  int64_t& charged_ns = threads_.at(std::this_thread::get_id()).charged_ns;
  spent_ns_ += now_ns - charged_ns;
  charged_ns = now_ns;
}

void WorkLimit::Part::look() {
  units_ = 0;
  limit_->charge_this_thread();
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
