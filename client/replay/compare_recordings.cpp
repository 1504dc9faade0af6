#include "client/replay/compare_recordings.h"

#include <algorithm>
#include <deque>
#include <limits>
#include <utility>

#include "client/recordings/reply_fields.h"
#include "client/replay/source.h"

namespace sightline {
namespace {

const IgnoredFields& fields_beside_the_input() {
  static const IgnoredFields fields = fields_named({"sightline.v1.OpenSession.recording",
                                                    "sightline.v1.OpenSession.degradation_policy",
                                                    "sightline.v1.Tick.step_control"});
  return fields;
}

// One recording as two queues in the order of sequences.
class Side {
 public:
  explicit Side(const Recording& recording) : source_(recording) {}

  // The front of each queue; null: at the end.
  const v1::CameraReply* reply() { return front(replies_); }
  const v1::Tick* tick() { return front(ticks_); }
  void pop_reply() { replies_.pop_front(); }
  void pop_tick() { ticks_.pop_front(); }
  uint64_t log_ns() const { return log_ns_; }
  uint64_t missing() const { return missing_; }

 private:
  template <typename Message>
  const Message* front(std::deque<Message>& row) {
    while (row.empty() && read_step()) {
    }
    return row.empty() ? nullptr : &row.front();
  }

  bool read_step() {
    RecordedStep step;
    if (!source_.next(step)) return false;
    for (v1::Tick& tick : step.ticks) ticks_.push_back(std::move(tick));
    if (step.has_reply) replies_.push_back(std::move(step.reply));
    missing_ += step.missing;
    log_ns_ = step.log_ns;
    return true;
  }

  StepSource source_;
  std::deque<v1::Tick> ticks_;
  std::deque<v1::CameraReply> replies_;
  uint64_t log_ns_ = 0, missing_ = 0;
};

// Walks one queue of both sides up to the sequence `limit`. Messages of only one side are counted, pairs go to `pair`.
// `next` returns the front of a queue, and `pop` removes it.
template <typename Message, typename Pair>
void join(Side& a, Side& b, const Message* (Side::*next)(), void (Side::*pop)(), uint64_t limit, uint64_t& only_a,
          uint64_t& only_b, Pair pair) {
  const auto front = [&](Side& side) {
    const Message* message = (side.*next)();
    return message && message->sequence() <= limit ? message : nullptr;
  };
  const Message *left = front(a), *right = front(b);
  while (left || right) {
    const bool take_left = left && (!right || left->sequence() <= right->sequence());
    const bool take_right = right && (!left || right->sequence() <= left->sequence());
    if (take_left && take_right) pair(*left, *right);
    only_a += take_left && !take_right;
    only_b += take_right && !take_left;
    if (take_left) (a.*pop)(), left = front(a);
    if (take_right) (b.*pop)(), right = front(b);
  }
}

}  // namespace

Result<RecordingComparison> compare_recordings(const Recording& a, const Recording& b,
                                               const std::function<void(double)>& progress) {
  auto convention = convention_of(a.open_session());
  if (!convention) return tl::unexpected(std::move(convention.error()));
  IgnoredFields unknown = reply_fields_unknown_to(a.container());
  for (const auto* field : reply_fields_unknown_to(b.container()))
    if (std::find(unknown.begin(), unknown.end(), field) == unknown.end()) unknown.push_back(field);
  RecordingComparison comparison(*convention, unknown);
  InputComparison& input = comparison.input;
  input.opening = first_difference(a.open_session(), b.open_session(), fields_beside_the_input());

  const auto compare_tick = [&](const v1::Tick& tick_a, const v1::Tick& tick_b) {
    ++input.ticks;
    const auto difference = first_difference(tick_a, tick_b, fields_beside_the_input());
    input.equal += !difference;
    if (difference && !input.first) input.first = {tick_a.sequence(), tick_a.time_s(), *difference};
  };
  Side side_a(a), side_b(b);
  const auto compare_ticks = [&](uint64_t limit) {
    join<v1::Tick>(side_a, side_b, &Side::tick, &Side::pop_tick, limit, input.only_a, input.only_b, compare_tick);
  };
  const auto compare_reply = [&](const v1::CameraReply& reply_a, const v1::CameraReply& reply_b) {
    comparison.replies.add(reply_a, reply_b);
    compare_ticks(reply_a.sequence());  // with the replies, so that no queue grows long
    if (progress) progress(static_cast<double>(side_a.log_ns() - a.start_ns()) * 1e-9);
  };
  constexpr uint64_t kAll = std::numeric_limits<uint64_t>::max();
  join<v1::CameraReply>(side_a, side_b, &Side::reply, &Side::pop_reply, kAll, comparison.only_a, comparison.only_b,
                        compare_reply);
  compare_ticks(kAll);
  comparison.missing_a = side_a.missing();
  comparison.missing_b = side_b.missing();
  return comparison;
}

}  // namespace sightline
