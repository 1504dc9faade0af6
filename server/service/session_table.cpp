#include "server/service/session_table.h"

#include <algorithm>
#include <utility>

namespace sightline {
namespace {

bool any_required(const std::vector<Target>& targets) {
  return std::ranges::any_of(targets, [](const Target& target) { return target.required && target.weight > 0; });
}

void add_targets(const StepResult& step, const std::vector<Target>& targets, double passed_s, CameraSums& sums) {
  const bool only_required = any_required(targets);
  for (size_t i = 0; i < std::min<size_t>(step.targets.size(), targets.size()); ++i) {
    if (!(targets[i].weight > 0) || (only_required && !targets[i].required)) continue;
    sums.target_s += passed_s;
    sums.shown_s += passed_s * step.targets[i].filtered_share * step.targets[i].picture_share;
  }
}

void add_shot(const ShotReport& shot, double passed_s, CameraSums& sums) {
  sums.shot_s += passed_s;
  sums.worth_s += passed_s * shot.worth;
  if (within_free_bands(shot.deviation)) sums.shot_kept_s += passed_s;
}

CameraSums sums_of(const SessionAnswer& answer, const std::vector<Target>& targets) {
  const double passed_s = answer.moved_s;
  CameraSums sums;
  sums.status_s[static_cast<size_t>(answer.step.status)] = passed_s;
  add_targets(answer.step, targets, passed_s, sums);
  if (answer.step.shot) add_shot(*answer.step.shot, passed_s, sums);
  sums.cuts = answer.step.cut ? 1 : 0;
  return sums;
}

}  // namespace

bool is_blind(TrackingStatus status) {
  return status == TrackingStatus::kSeeking || status == TrackingStatus::kBlocked ||
         status == TrackingStatus::kWaiting || status == TrackingStatus::kLost;
}

CameraSums& CameraSums::operator+=(const CameraSums& other) {
  for (size_t i = 0; i < status_s.size(); ++i) status_s[i] += other.status_s[i];
  target_s += other.target_s, shown_s += other.shown_s;
  shot_s += other.shot_s, shot_kept_s += other.shot_kept_s, worth_s += other.worth_s;
  cuts += other.cuts;
  return *this;
}

void SessionTable::Place::add(const SessionAnswer& answer, const std::vector<Target>& targets, int64_t now_ns) {
  table_.add(*row_, answer, sums_of(answer, targets), now_ns);
}

std::unique_ptr<SessionTable::Place> SessionTable::open(std::string id, std::string label, std::string client,
                                                        int64_t now_ns) {
  // The place is made first, so that no row stays behind where memory has run out.
  Rows one;
  one.push_back({.id = std::move(id),
                 .label = std::move(label),
                 .client = std::move(client),
                 .opened_ns = now_ns,
                 .moved_ns = now_ns});
  auto place = std::make_unique<Place>(*this, one.begin());
  const MutexLock lock(mutex_);
  one.front().number = ++opened_;
  rows_.splice(rows_.end(), one);
  return place;
}

void SessionTable::add(SessionRow& row, const SessionAnswer& answer, const CameraSums& of_step, int64_t now_ns) {
  const MutexLock lock(mutex_);
  ++row.steps;
  row.quality_level = answer.quality_level;
  row.status = answer.step.status;
  row.blind_s = is_blind(row.status) ? row.blind_s + answer.moved_s : 0.0;
  if (answer.moved_s > 0) row.moved_ns = now_ns;
  row.sums += of_step;
  sums_ += of_step;
}

void SessionTable::erase(Rows::iterator row) {
  const MutexLock lock(mutex_);
  rows_.erase(row);
}

std::vector<SessionRow> SessionTable::rows(uint64_t after, size_t at_most) const {
  const MutexLock lock(mutex_);
  const auto first = std::ranges::find_if(rows_, [&](const SessionRow& row) { return row.number > after; });
  std::vector<SessionRow> rows;
  for (auto row = first; row != rows_.end() && rows.size() < at_most; ++row) rows.push_back(*row);
  return rows;
}

CameraSums SessionTable::sums() const {
  const MutexLock lock(mutex_);
  return sums_;
}

SessionTable::Now SessionTable::now(int64_t now_ns) const {
  const MutexLock lock(mutex_);
  Now now;
  for (const SessionRow& row : rows_) {
    if (row.steps == 0) continue;
    ++now.by_status[static_cast<size_t>(row.status)];
    now.blind += row.blind_s >= kLongBlindS;
    const double stood_still_s = static_cast<double>(now_ns - row.moved_ns) * 1e-9;
    if (stood_still_s < kStandsStillS) now.longest_blind_s = std::max(now.longest_blind_s, row.blind_s);
  }
  return now;
}

}  // namespace sightline
