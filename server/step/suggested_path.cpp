#include "server/step/suggested_path.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

// The share of the way from a to b that is nearest to p, [0, 1]; `way` and `to_p` are relative to a.
double nearest_share(const glm::dvec3& way, const glm::dvec3& to_p) {
  const double squared = glm::dot(way, way);
  return squared > 0 ? std::clamp(glm::dot(to_p, way) / squared, 0.0, 1.0) : 0.0;
}

// The rotation from a to b as a vector along its axis, of the angle's length.
glm::dvec3 turn_between(const glm::dquat& a, const glm::dquat& b) {
  glm::dquat turn = b * glm::conjugate(a);
  if (turn.w < 0) turn = -turn;
  const glm::dvec3 axis(turn.x, turn.y, turn.z);
  const double sine = glm::length(axis);
  return sine > 0 ? axis * (2 * std::atan2(sine, turn.w) / sine) : glm::dvec3(0.0);
}

}  // namespace

template <typename Value>
void RecentTrack<Value>::start(const Value& value) {
  entries_.clear();
  entries_.push_back({value, 0.0});
}

template <typename Value>
void RecentTrack<Value>::pass(const Value& value, double dt_s) {
  if (dt_s <= 0) return;
  for (Entry& entry : entries_) entry.age_s += dt_s;
  const size_t n = entries_.size();
  const bool replaces = n >= 2 && entries_[n - 2].age_s - entries_[n - 1].age_s < kApartS;
  if (replaces)
    entries_[n - 1] = {value, 0.0};
  else
    entries_.push_back({value, 0.0});
  drop_old();
}

// Keeps one entry that is older than kKeptS, so that the track covers the whole time.
template <typename Value>
void RecentTrack<Value>::drop_old() {
  size_t dropped = 0;
  while (dropped + 1 < entries_.size() && entries_[dropped + 1].age_s >= kKeptS) ++dropped;
  if (entries_.size() - dropped == kMost) ++dropped;  // room for the next one
  if (dropped == 0) return;
  std::copy(entries_.begin() + dropped, entries_.end(), entries_.begin());
  entries_.resize(entries_.size() - dropped);
}

template class RecentTrack<glm::dvec3>;
template class RecentTrack<glm::dquat>;

glm::dvec3 away_from(const RecentTrack<glm::dvec3>& track, const glm::dvec3& position_m) {
  glm::dvec3 least = position_m - track[0];
  for (size_t i = 1; i < track.count(); ++i) {
    const glm::dvec3 way_m = track[i] - track[i - 1], to_m = position_m - track[i - 1];
    const glm::dvec3 away_m = to_m - nearest_share(way_m, to_m) * way_m;
    if (glm::dot(away_m, away_m) < glm::dot(least, least)) least = away_m;
  }
  return least;
}

double angle_from(const RecentTrack<glm::dquat>& track, const glm::dquat& rotation) {
  double least_rad = angle_between(track[0], rotation);
  for (size_t i = 1; i < track.count(); ++i) {
    const double share = nearest_share(turn_between(track[i - 1], track[i]), turn_between(track[i - 1], rotation));
    least_rad = std::min(least_rad, angle_between(glm::slerp(track[i - 1], track[i], share), rotation));
  }
  return least_rad;
}

}  // namespace sightline
