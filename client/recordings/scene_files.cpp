#include "client/recordings/scene_files.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/page/page_data.h"
#include "server/base/hash.h"
#include "server/scene/confined_folder.h"
#include "server/scene/gltf.h"
#include "server/scene/gltf_buffers.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;
using ReadBeside = std::function<Result<Bytes>(const std::string&)>;

constexpr std::string_view kAttachedScene = "scene/", kAttachedUpload = "upload/";

bool is_binary(const Bytes& file) {
  constexpr std::string_view kMagic = "glTF";
  return file.size() >= kMagic.size() &&
         std::string_view(reinterpret_cast<const char*>(file.data()), kMagic.size()) == kMagic;
}

bool is_scene_name(const std::string& name) {
  return name.ends_with(".glb") || name.ends_with(".gltf");
}

// A relative path that does not leave its folder.
bool stays_inside(const std::string& name) {
  const fs::path path(name);
  return !path.empty() && path.is_relative() &&
         std::none_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
}

// The hash by which a scene library knows the scene. It covers the file and the files that it refers to.
Result<std::string> content_hash(const Bytes& file, const ReadBeside& read_beside) {
  if (is_binary(file)) return to_hex(hash_bytes(file));
  GeometryStore store;
  auto asset = read_gltf(file, read_beside, store);
  if (!asset) return tl::unexpected(std::move(asset.error()));
  return to_hex((*asset)->hash);
}

// An upload is one file, so external buffers of a .gltf are put into it.
Result<Bytes> in_one_file(Bytes file, const ReadBeside& read_beside) {
  if (is_binary(file)) return file;
  const char* text = reinterpret_cast<const char*>(file.data());
  nlohmann::json document = nlohmann::json::parse(text, text + file.size(), nullptr, false);
  if (!document.is_object() || !document.contains("buffers") || !document["buffers"].is_array()) return file;
  for (nlohmann::json& buffer : document["buffers"]) {
    if (!buffer.is_object() || !buffer.contains("uri") || !buffer["uri"].is_string()) continue;
    const std::string uri = buffer["uri"];
    if (uri.starts_with("data:")) continue;
    const auto path = relative_path_of_uri(uri, "buffers.uri");
    if (!path) return tl::unexpected(path.error());
    const auto bytes = read_beside(*path);
    if (!bytes) return tl::unexpected(bytes.error());
    const auto* data = reinterpret_cast<const uint8_t*>(bytes->data());
    buffer["uri"] = std::string("data:application/octet-stream;base64,").append(to_base64({data, bytes->size()}));
  }
  const std::string packed = document.dump();
  const auto bytes = std::as_bytes(std::span(packed));
  return Bytes(bytes.begin(), bytes.end());
}

Error missing(const std::string& name, const std::string& hash) {
  std::string message = "the recording names the scene ";
  message.append(name.empty() ? "with the hash " + hash : '"' + name + '"')
      .append(
          ", which is not attached to it; give the file with --scene FILE, or its folder with --scene-dir "
          "DIR");
  return {ErrorCode::kNotFound, "scene", std::move(message)};
}

}  // namespace

void SceneFiles::bring_to(Bring bring) {
  bring_ = std::move(bring);
  brought_.clear();
}

Result<Bytes> SceneFiles::attachment(const std::string& name) const {
  for (const mcap::AttachmentIndex& index : recording_.container().attachments) {
    if (index.name != name) continue;
    const auto text = recording_.reader().attachment(index);
    if (!text) return tl::unexpected(text.error());
    const auto bytes = std::as_bytes(std::span(*text));
    return Bytes(bytes.begin(), bytes.end());
  }
  return fail(ErrorCode::kNotFound, name, "is not attached to the recording");
}

void SceneFiles::add_attachments(const Wanted& wanted, std::vector<Place>& places) const {
  for (const mcap::AttachmentIndex& index : recording_.container().attachments) {
    const std::string& name = index.name;
    const bool named = !wanted.name.empty() && name == std::string(kAttachedScene).append(wanted.name);
    const bool hashed = !wanted.hash.empty() && (name == std::string(kAttachedUpload).append(wanted.hash) ||
                                                 (name.starts_with(kAttachedScene) && is_scene_name(name)));
    if (!named && !hashed) continue;
    const std::string folder = name.substr(0, name.rfind('/') + 1);
    places.push_back({[this, name] { return attachment(name); },
                      [this, folder](const std::string& relative) { return attachment(folder + relative); }, name});
  }
}

