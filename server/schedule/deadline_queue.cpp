#include "server/schedule/deadline_queue.h"

#include <algorithm>
#include <cassert>
#include <tuple>
#include <utility>

namespace sightline {

bool DeadlineQueue::EarlierDeadline::operator()(const Flow* a, const Flow* b) const {
  return std::tie(a->deadline_ns_, a->number_) < std::tie(b->deadline_ns_, b->number_);
}

bool DeadlineQueue::LessServed::operator()(const Flow* a, const Flow* b) const {
  return std::tie(a->start_ns_, a->deadline_ns_, a->number_) < std::tie(b->start_ns_, b->deadline_ns_, b->number_);
}

bool DeadlineQueue::LessServedClient::operator()(const Client* a, const Client* b) const {
  return std::tie(a->start_ns, a->number) < std::tie(b->start_ns, b->number);
}

void DeadlineQueue::join(Flow& flow, const std::string& client) {
  assert(!flow.client_);
  std::erase_if(clients_, [this](const auto& known) {
    return known.second.use_count() == 1 && !known.second->has_long_steps(charged_ns_);
  });
  std::shared_ptr<Client>& known = clients_[client];
  if (!known) known = std::make_shared<Client>();
  flow.client_ = known;
}

void DeadlineQueue::insert(Flow& flow) {
  by_deadline_.insert(&flow);
  flow.client_->by_deadline.insert(&flow);
  flow.client_->by_service.insert(&flow);
}

void DeadlineQueue::remove(Flow& flow) {
  by_deadline_.erase(&flow);
  flow.client_->by_deadline.erase(&flow);
  flow.client_->by_service.erase(&flow);
}

void DeadlineQueue::push(Flow& flow, int64_t deadline_ns, bool may_be_long) {
  assert(!flow.waits_);
  if (!flow.client_) join(flow, "");
  Client& client = *flow.client_;
  flow.deadline_ns_ = deadline_ns;
  flow.start_ns_ = std::max(flow.served_ns_, client.virtual_ns - kClaimNs);
  flow.number_ = ++pushes_;
  flow.waits_ = true;
  flow.may_be_long_ = may_be_long;
  client.may_be_long += may_be_long;
  if (client.by_deadline.empty()) {
    client.start_ns = std::max(client.served_ns, virtual_ns_ - kClaimNs);
    client.number = flow.number_;
    by_service_.insert(&client);
  }
  insert(flow);
}

void DeadlineQueue::check_deadline(const Flow& flow, int64_t deadline_ns, int64_t now_ns) {
  if (deadline_ns >= now_ns) return;
  for (int64_t* const until_ns : {&fair_until_ns_, &flow.client_->fair_until_ns})
    if (now_ns >= *until_ns) *until_ns = now_ns + kFairForNs;
}

bool DeadlineQueue::held(const Client& client, int64_t now_ns) const {
  const auto is_own_long = [&](const Stepping& step) { return step.client == &client && step.is_long; };
  const bool has_long_steps = now_ns < client.long_until_ns || client.may_be_long > 0 ||
                              std::any_of(stepping_.begin(), stepping_.end(), is_own_long);
  if (!has_long_steps || !step_.beside(client, now_ns)) return false;
  const bool for_short_ones = short_step_.beside(client, now_ns);
  const auto counts = [&](const Stepping& step) {
    return for_short_ones ? step.is_long || now_ns < step.client->long_until_ns : step.client == &client;
  };
  return static_cast<size_t>(std::count_if(stepping_.begin(), stepping_.end(), counts)) >= most_long_;
}

DeadlineQueue::Flow* DeadlineQueue::next(int64_t now_ns) const {
  if (!overloaded(now_ns)) {
    const auto found = std::find_if(by_deadline_.begin(), by_deadline_.end(),
                                    [&](const Flow* flow) { return !held(*flow->client_, now_ns); });
    return found == by_deadline_.end() ? nullptr : *found;
  }
  const auto found = std::find_if(by_service_.begin(), by_service_.end(),
                                  [&](const Client* client) { return !held(*client, now_ns); });
  if (found == by_service_.end()) return nullptr;
  const Client& client = **found;
  return now_ns < client.fair_until_ns ? *client.by_service.begin() : *client.by_deadline.begin();
}

void DeadlineQueue::note_step(Client& client, bool may_be_long, int64_t now_ns) {
  step_.note(client, now_ns);
  const bool is_long = may_be_long || now_ns < client.long_until_ns;
  if (!is_long) short_step_.note(client, now_ns);
  stepping_.push_back({&client, is_long});
}

DeadlineQueue::Flow* DeadlineQueue::pop(int64_t now_ns) {
  if (empty()) return nullptr;
  check_deadline(**by_deadline_.begin(), (*by_deadline_.begin())->deadline_ns_, now_ns);
  Flow* const flow = next(now_ns);
  if (flow) take(*flow, now_ns);
  return flow;
}

void DeadlineQueue::take(Flow& flow, int64_t now_ns) {
  Client& client = *flow.client_;
  note_step(client, flow.may_be_long_, now_ns);
  client.may_be_long -= std::exchange(flow.may_be_long_, false);
  remove(flow);
  flow.waits_ = false;
  flow.popped_deadline_ns_ = flow.deadline_ns_;
  flow.served_ns_ = flow.start_ns_;
  client.virtual_ns = std::max(client.virtual_ns, flow.start_ns_);
  client.served_ns = client.start_ns;
  virtual_ns_ = std::max(virtual_ns_, client.start_ns);
  if (client.by_deadline.empty()) by_service_.erase(&client);
}

void DeadlineQueue::charge(Flow& flow, int64_t cost_ns, int64_t now_ns) {
  check_deadline(flow, flow.popped_deadline_ns_, now_ns);
  note_cost(*flow.client_, cost_ns, now_ns);
  charged_ns_ = std::max(charged_ns_, now_ns);
  if (cost_ns <= 0) return;
  charge(*flow.client_, cost_ns);
  flow.served_ns_ += cost_ns;
  if (!flow.waits_) return;
  remove(flow);
  flow.start_ns_ = std::max(flow.start_ns_, flow.served_ns_);
  insert(flow);
}

void DeadlineQueue::note_cost(Client& client, int64_t cost_ns, int64_t now_ns) {
  const auto step = std::find_if(stepping_.begin(), stepping_.end(),
                                 [&](const Stepping& one) { return one.client == &client; });
  if (step != stepping_.end()) stepping_.erase(step);
  if (cost_ns > kLongStepNs)
    client.long_until_ns = std::max(client.long_until_ns == INT64_MAX ? INT64_MIN : client.long_until_ns,
                                    now_ns + std::max(kLongForNs, kLongTimes * cost_ns));
  else if (client.long_until_ns == INT64_MAX)
    client.long_until_ns = now_ns;
}

void DeadlineQueue::note_elsewhere(Flow& flow, int64_t busy_ns, int64_t now_ns) {
  int64_t& until_ns = flow.client_->apart_until_ns;
  if (busy_ns > kLongStepNs) until_ns = std::max(until_ns, now_ns + kApart * busy_ns);
}

void DeadlineQueue::charge(Client& client, int64_t cost_ns) {
  client.served_ns += cost_ns;
  if (client.by_deadline.empty()) return;
  by_service_.erase(&client);
  client.start_ns = std::max(client.start_ns, client.served_ns);
  by_service_.insert(&client);
}

}  // namespace sightline
