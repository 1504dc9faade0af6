#include "client/cpp/waiting_ticks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

namespace sightline::live {
namespace {

// Elements size * i to size * (i + 1), or none of an empty list.
template <typename T, typename List>
std::vector<T> part(const List& values, int size, int i) {
  if (values.empty()) return {};
  return {values.begin() + size * i, values.begin() + size * (i + 1)};
}

bool are_finite(const auto& values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

bool is_none_or(int expected, int size) {
  return size == 0 || size == expected;
}

// All numbers are there and finite, and no id comes twice.
bool is_whole(const v1::Transforms& moved) {
  const int n = moved.ids_size();
  if (moved.positions_size() != 3 * n || !is_none_or(4 * n, moved.rotations_size())) return false;
  if (!is_none_or(3 * n, moved.velocities_size()) || !is_none_or(3 * n, moved.angular_velocities_size())) return false;
  if (std::set<uint64_t>(moved.ids().begin(), moved.ids().end()).size() != static_cast<size_t>(n)) return false;
  return are_finite(moved.positions()) && are_finite(moved.rotations()) && are_finite(moved.velocities()) &&
         are_finite(moved.angular_velocities());
}

}  // namespace

void WaitingTicks::Entry::fold(const v1::Tick& tick, double passed_s) {
  sequence = tick.sequence();
  time_s = tick.time_s();
  dt_s += passed_s;
  has_dt = has_dt || tick.has_dt_s();
  observed.reset();
  if (tick.has_observed_camera()) observed = tick.observed_camera();
  if (folded.size() < kMostParts) folded.push_back(tick);
  const v1::Transforms& moved = tick.transforms();
  for (int i = 0; i < moved.ids_size(); ++i) {
    Place& place = places.try_emplace(moved.ids(i), Place{places.size(), {}, {}, {}, {}}).first->second;
    place.position = part<double>(moved.positions(), 3, i);
    place.velocity = part<float>(moved.velocities(), 3, i);
    place.angular_velocity = part<float>(moved.angular_velocities(), 3, i);
    if (!moved.rotations().empty()) place.rotation = part<float>(moved.rotations(), 4, i);
  }
}

std::vector<v1::Tick> WaitingTicks::Entry::ticks() const {
  auto ticks = kept ? std::vector<v1::Tick>{*kept} : parts();
  const auto& seen = observed ? observed : suggested;
  if (!ticks.back().has_observed_camera() && seen) *ticks.back().mutable_observed_camera() = *seen;
  return ticks;
}

// Several ticks where need be: a message has rotations for all of its instances or for none, and so with velocities and
// angular velocities. Each part takes the number of a tick. Where there are fewer ticks than parts, the ticks go as
// they came.
std::vector<v1::Tick> WaitingTicks::Entry::parts() const {
  std::vector<std::pair<uint64_t, const Place*>> ordered;
  for (const auto& [id, place] : places) ordered.emplace_back(id, &place);
  std::sort(ordered.begin(), ordered.end(),
            [](const auto& a, const auto& b) { return a.second->order < b.second->order; });
  std::map<std::array<bool, 3>, size_t> kinds;
  std::vector<v1::Tick> parts;
  for (const auto& [id, place] : ordered) {
    const std::array has = {!place->rotation.empty(), !place->velocity.empty(), !place->angular_velocity.empty()};
    const auto [kind, is_new] = kinds.try_emplace(has, parts.size());
    if (is_new) parts.emplace_back();
    v1::Transforms& moved = *parts[kind->second].mutable_transforms();
    moved.add_ids(id);
    moved.mutable_positions()->Add(place->position.begin(), place->position.end());
    moved.mutable_rotations()->Add(place->rotation.begin(), place->rotation.end());
    moved.mutable_velocities()->Add(place->velocity.begin(), place->velocity.end());
    moved.mutable_angular_velocities()->Add(place->angular_velocity.begin(), place->angular_velocity.end());
  }
  if (parts.size() > folded.size()) return folded;
  if (parts.empty()) parts.emplace_back();
  for (size_t i = 0; i < parts.size(); ++i) {
    parts[i].set_sequence(sequence - (parts.size() - 1 - i));
    parts[i].set_time_s(time_s);
    if (has_dt) parts[i].set_dt_s(i == 0 ? dt_s : 0);
  }
  return parts;
}

Status WaitingTicks::add(const v1::Tick& tick) {
  const double passed_s = tick.has_dt_s() ? tick.dt_s() : time_s_ ? tick.time_s() - *time_s_ : 0;
  const bool plain = is_plain(tick);
  if (!plain || entries_.empty() || entries_.back().kept) {
    if (entries_.size() >= kMost)
      return fail(ErrorCode::kResourceExhausted, "tick", std::to_string(kMost) + " ticks wait for a daemon");
    entries_.emplace_back();
    if (!plain) entries_.back().kept = tick;
  }
  if (plain) entries_.back().fold(tick, passed_s);
  entries_.back().suggested.reset();
  time_s_ = tick.time_s();
  return {};
}

void WaitingTicks::suggest(v1::ObservedCamera observed) {
  if (!entries_.empty()) entries_.back().suggested = std::move(observed);
}

std::vector<v1::Tick> WaitingTicks::take() {
  auto ticks = entries_.front().ticks();
  entries_.pop_front();
  return ticks;
}

// Only a tick that a daemon is likely to take is folded.
bool WaitingTicks::is_plain(const v1::Tick& tick) const {
  if (tick.observed_camera().cut() || !std::isfinite(tick.time_s()) || !std::isfinite(tick.dt_s()) || tick.dt_s() < 0)
    return false;
  if ((time_s_ && tick.time_s() < *time_s_) || !is_whole(tick.transforms())) return false;
  v1::Tick rest = tick;
  rest.clear_sequence();
  rest.clear_time_s();
  rest.clear_dt_s();
  rest.clear_transforms();
  rest.clear_observed_camera();
  return rest.ByteSizeLong() == 0;
}

}  // namespace sightline::live
