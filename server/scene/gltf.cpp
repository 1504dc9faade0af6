// Reads a glTF file in four steps. Each step relies on the checks of the one before.
#include "server/scene/gltf.h"

#include <algorithm>
#include <filesystem>

#include "server/scene/confined_folder.h"
#include "server/scene/gltf_buffers.h"
#include "server/scene/gltf_container.h"
#include "server/scene/gltf_document.h"
#include "server/scene/gltf_json.h"

namespace sightline {
namespace {

// The copy for tinygltf names no file and no image. If tinygltf asks for one nevertheless, it gets nothing.
void forbid_io(tinygltf::TinyGLTF& reader) {
  tinygltf::FsCallbacks none{};
  none.FileExists = [](const std::string&, void*) { return false; };
  none.ExpandFilePath = [](const std::string&, void*) { return std::string(); };
  none.ReadWholeFile = [](std::vector<unsigned char>*, std::string*, const std::string&, void*) { return false; };
  none.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&, void*) {
    return false;
  };
  reader.SetFsCallbacks(none);
  reader.SetImageLoader([](tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int,
                           void*) { return true; },
                        nullptr);
}

Status parse_model(const nlohmann::json& json, tinygltf::Model& model) {
  const std::string text = json.dump();
  tinygltf::TinyGLTF reader;
  forbid_io(reader);
  std::string errors, warnings;
  const bool parsed = reader.LoadASCIIFromString(&model, &errors, &warnings, text.data(),
                                                 static_cast<unsigned>(text.size()), "");
  // tinygltf reports some members that it dropped only in the text.
  if (!parsed || !errors.empty()) return invalid("json", errors.empty() ? "cannot be read" : errors);
  return {};
}

// One hash for the file and all files that it refers to.
ContentHash hash_of(std::span<const std::byte> bytes, const std::vector<ContentHash>& external) {
  const ContentHash own = hash_bytes(bytes);
  if (external.empty()) return own;
  std::vector<ContentHash> all{own};
  all.insert(all.end(), external.begin(), external.end());
  return hash_bytes(std::as_bytes(std::span(all)));
}

GltfBudget budget_of(const GltfLimits& limits) {
  return {limits.max_triangles,        3 * limits.max_triangles,  limits.max_instances,
          limits.max_animation_values, limits.max_unpacked_bytes, limits.instances_flag};
}

void note_extensions(const nlohmann::json& json, SceneAsset& asset) {
  if (!json.contains("extensionsUsed")) return;
  for (const auto& name : json["extensionsUsed"]) asset.extensions_used.push_back(name.get<std::string>());
}

// What the file asks for and does not get, though nothing that is drawn needs it.
void warn_of_what_is_left_out(GltfDocument& document) {
  const nlohmann::json& about = document.json["asset"];
  if (const std::string least = about.value("minVersion", std::string("2.0")); least != "2.0")
    document.warnings.add("asset.minVersion: is " + least + ", and the file is read as glTF 2.0");
  for (const auto& [buffer, why] : document.absent_buffers)
    document.warnings.add(why.field + ": " + why.message + "; left out, because nothing that is drawn uses it");
}

Result<std::shared_ptr<const SceneAsset>> read_document(std::span<const std::byte> bytes, const ExternalFile& external,
                                                        GeometryStore& store, const GltfLimits& limits) {
  // 1. The container: which bytes are JSON.
  const auto container = split_gltf_container(bytes);
  if (!container) return tl::unexpected(container.error());
  // 2. The JSON: bounded, then every type and reference.
  const auto json = parse_gltf_json(container->json, limits);
  if (!json) return tl::unexpected(json.error());
  const auto checked = check_gltf_json(*json, limits);
  if (!checked) return tl::unexpected(checked.error());
  // 3. The buffers, and the structure through tinygltf.
  WorkLimit::Part work(limits.work);
  GltfDocument document{*json, work};
  document.budget = budget_of(limits);
  if (const Status s = load_gltf_buffers(*container, external, limits, document); !s) return tl::unexpected(s.error());
  if (const Status s = go_on(document); !s) return tl::unexpected(s.error());
  if (const Status s = parse_model(*checked, document.model); !s) return tl::unexpected(s.error());
  if (const Status s = go_on(document); !s) return tl::unexpected(s.error());
  // 4. The asset.
  auto asset = std::make_shared<SceneAsset>();
  asset->hash = hash_of(bytes, document.external_hashes);
  note_extensions(*json, *asset);
  std::vector<int> asset_node_of;
  if (const Status s = read_gltf_nodes(document, limits, *asset, asset_node_of); !s) return tl::unexpected(s.error());
  if (const Status s = read_gltf_meshes(document, store, asset_node_of, *asset); !s) return tl::unexpected(s.error());
  if (const Status s = read_gltf_animations(document, asset_node_of, *asset); !s) return tl::unexpected(s.error());
  warn_of_what_is_left_out(document);
  asset->warnings = document.warnings.take();
  return asset;
}

// The limits of a file come from the memory for geometry, but for those whose refusals name another flag.
Result<std::shared_ptr<const SceneAsset>> with_memory_flag(Result<std::shared_ptr<const SceneAsset>> asset,
                                                           const std::string& flag) {
  if (asset || asset.error().code != ErrorCode::kResourceExhausted || flag.empty()) return asset;
  std::string& message = asset.error().message;
  if (message.find("(--") == std::string::npos) message += " (" + flag + ")";
  return asset;
}

}  // namespace

