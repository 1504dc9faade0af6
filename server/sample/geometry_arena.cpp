#include "server/sample/geometry_arena.h"

#include <algorithm>
#include <utility>

namespace sightline {

uint32_t RunAllocator::take(uint32_t count) {
  const auto fit = std::find_if(free_.begin(), free_.end(), [&](const Run& run) { return run.count >= count; });
  if (fit == free_.end()) return UINT32_MAX;
  const uint32_t first = fit->first;
  fit->first += count;
  fit->count -= count;
  if (fit->count == 0) free_.erase(fit);
  return first;
}

void RunAllocator::give_back(uint32_t first, uint32_t count) {
  auto next = std::find_if(free_.begin(), free_.end(), [&](const Run& run) { return run.first > first; });
  next = free_.insert(next, {first, count});
  if (const auto after = next + 1; after != free_.end() && next->first + next->count == after->first) {
    next->count += after->count;
    free_.erase(after);
  }
  if (next == free_.begin()) return;
  if (const auto before = next - 1; before->first + before->count == next->first) {
    before->count += next->count;
    free_.erase(next);
  }
}

Result<ArenaSlice> GeometryArena::place(const std::shared_ptr<const Geometry>& geometry) {
  const auto found = entries_.find(geometry.get());
  if (found != entries_.end() && !found->second.geometry.expired()) return found->second.slice;
  // A dead geometry's address may have been used again: sweeping drops its entry.
  sweep();
  Result<ArenaSlice> slice = allocate(geometry->occluding_index_count);
  if (!slice) return slice;
  upload(*geometry, *slice);
  entries_.insert_or_assign(geometry.get(), Entry{geometry, *slice});
  return slice;
}

void GeometryArena::sweep() {
  std::erase_if(entries_, [this](const auto& item) {
    const Entry& entry = item.second;
    if (!entry.geometry.expired()) return false;
    pages_[entry.slice.page].runs.give_back(entry.slice.first_vertex, entry.slice.vertex_count);
    return true;
  });
  bool kept_one = false;
  for (Page& page : pages_) {
    if (!page.buffer || !page.runs.all_free(page.vertices)) continue;
    // Drivers clear new memory, so a page that comes and goes with each geometry would cost milliseconds.
    if (std::exchange(kept_one, true)) page = Page{GlBuffer(), 0, RunAllocator(0)};
  }
}

size_t GeometryArena::bytes() const {
  size_t vertices = 0;
  for (const auto& [key, entry] : entries_)
    if (!entry.geometry.expired()) vertices += entry.slice.vertex_count;
  return vertices * kVertexBytes;
}

Result<ArenaSlice> GeometryArena::allocate(uint32_t vertex_count) {
  for (uint32_t page = 0; page < pages_.size(); ++page) {
    const uint32_t first = pages_[page].runs.take(vertex_count);
    if (first != UINT32_MAX) return ArenaSlice{page, first, vertex_count};
  }
  uint32_t so_far = 0;
  for (const Page& page : pages_) so_far = std::min(kMaxPageVertices, so_far + std::min(kMaxPageVertices, page.vertices));
  const Result<uint32_t> page = add_page(std::max(vertex_count, std::max(so_far, kMinPageVertices)));
  if (!page) return tl::unexpected(page.error());
  return ArenaSlice{*page, pages_[*page].runs.take(vertex_count), vertex_count};
}

Result<uint32_t> GeometryArena::add_page(uint32_t vertices) {
  GlBuffer buffer = GlBuffer::create();
  while (glGetError() != GL_NO_ERROR) {
  }
  glNamedBufferStorage(buffer.name(), static_cast<GLsizeiptr>(vertices * kVertexBytes), nullptr,
                       GL_DYNAMIC_STORAGE_BIT);
  if (glGetError() != GL_NO_ERROR)
    return fail(ErrorCode::kResourceExhausted, "geometry", "the OpenGL device has no memory for the geometry");
  const auto vacant = std::find_if(pages_.begin(), pages_.end(), [](const Page& page) { return !page.buffer; });
  Page page{std::move(buffer), vertices, RunAllocator(vertices)};
  if (vacant != pages_.end()) {
    *vacant = std::move(page);
    return static_cast<uint32_t>(vacant - pages_.begin());
  }
  pages_.push_back(std::move(page));
  return static_cast<uint32_t>(pages_.size() - 1);
}

void GeometryArena::upload(const Geometry& geometry, const ArenaSlice& slice) {
  expanded_.resize(slice.vertex_count);
  for (uint32_t i = 0; i < slice.vertex_count; ++i) expanded_[i] = geometry.positions[geometry.indices[i]];
  glNamedBufferSubData(pages_[slice.page].buffer.name(), static_cast<GLintptr>(slice.first_vertex * kVertexBytes),
                       static_cast<GLsizeiptr>(slice.vertex_count * kVertexBytes), expanded_.data());
  expanded_.clear();
}

}  // namespace sightline
