// Takes maps with a renderer: searches for the triangles, draws them, reads back, and computes distances.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/base/error.h"
#include "server/sample/depth_map.h"
#include "server/sample/map_renderer.h"
#include "server/sample/sample_search.h"

namespace sightline {

// The maps of one mirror.
struct MapJob {
  const OccluderTable* table = nullptr;  // has taken in `mirror`, up to the requests' ahead_s
  const SceneMirror* mirror = nullptr;
  std::span<const MapRequest> requests;
  std::span<DepthMap> maps;  // as many
};

// Scratch of takes, for any number of mirrors. Single-threaded; what the jobs point at must outlive the calls.
class MapTaker {
 public:
  // Searches for what the first maps show: the part of a take that needs no renderer.
  void prepare(std::span<const MapJob> jobs);
  // Takes the maps of the prepared jobs. May be called again after a failure, with the same renderer or another one.
  // The renderer's context must be current.
  Status take(MapRenderer& renderer);

 private:
  struct Item {
    const MapJob* job;
    size_t map;
  };
  // Maps [first, first + count) of items_, drawn together.
  struct Chunk {
    size_t first = 0, count = 0;
    DrawList list;
    std::vector<MapSize> sizes;
  };
  Status take_chunks(MapRenderer& renderer);
  void search(size_t chunk);
  Status collect(MapRenderer& renderer, const Chunk& chunk) const;

  std::vector<Item> items_;
  size_t chunk_count_ = 0;
  std::array<Chunk, MapRenderer::kMaxInFlight> chunks_;  // chunk k is at k % kMaxInFlight
  size_t searched_ = 0;                                  // chunks so far; the last one may not have been drawn
  SampleSearch search_;
};

}  // namespace sightline
