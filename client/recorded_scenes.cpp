#include "client/recorded_scenes.h"

#include <stdlib.h>

#include <algorithm>
#include <fstream>

#include "client/file_bytes.h"

namespace sightline {
namespace {

constexpr std::string_view kNamed = "scene/", kUploaded = "upload/";
constexpr size_t kMostNames = 10'000;

// The name comes from a file that anybody may have made.
bool stays_below(const std::filesystem::path& path) {
  if (path.empty() || path.is_absolute() || !path.has_filename()) return false;
  return std::none_of(path.begin(), path.end(), [](const auto& part) { return part == ".." || part == "."; });
}

Result<std::filesystem::path> make_folder() {
  std::string name = (std::filesystem::temp_directory_path() / "sightline-scenes-XXXXXX").string();
  if (!mkdtemp(name.data())) return fail(ErrorCode::kUnavailable, name, "cannot be made");
  return std::filesystem::path(name);
}

Status write_below(const std::filesystem::path& folder, const std::string& name, const std::string& bytes) {
  const std::filesystem::path path = folder / name;
  std::error_code trouble;
  std::filesystem::create_directories(path.parent_path(), trouble);
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) return fail(ErrorCode::kUnavailable, path.string(), "cannot be written");
  return {};
}

}  // namespace

Result<std::unique_ptr<RecordedScenes>> RecordedScenes::find(const Recording& recording,
                                                             const ScenePlaces& places,
                                                             SamplerDevice& sampler) {
  std::unique_ptr<RecordedScenes> scenes(new RecordedScenes());
  scenes->folder_ = places.folder;
  const auto trouble = [&](const Error& error) { scenes->troubles_.push_back(to_string(error)); };
  auto files = recording.files();
  if (!files) trouble(files.error()), files.emplace();
  for (const RecordedFile& file : *files)
    if (file.name.starts_with(kNamed))
      if (Status ok = scenes->unpack(file); !ok) trouble(ok.error());
  scenes->world_ = std::make_unique<LocalWorld>(scenes->folder_, sampler);
  for (const RecordedFile& file : *files)
    if (file.name.starts_with(kUploaded))
      if (Status ok = scenes->add_upload(std::as_bytes(std::span(file.bytes)), file.name); !ok)
        trouble(ok.error());
  for (const std::string& path : places.files) {
    const auto bytes = read_file(path);
    if (!bytes) return tl::unexpected(bytes.error());
    if (Status ok = scenes->add_upload(*bytes, path); !ok) return tl::unexpected(ok.error());
  }
  return scenes;
}

RecordedScenes::~RecordedScenes() {
  std::error_code trouble;
  if (!unpacked_.empty()) std::filesystem::remove_all(unpacked_, trouble);
}

Status RecordedScenes::unpack(const RecordedFile& file) {
  const std::string name = file.name.substr(kNamed.size());
  if (!stays_below(name)) return fail(ErrorCode::kDataLoss, file.name, "is no name of a scene file");
  if (unpacked_.empty()) {
    auto folder = make_folder();
    if (!folder) return tl::unexpected(folder.error());
    unpacked_ = *folder;
    folder_ = unpacked_.string();
  }
  return write_below(unpacked_, name, file.bytes);
}

Status RecordedScenes::add_upload(std::span<const std::byte> bytes, const std::string& name) {
  auto asset = world_->scenes.add_uploaded(bytes);
  if (!asset) return fail(asset.error().code, name, to_string(asset.error()));
  held_.push_back(std::move(*asset));
  return {};
}

Result<std::shared_ptr<const SceneAsset>> RecordedScenes::load(bool by_hash, const std::string& key) {
  SceneLibrary& library = world_->scenes;
  if (!by_hash) {
    auto asset = library.load_named(key);
    if (asset) held_.push_back(*asset);
    return asset;
  }
  ContentHash hash;
  if (!from_hex(key, hash)) return invalid("scene.hash", "must be 32 hexadecimal digits");
  if (auto asset = library.find(hash)) return asset;
  // A file of the folder may hold just these bytes.
  for (const std::string& name : library.names(kMostNames)) {
    auto asset = library.load_named(name);
    if (!asset || (*asset)->hash != hash) continue;
    held_.push_back(*asset);
    return asset;
  }
  return fail(ErrorCode::kNotFound, "scene.hash", "no file at hand holds just these bytes");
}

Status RecordedScenes::look_up(const v1::SceneRef& scene) {
  const auto asset = load(scene.has_hash(), scene.has_hash() ? scene.hash() : scene.name());
  return asset ? Status() : tl::unexpected(asset.error());
}

Status RecordedScenes::look_up(const v1::MeshRef& mesh) {
  const auto asset =
      load(mesh.has_scene_hash(), mesh.has_scene_hash() ? mesh.scene_hash() : mesh.scene_name());
  return asset ? Status() : tl::unexpected(asset.error());
}

std::shared_ptr<const SceneAsset> RecordedScenes::asset(const v1::SceneRef& scene) {
  auto asset = load(scene.has_hash(), scene.has_hash() ? scene.hash() : scene.name());
  return asset ? *asset : nullptr;
}

}  // namespace sightline
