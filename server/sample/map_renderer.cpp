#include "server/sample/map_renderer.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstddef>
#include <cstring>

#include "server/gl/program.h"

namespace sightline {
namespace {

constexpr const char* kVertexShader = R"(
struct Instance {           // see InstanceDraw
  vec4 clip_x, clip_y, clip_w;
  uvec4 place;              // near plane as float bits, layer, viewport
};
layout(std430, binding = 0) readonly buffer Instances { Instance instances[]; };
layout(location = 0) in vec3 position;
layout(location = 1) in uvec2 part;  // instance, what to add to a vertex's number / 3 for that of its triangle
void main() {
  Instance instance = instances[part.x];
  vec4 p = vec4(position, 1.0);
  gl_Position = vec4(dot(instance.clip_x, p), dot(instance.clip_y, p), uintBitsToFloat(instance.place.x),
                     dot(instance.clip_w, p));
  PUT_TRIANGLE = uint(gl_VertexID) / 3u + part.y + 1u;
  PUT_LAYER = int(instance.place.y);
  PUT_VIEWPORT = int(instance.place.z);
}
)";

constexpr const char* kLayersInVertexShader = R"(#version 450 core
#extension GL_ARB_shader_viewport_layer_array : require
flat out uint triangle;
#define PUT_TRIANGLE triangle
#define PUT_LAYER gl_Layer
#define PUT_VIEWPORT gl_ViewportIndex
)";

constexpr const char* kLayersPassedOn = R"(#version 450 core
out Passed { flat uint triangle; flat int layer, viewport; } passed;
#define PUT_TRIANGLE passed.triangle
#define PUT_LAYER passed.layer
#define PUT_VIEWPORT passed.viewport
)";

constexpr const char* kGeometryShader = R"(#version 450 core
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
in Passed { flat uint triangle; flat int layer, viewport; } passed[];
flat out uint triangle;
void main() {
  for (int i = 0; i < 3; ++i) {
    gl_Position = gl_in[i].gl_Position;
    triangle = passed[i].triangle;
    gl_Layer = passed[i].layer;
    gl_ViewportIndex = passed[i].viewport;
    EmitVertex();
  }
}
)";

constexpr const char* kFragmentShader = R"(#version 450 core
flat in uint triangle;
layout(location = 0) out uint texel;
void main() { texel = triangle; }
)";

enum Binding : GLuint { kVertices = 0, kParts = 1 };
enum Location : GLuint { kPosition = 0, kPart = 1 };
constexpr GLuint kInstanceBlock = 0;
// Longer than any take: a device that does not answer is lost, and the context says so.
constexpr GLuint64 kFenceTimeoutNs = 2'000'000'000;

int power_of_two_at_least(int value) {
  return static_cast<int>(std::bit_ceil(static_cast<unsigned>(value)));
}

void set_format(const GlVertexArray& array, GLuint part_binding, GLuint part_offset) {
  const GLuint name = array.name();
  glEnableVertexArrayAttrib(name, kPosition);
  glVertexArrayAttribFormat(name, kPosition, 3, GL_FLOAT, GL_FALSE, 0);
  glVertexArrayAttribBinding(name, kPosition, kVertices);
  glEnableVertexArrayAttrib(name, kPart);
  glVertexArrayAttribIFormat(name, kPart, 2, GL_UNSIGNED_INT, part_offset);
  glVertexArrayAttribBinding(name, kPart, part_binding);
}

tl::unexpected<Error> no_memory(const char* what) {
  return fail(ErrorCode::kResourceExhausted, "", std::string("the OpenGL device has no memory for ").append(what));
}

// Makes `buffer` hold at least `bytes`, mapped with `access`.
template <typename MappedBuffer>
Status reserve(MappedBuffer& buffer, size_t bytes, GLbitfield access) {
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

template <typename MappedBuffer, typename T>
Status write(MappedBuffer& buffer, const std::vector<T>& items) {
  const size_t bytes = items.size() * sizeof(T);
  if (Status reserved = reserve(buffer, bytes, GL_MAP_WRITE_BIT); !reserved) return reserved;
  if (bytes > 0) std::memcpy(buffer.data, items.data(), bytes);
  return {};
}

template <typename Segment>
void set_viewports(const Segment& segment) {
  std::array<float, 4 * Segment::kMaxViewports> boxes{};
  for (int i = 0; i < segment.viewport_count; ++i) {
    boxes[4 * static_cast<size_t>(i) + 2] = static_cast<float>(segment.viewports[static_cast<size_t>(i)].width);
    boxes[4 * static_cast<size_t>(i) + 3] = static_cast<float>(segment.viewports[static_cast<size_t>(i)].height);
  }
  glViewportArrayv(0, segment.viewport_count, boxes.data());
}

}  // namespace

