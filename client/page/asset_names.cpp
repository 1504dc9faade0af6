#include "client/page/asset_names.h"

#include <algorithm>

#include "server/scene/mirror.h"

namespace sightline {

std::unordered_map<uint64_t, std::string> asset_names(const SceneAsset& asset) {
  std::unordered_map<uint64_t, std::string> names;
  uint64_t k = 0;
  for (const AssetNode& node : asset.nodes) {
    if (node.mesh < 0 || !asset.meshes[static_cast<size_t>(node.mesh)]) continue;
    const size_t count = std::max<size_t>(1, node.gpu_instances.size());
    for (size_t i = 0; i < count; ++i) {
      std::string& name = names[kAssetIdBit | k++] = node.name;
      if (count > 1) name.append(" #").append(std::to_string(i + 1));
    }
  }
  return names;
}

}  // namespace sightline
