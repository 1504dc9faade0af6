// Follows the state of a recorded session by its messages, and sums the state up in one tick. A later part of a
// recording, or a cut, begins with that tick and can be read alone. A session that is opened and receives it has the
// same scene, targets, settings, limits, lens and clock as one that received every tick. Its camera is where the newest
// reply had it.
//
//   SessionSnapshot snapshot;
//   snapshot.take_open(open);                      then, in the order of the recording:
//   snapshot.take_tick(tick, stamp);  snapshot.take_reply(reply);  snapshot.take_rejection(rejection);
//   snapshot.tick(), then snapshot.waiting()       is what the next part begins with
//
// A tick counts once a later message shows that it was applied. Until then it waits. Refused ticks never count.
//
// A tick cannot say everything. These differ:
//   - What the camera remembers: what it had seen, and where targets went. Replies go on alike, not equal, unless the
//   recording has a
//     StepMemory beside the tick. It also holds the velocities, revision and rotations below to the bit.
//   - Velocities that a session derives from successive positions are 0 until the next tick. Velocities that the client
//     sent are kept. Held and noisy positions are found out again.
//   - The scene revision counts deltas, and there is only one. Rotations that were kept from move to move may differ in
//     their last bits, and the mirror's hash with them; otherwise the hash is the same.
//   - When anything of the opening was turned, the rotation of everything else that moved is sent as floats. A node of
//   the
//     scene file that moved but was never turned then has no rotation in the client's frame, since the snapshot does
//     not read the file.
// After lost ticks, instances that the snapshot does not know are left out.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <iterator>
#include <map>
#include <memory>
#include <optional>

#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// How the message that held a tick was recorded.
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

// Finds the tick that a rejection refuses among the unanswered ones, oldest first; their end when there is none. The
// rejection of a failed step refuses no tick: see TickError. `number` gives a tick's sequence.
template <typename Ticks, typename Number>
auto find_refused(Ticks& waiting, const v1::TickError& rejection, const Number& number) {
  if (rejection.field_violations().empty()) return waiting.end();
  const auto is_it = [&](const auto& tick) { return number(tick) == rejection.sequence(); };
  // Two ticks may have the same number: either the second was refused for that, or the first for something else.
  if (rejection.field_violations(0).field() != "tick.sequence")
    return std::find_if(waiting.begin(), waiting.end(), is_it);
  const auto last = std::find_if(waiting.rbegin(), waiting.rend(), is_it);
  return last == waiting.rend() ? waiting.end() : std::prev(last.base());
}

// Not thread-safe. Holds one entry for each instance of the opening or of a tick, at most kMaxInstances
// (server/scene/mirror.h), and the waiting ticks: at most kMaxWaiting of them and kMaxWaitingBytes, twice what a daemon
// lets wait. Beyond that the oldest count as applied.
class SessionSnapshot {
 public:
  static constexpr size_t kMaxWaiting = 512;
  static constexpr size_t kMaxWaitingBytes = size_t{8} << 20;

  struct Instance {
    bool of_opening = false;                    // there when the session opened
    bool removed = false;                       // an instance of the opening that was removed
    bool added = false;                         // by a tick, perhaps after `removed`
    bool moved = false;                         // since it is there
    bool turned = false;                        // by a tick
    bool has_velocity = false;                  // sent with the newest tick that moved it
    std::array<double, 3> position{};           // valid when `moved`
    std::array<float, 4> rotation{0, 0, 0, 1};  // x y z w; until `turned` as in `given`
    // angular: zero unless it was sent with the newest tick that moved it
    std::array<float, 3> velocity{}, angular_velocity{};
    std::unique_ptr<v1::NewInstance> given;      // as it was opened or added; null: a node of the scene file
    std::unique_ptr<v1::Attributes> attributes;  // the newest change

    bool there() const { return added || (of_opening && !removed); }
  };

  // Starts again with a new session.
  void take_open(const v1::OpenSession& open);
  void take_tick(v1::Tick tick, const TickStamp& stamp);
  // The snapshot tick of `ticks` others, which a later part begins with. It counts at once.
  void take_snapshot_tick(const v1::Tick& tick, uint64_t ticks, const TickStamp& stamp);
  void take_reply(const v1::CameraReply& reply);
  void take_rejection(const v1::TickError& rejection);

  // How many ticks count; 0: none, and tick() is empty.
  uint64_t ticks() const { return ticks_; }
  // One tick for all of them. It asks for no step of its own (StepControl.merge_into_next), since its ticks were
  // answered.
  v1::Tick tick() const;
  // How the newest tick that counts was recorded.
  const TickStamp& stamp() const { return stamp_; }
  // The ticks after them, which are not answered yet, oldest first.
  const std::deque<WaitingTick>& waiting() const { return waiting_; }

  // By the client's id. Includes instances that are not there any more, and of the scene file's nodes those that were
  // named.
  const std::map<uint64_t, Instance>& instances() const { return instances_; }
  // of the client's world since the opening, client units
  const std::array<double, 3>& shift() const { return shift_; }
  uint64_t deltas() const { return deltas_; }  // ticks with a scene delta that count
  const std::optional<v1::Lens>& lens() const { return lens_; }
  // As the newest tick that had a list; empty: as the opening says.
  const std::optional<v1::TargetList>& targets() const { return targets_; }

 private:
  void apply(const v1::Tick& tick, const TickStamp& stamp);
  void shift_world(const std::array<double, 3>& shift);
  void apply_delta(const v1::SceneDelta& delta);
  void apply_transforms(const v1::Transforms& wire, bool paused);
  void apply_terms(const v1::Tick& tick);
  void apply_oldest();
  bool is_paused(const v1::Tick& tick) const;
  Instance* find(uint64_t id);
  bool there(uint64_t id) const;
  void add_targets(v1::Tick& out) const;

  std::map<uint64_t, Instance> instances_;  // sorted, as tick() lists them
  std::optional<v1::TargetList> targets_;
  std::optional<v1::Lens> lens_;
  std::optional<v1::Shot> shot_;
  std::optional<v1::Settings> settings_;
  std::optional<tuning::v1alpha1::Tuning> tuning_;
  std::optional<v1::CameraLimits> limits_;
  std::optional<v1::ObservedCamera> camera_;
  std::array<double, 3> shift_{};  // of the client's world since the opening, client units
  uint64_t ticks_ = 0, deltas_ = 0;
  uint64_t sequence_ = 0;  // of the newest tick that counts
  double time_s_ = 0.0;
  TickStamp stamp_;
  std::deque<WaitingTick> waiting_;
  size_t waiting_bytes_ = 0;
};

}  // namespace sightline
