#include "server/service/shape_memory.h"

#include <string>
#include <unordered_set>

namespace sightline {
namespace {

// What Embree takes beside the geometry: measured with 2,000 distinct shapes of each kind. OpenGL takes less.
constexpr size_t kSamplerBytesOfShape = 4'500, kSamplerBytesOfTriangle = 96;
// Measured, with the trees and the sampler's part.
constexpr size_t kBoxBytes = 6'500, kRoundBytes = 116'000, kCylinderBytes = 21'500;

// What a shape takes that was built.
size_t bytes_of(const Geometry& geometry) {
  return geometry.bytes() + kSamplerBytesOfShape + kSamplerBytesOfTriangle * geometry.triangle_count();
}

size_t bytes_of(const v1::Shape& shape) {
  switch (shape.shape_case()) {
    case v1::Shape::kSphere:
    case v1::Shape::kCapsule:
      return kRoundBytes;
    case v1::Shape::kCylinder:
      return kCylinderBytes;
    case v1::Shape::kCompound: {
      size_t bytes = 0;
      // Parts are no compounds, so this goes no deeper.
      for (const v1::Shape::Part& part : shape.compound().parts())
        bytes += part.shape().has_compound() ? kBoxBytes : bytes_of(part.shape());
      return bytes;
    }
    case v1::Shape::kBox:
    case v1::Shape::SHAPE_NOT_SET:
      break;
  }
  return kBoxBytes;
}

}  // namespace

size_t bytes_of_shapes(const google::protobuf::RepeatedPtrField<v1::NewInstance>& instances) {
  std::unordered_set<std::string> seen;
  size_t bytes = 0;
  for (const v1::NewInstance& instance : instances)
    if (instance.has_shape() && seen.insert(instance.shape().SerializeAsString()).second)
      bytes += bytes_of(instance.shape());
  return bytes;
}

void ShapeMemory::add(const google::protobuf::RepeatedPtrField<v1::NewInstance>& instances, const SceneMirror& mirror) {
  for (const v1::NewInstance& added : instances) {
    const Instance* const instance = added.has_shape() ? mirror.find(added.id()) : nullptr;
    if (!instance) continue;
    remove(added.id());
    if (++uses_[instance->geometry.get()] == 1) bytes_ += bytes_of(*instance->geometry);
    of_instance_.emplace(added.id(), instance->geometry);
  }
}

void ShapeMemory::remove(const google::protobuf::RepeatedField<uint64_t>& ids) {
  for (const uint64_t id : ids) remove(id);
}

void ShapeMemory::remove(uint64_t id) {
  const auto found = of_instance_.find(id);
  if (found == of_instance_.end()) return;
  const auto use = uses_.find(found->second.get());
  if (--use->second == 0) {
    bytes_ -= bytes_of(*found->second);
    uses_.erase(use);
  }
  of_instance_.erase(found);
}

}  // namespace sightline
