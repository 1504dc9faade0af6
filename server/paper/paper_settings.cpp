#include "server/paper/paper_settings.h"

namespace sightline {

StepSettings paper_row(Strategy strategy, double prediction_s) {
  StepSettings settings = preset_settings(Preset::kPaper);
  settings.aggregate.filter.mode = FilterMode::kNone;
  settings.move.strategy = strategy;
  settings.move.prediction_s = prediction_s;
  return settings;
}

StepSettings center_row(double prediction_s) {
  StepSettings settings = paper_row(Strategy::kRobust, prediction_s);
  settings.move.robust_goal = RobustGoal::kCenter;
  return settings;
}

StepSettings paper_stability(int a, int n) {
  StepSettings settings = paper_row(Strategy::kBasic, 0.0);
  if (n == 0) return settings;
  settings.aggregate.filter.mode = FilterMode::kJoint;
  settings.aggregate.filter.alpha = static_cast<double>(a) / n;
  settings.aggregate.filter.n = n;
  return settings;
}

StepSettings agile_stability(int a, int n) {
  StepSettings settings = paper_stability(a, n);
  settings.bound.paper_n = 3;
  return settings;
}

}  // namespace sightline
