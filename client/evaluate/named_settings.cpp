#include "client/evaluate/named_settings.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cctype>

#include "server/step/presets.h"
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
  NamedSettings named{.name = text.substr(0, equals), .settings = preset_settings(Preset::kSightline)};
  if (equals == std::string::npos || !is_name(named.name))
    return invalid("settings", "must be NAME=JSON, NAME being 1 to 32 letters, digits, '-' or '_'");
  const std::string field = std::string("settings.").append(named.name);
  v1::Settings wire;
  const auto parsed = google::protobuf::util::JsonStringToMessage(text.substr(equals + 1), &wire);
  if (!parsed.ok()) return invalid(field, std::string(parsed.message()));
  if (Status ok = read_settings(wire, field, named.settings); !ok) return tl::unexpected(ok.error());
  if (Status ok = validate(named.settings); !ok)
    return fail(ok.error().code, std::string(field).append(".").append(ok.error().field), ok.error().message);
  return named;
}

}  // namespace sightline
