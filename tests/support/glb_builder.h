// Builds glTF files, valid or not: JSON that a test may change freely, and a binary chunk.
#pragma once

#include <cstddef>
#include <cstring>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace sightline {

enum ComponentType { kByte = 5120, kUnsignedByte, kShort, kUnsignedShort, kUnsignedInt = 5125, kFloat };

class GlbBuilder {
 public:
  GlbBuilder();

  // Each function returns the index of what it added.
  int view(std::span<const std::byte> bytes, int stride = 0);
  template <typename T>
  int accessor(const std::vector<T>& values, const char* type, ComponentType component, bool normalized = false) {
    return accessor_over(view(std::as_bytes(std::span(values))), values.size() / components_of(type), type, component,
                         normalized);
  }
  int accessor_over(int buffer_view, size_t count, const char* type, ComponentType component, bool normalized = false);
  int floats(const std::vector<float>& values, const char* type = "VEC3") { return accessor(values, type, kFloat); }
  int add(const char* collection, nlohmann::json item);
  // A mesh of one primitive, and a root node that shows it.
  int mesh_node(nlohmann::json primitive);
  // A node with one triangle (0 0 0, 1 0 0, 0 1 0).
  int triangle_node();
  // An animation of one channel; returns its index.
  int animation(int node, const char* path, const char* interpolation, const std::vector<float>& times,
                const std::vector<float>& values);

  std::vector<std::byte> glb() const;
  std::vector<std::byte> gltf(const std::string& buffer_uri) const;
  std::vector<std::byte> gltf_with_data_uri() const;
  std::span<const std::byte> binary() const { return binary_; }

  nlohmann::json json;

 private:
  static size_t components_of(const char* type);
  nlohmann::json finished(const std::string* uri) const;
  std::vector<std::byte> binary_;
};

// A .glb of any JSON text and binary chunk, lengths filled in.
std::vector<std::byte> make_glb(std::string json_text, std::vector<std::byte> binary);
std::vector<std::byte> bytes_of(const std::string& text);

}  // namespace sightline
