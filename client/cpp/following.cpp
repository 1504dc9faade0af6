#include "client/cpp/following.h"

#include <algorithm>

namespace sightline::live {
namespace {

constexpr double kCarryS = 0.1;  // time constant with which the motion relative to the targets dies away
constexpr size_t kSteps = 5;

}  // namespace

TargetPlaces::TargetPlaces(const v1::OpenSession& opening) {
  for (const v1::NewInstance& added : opening.instances()) positions_[added.id()] = read(added.pose().position());
  choose(opening.targets());
}

void TargetPlaces::shift(const Vector& by) {
  for (auto& [id, position] : positions_) position = plus(position, by);
}

void TargetPlaces::apply(const v1::Tick& tick) {
  for (const uint64_t id : tick.delta().removed_ids()) positions_.erase(id);
  for (const v1::NewInstance& added : tick.delta().added_instances())
    positions_[added.id()] = read(added.pose().position());
  const v1::Transforms& moved = tick.transforms();
  for (int i = 0; i < moved.ids_size() && 3 * i + 2 < moved.positions_size(); ++i) {
    const Vector place{moved.positions(3 * i), moved.positions(3 * i + 1), moved.positions(3 * i + 2)};
    if (is_finite(place)) positions_[moved.ids(i)] = place;
  }
  if (tick.has_targets()) choose(tick.targets().targets());
}

void TargetPlaces::choose(const google::protobuf::RepeatedPtrField<v1::Target>& targets) {
  weights_.clear();
  for (const v1::Target& target : targets)
    weights_.emplace_back(target.id(), target.has_weight() ? target.weight() : 1.0);
}

std::vector<std::pair<uint64_t, double>> TargetPlaces::counted() const {
  std::vector<std::pair<uint64_t, double>> counted;
  for (const auto& target : weights_)
    if (target.second > 0 && positions_.contains(target.first)) counted.push_back(target);
  return counted;
}

std::optional<Vector> TargetPlaces::position(uint64_t id, const Drawn& drawn) const {
  if (const auto found = drawn.find(id); found != drawn.end()) return found->second;
  if (const auto found = positions_.find(id); found != positions_.end()) return found->second;
  return std::nullopt;
}

std::optional<Vector> TargetPlaces::centre(const Drawn& drawn) const {
  double total = 0;
  Vector sum{};
  for (const auto& [id, weight] : counted()) {
    total += weight;
    sum = plus(sum, times(weight, *position(id, drawn)));
  }
  if (total == 0) return std::nullopt;
  return times(1 / total, sum);
}

Vector Follower::at(double time_s, const Vector& centre) const {
  const double carried_s = kCarryS * (1 - std::exp(-std::max(time_s - since_s, 0.0) / kCarryS));
  return plus(plus(centre, offset), times(carried_s, velocity));
}

void RecentMotion::add(double time_s, const Vector& position) {
  if (last_ && time_s <= last_->first) return;
  if (last_) velocities_.push_back(times(1 / (time_s - last_->first), minus(position, last_->second)));
  if (velocities_.size() > kSteps) velocities_.pop_front();
  last_ = {time_s, position};
}

void RecentMotion::shift(const Vector& by) {
  if (last_) last_->second = plus(last_->second, by);
}

Vector RecentMotion::velocity() const {
  std::vector<Vector> slower(velocities_.begin(), velocities_.end());
  std::stable_sort(slower.begin(), slower.end(),
                   [](const Vector& a, const Vector& b) { return length(a) < length(b); });
  if (!slower.empty()) slower.pop_back();
  Vector mean{};
  for (const Vector& step : slower) mean = plus(mean, times(1 / static_cast<double>(slower.size()), step));
  return mean;
}

}  // namespace sightline::live
