// libFuzzer reads arbitrary bytes as a scene file, .glb or .gltf, as an upload does.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "server/scene/gltf.h"
#include "server/scene/mirror.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  GeometryStore store;
  // Small limits: an input that gets past one exceeds the memory limit of the run, and so is found.
  GltfLimits limits;
  limits.max_file_bytes = 1 << 20;
  limits.max_instances = 1000;
  const auto asset = read_gltf(std::as_bytes(std::span(data, size)), nullptr, store, limits);
  if (!asset) {
    if (asset.error().message.empty()) std::abort();
    return 0;
  }
  for (const auto& mesh : (*asset)->meshes) {
    if (!mesh) continue;
    for (const uint32_t index : mesh->indices)
      if (index >= mesh->positions.size()) std::abort();
    for (const glm::vec3& position : mesh->positions)
      if (!(std::abs(position.x) <= kMaxCoordinateM && std::abs(position.y) <= kMaxCoordinateM &&
            std::abs(position.z) <= kMaxCoordinateM))
        std::abort();
  }
  const auto instances = instantiate(**asset, {}, store);
  if (instances && instances->size() > limits.max_instances) std::abort();
  return 0;
}
