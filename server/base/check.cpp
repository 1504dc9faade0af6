#include "server/base/check.h"

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

}  // namespace sightline
