#include "server/scene/gltf_accessor.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>

#include "server/scene/gltf_json.h"
#include "server/scene/gltf_meshopt.h"

namespace sightline {
namespace {

// `count` elements of `element_bytes`, `stride` apart, known to lie inside their buffer.
struct StridedBytes {
  const std::byte* first = nullptr;
  size_t stride = 0;
  size_t count = 0;
};

size_t component_bytes(int component_type) {
  return static_cast<size_t>(tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(component_type)));
}

Result<StridedBytes> strided(GltfDocument& document, int view_index, size_t offset, size_t count, size_t element_bytes,
                             const std::string& field) {
  const tinygltf::BufferView& view = document.model.bufferViews[static_cast<size_t>(view_index)];
  const auto bytes = gltf_view_bytes(document, static_cast<size_t>(view_index));
  if (!bytes) return tl::unexpected(bytes.error());
  const size_t stride = view.byteStride != 0 ? view.byteStride : element_bytes;
  if (stride < element_bytes) return invalid(field, "has a byteStride smaller than an element");
  const auto outside = fail(ErrorCode::kDataLoss, field, "reaches beyond its buffer view");
  if (offset > bytes->size() || element_bytes > bytes->size() - offset) return outside;
  if (count - 1 > (bytes->size() - offset - element_bytes) / stride) return outside;
  return StridedBytes{bytes->data() + offset, stride, count};
}

template <typename T>
T load(const std::byte* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

// glTF 2.0 section 3.11: f = c / max, and not below -1 for signed types.
template <typename T>
float decode(const std::byte* from, bool normalized) {
  const float value = static_cast<float>(load<T>(from));
  if (!normalized) return value;
  return std::max(value / static_cast<float>(std::numeric_limits<T>::max()), -1.0f);
}

float decode_component(const std::byte* from, int component_type, bool normalized) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return decode<int8_t>(from, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return decode<uint8_t>(from, normalized);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return decode<int16_t>(from, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return decode<uint16_t>(from, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return static_cast<float>(load<uint32_t>(from));
    default:
      return load<float>(from);
  }
}

uint32_t decode_index(const std::byte* from, int component_type) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load<uint8_t>(from);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<uint16_t>(from);
    default:
      return load<uint32_t>(from);
  }
}

void decode_indices(const StridedBytes& from, int component_type, uint32_t* to) {
  if (component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT && from.stride == sizeof(uint32_t)) {
    std::memcpy(to, from.first, from.count * from.stride);
    return;
  }
  for (size_t i = 0; i < from.count; ++i) to[i] = decode_index(from.first + i * from.stride, component_type);
}

bool is_index_type(int component_type) {
  return component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

uint32_t largest_index(int component_type) {
  if (component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE) return UINT8_MAX;
  return component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? UINT16_MAX : UINT32_MAX;
}

// Where an accessor's elements and their sparse replacements lie. All ranges are checked.
struct Sources {
  std::optional<StridedBytes> base;
  StridedBytes sparse_indices;  // count 0 when not sparse
  StridedBytes sparse_values;
  int sparse_index_type = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
};

Status locate_sparse(GltfDocument& document, const tinygltf::Accessor& accessor, size_t element_bytes,
                     const std::string& field, Sources& sources) {
  const auto& sparse = accessor.sparse;
  const auto count = static_cast<size_t>(sparse.count);
  if (count > accessor.count) return invalid(field + ".sparse.count", "is larger than the accessor's count");
  if (!is_index_type(sparse.indices.componentType))
    return invalid(field + ".sparse.indices.componentType", "must be an unsigned type");
  const auto indices = strided(document, sparse.indices.bufferView, static_cast<size_t>(sparse.indices.byteOffset),
                               count, component_bytes(sparse.indices.componentType), field + ".sparse.indices");
  if (!indices) return tl::unexpected(indices.error());
  const auto values = strided(document, sparse.values.bufferView, static_cast<size_t>(sparse.values.byteOffset), count,
                              element_bytes, field + ".sparse.values");
  if (!values) return tl::unexpected(values.error());
  sources.sparse_indices = *indices;
  sources.sparse_values = *values;
  sources.sparse_index_type = sparse.indices.componentType;
  return {};
}

Result<Sources> locate(GltfDocument& document, int index, size_t element_bytes) {
  const tinygltf::Accessor& accessor = document.model.accessors[static_cast<size_t>(index)];
  const std::string field = gltf_path("accessors", static_cast<size_t>(index));
  Sources sources;
  if (accessor.bufferView >= 0) {
    const auto base = strided(document, accessor.bufferView, accessor.byteOffset, accessor.count, element_bytes, field);
    if (!base) return tl::unexpected(base.error());
    sources.base = *base;
  } else if (accessor.count > kMaxUnbackedElements) {
    return fail(
        ErrorCode::kResourceExhausted, field + ".count",
        "an accessor without a buffer view may have at most " + std::to_string(kMaxUnbackedElements) + " elements");
  }
  if (accessor.sparse.isSparse)
    if (const Status status = locate_sparse(document, accessor, element_bytes, field, sources); !status)
      return tl::unexpected(status.error());
  return sources;
}

// Calls replace(element, bytes) for each sparse substitution. Indices must rise strictly.
template <typename Replace>
Status substitute(const Sources& sources, size_t count, const std::string& field, Replace replace) {
  uint64_t next_allowed = 0;
  for (size_t i = 0; i < sources.sparse_indices.count; ++i) {
    const uint32_t element = decode_index(sources.sparse_indices.first + i * sources.sparse_indices.stride,
                                          sources.sparse_index_type);
    if (element < next_allowed || element >= count)
      return invalid(field + ".sparse.indices", "must rise strictly and stay below the accessor's count");
    next_allowed = uint64_t{element} + 1;
    replace(element, sources.sparse_values.first + i * sources.sparse_values.stride);
  }
  return {};
}

bool allowed_component(const tinygltf::Accessor& accessor, GltfComponents allowed) {
  if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT) return true;
  if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) return false;
  if (allowed == GltfComponents::kFloatOrNormalized) return accessor.normalized;
  return allowed == GltfComponents::kFloatOrAnyInteger;
}

