// Folds the ticks of a session into one that says all that they said, so that a later part of a recording, or a cut,
// stands alone: a session that is opened and told the folded tick has the same scene, targets, settings, limits, lens
// and clock as one that was told every tick, and its camera is where the newest reply had it.
//
//   TickFold fold;
//   fold.take_open(open);                      then, in the order of the recording:
//   fold.take_tick(tick, stamp);  fold.take_reply(reply);  fold.take_rejection(rejection);
//   fold.tick(), then fold.waiting()           is what the next part begins with
//
// Whether a tick was applied is known only once something answers it: until then it waits, and is not folded. What was
// refused never is.
//
// Not the same, since no tick can say it:
//   - Memory: what the camera had seen, where targets went. Replies go on alike, not equal.
//   - Velocities that a session derives from successive positions are 0 until the next tick. Told ones are told.
//   - Revision: it counts deltas, and there is one. Rotations that were kept from move to move may differ in their last
//     bits, and the mirror's hash with them; else it is the same.
//   - A rotation of the opening of something that moved but was never turned is told as floats when anything else of
//     the opening was turned. Nodes of the scene file then stand unturned in the client's frame: their rotation is
//     the file's, which the fold does not read.
// After ticks that were lost, what names instances that the fold knows nothing of is left out.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <iterator>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Of the message that a tick came in; handed back.
struct TickStamp {
  uint32_t sequence = 0;  // of its topic
  uint64_t log_ns = 0;
  uint64_t publish_ns = 0;
};

struct WaitingTick {
  v1::Tick tick;
  TickStamp stamp;
  size_t bytes = 0;  // serialised
};

// Which of the ticks that nobody has answered yet, oldest first, a rejection refuses; their end: none. A step that failed
// refuses nothing: see Rejection. `number` gives a tick's sequence.
template <typename Ticks, typename Number>
auto find_refused(Ticks& waiting, const v1::TickError& rejection, const Number& number) {
  if (rejection.field_violations().empty()) return waiting.end();
  const auto is_it = [&](const auto& tick) { return number(tick) == rejection.sequence(); };
  // Two may have the same number. The second was refused for it, or the first for something else.
  if (rejection.field_violations(0).field() != "tick.sequence")
    return std::find_if(waiting.begin(), waiting.end(), is_it);
  const auto last = std::find_if(waiting.rbegin(), waiting.rend(), is_it);
  return last == waiting.rend() ? waiting.end() : std::prev(last.base());
}

// Not thread-safe. Holds one entry an instance of the opening or of a tick, at most kMaxInstances (server/scene/mirror.h),
// and what waits: at most kMaxWaiting ticks or kMaxWaitingBytes, twice what a daemon lets wait. Of more the oldest count
// as applied.
class TickFold {
 public:
  static constexpr size_t kMaxWaiting = 512;
  static constexpr size_t kMaxWaitingBytes = size_t{8} << 20;

  // Starts anew.
  void take_open(const v1::OpenSession& open);
  void take_tick(v1::Tick tick, const TickStamp& stamp);
  // A tick that stands for `ticks` others: what a later part begins with. It waits for nothing.
  void take_folded(const v1::Tick& tick, uint64_t ticks, const TickStamp& stamp);
  void take_reply(const v1::CameraReply& reply);
  void take_rejection(const v1::TickError& rejection);

  // How many ticks are folded; 0: none, and tick() says nothing.
  uint64_t ticks() const { return ticks_; }
  // One tick for all of them. It asks for no step of its own (StepControl.merge_into_next): its answer has been given.
  v1::Tick tick() const;
  // Of the newest folded tick.
  const TickStamp& stamp() const { return stamp_; }
  // What came after them and is not answered yet, oldest first.
  const std::deque<WaitingTick>& waiting() const { return waiting_; }

 private:
  struct Entry {
    bool of_opening = false;                    // there when the session opened
    bool removed = false;                       // of those: removed; under `added` it may be there again
    bool moved = false;                         // since it is there
    bool turned = false;                        // by a tick
    bool has_velocity = false;                  // told by the newest tick that moved it
    std::array<double, 3> position{};           // when moved
    std::array<float, 4> rotation{0, 0, 0, 1};  // x y z w; when not turned, as it was opened or added
    std::array<float, 3> velocity{};
    std::unique_ptr<v1::NewInstance> added;      // by a tick
    std::unique_ptr<v1::Attributes> attributes;  // the newest change

    bool there() const { return added != nullptr || (of_opening && !removed); }
  };

  void fold(const v1::Tick& tick, const TickStamp& stamp);
  void fold_delta(const v1::SceneDelta& delta);
  void fold_transforms(const v1::Transforms& wire, bool paused);
  void fold_terms(const v1::Tick& tick);
  void fold_oldest();
  bool is_paused(const v1::Tick& tick) const;
  Entry* find(uint64_t id);
  bool there(uint64_t id) const;
  std::vector<std::pair<uint64_t, const Entry*>> sorted() const;
  void tell_targets(v1::Tick& out) const;

  std::unordered_map<uint64_t, Entry> entries_;
  std::optional<v1::TargetList> targets_;
  std::optional<v1::Lens> lens_;
  std::optional<v1::Settings> settings_;
  std::optional<tuning::v1alpha1::Tuning> tuning_;
  std::optional<v1::CameraLimits> limits_;
  std::optional<v1::ObservedCamera> camera_;
  uint64_t ticks_ = 0;
  uint64_t sequence_ = 0;  // of the newest
  double time_s_ = 0.0;
  TickStamp stamp_;
  std::deque<WaitingTick> waiting_;
  size_t waiting_bytes_ = 0;
};

}  // namespace sightline
