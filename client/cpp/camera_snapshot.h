// The state of a session as the client knows it, so that the session can go on in another daemon.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Follows the ticks that a daemon has applied. A session that is opened with opening() and gets ticks() has the same
// scene, targets, settings, limits, lens and clock as one that got every tick, and its camera is where the newest reply
// had it.
//
// The shot goes on. The camera's memory of the things that it had seen before is lost.
class CameraSnapshot {
 public:
  explicit CameraSnapshot(v1::OpenSession first) : first_(std::move(first)) {}

  // Hash of the scene that the opening names; empty: it names none by its hash.
  const std::string& scene_hash() const { return first_.scene().hash(); }
  void use_scene(const std::string& hash) { first_.mutable_scene()->set_hash(hash); }

  // Takes a tick that the daemon has applied.
  void apply(const v1::Tick& tick);
  void take_reply(const v1::CameraReply& reply);

  // The first message of the session that goes on: as at first, but with the camera where it is now.
  v1::OpenSession opening() const;
  // The ticks that follow the opening; they get no replies of their own. `next_sequence` is that of the tick after
  // them. None before the first reply.
  std::vector<v1::Tick> ticks(uint64_t next_sequence) const;

 private:
  // The changes that ticks made to one instance.
  struct Change {
    uint64_t order = 0;                    // of the first change
    bool removed = false;                  // an instance of the opening, or a node of its scene file
    std::optional<v1::NewInstance> added;  // by a tick, perhaps after `removed`
    std::optional<v1::Attributes> attributes;
    std::vector<double> position;
    std::vector<float> rotation;
  };
  using Entry = std::pair<uint64_t, const Change*>;

  Change& change(uint64_t id);
  void shift_world(const v1::Vec3& shift);
  void apply_delta(const v1::SceneDelta& delta);
  void forget_in_targets(uint64_t id);
  void move(const v1::Transforms& moved);
  void take_terms(const v1::Tick& tick);
  void go_on_with_shot(v1::OpenSession& request) const;
  std::vector<Entry> in_order() const;
  std::optional<v1::SceneDelta> delta() const;
  std::optional<v1::Transforms> transforms(const std::function<bool(const Change&)>& takes) const;

  v1::OpenSession first_;  // with the newest shot
  std::map<uint64_t, Change> changes_;
  uint64_t orders_ = 0;
  // the newest targets, lens, settings, limits and tuning, and how far the world has been shifted since the opening
  v1::Tick terms_;
  double time_s_ = 0.0;
  std::optional<v1::ObservedCamera> camera_;
  std::optional<v1::ShotReport> kept_;  // of the newest reply
};

// True if the tick was applied and only its step failed (see TickError).
bool was_applied(const v1::TickError& error);

}  // namespace sightline