// How an accessor's elements are stored, and how they become floats.
struct FloatFormat {
  int component_type = TINYGLTF_COMPONENT_TYPE_FLOAT;
  bool normalized = false;
  size_t width = 0;  // components of an element

  size_t element_bytes() const { return component_bytes(component_type) * width; }
  void decode_element(const std::byte* from, float* to) const {
    const size_t step = component_bytes(component_type);
    for (size_t c = 0; c < width; ++c) to[c] = decode_component(from + c * step, component_type, normalized);
  }
  void decode(const StridedBytes& from, float* to) const {
    if (component_type == TINYGLTF_COMPONENT_TYPE_FLOAT && from.stride == element_bytes()) {
      std::memcpy(to, from.first, from.count * from.stride);
      return;
    }
    for (size_t i = 0; i < from.count; ++i) decode_element(from.first + i * from.stride, to + i * width);
  }
};

Status check_type(const GltfDocument& document, int index) {
  const auto i = static_cast<size_t>(index);
  if (is_gltf_accessor_type(document.json["accessors"][i]["type"].get_ref<const std::string&>())) return {};
  return invalid(gltf_path("accessors", i) + ".type", "is not one of the words that glTF allows here");
}

Result<FloatFormat> float_format(GltfDocument& document, int index, int components, GltfComponents allowed,
                                 const std::string& field) {
  const tinygltf::Accessor& accessor = document.model.accessors[static_cast<size_t>(index)];
  if (const Status known = check_type(document, index); !known) return tl::unexpected(known.error());
  if (tinygltf::GetNumComponentsInType(static_cast<uint32_t>(accessor.type)) != components ||
      !allowed_component(accessor, allowed))
    return invalid(field, "accessors[" + std::to_string(index) + "] has the wrong type or componentType");
  return FloatFormat{accessor.componentType, accessor.normalized, static_cast<size_t>(components)};
}

struct FloatSource : FloatFormat {
  Sources sources;
  size_t count = 0;

  // `to` holds zeros.
  Status decode_all(int index, float* to) const {
    if (sources.base) decode(*sources.base, to);
    return substitute(sources, count, gltf_path("accessors", static_cast<size_t>(index)),
                      [&](size_t element, const std::byte* from) { decode_element(from, to + element * width); });
  }
};

