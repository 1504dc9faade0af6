#include "server/base/check.h"

#include <algorithm>
#include <cstdio>

namespace sightline {

Status check_interval(const char* field, double value, char opening, double low, double high, char closing) {
  const bool high_enough = opening == '[' ? value >= low : value > low;
  const bool low_enough = closing == ']' ? value <= high : value < high;
  if (high_enough && low_enough) return {};
  char text[128];
  std::snprintf(text, sizeof text, "must be in %c%g, %g%c, got %g", opening, low, high, closing, value);
  return invalid(field, text);
}

Status check_some_weight(const char* field, const char* names, std::initializer_list<double> weights) {
  if (std::any_of(weights.begin(), weights.end(), [](double weight) { return weight > 0; })) return {};
  return invalid(field, std::string("at least one of ") + names + " must be above 0");
}

}  // namespace sightline
