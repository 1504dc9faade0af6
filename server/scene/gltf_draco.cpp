#include "server/scene/gltf_draco.h"

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>

#include <cstring>
#include <optional>

#include "server/scene/gltf_accessor.h"

namespace sightline {
namespace {

// Memory that Draco needs for a face while it decodes, rounded up. It holds the face's corners, their opposites and
// vertices, and the same again for each set of attributes with its own seams.
constexpr size_t kWorkBytesPerFace = 128;
constexpr size_t kWorkBytesPerFaceAndAttributeSet = 32;

struct Bounds {
  size_t max_faces = 0;
  size_t max_bytes = 0;  // all that may be allocated
};

// One of Draco's decoders, stopped before it allocates more than the bounds. Draco itself trusts the sizes that a
// stream states.
template <typename Base>
class BoundedDecoder : public Base {
 public:
  BoundedDecoder(const Bounds& bounds, WorkLimit::Part& work) : bounds_(bounds), work_(work) {}
  // True when a failure was caused by a bound.
  bool exceeded() const { return exceeded_; }
  size_t bytes() const { return bytes_; }

 protected:
  bool DecodeConnectivity() override { return announced_sizes_fit() && Base::DecodeConnectivity(); }

  // Attributes are described by now, and hold nothing.
  bool DecodeAllAttributes() override {
    if (work_.ends_now()) return false;
    const draco::PointCloud& cloud = *this->point_cloud();
    for (int i = 0; i < cloud.num_attributes(); ++i) {
      const draco::PointAttribute& attribute = *cloud.attribute(i);
      // Decoded as 32-bit integers and mapped to points, before the values themselves.
      const size_t each = static_cast<size_t>(attribute.byte_stride()) + 4u * attribute.num_components() + 4u;
      if (!take(cloud.num_points() * each)) return false;
    }
    return Base::DecodeAllAttributes();
  }

 private:
  // The head of the connectivity (Draco bit stream 2.2, sections 4 and 5), read ahead.
  bool announced_sizes_fit() {
    constexpr bool kEdgebreaker = std::is_same_v<Base, draco::MeshEdgebreakerDecoder>;
    draco::DecoderBuffer ahead = *this->buffer();
    uint32_t vertices = 0, faces = 0;
    uint8_t attribute_sets = 0;
    const bool read = kEdgebreaker ? draco::DecodeVarint(&vertices, &ahead) && draco::DecodeVarint(&faces, &ahead) &&
                                         ahead.Decode(&attribute_sets)
                                   : draco::DecodeVarint(&faces, &ahead) && draco::DecodeVarint(&vertices, &ahead);
    if (!read) return false;
    return within(faces <= bounds_.max_faces && vertices <= 3 * size_t{faces}) &&
           take(faces * (kWorkBytesPerFace + kWorkBytesPerFaceAndAttributeSet * attribute_sets));
  }
  bool within(bool fits) {
    exceeded_ = exceeded_ || !fits;
    return fits;
  }
  bool take(size_t bytes) { return within((bytes_ += bytes) <= bounds_.max_bytes); }

  const Bounds bounds_;
  WorkLimit::Part& work_;
  size_t bytes_ = 0;
  bool exceeded_ = false;
};

std::optional<draco::DataType> draco_type(int component_type) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return draco::DT_INT8;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return draco::DT_UINT8;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return draco::DT_INT16;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return draco::DT_UINT16;
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return draco::DT_FLOAT32;
    default:
      return std::nullopt;
  }
}

// One primitive's stream on its way to a DracoMesh.
class Unpacking {
 public:
  Unpacking(std::span<const std::byte> bytes, const Bounds& bounds, WorkLimit::Part& work, std::string field)
      : bytes_(bytes), bounds_(bounds), work_(work), field_(std::move(field)) {}

