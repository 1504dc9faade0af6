// Range checks for settings. Every message has the same form and states the allowed range and the given value.
#pragma once

#include <initializer_list>
#include <string>

#include "server/base/error.h"

namespace sightline {

// Fails with "must be in [low, high], got value" unless the value lies in the interval (NaN fails). An end with '[' or
// ']' is part of the interval, one with '(' or ')' is not.
Status check_interval(const char* field, double value, char opening, double low, double high, char closing);
// The same for a value that may also be 0: "must be 0 or in [low, high], got value".
Status check_zero_or(const char* field, double value, char opening, double low, double high, char closing);
// [low, high]
inline Status check_range(const char* field, double value, double low, double high) {
  return check_interval(field, value, '[', low, high, ']');
}
// (low, high]
inline Status check_above(const char* field, double value, double low, double high) {
  return check_interval(field, value, '(', low, high, ']');
}
// Weights that are all 0 prefer nothing. Fails with "at least one of <names> must be above 0" unless one is.
Status check_some_weight(const char* field, const char* names, std::initializer_list<double> weights);

}  // namespace sightline
