// Renders draw lists: every map into a layer of its own of one array texture, always from the same corner, so that its texels are the
// same bits whatever is drawn beside it. A texel holds which triangle its sample point shows; distances are worked out on the CPU
// (seen_triangle.h), in double: a rasteriser that rounds vertices to 1/256 pixel and interpolates in single precision errs on
// steeply slanted triangles.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/base/error.h"
#include "server/gl/gl_object.h"
#include "server/sample/depth_map.h"
#include "server/sample/draw_list.h"
#include "server/sample/egl_variant.h"
#include "server/sample/geometry_arena.h"

namespace sightline {

struct MapSize {
  int width = 0, height = 0;
  bool operator==(const MapSize&) const = default;
};

// What some maps show, layer by layer: texel (x, y) of map i is texels[(i * height + y) * width + x]. 0: nothing; else one more
// than the triangle's number in the draw list.
struct TexelLayers {
  const uint32_t* texels = nullptr;
  int width = 0, height = 0;
};

// The OpenGL half of the sampler: needs its context current in every call, its making and its end included.
class MapRenderer {
 public:
  enum class LayersBy { kAnyStage, kGeometryShader };
  // Fails with kUnavailable when the shaders do not compile. Layers are chosen in the vertex shader where the device can
  // (GL_ARB_shader_viewport_layer_array), or always in a geometry shader.
  static Result<std::unique_ptr<MapRenderer>> create(LayersBy layers_by = LayersBy::kAnyStage);

  // Maps in one call of submit; more are the caller's to split.
  static constexpr size_t kMaxMaps = 1024;
  // Submitted and not collected yet, at most: all but one wait in a ring, which is what `ring` is for.
  static constexpr size_t kMaxInFlight = 3;

  // Starts drawing maps of these sizes: sizes[i] is that of the list's map i. `variant` must be the same until all is collected;
  // without its `ring` at most one may be in flight. Fails with kResourceExhausted when the device has no memory.
  Status submit(const DrawList& list, std::span<const MapSize> sizes, const EglVariant& variant);
  // Waits for the oldest submitted and not collected maps. Valid until the next call of submit.
  Result<TexelLayers> collect();
  // Forgets what is in flight, after an error.
  void abandon();

  void sweep() { arena_.sweep(); }
  size_t geometry_bytes() const { return arena_.bytes(); }

 private:
  // As in the vertex shader.
  struct InstanceData {
    glm::vec4 clip_x, clip_y, clip_w;
    float near_m;
    uint32_t layer, viewport, unused;
  };
  struct StreamedVertex {
    glm::vec3 position;
    uint32_t instance, first_triangle;
  };
  struct PartData {
    uint32_t instance, first_triangle;
  };
  struct DrawCommand {  // DrawArraysIndirectCommand
    uint32_t count, instance_count, first, base_instance;
  };
  // Maps [first_map, end_map) drawn with one set of viewports.
  struct Segment {
    static constexpr int kMaxViewports = 16;
    uint32_t first_map, end_map;
    int viewport_count;
    std::array<MapSize, kMaxViewports> viewports;
  };
  // One multi-draw: what one segment draws from one page.
  struct Batch {
    uint32_t segment, page, first_command;
  };
  // Mapped as long as it lives; written only while no draw reads it.
  struct MappedBuffer {
    GlBuffer buffer;
    std::byte* data = nullptr;
    size_t capacity = 0;
  };
  struct Target {
    int width, height, layers;
    GlTexture2dArray color, depth;
    GlFramebuffer framebuffer;
  };
  // What one submission holds until it is collected.
  struct Flight {
    MappedBuffer instances, vertices, parts, commands, pixels;
    GlSync fence;  // none: read at once
    int width = 0, height = 0;
    size_t texel_count = 0;
  };

  MapRenderer() = default;
  void set_up_vertex_arrays();
  void divide_into_segments(std::span<const MapSize> sizes, bool draw_per_map);
  Status write_instances(const DrawList& list, Flight& flight);
  Status draw_triangles(const DrawList& list, Flight& flight);
  Status draw_clusters(const DrawList& list, Flight& flight);
  Status place_parts(const DrawList& list);
  void build_batches(const DrawList& list);
  void append_commands(const DrawList& list, const Segment& segment, uint32_t page);
  Result<const Target*> target_of(int width, int height, int layers);
  Status read_back(const Target& target, int layers, bool ring, Flight& flight);

  GlProgram program_;
  GlVertexArray streamed_, placed_;  // vertices sent with the take; geometry that stands in the arena
  GeometryArena arena_;
  std::array<Flight, kMaxInFlight> flights_;
  size_t first_in_flight_ = 0, in_flight_ = 0;
  std::vector<Target> targets_;  // by size; all sides are powers of two, so they stay few
  std::vector<uint32_t> texels_;  // read at once

  // Scratch of one call.
  std::vector<Segment> segments_;
  std::vector<uint32_t> viewport_of_map_;
  std::vector<InstanceData> instance_data_;
  std::vector<StreamedVertex> vertices_;
  std::vector<ArenaSlice> slices_;  // of list.instances
  std::vector<PartData> part_data_;
  std::vector<DrawCommand> commands_;
  std::vector<Batch> batches_;
};

}  // namespace sightline
