// Loads scenes by name from one folder (--scene-dir), and scenes that clients upload. Nothing outside the folder can be
// reached: names are relative paths without "..", and the opened file must lie inside after symbolic links are
// resolved.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/base/mutex.h"
#include "server/scene/asset.h"
#include "server/scene/confined_folder.h"
#include "server/scene/gltf.h"

namespace sightline {

// A file that a scene was read from.
struct SceneFile {
  std::string name;  // relative to the folder; empty for an upload
  std::shared_ptr<const std::string> bytes;
};

// Who asks for a scene by its hash.
struct SceneReader {
  std::string client;     // the owner of its uploads
  bool sees_all = false;  // also the uploads of others
};

// Keeps loaded assets while a session uses them. Thread-safe.
class SceneLibrary {
 public:
  // With an empty `folder` nothing can be loaded by name (kFailedPrecondition, "--scene-dir is not set"). When the
  // folder cannot be opened, every call of load_named says so. `store` must outlive the library. With
  // `keep_uploaded_bytes` the bytes of an upload are kept as long as its asset, for files_of. `kept_bytes` is the most
  // memory of uploads that are kept for sessions to come. The newest one is kept in any case. `owner_bytes` is the most
  // memory of all uploads of one owner, those in use included; 0: no limit.
  SceneLibrary(std::string folder, GltfLimits limits, GeometryStore& store, bool keep_uploaded_bytes = false,
               size_t kept_bytes = size_t{64} << 20, size_t owner_bytes = 0);

  // Loads "hall.glb" or "levels/one.gltf". Reads again when the modification time or size of the file, or of a file
  // that it refers to, has changed. Fails with field "scene.name" (kInvalidArgument for a name that leaves the folder;
  // kNotFound), or as read_gltf does. `work` ends the reading; null: nothing does.
  Result<std::shared_ptr<const SceneAsset>> load_named(const std::string& name, WorkLimit* work = nullptr);
  // True when load_named would return without reading the file.
  bool is_loaded(const std::string& name) { return find_unchanged(name) != nullptr; }
  // Reads uploaded bytes, which may not refer to other files, and keeps the asset under its hash while it is in use.
  // Uploads are kept even when unused, so that an upload is still available when its session opens. Beyond
  // kKeptUploads, the owner with the most scenes loses its oldest one; beyond kept_bytes, the owner with the most
  // bytes. An owner is the name of a client. Equal files of two owners are two assets, which share their geometries.
  // When the owner's uploads take more than owner_bytes, it loses its oldest ones that no session uses. Fails with
  // kResourceExhausted when that does not suffice, and as read_gltf does; nothing has changed then.
  Result<std::shared_ptr<const SceneAsset>> add_uploaded(std::span<const std::byte> bytes,
                                                         const std::string& owner = {}, WorkLimit* work = nullptr);
  // Finds a loaded asset: an upload of the reader's own, or a named scene. kNotFound (field "scene.hash") when there is
  // none.
  Result<std::shared_ptr<const SceneAsset>> find(const ContentHash& hash, const SceneReader& reader = {});
  // The files of a loaded scene, so that it can be loaded elsewhere: the scene file first, then the files that it
  // refers to. Named files are read again, which may take seconds; callers share bytes that are still held. A hash
  // finds an upload, or a named scene with that hash. Fails with kNotFound when the scene is not loaded or an upload's
  // bytes were not kept. Fails with kFailedPrecondition when a file has changed since it was loaded, and as reading
  // fails.
  Result<std::vector<SceneFile>> files_of(const std::string& name);
  Result<std::vector<SceneFile>> files_of(const ContentHash& hash, const SceneReader& reader = {});
  // Names of the .glb and .gltf files below the folder that sort after `after`: the first `limit` of them, sorted by
  // bytes.
  std::vector<std::string> names(const std::string& after, size_t limit) const;

  // Counts of uploads, open in no session, that were dropped for newer ones since the start. `for_owner`: the owner's
  // own uploads exceeded owner_bytes. `for_all`: the uploads of all clients exceeded their budget.
  struct DroppedUploads {
    std::atomic<uint64_t> for_all{0}, for_owner{0};
  };
  const DroppedUploads& dropped_uploads() const { return dropped_uploads_; }

  static constexpr size_t kKeptUploads = 256;
  const GltfLimits& limits() const { return limits_; }

 private:
  // One file that an asset was read from: the scene file, or a file that it refers to.
  struct Source {
    std::string path;  // relative to the folder
    FileStamp stamp;
  };
  struct Named {
    std::vector<Source> sources;
    std::weak_ptr<const SceneAsset> asset;
  };
  // Bytes of a file that a caller holds, and the file's stamp when they were read.
  struct KeptFile {
    FileStamp stamp;
    std::weak_ptr<const std::string> bytes;
  };
  using Asset = std::shared_ptr<const SceneAsset>;
  struct KeptUpload {
    Asset asset;
    std::string owner;
    size_t bytes = 0;
  };

  Result<SceneFile> read_again(const Source& source);
  std::string name_of(const ContentHash& hash);  // of a loaded named scene; empty when there is none
  Asset find_unchanged(const std::string& name);
  Result<Asset> read_named(const std::string& name, std::vector<Source>& sources, WorkLimit* work) const;
  GltfLimits limits_with(WorkLimit* work) const;
  // By owner, so that a client can neither find another's upload nor put its own in the place of it. Named scenes have
  // no owner.
  template <typename Value>
  using ByHash = std::map<std::pair<std::string, ContentHash>, std::weak_ptr<Value>>;

  template <typename Value>
  static std::shared_ptr<Value> find_in(const ByHash<Value>& assets, const ContentHash& hash,
                                        const SceneReader& reader);
  Asset remember(Asset asset, const std::string& owner) NEEDS(mutex_);
  void keep(Asset asset, const std::string& owner) NEEDS(mutex_);
  // of the owner's other assets
  size_t bytes_of_others(const SceneAsset& asset, const std::string& owner) const NEEDS(mutex_);
  // false: there is none, and nothing was dropped
  bool make_room(const SceneAsset& asset, const std::string& owner) NEEDS(mutex_);
  bool drop_one_upload(const std::function<size_t(const KeptUpload&)>& amount) NEEDS(mutex_);

  const std::string folder_;
  const std::optional<ConfinedFolder> opened_;  // absent when folder_ is empty or cannot be opened
  const GltfLimits limits_;
  GeometryStore& store_;
  const bool keep_uploaded_bytes_;
  const size_t kept_bytes_, owner_bytes_;
  DroppedUploads dropped_uploads_;
  Mutex mutex_;
  std::map<std::string, Named> named_ GUARDED(mutex_);
  ByHash<const SceneAsset> by_hash_ GUARDED(mutex_);
  std::vector<KeptUpload> kept_uploads_ GUARDED(mutex_);  // oldest first
  ByHash<const std::string> uploaded_bytes_ GUARDED(mutex_);
  std::map<std::string, KeptFile> kept_files_ GUARDED(mutex_);  // by path
};

}  // namespace sightline
