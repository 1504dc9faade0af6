// make-scenes: writes the generated scenarios as .glb files.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "scenes/catalog.h"
#include "server/scene/gltf.h"

namespace {

using namespace sightline;
using namespace sightline::scenes;

void list_scenes() {
  for (const SceneGroup group : kAllGroups) {
    std::printf("%s:\n", std::string(name_of(group)).c_str());
    for (const CatalogEntry* entry : scenes_of(group))
      std::printf("  %-22s %s\n", entry->name.c_str(), entry->summary.c_str());
  }
}

// Reads the file back before writing it: a scenario that the server would refuse is never left on the disk.
Status write_scene(const CatalogEntry& entry, const SceneRequest& request, const std::filesystem::path& path) {
  const auto bytes = entry.make(request);
  if (!bytes) return tl::unexpected(bytes.error());
  GeometryStore store;
  const auto asset = read_gltf(*bytes, nullptr, store);
  if (!asset) return tl::unexpected(asset.error());
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes->data()), static_cast<std::streamsize>(bytes->size()));
  file.close();
  if (!file) return fail(ErrorCode::kUnavailable, path.string(), "cannot be written");
  std::printf("%s  %zu triangles  %.1f s\n", path.c_str(), (*asset)->triangle_count(),
              (*asset)->animations.at(0).duration_s);
  return {};
}

int make_all(const std::vector<std::string>& names, const SceneRequest& request, const std::filesystem::path& folder) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  for (const std::string& name : names)
    if (Status done = write_scene(*find_scene(name), request, folder / (name + ".glb")); !done) {
      std::fprintf(stderr, "%s: %s\n", name.c_str(), to_string(done.error()).c_str());
      return 1;
    }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Writes generated scenarios as glTF files (.glb). The same seed gives the same bytes."};
  std::string folder;
  bool list = false;
  SceneRequest request;
  std::vector<std::string> names;
  app.add_option("--out", folder, "folder to write to; made when it is missing");
  app.add_option("--seed", request.seed, "which variant to make")->capture_default_str();
  app.add_option("--targets", request.arena_targets, "targets in the arena")
      ->check(CLI::Range(2, 8))
      ->capture_default_str();
  app.add_option("--movers", request.crowd_movers, "movers in the crowd")
      ->check(CLI::Range(0, 35))
      ->capture_default_str();
  app.add_option("--motion", request.motion,
                 "folder of recorded motion, for the scenes motion-...; default: the environment variable "
                 "SIGHTLINE_MOTION");
  std::string group = "study";
  app.add_option("--tiles", request.tiles,
                 "folder of the tile set, for the scenes tile-...; default: the environment variable SIGHTLINE_TILES");
  app.add_option("--group", group, "scenes to make when none is named; --list shows the groups")
      ->check([](const std::string& name) { return find_group(name) ? "" : "no group '" + name + "'; see --list"; })
      ->capture_default_str();
  app.add_flag("--list", list, "print the names and stop");
  app.add_option("NAME", names, "scenes to make; all of the group when none is named")
      ->check([](const std::string& name) { return find_scene(name) ? "" : "no scene '" + name + "'; see --list"; });
  CLI11_PARSE(app, argc, argv);
  if (list) return list_scenes(), 0;
  if (folder.empty()) {
    std::fprintf(stderr, "--out is required\n");
    return 2;
  }
  if (names.empty())
    for (const CatalogEntry* entry : scenes_of(*find_group(group))) names.push_back(entry->name);
  return make_all(names, request, folder);
}