Result<std::unique_ptr<MapRenderer>> MapRenderer::create(LayersBy layers_by) {
  std::unique_ptr<MapRenderer> renderer(new MapRenderer);
  const bool in_vertex_shader =
      layers_by == LayersBy::kAnyStage && epoxy_has_gl_extension("GL_ARB_shader_viewport_layer_array");
  const std::string vertex = std::string(in_vertex_shader ? kLayersInVertexShader : kLayersPassedOn) + kVertexShader;
  Result<GlProgram> program = make_program(vertex, kFragmentShader, in_vertex_shader ? "" : kGeometryShader);
  if (!program) return tl::unexpected(program.error());
  renderer->program_ = std::move(*program);
  renderer->set_up_vertex_arrays();
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

void MapRenderer::set_up_vertex_arrays() {
  streamed_ = GlVertexArray::create();
  set_format(streamed_, kVertices, offsetof(StreamedVertex, instance));
  placed_ = GlVertexArray::create();
  set_format(placed_, kParts, 0);
  glVertexArrayBindingDivisor(placed_.name(), kParts, 1);
}

Status MapRenderer::submit(const DrawList& list, std::span<const MapSize> sizes, const EglVariant& variant) {
  assert(sizes.size() <= kMaxMaps && sizes.size() == list.end_part_of_map.size() && !sizes.empty());
  assert(in_flight_ < (variant.ring ? kMaxInFlight : 1));
  Flight& flight = flights_[(first_in_flight_ + in_flight_) % kMaxInFlight];
  flight.width = flight.height = 1;
  for (const MapSize& size : sizes) {
    flight.width = std::max(flight.width, size.width);
    flight.height = std::max(flight.height, size.height);
  }
  const int layers = static_cast<int>(sizes.size());
  const Result<const Target*> target = target_of(flight.width, flight.height, layers);
  if (!target) return tl::unexpected(target.error());
  divide_into_segments(sizes, variant.draw_per_map);
  if (Status written = write_instances(list, flight); !written) return written;
  glBindFramebuffer(GL_FRAMEBUFFER, (*target)->framebuffer.name());
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  const Status drawn =
      variant.detail == Detail::kTriangles ? draw_triangles(list, flight) : draw_clusters(list, flight);
  if (!drawn) return drawn;
  if (Status read = read_back(**target, layers, variant.ring, flight); !read) return read;
  ++in_flight_;
  return {};
}

Result<TexelLayers> MapRenderer::collect() {
  assert(in_flight_ > 0);
  Flight& flight = flights_[first_in_flight_];
  first_in_flight_ = (first_in_flight_ + 1) % kMaxInFlight;
  --in_flight_;
  if (!flight.fence) return TexelLayers{texels_.data(), flight.width, flight.height};
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

void MapRenderer::divide_into_segments(std::span<const MapSize> sizes, bool draw_per_map) {
  segments_.clear();
  viewport_of_map_.clear();
  const int most = draw_per_map ? 1 : Segment::kMaxViewports;
  for (uint32_t map = 0; map < sizes.size(); ++map) {
    if (segments_.empty() || draw_per_map) segments_.push_back({map, map, 0, {}});
    const auto find = [&](const Segment& segment) {
      const auto end = segment.viewports.begin() + segment.viewport_count;
      return static_cast<int>(std::find(segment.viewports.begin(), end, sizes[map]) - segment.viewports.begin());
    };
    int viewport = find(segments_.back());
    if (viewport == most) {
      segments_.push_back({map, map, 0, {}});
      viewport = 0;
    }
    Segment& segment = segments_.back();
    if (viewport == segment.viewport_count)
      segment.viewports[static_cast<size_t>(segment.viewport_count++)] = sizes[map];
    segment.end_map = map + 1;
    viewport_of_map_.push_back(static_cast<uint32_t>(viewport));
  }
}

Status MapRenderer::write_instances(const DrawList& list, Flight& flight) {
  instance_data_.clear();
  for (const InstanceDraw& draw : list.instances)
    instance_data_.push_back(
        {draw.clip_x, draw.clip_y, draw.clip_w, draw.near_m, draw.map, viewport_of_map_[draw.map], 0});
  if (Status written = write(flight.instances, instance_data_); !written) return written;
  if (flight.instances.buffer)
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kInstanceBlock, flight.instances.buffer.name());
  return {};
}

Status MapRenderer::draw_triangles(const DrawList& list, Flight& flight) {
  vertices_.clear();
  for (const DrawPart& part : list.parts) {
    const Geometry& geometry = *list.instances[part.instance].instance->geometry;
    for (uint32_t i = part.first_index; i < part.first_index + part.index_count; ++i)
      vertices_.push_back({geometry.positions[geometry.indices[i]], part.instance, 0});
  }
  if (vertices_.empty()) return {};
  if (Status written = write(flight.vertices, vertices_); !written) return written;
  glBindVertexArray(streamed_.name());
  glVertexArrayVertexBuffer(streamed_.name(), kVertices, flight.vertices.buffer.name(), 0, sizeof(StreamedVertex));
  const auto first_triangle = [&](uint32_t map) {
    const uint32_t part = list.first_part(map);
    return part < list.parts.size() ? list.parts[part].first_triangle : list.triangle_count;
  };
  for (const Segment& segment : segments_) {
    const uint32_t first = first_triangle(segment.first_map), end = first_triangle(segment.end_map);
    if (first == end) continue;
    set_viewports(segment);
    glDrawArrays(GL_TRIANGLES, static_cast<GLint>(3 * first), static_cast<GLsizei>(3 * (end - first)));
  }
  return {};
}

Status MapRenderer::draw_clusters(const DrawList& list, Flight& flight) {
  if (Status placed = place_parts(list); !placed) return placed;
  build_batches(list);
  if (commands_.empty()) return {};
  Status written = write(flight.parts, part_data_);
  if (written) written = write(flight.commands, commands_);
  if (!written) return written;
  glBindVertexArray(placed_.name());
  glVertexArrayVertexBuffer(placed_.name(), kParts, flight.parts.buffer.name(), 0, sizeof(PartData));
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, flight.commands.buffer.name());
  for (size_t i = 0; i < batches_.size(); ++i) {
    const size_t first = batches_[i].first_command;
    const size_t end = i + 1 < batches_.size() ? batches_[i + 1].first_command : commands_.size();
    if (first == end) continue;
    set_viewports(segments_[batches_[i].segment]);
    glVertexArrayVertexBuffer(placed_.name(), kVertices, arena_.buffer(batches_[i].page), 0,
                              GeometryArena::kVertexBytes);
    glMultiDrawArraysIndirect(GL_TRIANGLES, reinterpret_cast<const void*>(first * sizeof(DrawCommand)),
                              static_cast<GLsizei>(end - first), 0);
  }
  return {};
}