  // Returns the bytes that it took.
  Result<size_t> decode() {
    draco::DecoderBuffer buffer = start();
    draco::DracoHeader header;
    if (!draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok()) return damaged("has no Draco header");
    if (header.version_major != 2 || header.version_minor != 2)
      return fail(ErrorCode::kUnsupported, field_, "is not of Draco's bit stream 2.2");
    if (header.encoder_type != draco::TRIANGULAR_MESH) return damaged("holds no mesh");
    if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING) return decode_with<draco::MeshEdgebreakerDecoder>();
    if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING) return decode_with<draco::MeshSequentialDecoder>();
    return damaged("is packed by an unknown method");
  }

  Result<DracoMesh> take(const draco::PointAttribute* position, int component_type) const {
    if (!position) return invalid(field_ + ".attributes.POSITION", "names no attribute of the stream");
    if (position->num_components() != 3 || position->data_type() != draco_type(component_type))
      return invalid(field_ + ".attributes.POSITION", "is of another type than its accessor");
    DracoMesh out;
    out.vertex_count = mesh_.num_points();
    const auto element = static_cast<size_t>(position->byte_stride());
    out.positions.resize(out.vertex_count * element);
    for (uint32_t i = 0; i < mesh_.num_points(); ++i) {
      const draco::AttributeValueIndex value = position->mapped_index(draco::PointIndex(i));
      if (value.value() >= position->size()) return damaged("maps a vertex to no value");
      position->GetValue(value, out.positions.data() + i * element);
    }
    out.indices.reserve(3 * size_t{mesh_.num_faces()});
    for (uint32_t i = 0; i < mesh_.num_faces(); ++i)
      for (const draco::PointIndex& corner : mesh_.face(draco::FaceIndex(i))) out.indices.push_back(corner.value());
    return out;
  }

  // The attribute of the stream that the extension's object gives this name; null for none.
  const draco::PointAttribute* attribute(const tinygltf::Value& packing, const std::string& name) const {
    const tinygltf::Value& ids = packing.Get("attributes");
    if (!ids.Has(name)) return nullptr;
    return mesh_.GetAttributeByUniqueId(static_cast<uint32_t>(ids.Get(name).GetNumberAsInt()));
  }

  // For each vertex, in memory.
  static size_t influence_bytes(const tinygltf::Value& packing) {
    size_t sets = 0;
    while (sets < kMostGltfInfluences && packing.Get("attributes").Has("JOINTS_" + std::to_string(sets))) ++sets;
    return sets * 2 * 4 * sizeof(float);
  }

  Result<std::vector<GltfInfluences>> take_influences(const tinygltf::Value& packing) const {
    std::vector<GltfInfluences> sets;
    while (sets.size() < kMostGltfInfluences) {
      const std::string number = std::to_string(sets.size());
      if (!packing.Get("attributes").Has("JOINTS_" + number)) break;
      auto joints = take_fours(packing, "JOINTS_" + number), weights = take_fours(packing, "WEIGHTS_" + number);
      if (!joints) return tl::unexpected(std::move(joints.error()));
      if (!weights) return tl::unexpected(std::move(weights.error()));
      sets.push_back({std::move(*joints), std::move(*weights)});
    }
    return sets;
  }

 private:
  // Four numbers for each vertex.
  Result<std::vector<float>> take_fours(const tinygltf::Value& packing, const std::string& name) const {
    const draco::PointAttribute* source = attribute(packing, name);
    if (!source) return invalid(field_ + ".attributes." + name, "names no attribute of the stream");
    if (source->num_components() != 4) return invalid(field_ + ".attributes." + name, "must have four components");
    std::vector<float> values(4 * size_t{mesh_.num_points()});
    for (uint32_t i = 0; i < mesh_.num_points(); ++i) {
      const draco::AttributeValueIndex value = source->mapped_index(draco::PointIndex(i));
      if (value.value() >= source->size()) return damaged("maps a vertex to no value");
      if (!source->ConvertValue<float>(value, 4, &values[4 * size_t{i}]))
        return damaged(name + " holds what is no number");
    }
    return values;
  }

  draco::DecoderBuffer start() const {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
    return buffer;
  }

  template <typename Decoder>
  Result<size_t> decode_with() {
    BoundedDecoder<Decoder> decoder(bounds_, work_);
    draco::DecoderBuffer buffer = start();
    const draco::DecoderOptions options;
    const draco::Status status = decoder.Decode(options, &buffer, &mesh_);
    if (work_.ends_now()) return tl::unexpected(work_.limit()->error());
    if (decoder.exceeded())
      return fail(ErrorCode::kResourceExhausted, field_,
                  "unpacks to more triangles than its accessors state, or to more bytes than are allowed");
    if (!status.ok()) return damaged(status.error_msg_string());
    if (mesh_.num_faces() > bounds_.max_faces) return damaged("holds more triangles than it said");
    return decoder.bytes();
  }

  tl::unexpected<Error> damaged(const std::string& how) const {
    return fail(ErrorCode::kDataLoss, field_, "is damaged: " + how);
  }

  const std::span<const std::byte> bytes_;
  const Bounds bounds_;
  WorkLimit::Part& work_;
  const std::string field_;
  draco::Mesh mesh_;
};

}  // namespace

const tinygltf::Value* draco_packing(const tinygltf::Primitive& primitive) {
  const auto found = primitive.extensions.find(kDracoExtension);
  return found == primitive.extensions.end() ? nullptr : &found->second;
}

Result<DracoMesh> unpack_draco(GltfDocument& document, const tinygltf::Value& packing, int position, bool skinned,
                               size_t max_triangles, const std::string& primitive_field) {
  const std::string field = primitive_field + ".extensions." + kDracoExtension;
  const auto bytes = gltf_view_bytes(document, static_cast<size_t>(packing.Get("bufferView").GetNumberAsInt()));
  if (!bytes) return tl::unexpected(bytes.error());
  const tinygltf::Accessor& accessor = document.model.accessors[static_cast<size_t>(position)];
  Unpacking unpacking(*bytes, {max_triangles, document.budget.unpacked_bytes}, document.work, field);
  const auto taken = unpacking.decode();
  if (!taken) return tl::unexpected(taken.error());
  if (const Status s = GltfBudget::take(document.budget.unpacked_bytes, *taken, field, "unpacked bytes"); !s)
    return tl::unexpected(s.error());
  auto mesh = unpacking.take(unpacking.attribute(packing, "POSITION"), accessor.componentType);
  if (!mesh || !skinned) return mesh;
  const size_t more = Unpacking::influence_bytes(packing) * mesh->vertex_count;
  if (const Status s = GltfBudget::take(document.budget.unpacked_bytes, more, field, "unpacked bytes"); !s)
    return tl::unexpected(s.error());
  auto influences = unpacking.take_influences(packing);
  if (!influences) return tl::unexpected(std::move(influences.error()));
  mesh->influences = std::move(*influences);
  return mesh;
}

}  // namespace sightline
