#include "server/device_report.h"

#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/sample/embree_sampler.h"

namespace sightline {
namespace {

std::string device_note(const EglDeviceInfo& device) {
  if (!device.trouble.empty()) return device.trouble;
  std::string note = device.software ? "software" : "hardware";
  if (device.robust) note += ", robust";
  return note;
}

// One line of the list of devices. Embree has no index and no node.
struct DeviceRow {
  bool used = false;
  const char* kind = "egl";
  int index = -1;
  std::string platform, node, renderer, version, note;
};

std::vector<DeviceRow> device_rows(const EglOptions& options, const Result<SamplerDecision>& decision) {
  const auto chosen = [&](SamplerChoice choice) { return decision && decision->sampler == choice; };
  std::vector<DeviceRow> rows;
  for (const EglDeviceInfo& device : list_egl_devices(options))
    rows.push_back({chosen(SamplerChoice::kEgl) && device.chosen, "egl", device.index, device.platform, device.drm_node,
                    device.renderer, device.gl_version, device_note(device)});
  rows.push_back(
      {chosen(SamplerChoice::kEmbree), "embree", -1, "cpu", "", make_embree_sampler_device()->renderer(), "", ""});
  return rows;
}

void print_devices(const std::vector<DeviceRow>& rows) {
  const auto or_dash = [](const std::string& text) { return text.empty() ? "-" : text.c_str(); };
  std::printf("%-5s %-6s %-6s %-12s %-20s %s\n", "used", "kind", "index", "platform", "node", "renderer");
  for (const DeviceRow& row : rows) {
    const std::string index = row.index < 0 ? "" : std::to_string(row.index);
    std::printf("%-5s %-6s %-6s %-12s %-20s %s", row.used ? "*" : "", row.kind, or_dash(index), row.platform.c_str(),
                or_dash(row.node), or_dash(row.renderer));
    row.note.empty() ? std::printf("\n") : std::printf(", %s (%s)\n", or_dash(row.version), row.note.c_str());
  }
}

void print_devices_json(const std::vector<DeviceRow>& rows, const Result<SamplerDecision>& decision) {
  nlohmann::ordered_json json{{"used", decision ? decision->reason : ""},
                              {"trouble", decision ? "" : to_string(decision.error())},
                              {"devices", nlohmann::ordered_json::array()}};
  for (const DeviceRow& row : rows)
    json["devices"].push_back({{"used", row.used},
                               {"kind", row.kind},
                               {"index", row.index},
                               {"platform", row.platform},
                               {"node", row.node},
                               {"renderer", row.renderer},
                               {"version", row.version},
                               {"note", row.note}});
  std::printf("%s\n", json.dump(2).c_str());
}

}  // namespace

int report_devices(SamplerChoice choice, const EglOptions& options, bool json) {
  const auto decision = decide_sampler(choice, options, [&] { return choose_egl_device(options); });
  const std::vector<DeviceRow> rows = device_rows(options, decision);
  if (json) {
    print_devices_json(rows, decision);
    return EXIT_SUCCESS;
  }
  print_devices(rows);
  std::printf("%s\n", decision ? ("used because: " + decision->reason).c_str()
                               : ("none would be used: " + to_string(decision.error())).c_str());
  return EXIT_SUCCESS;
}

}  // namespace sightline
