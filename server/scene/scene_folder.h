// Scenes by name from one folder (--scene-dir). Nothing outside that folder can be reached: names are
// relative paths without "..", and after symbolic links are resolved the file must still lie inside (checked
// on the opened file).
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/scene/asset.h"
#include "server/scene/confined_folder.h"
#include "server/scene/gltf.h"

namespace sightline {

// A file that a scene was read from, as it was then.
struct SceneFile {
  std::string name;  // relative to the folder; empty: uploaded
  std::shared_ptr<const std::string> bytes;
};

// Keeps loaded assets as long as some session uses them. Thread-safe.
class SceneLibrary {
 public:
  // `folder` may be empty: then nothing can be loaded by name (kFailedPrecondition, "--scene-dir is not
  // set"). One that cannot be opened says so at every load_named. `store` must outlive the library. With
  // `keep_uploaded_bytes` an upload's bytes stay as long as its asset does, for files_of.
  SceneLibrary(std::string folder, GltfLimits limits, GeometryStore& store, bool keep_uploaded_bytes = false);

  // "hall.glb" or "levels/one.gltf". Errors carry field "scene.name": kInvalidArgument for a name that leaves
  // the folder, kNotFound, or what read_gltf says with its own field. A file that changed on disk, or one of
  // the files that it refers to, is read anew (told by modification time and size).
  Result<std::shared_ptr<const SceneAsset>> load_named(const std::string& name);
  // Whether load_named would answer without reading the file.
  bool is_loaded(const std::string& name) { return find_unchanged(name) != nullptr; }
  // Reads uploaded bytes (no external files) and keeps the asset under its hash while it is used, and the
  // newest `kKeptUploads` ones even when unused, so that an upload is still there when the session opens.
  Result<std::shared_ptr<const SceneAsset>> add_uploaded(std::span<const std::byte> bytes);
  // kNotFound (field "scene.hash") when no such asset is alive.
  Result<std::shared_ptr<const SceneAsset>> find(const ContentHash& hash);
  // The bytes of a scene that is loaded, so that it can be loaded elsewhere: the scene file first, then what it refers
  // to. Named files are read again, which may take seconds; whoever asks while others hold the bytes shares them.
  // kNotFound: not loaded, or an upload whose bytes are not kept; kFailedPrecondition: a file has changed since it was
  // loaded; or as reading fails. By hash: an upload, or a named scene of that content.
  Result<std::vector<SceneFile>> files_of(const std::string& name);
  Result<std::vector<SceneFile>> files_of(const ContentHash& hash);
  // Names of the .glb and .gltf files below the folder that sort after `after`: the first `limit` of them, sorted by bytes.
  std::vector<std::string> names(const std::string& after, size_t limit) const;

  static constexpr size_t kKeptUploads = 8;
  const GltfLimits& limits() const { return limits_; }

 private:
  // What an asset was read from: the scene file and every file that it refers to.
  struct Source {
    std::string path;  // relative to the folder
    FileStamp stamp;
  };
  struct Named {
    std::vector<Source> sources;
    std::weak_ptr<const SceneAsset> asset;
  };
  // A file's bytes that somebody holds, and of when they are.
  struct KeptFile {
    FileStamp stamp;
    std::weak_ptr<const std::string> bytes;
  };
  using Asset = std::shared_ptr<const SceneAsset>;

  Result<SceneFile> read_again(const Source& source);
  std::string name_of(const ContentHash& hash);  // of a named scene that is alive; empty: none
  Asset find_unchanged(const std::string& name);
  Result<Asset> read_named(const std::string& name, std::vector<Source>& sources) const;
  Asset remember(Asset asset);  // needs mutex_

  const std::string folder_;
  const std::optional<ConfinedFolder> opened_;  // absent when folder_ is empty or cannot be opened
  const GltfLimits limits_;
  GeometryStore& store_;
  const bool keep_uploaded_bytes_;
  std::mutex mutex_;
  std::map<std::string, Named> named_;                              // guarded by mutex_
  std::map<ContentHash, std::weak_ptr<const SceneAsset>> by_hash_;  // guarded by mutex_
  std::vector<std::shared_ptr<const SceneAsset>> kept_uploads_;     // guarded by mutex_
  std::map<ContentHash, std::weak_ptr<const std::string>> uploaded_bytes_;  // guarded by mutex_
  std::map<std::string, KeptFile> kept_files_;                              // by path; guarded by mutex_
};

}  // namespace sightline
