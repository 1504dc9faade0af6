#include "server/sample/map_renderer.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstddef>
#include <cstring>

#include "server/gl/program.h"

namespace sightline {
namespace {

constexpr const char* kVertexShader = R"(#version 450 core
#extension GL_ARB_shader_viewport_layer_array : require
struct Instance {           // see MapRenderer::InstanceData
  vec4 clip_x, clip_y, clip_w;
  uvec4 near_and_map;       // near plane as float bits, map
};
layout(std430, binding = 0) readonly buffer Instances { Instance instances[]; };
layout(location = 0) in vec3 position;
layout(location = 1) in uint instance_index;
flat out uint triangle;
void main() {
  Instance instance = instances[instance_index];
  vec4 p = vec4(position, 1.0);
  gl_Position = vec4(dot(instance.clip_x, p), dot(instance.clip_y, p), uintBitsToFloat(instance.near_and_map.x),
                     dot(instance.clip_w, p));
  triangle = uint(gl_VertexID) / 3u + 1u;
  gl_Layer = gl_ViewportIndex = int(instance.near_and_map.y);
}
)";

constexpr const char* kFragmentShader = R"(#version 450 core
flat in uint triangle;
layout(location = 0) out uint texel;
void main() { texel = triangle; }
)";

enum Location : GLuint { kPosition = 0, kInstance = 1 };
constexpr GLuint kInstanceBlock = 0, kVertexBinding = 0;
// Longer than any take: a device that does not answer by then counts as lost.
constexpr GLuint64 kFenceTimeoutNs = 2'000'000'000;

int power_of_two_at_least(int value) {
  return static_cast<int>(std::bit_ceil(static_cast<unsigned>(value)));
}

tl::unexpected<Error> no_memory(const char* what) {
  return fail(ErrorCode::kResourceExhausted, "", std::string("the OpenGL device has no memory for ").append(what));
}

void set_viewports(std::span<const MapSize> sizes) {
  std::array<float, 4 * MapRenderer::kMaxMaps> boxes{};
  for (size_t i = 0; i < sizes.size(); ++i) {
    boxes[4 * i + 2] = static_cast<float>(sizes[i].width);
    boxes[4 * i + 3] = static_cast<float>(sizes[i].height);
  }
  glViewportArrayv(0, static_cast<GLsizei>(sizes.size()), boxes.data());
}

}  // namespace

Result<std::unique_ptr<MapRenderer>> MapRenderer::create() {
  Result<GlProgram> program = make_program(kVertexShader, kFragmentShader);
  if (!program) return tl::unexpected(program.error());
  std::unique_ptr<MapRenderer> renderer(new MapRenderer);
  renderer->program_ = std::move(*program);
  renderer->set_up_vertex_array();
  // Reversed z with an infinite far plane: depth = near / w in (0, 1], greater is nearer.
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  glDepthFunc(GL_GREATER);
  glClearDepth(0.0);
  glEnable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glDisable(GL_DITHER);
  glUseProgram(renderer->program_.name());
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  return renderer;
}

void MapRenderer::set_up_vertex_array() {
  vertex_array_ = GlVertexArray::create();
  const GLuint name = vertex_array_.name();
  glEnableVertexArrayAttrib(name, kPosition);
  glVertexArrayAttribFormat(name, kPosition, 3, GL_FLOAT, GL_FALSE, offsetof(Vertex, position));
  glVertexArrayAttribBinding(name, kPosition, kVertexBinding);
  glEnableVertexArrayAttrib(name, kInstance);
  glVertexArrayAttribIFormat(name, kInstance, 1, GL_UNSIGNED_INT, offsetof(Vertex, instance));
  glVertexArrayAttribBinding(name, kInstance, kVertexBinding);
}

Status MapRenderer::submit(const DrawList& list, std::span<const MapSize> sizes) {
  assert(sizes.size() <= kMaxMaps && sizes.size() == list.map_count && !list.triangles.empty());
  assert(in_flight_ < kMaxInFlight);
  Flight& flight = flights_[(first_in_flight_ + in_flight_) % kMaxInFlight];
  flight.width = flight.height = 1;
  for (const MapSize& size : sizes) {
    flight.width = std::max(flight.width, size.width);
    flight.height = std::max(flight.height, size.height);
  }
  const int layers = static_cast<int>(sizes.size());
  const Result<const Target*> target = target_of(flight.width, flight.height, layers);
  if (!target) return tl::unexpected(target.error());
  glBindFramebuffer(GL_FRAMEBUFFER, (*target)->framebuffer.name());
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  set_viewports(sizes);
  if (const Status drawn = draw(list, flight); !drawn) return drawn;
  if (Status read = read_back(**target, layers, flight); !read) return read;
  ++in_flight_;
  return {};
}

