// Reads files that tests made (packed_mesh.h), and compares what was read with the meshes that they were made from.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/scene/gltf.h"
#include "tests/support/triangles.h"

namespace sightline {

// Where an error about a file of PackedFile::draco_node says that it is.
inline const std::string kDracoField = "meshes[0].primitives[0].extensions.KHR_draco_mesh_compression";

inline std::shared_ptr<const SceneAsset> load(const std::vector<std::byte>& glb,
                                              const ExternalFile& external = nullptr) {
  GeometryStore store;
  auto asset = read_gltf(glb, external, store);
  if (asset) return *asset;
  ADD_FAILURE() << to_string(asset.error());
  return std::make_shared<SceneAsset>();
}

inline Error error_of(const std::vector<std::byte>& glb, const GltfLimits& limits = {}) {
  GeometryStore store;
  const auto asset = read_gltf(glb, nullptr, store, limits);
  return asset ? Error{ErrorCode::kInternal, "", "was read without an error"} : asset.error();
}

inline std::vector<Triangle> triangles_in(const std::vector<std::byte>& glb) {
  const auto asset = load(glb);
  return asset->meshes.size() == 1 && asset->meshes[0] ? triangles_of(*asset->meshes[0]) : std::vector<Triangle>();
}

// The greatest distance between corners of `a` and the matching corners of `b`, under the rotation of `b`'s corners
// that fits best.
inline float distance(const Triangle& a, const Triangle& b) {
  float best = std::numeric_limits<float>::infinity();
  for (size_t turn = 0; turn < 3; ++turn) {
    float worst = 0.0f;
    for (size_t k = 0; k < 3; ++k)
      for (size_t axis = 0; axis < 3; ++axis) worst = std::max(worst, std::abs(a[k][axis] - b[(k + turn) % 3][axis]));
    best = std::min(best, worst);
  }
  return best;
}

// Every triangle of one set matches a different triangle of the other, with no corner farther than `step_m` along any
// axis.
inline void expect_same_within(const std::vector<Triangle>& wanted, std::vector<Triangle> found, float step_m) {
  ASSERT_EQ(found.size(), wanted.size());
  for (const Triangle& t : wanted) {
    const auto nearest = std::min_element(found.begin(), found.end(), [&](const Triangle& a, const Triangle& b) {
      return distance(t, a) < distance(t, b);
    });
    ASSERT_LE(distance(t, *nearest), step_m);
    found.erase(nearest);
  }
}

template <typename T>
std::span<const std::byte> raw(const std::vector<T>& values) {
  return std::as_bytes(std::span(values));
}

}  // namespace sightline
