// Renders draw lists: every map into one tile of an atlas, one read-back a pass for all of them. A texel holds which triangle of
// which instance its sample point shows; distances are worked out on the CPU (egl_sampler.cpp), in double: a
// rasteriser that rounds vertices to 1/256 pixel and interpolates in single precision errs on steeply slanted triangles.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/base/error.h"
#include "server/gl/egl_context.h"
#include "server/gl/gl_object.h"
#include "server/sample/draw_list.h"
#include "server/sample/geometry_arena.h"

namespace sightline {

// What one texel shows.
struct TexelSource {
  uint32_t vertex = 0;         // any of the triangle's three, counted in Geometry::indices
  uint32_t slot_plus_one = 0;  // 0: nothing
  bool operator==(const TexelSource&) const = default;
};

// Where one map stands in the atlas, in texels.
struct AtlasTile {
  int x = 0, y = 0;
};
// Rows of tiles from the bottom, left to right; the width is a power of two from 64 up.
struct AtlasLayout {
  int width = 0, height = 0;
  std::vector<AtlasTile> tiles;
};
// Every map is at most kMaxMapSize a side.
void lay_out(std::span<const MapRequest> requests, AtlasLayout& layout);

// The triangles that a pass draws.
struct DrawPass {
  // Triangles of one instance: indices [first, first + count).
  struct Part {
    uint32_t instance;  // into DrawList::instances
    uint32_t first, count;
  };
  std::vector<uint32_t> indices;       // positions in Geometry::indices of the part's instance, three a triangle
  std::vector<Part> parts;
  std::vector<uint32_t> first_of_map;  // map i has parts [first_of_map[i], first_of_map[i + 1])
};

// The OpenGL half of the sampler: needs its context current in every call, its making and its end included.
class MapRenderer {
 public:
  static Result<std::unique_ptr<MapRenderer>> create();

  // Maps in one call; more are the caller's to split.
  static constexpr size_t kMaxMaps = 1024;

  // Makes ready for passes over `list`: an empty atlas with a tile of the size of requests[i] for list.maps[i]. Fails
  // with kResourceExhausted when the device has no memory.
  Status begin(const DrawList& list, std::span<const MapRequest> requests);
  const AtlasLayout& layout() const { return layout_; }

  // Draws the triangles of one pass on top of the passes since begin(), and reads the atlas back: row-major from the
  // bottom, layout().width a row; valid until the next call.
  Result<std::span<const TexelSource>> draw(std::span<const MapRequest> requests, const DrawPass& pass);

  void sweep() { arena_.sweep(); }
  size_t geometry_bytes() const { return arena_.bytes(); }

 private:
  // As in the vertex shader and set_up_vertex_array.
  struct InstanceData {
    glm::vec4 clip_x, clip_y, clip_w;
    uint32_t slot_plus_one, first_vertex;
    float near_m;
    uint32_t unused;
  };
  struct DrawCommand {  // DrawElementsIndirectCommand
    uint32_t count, instance_count, first_index, base_vertex, base_instance;
  };
  // One multi-draw: commands of one map that read one page.
  struct Batch {
    uint32_t map, page, first_command, command_count;
  };
  // Mapped as long as it lives; written only while the device is idle, which it is after each read-back.
  struct MappedBuffer {
    GlBuffer buffer;
    std::byte* data = nullptr;
    size_t capacity = 0;
  };
  struct Atlas {
    int width, height;
    GlTexture2d color, depth;
    GlFramebuffer framebuffer;
  };

  MapRenderer() = default;
  void set_up_vertex_array();
  Status place_geometry(const DrawList& list);
  void build_instance_data(const DrawList& list);
  void build_batches(const DrawPass& pass);
  void append_commands(std::span<const DrawPass::Part> parts, uint32_t page);
  Status write(MappedBuffer& buffer, const void* data, size_t bytes);
  Result<const Atlas*> atlas_of(int width, int height);
  void draw_batches(std::span<const MapRequest> requests) const;

  GlProgram program_;
  GlVertexArray vertex_array_;
  GeometryArena arena_;
  MappedBuffer instance_buffer_, index_buffer_, command_buffer_;
  std::vector<Atlas> atlases_;  // by size; both sides are powers of two, so they stay few

  // From begin() to the last draw().
  AtlasLayout layout_;
  std::vector<ArenaSlice> slices_;  // of list.instances
  std::vector<InstanceData> instance_data_;
  std::vector<TexelSource> texels_;

  // Scratch of one call.
  std::vector<DrawCommand> commands_;
  std::vector<Batch> batches_;
};

}  // namespace sightline
