#include "client/replay/result.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>

#include "client/base/text_table.h"

namespace sightline {
namespace {

void line(std::ostream& out, const char* label, const std::string& text) {
  out << formatted("%-11s ", label) << text << '\n';
}

const char* name_of(ReplayVerdict verdict) {
  switch (verdict) {
    case ReplayVerdict::kEqual:
      return "equal";
    case ReplayVerdict::kAlike:
      return "alike";
    case ReplayVerdict::kDiffers:
      return "differs";
    case ReplayVerdict::kNothing:
      return "nothing";
  }
  return "";
}

nlohmann::ordered_json json_of(const std::optional<ReplyDifference>& first) {
  if (!first) return nullptr;
  return {{"sequence", first->sequence},
          {"time_s", first->time_s},
          {"field", first->field.path},
          {"recorded", first->field.a},
          {"replayed", first->field.b}};
}

}  // namespace

const char* to_string(ReplayVerdict verdict) {
  switch (verdict) {
    case ReplayVerdict::kEqual:
      return "equal";
    case ReplayVerdict::kAlike:
      return "alike, not equal";
    case ReplayVerdict::kDiffers:
      return "differs";
    case ReplayVerdict::kNothing:
      return "nothing to compare: the recording has no reply";
  }
  return "";
}

void ReplayResult::add(const ReplayedStep& step) {
  const RecordedStep& recorded = step.recorded.step;
  gaps_ += recorded.missing > 0;
  missing_ += recorded.missing;
  lost_replies_ += step.recorded.answer == StepAnswer::kLost;
  if (step.recorded.answer == StepAnswer::kNone) unanswered_ticks_ += recorded.ticks.size();
  faults_ += static_cast<uint64_t>(recorded.faults.size());
  if (first_fault_.empty() && !recorded.faults.empty()) first_fault_ = recorded.faults.front().message();
  add_rejections(step);
  if (step.recorded.answer != StepAnswer::kRecorded) return;
  if (!step.answer.has_reply) {
    ++only_recorded_;
    return;
  }
  const bool equal = replies_.add(recorded.reply, step.answer.reply);
  if (gaps_ > 0) return;
  ++compared_before_gap_;
  equal_before_gap_ += equal;
}

// The replay may refuse a tick one step later than the recording did (FedStep).
void ReplayResult::add_rejections(const ReplayedStep& step) {
  for (const v1::TickError& rejection : step.recorded.step.rejections)
    if (refuses(rejection)) refused_recorded_.push_back(rejection.sequence());
  for (const v1::TickError& rejection : step.answer.rejections) {
    const auto same = std::find(refused_recorded_.begin(), refused_recorded_.end(), rejection.sequence());
    if (same != refused_recorded_.end()) {
      refused_recorded_.erase(same);
      ++refused_both_;
    } else {
      ++refused_only_replayed_;
      if (!first_new_refusal_) first_new_refusal_ = rejection;
    }
  }
}

bool ReplayResult::expected_equal() const {
  return never_equal_.empty() && gaps_ == 0 && lost_replies_ == 0;
}

ReplayVerdict ReplayResult::verdict() const {
  if (replies_.compared() + only_recorded_ == 0) return ReplayVerdict::kNothing;
  const bool same_steps = only_recorded_ == 0 && refused_recorded_.empty() && refused_only_replayed_ == 0;
  if (replies_.all_equal() && same_steps) return ReplayVerdict::kEqual;
  if (expected_equal() || (never_equal_.empty() && compared_before_gap_ > equal_before_gap_))
    return ReplayVerdict::kDiffers;
  const bool near = replies_.position_m() <= kVisibleJumpM &&
                    replies_.direction_deg() <= kVisibleJumpRad * 180 / std::numbers::pi;
  return near ? ReplayVerdict::kAlike : ReplayVerdict::kDiffers;
}

void ReplayResult::print(std::ostream& out) const {
  std::string count = formatted("%s compared, %s equal", std::to_string(replies_.compared()).c_str(),
                                std::to_string(replies_.equal()).c_str());
  if (only_recorded_ > 0) count.append(", ").append(std::to_string(only_recorded_)).append(" not answered again");
  line(out, "replies", count);
  line(out, "hash",
       formatted("%016lx recorded, %016lx replayed", static_cast<unsigned long>(replies_.hash_a()),
                 static_cast<unsigned long>(replies_.hash_b())));
  for (const std::string& field : replies_.unknown())
    line(out, "unknown", field + ": newer than the recording, not compared");
  if (const auto& first = replies_.first())
    line(out, "first",
         formatted("tick %lu at %.3f s: ", static_cast<unsigned long>(first->sequence), first->time_s) +
             first->field.path + " was " + first->field.a + ", is " + first->field.b);
  if (!replies_.all_equal())
    line(out, "at most",
         formatted("camera %.6g m and %.6g degrees off, visible shares %.6g", replies_.position_m(),
                   replies_.direction_deg(), replies_.visible_share()));
  if (refused_both_ + refused_recorded_.size() + refused_only_replayed_ > 0)
    line(out, "refused",
         formatted("%s ticks as recorded, %s only in the recording, %s only now", std::to_string(refused_both_).c_str(),
                   std::to_string(refused_recorded_.size()).c_str(), std::to_string(refused_only_replayed_).c_str()));
  if (first_new_refusal_)
    line(out, "", "tick " + std::to_string(first_new_refusal_->sequence()) + " now: " + first_new_refusal_->message());
  if (faults_ > 0) line(out, "faults", std::to_string(faults_) + " in the recording, first: " + first_fault_);
  if (gaps_ > 0)
    line(out, "gaps",
         formatted("%s, %s messages are missing; %s of %s replies before the first are equal",
                   std::to_string(gaps_).c_str(), std::to_string(missing_).c_str(),
                   std::to_string(equal_before_gap_).c_str(), std::to_string(compared_before_gap_).c_str()));
  if (lost_replies_ > 0) line(out, "", std::to_string(lost_replies_) + " steps were taken whose replies are missing");
  if (unanswered_ticks_ > 0)
    line(out, "", "the recording ends before the answer to " + std::to_string(unanswered_ticks_) + " ticks");
  if (never_equal_ == kOtherSettings) return line(out, "result", never_equal_);
  std::string verdict = to_string(this->verdict());
  if (!never_equal_.empty() && replies_.compared() > 0 && !replies_.all_equal())
    verdict.append(" (").append(never_equal_).append(")");
  line(out, "result", verdict);
}

nlohmann::ordered_json ReplayResult::json() const {
  const bool other_settings = never_equal_ == kOtherSettings;
  return {{"verdict", other_settings ? kOtherSettings : name_of(verdict())},
          {"reason", never_equal_},
          {"replies",
           {{"compared", replies_.compared()},
            {"equal", replies_.equal()},
            {"not_answered_again", only_recorded_},
            {"first", json_of(replies_.first())},
            {"hash_recorded", formatted("%016lx", static_cast<unsigned long>(replies_.hash_a()))},
            {"hash_replayed", formatted("%016lx", static_cast<unsigned long>(replies_.hash_b()))},
            {"position_m", replies_.position_m()},
            {"direction_deg", replies_.direction_deg()},
            {"visible_share", replies_.visible_share()},
            {"unknown_fields", replies_.unknown()}}},
          {"refused_ticks",
           {{"as_recorded", refused_both_},
            {"only_recorded", refused_recorded_.size()},
            {"only_replayed", refused_only_replayed_}}},
          {"faults", faults_},
          {"gaps", {{"count", gaps_}, {"missing_messages", missing_}, {"lost_replies", lost_replies_}}},
          {"unanswered_ticks", unanswered_ticks_}};
}

}  // namespace sightline
