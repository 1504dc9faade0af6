// Where the targets are, as the game said, and a camera that follows them without a daemon.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "client/cpp/rotations.h"
#include "sightline/v1/session.pb.h"

namespace sightline::live {

// Positions by id that are newer than the newest tick.
using Drawn = std::map<uint64_t, Vector>;

// Follows the positions of the instances and the list of targets.
class TargetPlaces {
 public:
  explicit TargetPlaces(const v1::OpenSession& opening);

  void shift(const Vector& by);
  void apply(const v1::Tick& tick);
  // The targets that make up the centre, and their weights.
  std::vector<std::pair<uint64_t, double>> counted() const;
  std::optional<Vector> position(uint64_t id, const Drawn& drawn) const;
  // The weighted mean of the targets; nothing: there is none whose position is known.
  std::optional<Vector> centre(const Drawn& drawn) const;

 private:
  void choose(const google::protobuf::RepeatedPtrField<v1::Target>& targets);

  std::map<uint64_t, Vector> positions_;
  std::vector<std::pair<uint64_t, double>> weights_;
};

// Keeps the camera's place relative to the targets' centre. Its motion relative to them dies away. It turns no more.
struct Follower {
  Vector offset{}, velocity{};
  double since_s = 0;

  Vector at(double time_s, const Vector& centre) const;
};

// The velocity of a point from its last positions. A single jump does not count.
class RecentMotion {
 public:
  void add(double time_s, const Vector& position);
  void shift(const Vector& by);
  // The mean of the last steps without the fastest.
  Vector velocity() const;

 private:
  std::optional<std::pair<double, Vector>> last_;
  std::deque<Vector> velocities_;
};

}  // namespace sightline::live