Result<TexelLayers> MapRenderer::collect() {
  assert(in_flight_ > 0);
  Flight& flight = flights_[first_in_flight_];
  first_in_flight_ = (first_in_flight_ + 1) % kMaxInFlight;
  --in_flight_;
  const GlSync fence = std::move(flight.fence);
  const GLenum waited = glClientWaitSync(fence.get(), GL_SYNC_FLUSH_COMMANDS_BIT, kFenceTimeoutNs);
  if (waited != GL_ALREADY_SIGNALED && waited != GL_CONDITION_SATISFIED)
    return fail(ErrorCode::kUnavailable, "", "the OpenGL device does not answer");
  return TexelLayers{reinterpret_cast<const uint32_t*>(flight.pixels.data), flight.width, flight.height};
}

void MapRenderer::abandon() {
  if (in_flight_ > 0) glFinish();
  for (Flight& flight : flights_) flight.fence = GlSync();
  first_in_flight_ = in_flight_ = 0;
}

Status MapRenderer::draw(const DrawList& list, Flight& flight) {
  instance_data_.clear();
  for (const InstanceDraw& draw : list.instances)
    instance_data_.push_back({draw.clip_x, draw.clip_y, draw.clip_w, draw.near_m, draw.map, {}});
  vertices_.clear();
  for (const TriangleDraw& triangle : list.triangles) {
    const Geometry& geometry = *list.instances[triangle.instance].instance->geometry;
    for (uint32_t i = triangle.first_index; i < triangle.first_index + 3; ++i)
      vertices_.push_back({geometry.positions[geometry.indices[i]], triangle.instance});
  }
  if (Status written = write(flight.instances, instance_data_); !written) return written;
  if (Status written = write(flight.vertices, vertices_); !written) return written;
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kInstanceBlock, flight.instances.buffer.name());
  glBindVertexArray(vertex_array_.name());
  glVertexArrayVertexBuffer(vertex_array_.name(), kVertexBinding, flight.vertices.buffer.name(), 0, sizeof(Vertex));
  glDrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(vertices_.size()));
  return {};
}

Result<const MapRenderer::Target*> MapRenderer::target_of(int width, int height, int layers) {
  width = power_of_two_at_least(std::max(width, 8));
  height = power_of_two_at_least(std::max(height, 8));
  layers = power_of_two_at_least(std::max(layers, 4));
  for (const Target& target : targets_)
    if (target.width == width && target.height == height && target.layers == layers) return &target;
  Target target{width, height, layers, GlTexture2dArray::create(), GlTexture2dArray::create(), GlFramebuffer::create()};
  glTextureStorage3D(target.color.name(), 1, GL_R32UI, width, height, layers);
  glTextureStorage3D(target.depth.name(), 1, GL_DEPTH_COMPONENT32F, width, height, layers);
  const GLuint framebuffer = target.framebuffer.name();
  glNamedFramebufferTexture(framebuffer, GL_COLOR_ATTACHMENT0, target.color.name(), 0);
  glNamedFramebufferTexture(framebuffer, GL_DEPTH_ATTACHMENT, target.depth.name(), 0);
  if (glCheckNamedFramebufferStatus(framebuffer, GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) return no_memory("maps");
  targets_.push_back(std::move(target));
  return &targets_.back();
}

Status MapRenderer::read_back(const Target& target, int layers, Flight& flight) {
  const size_t bytes = static_cast<size_t>(flight.width) * flight.height * layers * sizeof(uint32_t);
  if (Status reserved = reserve(flight.pixels, bytes, GL_MAP_READ_BIT); !reserved) return reserved;
  glBindBuffer(GL_PIXEL_PACK_BUFFER, flight.pixels.buffer.name());
  glGetTextureSubImage(target.color.name(), 0, 0, 0, 0, flight.width, flight.height, layers, GL_RED_INTEGER,
                       GL_UNSIGNED_INT, static_cast<GLsizei>(bytes), nullptr);
  glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
  flight.fence = GlSync::create();
  return {};
}

// Makes `buffer` hold at least `bytes`, mapped with `access`.
Status MapRenderer::reserve(MappedBuffer& buffer, size_t bytes, GLbitfield access) {
  if (bytes <= buffer.capacity) return {};
  const size_t capacity = std::bit_ceil(std::max<size_t>(bytes, 1 << 14));
  access |= GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
  buffer = MappedBuffer{GlBuffer::create(), nullptr, 0};
  glNamedBufferStorage(buffer.buffer.name(), static_cast<GLsizeiptr>(capacity), nullptr, access);
  buffer.data = static_cast<std::byte*>(
      glMapNamedBufferRange(buffer.buffer.name(), 0, static_cast<GLsizeiptr>(capacity), access));
  if (!buffer.data) return no_memory("draws");
  buffer.capacity = capacity;
  return {};
}

template <typename T>
Status MapRenderer::write(MappedBuffer& buffer, const std::vector<T>& items) {
  const size_t bytes = items.size() * sizeof(T);
  if (Status reserved = reserve(buffer, bytes, GL_MAP_WRITE_BIT); !reserved) return reserved;
  std::memcpy(buffer.data, items.data(), bytes);
  return {};
}

}  // namespace sightline
