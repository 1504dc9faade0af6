// Primitives that were packed by Draco (KHR_draco_mesh_compression).
#pragma once

#include <cstdint>
#include <vector>

#include "server/scene/gltf_document.h"
#include "server/scene/gltf_skin.h"

namespace sightline {

inline constexpr const char* kDracoExtension = "KHR_draco_mesh_compression";

// The extension's object, or null.
const tinygltf::Value* draco_packing(const tinygltf::Primitive& primitive);

// A primitive unpacked: always a list of triangles, also where the packed one is a strip.
struct DracoMesh {
  std::vector<std::byte> positions;  // tightly packed, of the type that the accessor of POSITION states
  size_t vertex_count = 0;
  std::vector<uint32_t> indices;           // three a triangle; not checked against vertex_count
  std::vector<GltfInfluences> influences;  // of a skin; empty where none was asked for
};

// `packing` has passed check_gltf_json; `position` is the accessor of POSITION; `skinned` asks for the influences that
// are packed with it; `field` names the primitive. Takes what
// Draco needs from the budget of unpacked bytes, before it is allocated. Fails with kDataLoss (a damaged stream),
// kUnsupported (a bit stream other than 2.2), kInvalidArgument (positions of another type than the accessor's, joints
// without weights or not four a vertex) or
// kResourceExhausted (more than `max_triangles`, which the accessors state, or than the budget has left), all with
// a field at or below "<field>.extensions.KHR_draco_mesh_compression". The number of vertices may differ from the
// accessor's: Draco parts vertices at which surfaces touch without an edge.
Result<DracoMesh> unpack_draco(GltfDocument& document, const tinygltf::Value& packing, int position, bool skinned,
                               size_t max_triangles, const std::string& field);

}  // namespace sightline
