#include "server/sample/map_taker.h"

#include <algorithm>
#include <limits>

#include "server/sample/seen_triangle.h"

namespace sightline {
namespace {

void start_map(const MapRequest& request, DepthMap& map) {
  const size_t count = static_cast<size_t>(request.view.width) * request.view.height;
  map.view = request.view;
  map.ahead_s = request.ahead_s;
  map.distance_m.assign(count, std::numeric_limits<float>::infinity());
  map.occluder.assign(count, kNoOccluder);
}

void resolve_map(const DrawList& list, const uint32_t* texels, int stride, DepthMap& map) {
  SeenTriangle seen;
  const InstanceDraw* instance = nullptr;
  uint32_t last = 0;
  size_t texel = 0;
  for (int y = 0; y < map.view.height; ++y)
    for (int x = 0; x < map.view.width; ++x, ++texel) {
      const uint32_t triangle = texels[y * stride + x];
      if (triangle == 0) continue;
      // Neighbours often show the same triangle.
      if (triangle != last) {
        const TriangleDraw& drawn = list.triangles[triangle - 1];
        instance = &list.instances[drawn.instance];
        seen = SeenTriangle(map.view, *instance->instance, map.ahead_s, drawn.first_index);
      }
      last = triangle;
      const glm::dvec3 direction = texel_direction(map.view, x, y);
      map.occluder[texel] = instance->slot;
      map.distance_m[texel] = static_cast<float>(seen.depth_along(direction) * glm::length(direction));
    }
}

}  // namespace

void MapTaker::prepare(std::span<const MapJob> jobs) {
  items_.clear();
  for (const MapJob& job : jobs)
    for (size_t map = 0; map < job.requests.size(); ++map) items_.push_back({&job, map});
  chunk_count_ = (items_.size() + MapRenderer::kMaxMaps - 1) / MapRenderer::kMaxMaps;
  searched_ = 0;
  if (chunk_count_ > 0) search(0);
}

Status MapTaker::take(MapRenderer& renderer) {
  const Status taken = take_chunks(renderer);
  if (!taken) renderer.abandon();
  return taken;
}

Status MapTaker::take_chunks(MapRenderer& renderer) {
  if (searched_ > 1) search(0);  // again, after a failure
  size_t collected = 0;
  for (size_t k = 0; k < chunk_count_; ++k) {
    if (k >= searched_) search(k);
    const Chunk& chunk = chunks_[k % chunks_.size()];
    if (!chunk.list.triangles.empty())
      if (Status submitted = renderer.submit(chunk.list, chunk.sizes); !submitted) return submitted;
    for (; collected + MapRenderer::kMaxInFlight - 1 <= k; ++collected)
      if (Status done = collect(renderer, chunks_[collected % chunks_.size()]); !done) return done;
  }
  for (; collected < chunk_count_; ++collected)
    if (Status done = collect(renderer, chunks_[collected % chunks_.size()]); !done) return done;
  return {};
}

void MapTaker::search(size_t k) {
  Chunk& chunk = chunks_[k % chunks_.size()];
  chunk.first = k * MapRenderer::kMaxMaps;
  chunk.count = std::min(MapRenderer::kMaxMaps, items_.size() - chunk.first);
  chunk.list.clear();
  chunk.sizes.clear();
  for (const Item& item : std::span(items_).subspan(chunk.first, chunk.count)) {
    const MapRequest& request = item.job->requests[item.map];
    search_.append_map(*item.job->table, *item.job->mirror, request, chunk.list);
    chunk.sizes.push_back({request.view.width, request.view.height});
  }
  searched_ = k + 1;
}

Status MapTaker::collect(MapRenderer& renderer, const Chunk& chunk) const {
  for (const Item& item : std::span(items_).subspan(chunk.first, chunk.count))
    start_map(item.job->requests[item.map], item.job->maps[item.map]);
  if (chunk.list.triangles.empty()) return {};
  const Result<TexelLayers> layers = renderer.collect();
  if (!layers) return tl::unexpected(layers.error());
  for (size_t i = 0; i < chunk.count; ++i) {
    const Item& item = items_[chunk.first + i];
    resolve_map(chunk.list, layers->texels + i * static_cast<size_t>(layers->width) * layers->height, layers->width,
                item.job->maps[item.map]);
  }
  return {};
}

}  // namespace sightline
