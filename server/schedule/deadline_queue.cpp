#include "server/schedule/deadline_queue.h"

#include <algorithm>
#include <cassert>
#include <tuple>

namespace sightline {

bool DeadlineQueue::EarlierDeadline::operator()(const Flow* a, const Flow* b) const {
  return std::tie(a->deadline_ns_, a->number_) < std::tie(b->deadline_ns_, b->number_);
}

bool DeadlineQueue::LessServed::operator()(const Flow* a, const Flow* b) const {
  return std::tie(a->start_ns_, a->deadline_ns_, a->number_) <
         std::tie(b->start_ns_, b->deadline_ns_, b->number_);
}

void DeadlineQueue::insert(Flow& flow) {
  by_deadline_.insert(&flow);
  by_service_.insert(&flow);
}

void DeadlineQueue::remove(Flow& flow) {
  by_deadline_.erase(&flow);
  by_service_.erase(&flow);
}

void DeadlineQueue::push(Flow& flow, int64_t deadline_ns) {
  assert(!flow.waits_);
  flow.deadline_ns_ = deadline_ns;
  flow.start_ns_ = std::max(flow.served_ns_, virtual_ns_ - kClaimNs);
  flow.number_ = ++pushes_;
  flow.waits_ = true;
  insert(flow);
}

void DeadlineQueue::check_deadline(int64_t deadline_ns, int64_t now_ns) {
  if (deadline_ns < now_ns && !overloaded(now_ns)) fair_until_ns_ = now_ns + kFairForNs;
}

DeadlineQueue::Flow* DeadlineQueue::pop(int64_t now_ns) {
  if (empty()) return nullptr;
  check_deadline((*by_deadline_.begin())->deadline_ns_, now_ns);
  Flow& flow = overloaded(now_ns) ? **by_service_.begin() : **by_deadline_.begin();
  remove(flow);
  flow.waits_ = false;
  flow.popped_deadline_ns_ = flow.deadline_ns_;
  flow.served_ns_ = flow.start_ns_;
  virtual_ns_ = std::max(virtual_ns_, flow.start_ns_);
  return &flow;
}

void DeadlineQueue::charge(Flow& flow, int64_t cost_ns, int64_t now_ns) {
  check_deadline(flow.popped_deadline_ns_, now_ns);
  if (cost_ns <= 0) return;
  flow.served_ns_ += cost_ns;
  if (!flow.waits_) return;
  remove(flow);
  flow.start_ns_ = std::max(flow.start_ns_, flow.served_ns_);
  insert(flow);
}

}  // namespace sightline
