#include "server/base/check.h"

#include <algorithm>
#include <cstdio>

namespace sightline {
namespace {

tl::unexpected<Error> out_of_range(const char* field, double value, char open, double low, double high) {
  char text[128];
  std::snprintf(text, sizeof text, "must be in %c%g, %g], got %g", open, low, high, value);
  return invalid(field, text);
}

}  // namespace

Status check_range(const char* field, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return out_of_range(field, value, '[', low, high);
}

Status check_above(const char* field, double value, double low, double high) {
  if (value > low && value <= high) return {};
  return out_of_range(field, value, '(', low, high);
}

Status check_some_weight(const char* field, const char* names, std::initializer_list<double> weights) {
  if (std::any_of(weights.begin(), weights.end(), [](double weight) { return weight > 0; })) return {};
  return invalid(field, std::string("at least one of ") + names + " must be above 0");
}

}  // namespace sightline
