// The memory of the shapes of one session. Each distinct shape is a mesh with its tree, and a session can have as many
// as it has instances.
#pragma once

#include <google/protobuf/repeated_field.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <unordered_map>

#include "server/scene/mirror.h"
#include "sightline/v1/scene.pb.h"

namespace sightline {

// About what the distinct shapes among these instances take, if nothing has them so far. It is asked before they are
// built.
size_t bytes_of_shapes(const google::protobuf::RepeatedPtrField<v1::NewInstance>& instances);

// Counts each distinct shape once, while an instance has it. Meshes of scene files do not count, because scene files
// have limits of their own. Not thread-safe.
class ShapeMemory {
 public:
  // Takes note of what was added. Instances that the mirror lacks are left out.
  void add(const google::protobuf::RepeatedPtrField<v1::NewInstance>& instances, const SceneMirror& mirror);
  void remove(const google::protobuf::RepeatedField<uint64_t>& ids);
  size_t bytes() const { return bytes_; }

 private:
  void remove(uint64_t id);

  // The geometries stay alive while they are counted, so that none takes the address of another.
  using Shared = std::shared_ptr<const Geometry>;
  std::unordered_map<uint64_t, Shared> of_instance_;
  std::unordered_map<const Geometry*, size_t> uses_;
  size_t bytes_ = 0;
};

}  // namespace sightline
