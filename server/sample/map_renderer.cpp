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
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 clip_x;    // rows of clip_from_instance; see InstanceDraw
layout(location = 2) in vec4 clip_y;
layout(location = 3) in vec4 clip_w;
layout(location = 4) in uvec4 identity; // slot + 1, first vertex of the geometry in its page, near plane as float bits
flat out uvec2 source;
void main() {
  vec4 p = vec4(position, 1.0);
  gl_Position = vec4(dot(clip_x, p), dot(clip_y, p), uintBitsToFloat(identity.z), dot(clip_w, p));
  source = uvec2(uint(gl_VertexID) - identity.y, identity.x);
}
)";

constexpr const char* kFragmentShader = R"(#version 450 core
flat in uvec2 source;
layout(location = 0) out uvec2 texel;
void main() { texel = source; }
)";

enum Binding : GLuint { kPositions = 0, kInstances = 1 };

int power_of_two_at_least(int value) {
  return static_cast<int>(std::bit_ceil(static_cast<unsigned>(value)));
}

// Places the tiles in rows of `layout.width`; returns the height.
int fill_rows(std::span<const MapRequest> requests, AtlasLayout& layout) {
  layout.tiles.clear();
  int x = 0, y = 0, row_height = 0;
  for (const MapRequest& request : requests) {
    if (x + request.view.width > layout.width) {
      x = 0;
      y += row_height;
      row_height = 0;
    }
    layout.tiles.push_back({x, y});
    x += request.view.width;
    row_height = std::max(row_height, request.view.height);
  }
  return y + row_height;
}

}  // namespace

void lay_out(std::span<const MapRequest> requests, AtlasLayout& layout) {
  layout.width = kMaxMapSize;
  while ((layout.height = fill_rows(requests, layout)) > 2 * layout.width) layout.width *= 2;
}

Result<std::unique_ptr<MapRenderer>> MapRenderer::create() {
  std::unique_ptr<MapRenderer> renderer(new MapRenderer);
  Result<GlProgram> program = make_program(kVertexShader, kFragmentShader);
  if (!program) return tl::unexpected(program.error());
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
  glBindVertexArray(renderer->vertex_array_.name());
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  return renderer;
}

void MapRenderer::set_up_vertex_array() {
  vertex_array_ = GlVertexArray::create();
  const GLuint array = vertex_array_.name();
  glEnableVertexArrayAttrib(array, 0);
  glVertexArrayAttribFormat(array, 0, 3, GL_FLOAT, GL_FALSE, 0);
  glVertexArrayAttribBinding(array, 0, kPositions);
  const auto row = [&](GLuint location, size_t offset) {
    glEnableVertexArrayAttrib(array, location);
    glVertexArrayAttribFormat(array, location, 4, GL_FLOAT, GL_FALSE, static_cast<GLuint>(offset));
    glVertexArrayAttribBinding(array, location, kInstances);
  };
  row(1, offsetof(InstanceData, clip_x));
  row(2, offsetof(InstanceData, clip_y));
  row(3, offsetof(InstanceData, clip_w));
  glEnableVertexArrayAttrib(array, 4);
  glVertexArrayAttribIFormat(array, 4, 4, GL_UNSIGNED_INT, offsetof(InstanceData, slot_plus_one));
  glVertexArrayAttribBinding(array, 4, kInstances);
  glVertexArrayBindingDivisor(array, kInstances, 1);
}

Status MapRenderer::begin(const DrawList& list, std::span<const MapRequest> requests) {
  assert(requests.size() <= kMaxMaps && requests.size() == list.maps.size());
  lay_out(requests, layout_);
  texels_.resize(static_cast<size_t>(layout_.width) * layout_.height);
  if (Status placed = place_geometry(list); !placed) return placed;
  build_instance_data(list);
  const Status written =
      write(instance_buffer_, instance_data_.data(), instance_data_.size() * sizeof(InstanceData));
  if (!written) return written;
  const Result<const Atlas*> atlas = atlas_of(layout_.width, power_of_two_at_least(std::max(16, layout_.height)));
  if (!atlas) return tl::unexpected(atlas.error());
  glBindFramebuffer(GL_FRAMEBUFFER, (*atlas)->framebuffer.name());
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  return {};
}

Result<std::span<const TexelSource>> MapRenderer::draw(std::span<const MapRequest> requests, const DrawPass& pass) {
  build_batches(pass);
  Status written = write(index_buffer_, pass.indices.data(), pass.indices.size() * sizeof(uint32_t));
  if (written) written = write(command_buffer_, commands_.data(), commands_.size() * sizeof(DrawCommand));
  if (!written) return tl::unexpected(written.error());
  draw_batches(requests);
  glReadPixels(0, 0, layout_.width, layout_.height, GL_RG_INTEGER, GL_UNSIGNED_INT, texels_.data());
  return std::span<const TexelSource>(texels_);
}

