// Takes maps with a renderer: searches, draws, reads back, and turns triangles into distances.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/base/error.h"
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

// Scratch of takes, of any number of mirrors. Single-threaded; what the jobs point at must outlive the calls.
class MapTaker {
 public:
  // Looks for what the first maps show: the part of a take that needs no renderer.
  void prepare(std::span<const MapJob> jobs, const EglVariant& variant);
  // Takes the maps of the jobs that were prepared. May be called again after a failure, with the same renderer or another. Needs
  // the renderer's context current.
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

  EglVariant variant_;
  std::vector<Item> items_;
  size_t chunk_count_ = 0;
  std::array<Chunk, MapRenderer::kMaxInFlight> chunks_;  // chunk k is at k % kMaxInFlight
  size_t searched_ = 0;                                  // chunks so far; the last one may not have been drawn
  SampleSearch search_;
};

}  // namespace sightline
