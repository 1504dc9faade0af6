// Makes packed glTF files with the libraries' own encoders: what an exporter would write.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "server/scene/geometry.h"
#include "tests/support/glb_builder.h"

namespace sightline {

// A patch of hills with no symmetry: 2 n^2 triangles, every vertex used.
MeshData hills(uint32_t n);

// Streams of EXT_meshopt_compression.
std::vector<std::byte> meshopt_attributes(std::span<const std::byte> elements, size_t stride);
std::vector<std::byte> meshopt_triangles(const std::vector<uint32_t>& indices, size_t vertex_count);
std::vector<std::byte> meshopt_sequence(const std::vector<uint32_t>& indices, size_t vertex_count);

// A stream of KHR_draco_mesh_compression with the one attribute POSITION of unique id 0.
struct DracoOptions {
  bool edgebreaker = true;    // else sequential
  int quantization_bits = 0;  // 0: floats as they are
};
// Four joints and weights for each vertex, the attributes of unique ids 1 and 2.
struct DracoSkin {
  std::vector<uint16_t> joints;
  std::vector<float> weights;
};
std::vector<std::byte> draco_stream(const MeshData& mesh, const DracoOptions& options, const DracoSkin& skin = {});

// A glTF file whose views are packed. The buffer into which they unpack has no bytes in the file.
class PackedFile : public GlbBuilder {
 public:
  // The index of a view of `count` elements of `stride` bytes that `stream` unpacks to.
  int packed_view(std::span<const std::byte> stream, size_t count, size_t stride, const char* mode,
                  const char* filter = nullptr);
  // A node that shows the mesh, positions as floats and indices as `index_bytes` (2 or 4), both packed by
  // meshoptimizer.
  int meshopt_node(const MeshData& mesh, size_t index_bytes);
  // The same, packed by Draco.
  int draco_node(const MeshData& mesh, const DracoOptions& options, const DracoSkin& skin = {});
  // The whole file; call it once all is added.
  std::vector<std::byte> packed_glb();

  nlohmann::json& packing(int view) { return json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"]; }

 private:
  size_t unpacked_bytes_ = 0;
};

}  // namespace sightline
