#include "client/evaluate/named_settings.h"

#include <algorithm>
#include <cctype>

#include "client/command/wire_presets.h"
#include "server/wire/from_proto_values.h"

namespace sightline {
namespace {

constexpr size_t kLongestName = 32;

bool is_name(const std::string& name) {
  return !name.empty() && name.size() <= kLongestName &&
         std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; });
}

}  // namespace

Result<NamedSettings> read_named_settings(const std::string& text) {
  const size_t equals = text.find('=');
  NamedSettings named{.name = text.substr(0, equals), .settings = {}};
  if (equals == std::string::npos || !is_name(named.name))
    return invalid("settings", "must be NAME=JSON, NAME being 1 to 32 letters, digits, '-' or '_'");
  const std::string field = std::string("settings.").append(named.name);
  const auto wire = settings_from_json(text.substr(equals + 1));
  if (!wire) return invalid(field, wire.error().message);
  if (Status ok = read_settings(wire->settings(), wire->tuning(), field + ".", named.settings); !ok)
    return tl::unexpected(ok.error());
  if (Status ok = validate(named.settings); !ok)
    return fail(ok.error().code, std::string(field).append(".").append(ok.error().field), ok.error().message);
  return named;
}

}  // namespace sightline
