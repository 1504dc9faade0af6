// Renders draw lists with OpenGL. Each map is drawn into its own layer of an array texture, with its own viewport in
// the layer's lower left corner. Its texels therefore do not depend on the other maps. A texel holds the number of the
// triangle that its sample point shows. Distances are computed on the CPU in double (seen_triangle.h): a rasteriser
// that rounds vertices to 1/256 pixel and interpolates in single precision errs on steeply slanted triangles.
//
// All maps of a submission are one draw call. They are read back through a ring of pixel buffers with fences, so that
// the CPU searches the next maps while a GPU draws these. Measured over a city of 280 K triangles on llvmpipe (CPU time
// for 2, 16 and 64 maps of 7 x 7):
//   this way                                  0.12  0.83  2.3 ms
//   read back at once, without the ring       0.11  0.81  2.5 ms
//   a draw call for each map                  0.12  0.85  2.5 ms
//   whole clusters from a device buffer       4.2   51    210 ms; finding them (0.10, 1.1, 5.2 ms) takes the CPU longer
//   than finding the
//                                             single triangles (0.06, 0.53, 1.4 ms), so no GPU can make this way the
//                                             faster one
// On an NVIDIA H100 this way is slower than Embree, since the search for the triangles takes longer than all rays of
// the maps (tests/results/speed/gpu.md). The other ways have not been measured on a GPU.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/base/error.h"
#include "server/gl/gl_object.h"
#include "server/sample/draw_list.h"

namespace sightline {

struct MapSize {
  int width = 0, height = 0;
};

// The texels of some maps: texel (x, y) of map i is texels[(i * height + y) * width + x]. Its value is 0 where nothing
// is seen, otherwise the index of a triangle in the draw list plus one.
struct TexelLayers {
  const uint32_t* texels = nullptr;
  int width = 0, height = 0;
};

// The OpenGL half of the sampler. Its context must be current in every call, including create() and the destructor.
class MapRenderer {
 public:
  // Fails as make_program does.
  static Result<std::unique_ptr<MapRenderer>> create();

  // The most maps of one submission: every OpenGL 4.5 device has this many viewports.
  static constexpr size_t kMaxMaps = 16;
  // The most submissions that may wait to be collected.
  static constexpr size_t kMaxInFlight = 3;

  // Starts drawing a list that is not empty; sizes[i] is the size of its map i. Fails with kResourceExhausted when the
  // device has no memory.
  Status submit(const DrawList& list, std::span<const MapSize> sizes);
  // Waits for the oldest submission that is not collected. The result is valid until the next call of submit.
  Result<TexelLayers> collect();
  // Drops all submissions, after an error.
  void abandon();

 private:
  // As in the vertex shader.
  struct InstanceData {
    glm::vec4 clip_x, clip_y, clip_w;
    float near_m;
    uint32_t map, unused[2];
  };
  struct Vertex {
    glm::vec3 position;
    uint32_t instance;
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
  // The buffers of one submission until it is collected.
  struct Flight {
    MappedBuffer instances, vertices, pixels;
    GlSync fence;
    int width = 0, height = 0;
  };

  MapRenderer() = default;
  void set_up_vertex_array();
  Status draw(const DrawList& list, Flight& flight);
  Result<const Target*> target_of(int width, int height, int layers);
  Status read_back(const Target& target, int layers, Flight& flight);

  static Status reserve(MappedBuffer& buffer, size_t bytes, GLbitfield access);
  template <typename T>
  static Status write(MappedBuffer& buffer, const std::vector<T>& items);

  GlProgram program_;
  GlVertexArray vertex_array_;
  std::array<Flight, kMaxInFlight> flights_;
  size_t first_in_flight_ = 0, in_flight_ = 0;
  std::vector<Target> targets_;  // by size; all sides are powers of two, so there are few

  // Scratch of one call.
  std::vector<InstanceData> instance_data_;
  std::vector<Vertex> vertices_;
};

}  // namespace sightline