Status MapRenderer::place_geometry(const DrawList& list) {
  slices_.clear();
  for (const InstanceDraw& draw : list.instances) {
    const Result<ArenaSlice> slice = arena_.place(draw.instance->geometry);
    if (!slice) return tl::unexpected(slice.error());
    slices_.push_back(*slice);
  }
  return {};
}

void MapRenderer::build_instance_data(const DrawList& list) {
  instance_data_.clear();
  for (size_t i = 0; i < list.instances.size(); ++i) {
    const InstanceDraw& draw = list.instances[i];
    instance_data_.push_back(
        {draw.clip_x, draw.clip_y, draw.clip_w, draw.slot + 1, slices_[i].first_vertex, draw.near_m, 0});
  }
}

void MapRenderer::build_batches(const DrawPass& pass) {
  commands_.clear();
  batches_.clear();
  for (uint32_t map = 0; map + 1 < pass.first_of_map.size(); ++map) {
    const std::span parts(pass.parts.data() + pass.first_of_map[map],
                          pass.first_of_map[map + 1] - pass.first_of_map[map]);
    for (uint32_t page = 0; page < arena_.page_count(); ++page) {
      const uint32_t first = static_cast<uint32_t>(commands_.size());
      append_commands(parts, page);
      const uint32_t count = static_cast<uint32_t>(commands_.size()) - first;
      if (count > 0) batches_.push_back({map, page, first, count});
    }
  }
}

void MapRenderer::append_commands(std::span<const DrawPass::Part> parts, uint32_t page) {
  for (const DrawPass::Part& part : parts) {
    const ArenaSlice& slice = slices_[part.instance];
    if (slice.page == page) commands_.push_back({part.count, 1, part.first, slice.first_vertex, part.instance});
  }
}

Status MapRenderer::write(MappedBuffer& buffer, const void* data, size_t bytes) {
  if (bytes > buffer.capacity) {
    const size_t capacity = std::bit_ceil(std::max<size_t>(bytes, 1 << 16));
    constexpr GLbitfield kAccess = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    buffer = MappedBuffer{GlBuffer::create(), nullptr, 0};
    glNamedBufferStorage(buffer.buffer.name(), static_cast<GLsizeiptr>(capacity), nullptr, kAccess);
    buffer.data = static_cast<std::byte*>(
        glMapNamedBufferRange(buffer.buffer.name(), 0, static_cast<GLsizeiptr>(capacity), kAccess));
    if (!buffer.data) return fail(ErrorCode::kResourceExhausted, "", "the OpenGL device has no memory for draws");
    buffer.capacity = capacity;
  }
  if (bytes > 0) std::memcpy(buffer.data, data, bytes);
  return {};
}

Result<const MapRenderer::Atlas*> MapRenderer::atlas_of(int width, int height) {
  for (const Atlas& atlas : atlases_)
    if (atlas.width == width && atlas.height == height) return &atlas;
  Atlas atlas{width, height, GlTexture2d::create(), GlTexture2d::create(), GlFramebuffer::create()};
  glTextureStorage2D(atlas.color.name(), 1, GL_RG32UI, width, height);
  glTextureStorage2D(atlas.depth.name(), 1, GL_DEPTH_COMPONENT32F, width, height);
  const GLuint framebuffer = atlas.framebuffer.name();
  glNamedFramebufferTexture(framebuffer, GL_COLOR_ATTACHMENT0, atlas.color.name(), 0);
  glNamedFramebufferTexture(framebuffer, GL_DEPTH_ATTACHMENT, atlas.depth.name(), 0);
  if (glCheckNamedFramebufferStatus(framebuffer, GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    return fail(ErrorCode::kResourceExhausted, "", "the OpenGL device cannot make the framebuffer");
  atlases_.push_back(std::move(atlas));
  return &atlases_.back();
}

void MapRenderer::draw_batches(std::span<const MapRequest> requests) const {
  glVertexArrayVertexBuffer(vertex_array_.name(), kInstances, instance_buffer_.buffer.name(), 0, sizeof(InstanceData));
  glVertexArrayElementBuffer(vertex_array_.name(), index_buffer_.buffer.name());
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, command_buffer_.buffer.name());
  for (const Batch& batch : batches_) {
    const MapView& view = requests[batch.map].view;
    const AtlasTile& tile = layout_.tiles[batch.map];
    glViewport(tile.x, tile.y, view.width, view.height);
    glVertexArrayVertexBuffer(vertex_array_.name(), kPositions, arena_.buffer(batch.page), 0,
                              GeometryArena::kVertexBytes);
    glMultiDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT,
                                reinterpret_cast<const void*>(batch.first_command * sizeof(DrawCommand)),
                                static_cast<GLsizei>(batch.command_count), 0);
  }
}

}  // namespace sightline
