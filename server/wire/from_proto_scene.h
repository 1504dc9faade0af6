// Readers for the messages of scene.proto. They fail with `field` or a path below it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/wire/from_proto.h"

namespace sightline {

// Makes instances. It asks the library only once for each file, even if many instances name it.
class InstanceReader {
 public:
  InstanceReader(const SceneSource& source, const Convention& convention) : source_(source), convention_(convention) {}

  Result<NewInstance> read(const v1::NewInstance& wire, const std::string& field);
  // The files of all meshes so far.
  std::vector<std::shared_ptr<const SceneAsset>> assets() const;

 private:
  using Asset = std::shared_ptr<const SceneAsset>;
  Result<std::shared_ptr<const Geometry>> read_geometry(const v1::NewInstance& wire, const std::string& field);
  Result<std::shared_ptr<const Geometry>> read_mesh(const v1::MeshRef& wire, const std::string& field);
  Result<Asset> find_asset(const v1::MeshRef& wire, const std::string& field);

  const SceneSource& source_;
  const Convention& convention_;
  std::map<std::string, Asset> assets_;  // by name or hash; names end in .glb or .gltf, hashes do not
};

// A scene file's instances, in metres and moved to the world origin. `wire` must name a file.
struct LoadedScene {
  std::shared_ptr<const SceneAsset> asset;
  std::vector<NewInstance> instances;
};
Result<LoadedScene> read_scene(const v1::SceneRef& wire, const SceneSource& source, const Convention& convention,
                               const std::string& field);

Status read_target(const v1::Target& wire, const Convention& convention, const std::string& field, Target& out);
Status read_delta(const v1::SceneDelta& wire, InstanceReader& instances, const std::string& field, SceneDelta& out);
// Fields "tick.transforms....".
Status read_transforms(const v1::Transforms& wire, const Convention& convention, TickInput& out);

}  // namespace sightline
