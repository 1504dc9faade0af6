#include "server/scene/scene_folder.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <numeric>

namespace sightline {
namespace {

constexpr const char* kField = "scene.name";

std::optional<ConfinedFolder> open_or_nothing(const std::string& path) {
  if (path.empty()) return std::nullopt;
  auto folder = ConfinedFolder::open(path);
  if (!folder) return std::nullopt;
  return std::move(*folder);
}

bool is_scene_name(const std::string& name) {
  return name.ends_with(".glb") || name.ends_with(".gltf");
}

Error with_field(Error error, const std::string& field) {
  if (error.field.empty()) error.field = field;
  return error;
}

// "levels/one.gltf" -> "levels/"
std::string folder_of(const std::string& name) {
  const size_t slash = name.rfind('/');
  return slash == std::string::npos ? "" : name.substr(0, slash + 1);
}

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// The asset, holding `bytes` as long as it is held itself.
std::shared_ptr<const SceneAsset> with_bytes(std::shared_ptr<const SceneAsset> asset,
                                             std::shared_ptr<const std::string> bytes) {
  const SceneAsset* const plain = asset.get();
  return {std::make_shared<std::pair<std::shared_ptr<const SceneAsset>, std::shared_ptr<const std::string>>>(
              std::move(asset), std::move(bytes)),
          plain};
}

// A fair estimate. Each node counts as much as its struct, since a file can have very many.
size_t memory_of(const SceneAsset& asset) {
  size_t bytes = sizeof(asset) + asset.nodes.size() * sizeof(AssetNode);
  for (const auto& mesh : asset.meshes) bytes += mesh ? mesh->bytes() : 0;
  for (const AssetNode& node : asset.nodes)
    bytes += node.gpu_instances.size() * sizeof(Affine) + node.extras_json.size();
  for (const AssetAnimation& animation : asset.animations)
    for (const AssetChannel& channel : animation.channels)
      bytes += (channel.times_s.size() + channel.values.size()) * sizeof(float);
  return bytes;
}

}  // namespace

SceneLibrary::SceneLibrary(std::string folder, GltfLimits limits, GeometryStore& store, bool keep_uploaded_bytes,
                           size_t kept_bytes, size_t owner_bytes)
    : folder_(std::move(folder)),
      opened_(open_or_nothing(folder_)),
      limits_(limits),
      store_(store),
      keep_uploaded_bytes_(keep_uploaded_bytes),
      kept_bytes_(kept_bytes),
      owner_bytes_(owner_bytes) {}

Result<std::shared_ptr<const SceneAsset>> SceneLibrary::load_named(const std::string& name, WorkLimit* work) {
  if (folder_.empty()) return fail(ErrorCode::kFailedPrecondition, kField, "--scene-dir is not set");
  if (!opened_) return fail(ErrorCode::kUnavailable, kField, "the scene folder cannot be opened");
  if (!is_scene_name(name)) return invalid(kField, "must end in .glb or .gltf");
  if (Asset asset = find_unchanged(name)) return asset;

  std::vector<Source> sources;
  auto asset = read_named(name, sources, work);
  if (!asset) return asset;
  const MutexLock lock(mutex_);
  Asset shared = remember(std::move(*asset), {});
  named_[name] = {std::move(sources), shared};
  return shared;
}

GltfLimits SceneLibrary::limits_with(WorkLimit* work) const {
  GltfLimits limits = limits_;
  limits.work = work;
  return limits;
}

// The lock is not held while the disk is read.
SceneLibrary::Asset SceneLibrary::find_unchanged(const std::string& name) {
  if (!opened_) return nullptr;
  Asset asset;
  std::vector<Source> sources;
  {
    const MutexLock lock(mutex_);
    const auto known = named_.find(name);
    if (known == named_.end()) return nullptr;
    asset = known->second.asset.lock();
    sources = known->second.sources;
  }
  if (!asset) return nullptr;
  for (const Source& source : sources) {
    const auto now = opened_->stamp(source.path);
    if (!now || *now != source.stamp) return nullptr;
  }
  return asset;
}

Result<SceneLibrary::Asset> SceneLibrary::read_named(const std::string& name, std::vector<Source>& sources,
                                                     WorkLimit* work) const {
  auto file = opened_->read(name, limits_.max_file_bytes);
  if (!file) return tl::unexpected(with_field(std::move(file.error()), kField));
  sources.push_back({name, file->stamp});
  const ExternalFile external = [&](const std::string& relative) -> Result<std::vector<std::byte>> {
    const std::string path = folder_of(name) + relative;
    auto content = opened_->read(path, limits_.max_file_bytes);
    if (!content) return tl::unexpected(std::move(content.error()));
    sources.push_back({path, content->stamp});
    return std::move(content->bytes);
  };
  auto asset = read_gltf(file->bytes, external, store_, limits_with(work));
  if (!asset) return tl::unexpected(with_field(std::move(asset.error()), kField));
  return asset;
}

Result<std::shared_ptr<const SceneAsset>> SceneLibrary::add_uploaded(std::span<const std::byte> bytes,
                                                                     const std::string& owner, WorkLimit* work) {
  auto asset = read_gltf(bytes, nullptr, store_, limits_with(work));
  if (!asset) return asset;
  std::shared_ptr<const std::string> kept;
  if (keep_uploaded_bytes_) {
    kept = std::make_shared<const std::string>(text_of(bytes));
    *asset = with_bytes(std::move(*asset), kept);
  }
  const MutexLock lock(mutex_);
  if (!make_room(**asset, owner))
    return fail(ErrorCode::kResourceExhausted, "",
                "the scenes that this client has uploaded take more than " + std::to_string(owner_bytes_ >> 20) +
                    " MiB (--client-scenes-memory-mib)");
  Asset shared = remember(*asset, owner);
  if (kept && shared == *asset) uploaded_bytes_[{owner, shared->hash}] = kept;
  keep(shared, owner);
  return shared;
}

size_t SceneLibrary::bytes_of_others(const SceneAsset& asset, const std::string& owner) const {
  size_t bytes = 0;
  for (auto entry = by_hash_.lower_bound({owner, ContentHash{}});
       entry != by_hash_.end() && entry->first.first == owner; ++entry)
    if (const Asset alive = entry->second.lock(); alive && alive->hash != asset.hash) bytes += memory_of(*alive);
  return bytes;
}

bool SceneLibrary::make_room(const SceneAsset& asset, const std::string& owner) {
  if (owner_bytes_ == 0 || owner.empty()) return true;
  const auto unused = [&](const KeptUpload& kept) {
    return kept.owner == owner && kept.asset.use_count() == 1 && kept.asset->hash != asset.hash;
  };
  size_t bytes = bytes_of_others(asset, owner) + memory_of(asset);
  size_t spare = 0;
  for (const KeptUpload& kept : kept_uploads_)
    if (unused(kept)) spare += kept.bytes;
  if (bytes > owner_bytes_ + spare) return false;
  std::erase_if(kept_uploads_, [&](const KeptUpload& kept) {
    if (bytes <= owner_bytes_ || !unused(kept)) return false;
    bytes -= kept.bytes;
    ++dropped_uploads_.for_owner;
    return true;
  });
  return true;
}

void SceneLibrary::keep(Asset asset, const std::string& owner) {
  std::erase_if(kept_uploads_, [&](const KeptUpload& kept) { return kept.asset == asset; });
  const size_t bytes = memory_of(*asset);
  kept_uploads_.push_back({std::move(asset), owner, bytes});
  const auto all = [&]() NEEDS(mutex_) {
    return std::accumulate(kept_uploads_.begin(), kept_uploads_.end(), size_t{0},
                           [](size_t sum, const KeptUpload& kept) { return sum + kept.bytes; });
  };
  while (kept_uploads_.size() > kKeptUploads && drop_one_upload([](const KeptUpload&) { return size_t{1}; })) {
  }
  while (all() > kept_bytes_ && drop_one_upload([](const KeptUpload& kept) { return kept.bytes; })) {
  }
}

// The owner with the largest amount loses its oldest upload. `amount` is what one upload takes of the limit that is
// exceeded: one scene, or its bytes. An owner within its share, the limit divided by the number of owners, loses
// nothing. The newest upload stays: false when the owner has no other.
bool SceneLibrary::drop_one_upload(const std::function<size_t(const KeptUpload&)>& amount) {
  std::map<std::string, size_t> amounts;
  for (const KeptUpload& kept : kept_uploads_) amounts[kept.owner] += amount(kept);
  const auto most = std::max_element(amounts.begin(), amounts.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  const auto newest = std::prev(kept_uploads_.end());
  const auto oldest = std::find_if(kept_uploads_.begin(), newest,
                                   [&](const KeptUpload& kept) { return kept.owner == most->first; });
  if (oldest == newest) return false;
  if (oldest->asset.use_count() == 1) ++dropped_uploads_.for_all;
  kept_uploads_.erase(oldest);
  return true;
}

// Two loads of the same bytes by one owner share one asset: the one that is still in use.
SceneLibrary::Asset SceneLibrary::remember(Asset asset, const std::string& owner) {
  std::erase_if(by_hash_, [](const auto& entry) { return entry.second.expired(); });
  std::erase_if(named_, [](const auto& entry) { return entry.second.asset.expired(); });
  std::erase_if(uploaded_bytes_, [](const auto& entry) { return entry.second.expired(); });
  std::weak_ptr<const SceneAsset>& known = by_hash_[{owner, asset->hash}];
  if (Asset alive = known.lock()) return alive;
  known = asset;
  return asset;
}

template <typename Value>
std::shared_ptr<Value> SceneLibrary::find_in(const ByHash<Value>& assets, const ContentHash& hash,
                                             const SceneReader& reader) {
  for (const std::string& owner : {reader.client, std::string()})
    if (const auto found = assets.find({owner, hash}); found != assets.end())
      if (auto alive = found->second.lock()) return alive;
  if (!reader.sees_all) return nullptr;
  for (const auto& [key, value] : assets)
    if (key.second == hash)
      if (auto alive = value.lock()) return alive;
  return nullptr;
}

Result<std::shared_ptr<const SceneAsset>> SceneLibrary::find(const ContentHash& hash, const SceneReader& reader) {
  const MutexLock lock(mutex_);
  if (Asset asset = find_in(by_hash_, hash, reader)) return asset;
  return fail(ErrorCode::kNotFound, "scene.hash", "no scene with the hash " + to_hex(hash) + " is loaded");
}

Result<std::vector<SceneFile>> SceneLibrary::files_of(const std::string& name) {
  std::vector<Source> sources;
  {
    const MutexLock lock(mutex_);
    const auto known = named_.find(name);
    if (known == named_.end() || known->second.asset.expired())
      return fail(ErrorCode::kNotFound, kField, "\"" + name + "\" is not loaded");
    sources = known->second.sources;
  }
  std::vector<SceneFile> files;
  for (const Source& source : sources) {
    auto file = read_again(source);
    if (!file) return tl::unexpected(with_field(std::move(file.error()), kField));
    files.push_back(std::move(*file));
  }
  return files;
}

Result<std::vector<SceneFile>> SceneLibrary::files_of(const ContentHash& hash, const SceneReader& reader) {
  {
    const MutexLock lock(mutex_);
    if (auto bytes = find_in(uploaded_bytes_, hash, reader)) return std::vector<SceneFile>{{"", std::move(bytes)}};
  }
  if (const std::string name = name_of(hash); !name.empty()) return files_of(name);
  return fail(ErrorCode::kNotFound, "scene.hash", "the bytes of " + to_hex(hash) + " were not kept");
}

std::string SceneLibrary::name_of(const ContentHash& hash) {
  const MutexLock lock(mutex_);
  for (const auto& [name, named] : named_)
    if (const Asset asset = named.asset.lock(); asset && asset->hash == hash) return name;
  return {};
}

// The lock is not held while the disk is read.
Result<SceneFile> SceneLibrary::read_again(const Source& source) {
  {
    const MutexLock lock(mutex_);
    if (const auto kept = kept_files_.find(source.path); kept != kept_files_.end())
      if (auto bytes = kept->second.bytes.lock(); bytes && kept->second.stamp == source.stamp)
        return SceneFile{source.path, std::move(bytes)};
  }
  auto content = opened_->read(source.path, limits_.max_file_bytes);
  if (!content) return tl::unexpected(std::move(content.error()));
  if (content->stamp != source.stamp)
    return fail(ErrorCode::kFailedPrecondition, "", "\"" + source.path + "\" has changed since it was loaded");
  auto bytes = std::make_shared<const std::string>(text_of(content->bytes));
  const MutexLock lock(mutex_);
  std::erase_if(kept_files_, [](const auto& entry) { return entry.second.bytes.expired(); });
  kept_files_[source.path] = {source.stamp, bytes};
  return SceneFile{source.path, std::move(bytes)};
}

std::vector<std::string> SceneLibrary::names(const std::string& after, size_t limit) const {
  namespace fs = std::filesystem;
  std::vector<std::string> found;
  if (!opened_) return found;
  std::error_code error;
  const auto skip = fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator it(folder_, skip, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().lexically_relative(folder_).generic_string();
    if (name > after && is_scene_name(name) && opened_->stamp(name)) found.push_back(name);
  }
  std::sort(found.begin(), found.end());
  if (found.size() > limit) found.resize(limit);
  return found;
}

}  // namespace sightline
