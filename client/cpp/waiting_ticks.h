// Ticks that wait for a daemon that is late or away, in their order. Those that carry only time and places, and perhaps
// an observed camera that is no cut, fold into one: the newest place counts for each id. Every other tick is kept
// whole, so that a refusal hits it alone.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "server/base/error.h"
#include "sightline/v1/session.pb.h"

namespace sightline::live {

class WaitingTicks {
 public:
  // The number of entries that may wait.
  static constexpr size_t kMost = 4096;
  // The number of ticks that an entry can become: with and without rotation, velocity and angular velocity.
  static constexpr size_t kMostParts = 8;

  bool empty() const { return entries_.empty(); }
  // Takes a tick with its number. kResourceExhausted (field "tick") when kMost wait.
  Status add(const v1::Tick& tick);
  // Goes with the newest tick as its observed camera, if that tick waits and has none.
  void suggest(v1::ObservedCamera observed);
  // The ticks to send next, each of which gets an answer. Needs one that waits.
  std::vector<v1::Tick> take();

 private:
  struct Place {
    size_t order = 0;  // of its first tick in the entry
    std::vector<double> position;
    std::vector<float> rotation;          // empty: it stays as it is
    std::vector<float> velocity;          // empty: the daemon derives it
    std::vector<float> angular_velocity;  // empty: the daemon derives it
  };
  // A tick that is kept whole, or several in one that only say where things are.
  struct Entry {
    std::optional<v1::Tick> kept;
    uint64_t sequence = 0;
    double time_s = 0, dt_s = 0;
    bool has_dt = false;           // some tick said its dt_s
    std::vector<v1::Tick> folded;  // the first kMostParts
    std::map<uint64_t, Place> places;
    std::optional<v1::ObservedCamera> observed;   // of the newest tick
    std::optional<v1::ObservedCamera> suggested;  // what the player sees instead of the daemon's camera

    void fold(const v1::Tick& tick, double passed_s);
    std::vector<v1::Tick> ticks() const;
    std::vector<v1::Tick> parts() const;
  };
  bool is_plain(const v1::Tick& tick) const;

  std::deque<Entry> entries_;
  std::optional<double> time_s_;  // of the newest tick
};

}  // namespace sightline::live
