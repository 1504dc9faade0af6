#include "server/aggregate/places.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "server/base/vector_clones.h"

namespace sightline {
namespace {

// A run is written in whole chunks of this many positions. The next run overwrites what is too much.
constexpr size_t kChunk = 8;
static_assert(kChunk <= PlaceTile::kTilePad);

// Writes the positions [first, end) of the runs; the first of them is in `run`.
SIGHTLINE_VECTOR_CLONES
void write_runs(const PlaceView& places, size_t run, size_t first, size_t end, const glm::dvec3& origin_m,
                PlaceTile& tile) {
  const double spacing_m = places.spacing_m(), from_x_m = origin_m.x;
  for (size_t next = first; next < end; ++run) {
    const PlaceRun& from = places.runs()[run];
    const auto y_m = static_cast<float>(from.cell.y * spacing_m - origin_m.y),
               z_m = static_cast<float>(from.cell.z * spacing_m - origin_m.z);
    const size_t stop = std::min(places.end_of_run(run), end);
    int cell = from.cell.x + static_cast<int>(next - from.first);
    for (size_t at = next - first; at < stop - first; at += kChunk, cell += static_cast<int>(kChunk)) {
      for (int k = 0; k < static_cast<int>(kChunk); ++k)
        tile.x_m[at + k] = static_cast<float>((cell + k) * spacing_m - from_x_m);
      for (size_t k = 0; k < kChunk; ++k) tile.y_m[at + k] = y_m;
      for (size_t k = 0; k < kChunk; ++k) tile.z_m[at + k] = z_m;
    }
    next = stop;
  }
}

void write_singles(std::span<const glm::dvec3> singles_m, size_t at, const glm::dvec3& origin_m, PlaceTile& tile) {
  for (const glm::dvec3& place_m : singles_m) {
    const glm::dvec3 from_origin = place_m - origin_m;
    tile.x_m[at] = static_cast<float>(from_origin.x);
    tile.y_m[at] = static_cast<float>(from_origin.y);
    tile.z_m[at] = static_cast<float>(from_origin.z);
    ++at;
  }
}

SIGHTLINE_VECTOR_CLONES
void list_runs(const PlaceView& places, double* __restrict out) {
  const double spacing_m = places.spacing_m();
  for (size_t run = 0; run < places.runs().size(); ++run) {
    const PlaceRun from = places.runs()[run];
    const double y_m = from.cell.y * spacing_m, z_m = from.cell.z * spacing_m;
    const auto count = static_cast<int>(places.end_of_run(run) - from.first);
    for (int k = 0; k < count; ++k, out += 3) {
      out[0] = (from.cell.x + k) * spacing_m;
      out[1] = y_m;
      out[2] = z_m;
    }
  }
}

}  // namespace

size_t PlaceView::run_of(size_t place) const {
  assert(place < in_runs_);
  const auto after = std::upper_bound(runs_.begin(), runs_.end(), place,
                                      [](size_t number, const PlaceRun& run) { return number < run.first; });
  return static_cast<size_t>(after - runs_.begin()) - 1;
}

glm::dvec3 PlaceView::operator[](size_t place) const {
  assert(place < size());
  return place < in_runs_ ? in_run(runs_[run_of(place)], place) : singles_m_[place - in_runs_];
}

void PlaceList::set_runs(double spacing_m, std::span<const PlaceRun> runs, size_t in_runs) {
  assert(singles_m_.empty());
  spacing_m_ = spacing_m;
  runs_.assign(runs.begin(), runs.end());
  in_runs_ = in_runs;
}

void list_places(const PlaceView& places, std::vector<glm::dvec3>& position_m) {
  position_m.resize(places.size());
  if (places.in_runs() > 0) list_runs(places, &position_m[0].x);
  std::copy(places.singles_m().begin(), places.singles_m().end(),
            position_m.begin() + static_cast<ptrdiff_t>(places.in_runs()));
}

PlaceExtent extent_of(const PlaceView& places) {
  if (places.empty()) return {};
  glm::dvec3 low = places[0], high = low;
  const auto take_in = [&](const glm::dvec3& p) { low = glm::min(low, p), high = glm::max(high, p); };
  const auto over_ends = [&](auto take) {
    for (size_t run = 0; run < places.runs().size(); ++run) {
      take(places.in_run(places.runs()[run], places.runs()[run].first));
      take(places.in_run(places.runs()[run], places.end_of_run(run) - 1));
    }
    for (const glm::dvec3& place_m : places.singles_m()) take(place_m);
  };
  over_ends(take_in);
  PlaceExtent extent{.middle_m = (low + high) / 2.0};
  // Half of the box, plus the rounding error of the distance to its middle.
  extent.reach_m = (high - low) * (0.5 + 0x1p-24);
  double squared = 0.0;
  over_ends([&](const glm::dvec3& p) {
    const glm::dvec3 off = p - extent.middle_m;
    const double far = glm::dot(off, off);
    // Written so that a NaN stays.
    squared = far <= squared ? squared : far;
  });
  extent.radius_m = std::sqrt(squared) * (1 + 0x1p-24);
  return extent;
}

void fill_tile(const PlaceView& places, size_t first, const glm::dvec3& origin_m, PlaceTile& tile) {
  assert(first < places.size());
  tile.first = first;
  tile.count = std::min(kTilePlaces, places.size() - first);
  const size_t end = first + tile.count, end_in_runs = std::min(end, places.in_runs());
  if (first < end_in_runs) write_runs(places, places.run_of(first), first, end_in_runs, origin_m, tile);
  const size_t next = std::max(first, end_in_runs);
  if (next < end)
    write_singles(places.singles_m().subspan(next - places.in_runs(), end - next), next - first, origin_m, tile);
  for (float* const axis : {tile.x_m, tile.y_m, tile.z_m}) std::fill_n(axis + tile.count, PlaceTile::kTilePad, 0.0f);
}

}  // namespace sightline
