// Reads numbers from accessors (glTF 2.0 sections 3.6.2 and 3.11, KHR_mesh_quantization). Every range is checked
// against its buffer, with arithmetic that cannot overflow, before anything is allocated.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "server/scene/gltf_document.h"

namespace sightline {

// The most elements of an accessor without a buffer view, which are all zero before sparse substitution.
inline constexpr size_t kMaxUnbackedElements = size_t{1} << 20;

// The bytes of a buffer view, unpacked if it is packed (gltf_meshopt.h). kDataLoss (field "bufferViews[i]") when it
// leaves its buffer.
Result<std::span<const std::byte>> gltf_view_bytes(GltfDocument& document, size_t view);

enum class GltfComponents { kFloatOnly, kFloatOrNormalized, kFloatOrAnyInteger };

// The elements as a flat array of floats, `components` for each. Normalised integers become [0, 1] or [-1, 1]; other
// integers keep their value. Sparse values are substituted. `field` is the reference to the accessor. Fails with
// kInvalidArgument on the wrong type and kDataLoss on a range that leaves the buffer.
Result<std::vector<float>> read_gltf_floats(GltfDocument& document, int accessor, int components,
                                            GltfComponents allowed, const std::string& field);

// The same for the positions of a mesh, VEC3 of floats or any integers but unsigned ints.
Result<std::vector<glm::vec3>> read_gltf_positions(GltfDocument& document, int accessor, const std::string& field);
// The same, but the elements, of the accessor's type, are tightly packed in `elements`, and the accessor's count is
// ignored. The accessor must not be sparse.
Result<std::vector<glm::vec3>> read_gltf_positions(GltfDocument& document, int accessor,
                                                   std::span<const std::byte> elements, const std::string& field);

// A scalar accessor of unsigned bytes, shorts or ints. An index equal to the type's largest value (a restart
// in other formats, forbidden in glTF) is kInvalidArgument.
Result<std::vector<uint32_t>> read_gltf_indices(GltfDocument& document, int accessor, const std::string& field);

}  // namespace sightline