void GltfWarnings::add(std::string text) {
  if (texts_.size() < kMax)
    texts_.push_back(std::move(text));
  else if (texts_.size() == kMax)
    texts_.push_back("further warnings left out");
}

Status GltfBudget::take(size_t& left, size_t amount, const std::string& field, const char* what) {
  if (amount > left)
    return fail(ErrorCode::kResourceExhausted, field, std::string("too many ") + what + " in one file");
  left -= amount;
  return {};
}

Status GltfBudget::take_instances(size_t amount, const std::string& field) {
  Status taken = take(instances, amount, field, "instances");
  if (!taken && !instances_flag.empty()) taken.error().message += " (" + instances_flag + ")";
  return taken;
}

std::string gltf_path(const char* collection, size_t index) {
  return std::string(collection) + "[" + std::to_string(index) + "]";
}

GltfLimits GltfLimits::within(size_t bytes) {
  // With what is needed while it is built: three own corners for each triangle, indices and trees.
  constexpr size_t kBytesOfTriangle = 96;
  // Measured, with what tinygltf and the JSON library make of them.
  constexpr size_t kBytesOfNode = 512, kBytesOfJsonValue = 96;
  GltfLimits limits;
  limits.max_triangles = std::min(limits.max_triangles, bytes / kBytesOfTriangle);
  limits.max_nodes = std::min(limits.max_nodes, bytes / kBytesOfNode);
  limits.max_json_bytes = std::min(limits.max_json_bytes, bytes / 4);
  limits.max_json_values = std::min(limits.max_json_values, bytes / kBytesOfJsonValue);
  limits.max_animation_values = std::min(limits.max_animation_values, bytes / 4 / sizeof(float));
  limits.max_unpacked_bytes = std::min(limits.max_unpacked_bytes, bytes);
  return limits;
}

Result<std::shared_ptr<const SceneAsset>> read_gltf(std::span<const std::byte> bytes, const ExternalFile& external,
                                                    GeometryStore& store, const GltfLimits& limits) {
  if (bytes.size() > limits.max_file_bytes)
    return fail(ErrorCode::kResourceExhausted, "",
                "the file is larger than " + std::to_string(limits.max_file_bytes) + " bytes");
  try {
    return with_memory_flag(read_document(bytes, external, store, limits), limits.memory_flag);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kResourceExhausted, "", "not enough memory to read the file");
  } catch (const std::exception& e) {  // the JSON library and tinygltf throw; nothing of ours does
    return fail(ErrorCode::kDataLoss, "json", e.what());
  }
}

Result<std::shared_ptr<const SceneAsset>> read_gltf_file(const std::string& path, GeometryStore& store,
                                                         const GltfLimits& limits) {
  const std::filesystem::path file(path);
  const auto folder = ConfinedFolder::open(file.has_parent_path() ? file.parent_path().string() : ".");
  if (!folder) return tl::unexpected(folder.error());
  // The file itself was named by the user and may be a link to anywhere; what it refers to may not leave its
  // folder.
  auto bytes = read_whole_file(path, limits.max_file_bytes);
  if (!bytes) return tl::unexpected(std::move(bytes.error()));
  const ExternalFile external = [&](const std::string& relative) -> Result<std::vector<std::byte>> {
    auto content = folder->read(relative, limits.max_file_bytes);
    if (!content) return tl::unexpected(std::move(content.error()));
    return std::move(content->bytes);
  };
  return read_gltf(*bytes, external, store, limits);
}

}  // namespace sightline
