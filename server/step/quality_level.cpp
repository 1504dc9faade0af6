#include "server/step/quality_level.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <tuple>

namespace sightline {
namespace {

// Factors of the settings; results are rounded up.
struct Cut {
  double points, search, resolution, candidates;
  bool predicts;
  double cost;  // an estimate; see expected_cost
};
constexpr std::array<Cut, kLowestQualityLevel + 1> kCuts{{
    {1, 1, 1, 1, true, 1.0},
    {1, 0.5, 1, 1, true, 0.85},
    {0.5, 0.5, 1, 1, true, 0.65},
    {0.25, 0.5, 1, 0.5, true, 0.35},
    {0.25, 0.25, 0.75, 0.25, true, 0.2},
    {0.125, 0.25, 0.5, 0.125, false, 0.1},
}};

// The least that the ranges of the settings allow.
constexpr int kLeastCandidates = 27;

int cut(int value, double share, int least) {
  return std::min(value, std::max(least, static_cast<int>(std::ceil(value * share))));
}

const Cut& cut_of(int level) {
  assert(level >= 0 && level <= kLowestQualityLevel);
  return kCuts[static_cast<size_t>(level)];
}

void note(const char* what, const std::string& before, const std::string& after, std::string& text) {
  if (before == after) return;
  text.append(text.empty() ? "" : ", ").append(what).append(" ").append(before).append(" -> ").append(after);
}

void note(const char* what, int before, int after, std::string& text) {
  note(what, std::to_string(before), std::to_string(after), text);
}

void note(const char* what, double before, double after, std::string& text) {
  note(what, std::string(before > 0 ? "on" : "off"), std::string(after > 0 ? "on" : "off"), text);
}

}  // namespace

StepSettings degrade(const StepSettings& settings, int level) {
  const Cut& c = cut_of(level);
  StepSettings less = settings;
  less.sample.points = cut(settings.sample.points, c.points, 1);
  less.sample.resolution = cut(settings.sample.resolution, c.resolution, kLeastResolution);
  if (settings.move.search_viewpoints)
    less.move.viewpoint_search.resolution = cut(settings.move.viewpoint_search.resolution, c.search, kLeastResolution);
  less.aggregate.candidates = cut(settings.aggregate.candidates, c.candidates, kLeastCandidates);
  if (!c.predicts) less.move.prediction_s = 0.0;
  return less;
}

bool degrades(const StepSettings& settings, int level) {
  const auto parts = [](const StepSettings& s) {
    return std::tie(s.sample.points, s.sample.resolution, s.move.viewpoint_search.resolution, s.aggregate.candidates,
                    s.move.prediction_s);
  };
  const StepSettings less = degrade(settings, level);
  return parts(less) != parts(settings);
}

std::string describe_degradation(const StepSettings& settings, int level) {
  const StepSettings less = degrade(settings, level);
  std::string text;
  note("points", settings.sample.points, less.sample.points, text);
  note("search resolution", settings.move.viewpoint_search.resolution, less.move.viewpoint_search.resolution, text);
  note("candidates", settings.aggregate.candidates, less.aggregate.candidates, text);
  note("resolution", settings.sample.resolution, less.sample.resolution, text);
  note("prediction", settings.move.prediction_s, less.move.prediction_s, text);
  return text;
}

double expected_cost(int level) {
  return cut_of(level).cost;
}

}  // namespace sightline