void SceneFiles::add_files(const Wanted& wanted, std::vector<Place>& places) const {
  const auto add = [&](const fs::path& path) {
    places.push_back({[path] { return read_whole_file(path.string(), SIZE_MAX); },
                      [path](const std::string& relative) {
                        return read_whole_file((path.parent_path() / relative).string(), SIZE_MAX);
                      },
                      path.string()});
  };
  for (const std::string& file : options_.files)
    if (!wanted.hash.empty() || fs::path(file).filename() == fs::path(wanted.name).filename()) add(file);
  if (options_.folder.empty()) return;
  std::error_code trouble;
  if (!wanted.name.empty() && stays_inside(wanted.name)) {
    const fs::path path = fs::path(options_.folder) / wanted.name;
    if (fs::is_regular_file(path, trouble)) add(path);
  }
  if (wanted.hash.empty()) return;
  const auto skip = fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator it(options_.folder, skip, trouble), end; !trouble && it != end;
       it.increment(trouble))
    if (is_scene_name(it->path().string()) && it->is_regular_file(trouble)) add(it->path());
}

std::vector<SceneFiles::Place> SceneFiles::places_of(const Wanted& wanted) const {
  std::vector<Place> places;
  add_attachments(wanted, places);
  add_files(wanted, places);
  return places;
}

// When files are only searched for a hash, unreadable ones are skipped.
Result<std::string> SceneFiles::bring_first(const std::vector<Place>& places, const Wanted& wanted) {
  for (const Place& place : places) {
    auto file = place.read();
    if (!file && wanted.hash.empty()) return tl::unexpected(std::move(file.error()));
    if (!file) continue;
    if (!wanted.hash.empty()) {
      const auto hash = content_hash(*file, place.read_beside);
      if (!hash || *hash != wanted.hash) continue;
    }
    auto whole = in_one_file(std::move(*file), place.read_beside);
    auto hash = whole ? bring_(*whole) : Result<std::string>(tl::unexpected(whole.error()));
    if (!hash) return fail(hash.error().code, place.name, to_string(hash.error()));
    return hash;
  }
  if (options_.may_be_there) return std::string();
  return tl::unexpected(missing(wanted.name, wanted.hash));
}

Result<std::string> SceneFiles::bring(const Wanted& wanted) {
  const std::string key = wanted.name.empty() ? wanted.hash : "name:" + wanted.name;
  if (const auto known = brought_.find(key); known != brought_.end()) return known->second;
  auto hash = bring_first(places_of(wanted), wanted);
  if (hash) brought_[key] = *hash;
  return hash;
}

Status SceneFiles::name_by_hash(v1::OpenSession& open) {
  if (open.has_scene() && open.scene().source_case() != v1::SceneRef::SOURCE_NOT_SET) {
    const auto hash = bring({open.scene().name(), open.scene().hash()});
    if (!hash) return tl::unexpected(hash.error());
    if (!hash->empty()) open.mutable_scene()->set_hash(*hash);
  }
  for (v1::NewInstance& instance : *open.mutable_instances())
    if (Status named = name_by_hash(instance); !named) return named;
  return {};
}

bool SceneFiles::named_in(const v1::Tick& tick) {
  const auto& added = tick.delta().added_instances();
  return std::any_of(added.begin(), added.end(), [](const v1::NewInstance& instance) { return instance.has_mesh(); });
}

Status SceneFiles::name_by_hash(v1::Tick& tick) {
  if (!named_in(tick)) return {};
  for (v1::NewInstance& instance : *tick.mutable_delta()->mutable_added_instances())
    if (Status named = name_by_hash(instance); !named) return named;
  return {};
}

Status SceneFiles::name_by_hash(v1::NewInstance& instance) {
  if (!instance.has_mesh() || instance.mesh().source_case() == v1::MeshRef::SOURCE_NOT_SET) return {};
  v1::MeshRef& mesh = *instance.mutable_mesh();
  const auto hash = bring({mesh.scene_name(), mesh.scene_hash()});
  if (!hash) return tl::unexpected(hash.error());
  if (!hash->empty()) mesh.set_scene_hash(*hash);
  return {};
}

}  // namespace sightline
