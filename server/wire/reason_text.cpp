#include "server/wire/reason_text.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

constexpr double kAtOnceS = 0.05;

const char* name_of(ShotLimit limit) {
  switch (limit) {
    case ShotLimit::kMinDistance:
      return "min_distance_m";
    case ShotLimit::kMaxDistance:
      return "max_distance_m";
    case ShotLimit::kMinElevation:
      return "min_elevation_rad";
    case ShotLimit::kMaxElevation:
      return "max_elevation_rad";
    case ShotLimit::kPicture:
      break;
  }
  return "";
}

std::string limit_text(uint32_t limits) {
  constexpr ShotLimit kLimits[] = {ShotLimit::kMinDistance, ShotLimit::kMaxDistance, ShotLimit::kMinElevation,
                                   ShotLimit::kMaxElevation, ShotLimit::kPicture};
  for (const ShotLimit limit : kLimits) {
    if ((limits >> static_cast<int>(limit) & 1u) == 0) continue;
    if (limit == ShotLimit::kPicture) return "; the picture cannot hold all targets from the place of the shot";
    return std::string("; ") + name_of(limit) + " keeps it from the place of the shot";
  }
  return "";
}

// With one decimal.
std::string seconds(double time_s) {
  const auto tenths = std::lround(10 * std::clamp(time_s, 0.0, 100.0));
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " s";
}

std::string hider_text(const ShotReport& shot) {
  const auto hides = [](uint64_t by, const char* verb, uint64_t target) {
    return "; instance " + std::to_string(by) + verb + std::to_string(target) + " from the place of the shot";
  };
  if (shot.hidden_by != 0) return hides(shot.hidden_by, " hides target ", shot.hidden_target);
  if (shot.soon_by == 0) return "";
  if (shot.soon_s < kAtOnceS) return hides(shot.soon_by, " is about to hide target ", shot.soon_target);
  return hides(shot.soon_by, " is expected to hide target ", shot.soon_target) + " in " + seconds(shot.soon_s);
}

// In tens, so that the sentence does not change with every decision.
long tens_of_percent(double loss) {
  return 10 * std::lround(10 * std::clamp(loss, 0.0, 1.0));
}

std::string loss_text(const ComparedCourses& courses) {
  if (courses.taken != FlightCourse::kPlan || !courses.follow_loss || !courses.plan_loss) return "";
  const long follow = tens_of_percent(*courses.follow_loss), plan = tens_of_percent(*courses.plan_loss);
  if (follow <= plan) return "";
  return "; following is expected to lose " + std::to_string(follow) + " % in the coming second, this course " +
         std::to_string(plan) + " %";
}

}  // namespace

std::string reason_text(const StepResult& step) {
  std::string text(explain(step.reason));
  if (!step.shot) return text;
  // These reasons say all.
  if (step.reason == MoveReason::kAtDesiredPlace || step.reason == MoveReason::kPaused ||
      step.reason == MoveReason::kBodyOverlap)
    return text;
  const std::string hider = hider_text(*step.shot);
  return text + (hider.empty() ? limit_text(step.shot->limits) : hider) + loss_text(step.courses);
}

}  // namespace sightline
