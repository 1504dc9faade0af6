// The result of a step: the decision, and the visibility from the returned pose. Internal to this folder.
#pragma once

#include "server/aggregate/share_window.h"
#include "server/step/stages.h"

namespace sightline {

// A complete step.
struct ReportInput {
  const StepInput& input;
  const StepDump& dump;
  const TakenMaps& taken;
  std::span<const TargetPast> pasts;
  const TargetIds& given_up;
  uint32_t seen = 0;  // the targets that the camera has seen over the last steps, by the filter; bit i is target i
};

// Adds the visible shares in the picture of the returned pose to `shares`.
StepResult report_step(const ReportInput& step, ShareWindow& shares);

// The parts of the report (report.cpp calls them). `sight` and `result.targets` must hold the shares already.

// The instances that hide parts of the target from the returned pose (target_report.cpp).
void list_occlusions(const ReportInput& step, size_t target, TargetSight& sight);
// The part of the target's image that lies inside the picture (target_report.cpp).
double picture_share(const ReportInput& step, size_t target, const Lens& lens);
// The forecast for a target; empty without a prediction (target_report.cpp).
std::optional<SightForecast> forecast_sight(const ReportInput& step, size_t target, double present_share);
// Sets the status, with view_s and blocked_by (tracking_status.cpp).
void set_tracking_status(const ReportInput& step, const Lens& lens, StepResult& result);

}  // namespace sightline
