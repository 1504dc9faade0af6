#include "server/base/check.h"

#include <algorithm>
#include <cstdio>

namespace sightline {
namespace {

Status check(const char* field, double value, const char* other, char opening, double low, double high, char closing) {
  const bool high_enough = opening == '[' ? value >= low : value > low;
  const bool low_enough = closing == ']' ? value <= high : value < high;
  if (high_enough && low_enough) return {};
  char text[128];
  std::snprintf(text, sizeof text, "must be %sin %c%g, %g%c, got %g", other, opening, low, high, closing, value);
  return invalid(field, text);
}

}  // namespace

Status check_interval(const char* field, double value, char opening, double low, double high, char closing) {
  return check(field, value, "", opening, low, high, closing);
}

Status check_zero_or(const char* field, double value, char opening, double low, double high, char closing) {
  return value == 0 ? Status{} : check(field, value, "0 or ", opening, low, high, closing);
}

Status check_some_weight(const char* field, const char* names, std::initializer_list<double> weights) {
  if (std::any_of(weights.begin(), weights.end(), [](double weight) { return weight > 0; })) return {};
  return invalid(field, std::string("at least one of ") + names + " must be above 0");
}

}  // namespace sightline