Result<FloatSource> float_source(GltfDocument& document, int index, int components, GltfComponents allowed,
                                 const std::string& field) {
  const auto format = float_format(document, index, components, allowed, field);
  if (!format) return tl::unexpected(format.error());
  const auto sources = locate(document, index, format->element_bytes());
  if (!sources) return tl::unexpected(sources.error());
  return FloatSource{*format, *sources, document.model.accessors[static_cast<size_t>(index)].count};
}

}  // namespace

Result<std::span<const std::byte>> gltf_view_bytes(GltfDocument& document, size_t index) {
  if (const auto packing = meshopt_packing(document.json["bufferViews"][index]))
    return unpack_meshopt_view(document, index, *packing);
  const tinygltf::BufferView& view = document.model.bufferViews[index];
  const auto buffer = gltf_buffer_bytes(document, static_cast<size_t>(view.buffer));
  if (!buffer) return buffer;
  if (view.byteOffset > buffer->size() || view.byteLength > buffer->size() - view.byteOffset)
    return fail(ErrorCode::kDataLoss, gltf_path("bufferViews", index), "reaches beyond its buffer");
  return buffer->subspan(view.byteOffset, view.byteLength);
}

Result<std::vector<float>> read_gltf_floats(GltfDocument& document, int index, int components, GltfComponents allowed,
                                            const std::string& field) {
  const auto source = float_source(document, index, components, allowed, field);
  if (!source) return tl::unexpected(source.error());
  std::vector<float> values(source->count * source->width, 0.0f);
  if (const Status s = source->decode_all(index, values.data()); !s) return tl::unexpected(s.error());
  return values;
}

Result<std::vector<glm::vec3>> read_gltf_positions(GltfDocument& document, int index, const std::string& field) {
  const auto source = float_source(document, index, 3, GltfComponents::kFloatOrAnyInteger, field);
  if (!source) return tl::unexpected(source.error());
  std::vector<glm::vec3> values(source->count, glm::vec3(0.0f));
  if (const Status s = source->decode_all(index, &values.data()->x); !s) return tl::unexpected(s.error());
  return values;
}

Result<std::vector<glm::vec3>> read_gltf_positions(GltfDocument& document, int index,
                                                   std::span<const std::byte> elements, const std::string& field) {
  const auto format = float_format(document, index, 3, GltfComponents::kFloatOrAnyInteger, field);
  if (!format) return tl::unexpected(format.error());
  if (document.model.accessors[static_cast<size_t>(index)].sparse.isSparse) return invalid(field, "must not be sparse");
  std::vector<glm::vec3> values(elements.size() / format->element_bytes());
  if (!values.empty()) format->decode({elements.data(), format->element_bytes(), values.size()}, &values.data()->x);
  return values;
}

Result<std::vector<uint32_t>> read_gltf_indices(GltfDocument& document, int index, const std::string& field) {
  const tinygltf::Accessor& accessor = document.model.accessors[static_cast<size_t>(index)];
  if (const Status known = check_type(document, index); !known) return tl::unexpected(known.error());
  if (accessor.type != TINYGLTF_TYPE_SCALAR || !is_index_type(accessor.componentType) || accessor.normalized)
    return invalid(field, "accessors[" + std::to_string(index) + "] must be a scalar of an unsigned type");
  const auto sources = locate(document, index, component_bytes(accessor.componentType));
  if (!sources) return tl::unexpected(sources.error());

  std::vector<uint32_t> values(accessor.count, 0);
  const auto decode_element = [&](size_t element, const std::byte* from) {
    values[element] = decode_index(from, accessor.componentType);
  };
  if (sources->base) decode_indices(*sources->base, accessor.componentType, values.data());
  const Status status = substitute(*sources, accessor.count, gltf_path("accessors", static_cast<size_t>(index)),
                                   decode_element);
  if (!status) return tl::unexpected(status.error());
  const uint32_t restart = largest_index(accessor.componentType);
  for (size_t i = 0; i < values.size(); ++i)
    if (values[i] == restart) return invalid(gltf_path(field.c_str(), i), "is a primitive restart value");
  return values;
}

}  // namespace sightline
