// Scenes by name from one folder (--scene-dir). Nothing outside that folder can be reached: names are relative paths
// without "..", and after symbolic links are resolved the file must still lie inside (checked on the opened file).
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/scene/asset.h"
#include "server/scene/gltf.h"

namespace sightline {

// Keeps loaded assets as long as some session uses them. Thread-safe.
class SceneLibrary {
 public:
  // `folder` may be empty: then nothing can be loaded by name (kFailedPrecondition, "--scene-dir is not set").
  SceneLibrary(std::string folder, GltfLimits limits, GeometryStore& store);

  // "hall.glb" or "levels/one.gltf". Errors carry field "scene.name": kInvalidArgument for a name that leaves the
  // folder, kNotFound, or what read_gltf says. A file that changed on disk is read anew.
  Result<std::shared_ptr<const SceneAsset>> load_named(const std::string& name);
  // Reads uploaded bytes (no external files) and keeps the asset under its hash while it is used, and the newest
  // `kKeptUploads` ones even when unused, so that an upload is still there when the session opens.
  Result<std::shared_ptr<const SceneAsset>> add_uploaded(std::span<const std::byte> bytes);
  // kNotFound (field "scene.hash") when no such asset is alive.
  Result<std::shared_ptr<const SceneAsset>> find(const ContentHash& hash);
  // Names of the .glb and .gltf files below the folder, sorted, at most `limit`.
  std::vector<std::string> names(size_t limit) const;

  static constexpr size_t kKeptUploads = 8;
  const GltfLimits& limits() const { return limits_; }

 private:
  struct Named {
    int64_t modified_ns = 0;
    uint64_t size_bytes = 0;
    std::weak_ptr<const SceneAsset> asset;
  };
  void remember(const std::shared_ptr<const SceneAsset>& asset);  // needs mutex_

  const std::string folder_;  // canonical absolute path, or empty
  const GltfLimits limits_;
  GeometryStore& store_;
  std::mutex mutex_;
  std::map<std::string, Named> named_;                                        // guarded by mutex_
  std::map<ContentHash, std::weak_ptr<const SceneAsset>> by_hash_;            // guarded by mutex_
  std::vector<std::shared_ptr<const SceneAsset>> kept_uploads_;               // guarded by mutex_
};

}  // namespace sightline