Status MapRenderer::place_parts(const DrawList& list) {
  slices_.clear();
  for (const InstanceDraw& draw : list.instances) {
    const Result<ArenaSlice> slice = arena_.place(draw.instance->geometry);
    if (!slice) return tl::unexpected(slice.error());
    slices_.push_back(*slice);
  }
  // A vertex counts from the start of its page, a triangle from that of the list.
  part_data_.clear();
  for (const DrawPart& part : list.parts) {
    const uint32_t first_vertex = slices_[part.instance].first_vertex + part.first_index;
    part_data_.push_back({part.instance, part.first_triangle - first_vertex / 3});
  }
  return {};
}

void MapRenderer::build_batches(const DrawList& list) {
  commands_.clear();
  batches_.clear();
  for (uint32_t segment = 0; segment < segments_.size(); ++segment)
    for (uint32_t page = 0; page < arena_.page_count(); ++page) {
      batches_.push_back({segment, page, static_cast<uint32_t>(commands_.size())});
      append_commands(list, segments_[segment], page);
    }
}

void MapRenderer::append_commands(const DrawList& list, const Segment& segment, uint32_t page) {
  const uint32_t end = list.end_part_of_map[segment.end_map - 1];
  for (uint32_t part = list.first_part(segment.first_map); part < end; ++part) {
    const DrawPart& draw = list.parts[part];
    const ArenaSlice& slice = slices_[draw.instance];
    if (slice.page == page) commands_.push_back({draw.index_count, 1, slice.first_vertex + draw.first_index, part});
  }
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
  if (glCheckNamedFramebufferStatus(framebuffer, GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    return no_memory("maps");
  targets_.push_back(std::move(target));
  return &targets_.back();
}

Status MapRenderer::read_back(const Target& target, int layers, bool ring, Flight& flight) {
  flight.texel_count = static_cast<size_t>(flight.width) * flight.height * layers;
  const auto bytes = static_cast<GLsizei>(flight.texel_count * sizeof(uint32_t));
  void* into = nullptr;  // the start of the bound buffer
  if (ring) {
    if (Status reserved = reserve(flight.pixels, static_cast<size_t>(bytes), GL_MAP_READ_BIT); !reserved)
      return reserved;
    glBindBuffer(GL_PIXEL_PACK_BUFFER, flight.pixels.buffer.name());
  } else {
    texels_.resize(flight.texel_count);
    into = texels_.data();
  }
  glGetTextureSubImage(target.color.name(), 0, 0, 0, 0, flight.width, flight.height, layers, GL_RED_INTEGER,
                       GL_UNSIGNED_INT, bytes, into);
  if (!ring) return {};
  glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
  flight.fence = GlSync::create();
  return {};
}

}  // namespace sightline
