// The positions of the candidates of a step. Most are lattice points in runs along x, of which only the first point is
// stored; single positions follow them. The positions of a run are computed where they are needed, always with the same
// bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace sightline {

// The lattice points (cell + (k, 0, 0)) * spacing for k = 0, 1, ... up to the beginning of the next run.
struct PlaceRun {
  glm::ivec3 cell{0};
  uint32_t first = 0;  // index of its first position; ascending from run to run
};

// Indexed positions, with the runs before the single positions. The memory that the view refers to must outlive it.
class PlaceView {
 public:
  PlaceView() = default;
  PlaceView(std::span<const glm::dvec3> singles_m) : singles_m_(singles_m) {}
  PlaceView(const std::vector<glm::dvec3>& singles_m) : singles_m_(singles_m) {}
  // `in_runs`: total number of positions in the runs.
  PlaceView(double spacing_m, std::span<const PlaceRun> runs, size_t in_runs, std::span<const glm::dvec3> singles_m)
      : spacing_m_(spacing_m), runs_(runs), in_runs_(in_runs), singles_m_(singles_m) {}

  size_t size() const { return in_runs_ + singles_m_.size(); }
  bool empty() const { return size() == 0; }
  double spacing_m() const { return spacing_m_; }
  std::span<const PlaceRun> runs() const { return runs_; }
  size_t in_runs() const { return in_runs_; }
  std::span<const glm::dvec3> singles_m() const { return singles_m_; }

  // O(log runs).
  glm::dvec3 operator[](size_t place) const;
  // The run that contains a position, which must be in one.
  size_t run_of(size_t place) const;
  size_t end_of_run(size_t run) const { return run + 1 < runs_.size() ? runs_[run + 1].first : in_runs_; }
  glm::dvec3 in_run(const PlaceRun& run, size_t place) const {
    return glm::dvec3(run.cell.x + static_cast<int>(place - run.first), run.cell.y, run.cell.z) * spacing_m_;
  }

 private:
  double spacing_m_ = 0.0;
  std::span<const PlaceRun> runs_;
  size_t in_runs_ = 0;
  std::span<const glm::dvec3> singles_m_;
};

// The same, but owns its memory, which is kept when the list is cleared.
class PlaceList {
 public:
  void clear() { runs_.clear(), singles_m_.clear(), in_runs_ = 0; }
  // Sets the runs of a list that has no single positions yet.
  void set_runs(double spacing_m, std::span<const PlaceRun> runs, size_t in_runs);
  void push_back(const glm::dvec3& place_m) { singles_m_.push_back(place_m); }

  PlaceView view() const { return {spacing_m_, runs_, in_runs_, singles_m_}; }
  operator PlaceView() const { return view(); }
  size_t size() const { return in_runs_ + singles_m_.size(); }
  bool empty() const { return size() == 0; }
  glm::dvec3 operator[](size_t place) const { return view()[place]; }
  glm::dvec3 back() const { return view()[size() - 1]; }

  // Iterates over the positions, by value.
  class Iterator {
   public:
    Iterator(const PlaceList& list, size_t place) : list_(&list), place_(place) {}
    glm::dvec3 operator*() const { return (*list_)[place_]; }
    Iterator& operator++() { return ++place_, *this; }
    bool operator==(const Iterator& other) const { return place_ == other.place_; }

   private:
    const PlaceList* list_;
    size_t place_;
  };
  Iterator begin() const { return {*this, 0}; }
  Iterator end() const { return {*this, size()}; }

 private:
  double spacing_m_ = 0.0;
  std::vector<PlaceRun> runs_;
  size_t in_runs_ = 0;
  std::vector<glm::dvec3> singles_m_;
};

// Computes all positions, for callers that read them many times.
void list_places(const PlaceView& places, std::vector<glm::dvec3>& position_m);

// The least axis-aligned box that contains all positions, and the radius of a ball round its middle that does. All 0
// without positions.
struct PlaceExtent {
  glm::dvec3 middle_m{0.0}, reach_m{0.0};  // middle +- reach
  double radius_m = 0.0;
};
PlaceExtent extent_of(const PlaceView& places);

// Positions in a tile, so few that a tile and its results fit the L1 cache.
inline constexpr size_t kTilePlaces = 1024;

// Positions [first, first + count) in single precision, relative to an origin, followed by kTilePad zeros.
struct PlaceTile {
  static constexpr size_t kTilePad = 16;
  alignas(64) float x_m[kTilePlaces + kTilePad], y_m[kTilePlaces + kTilePad], z_m[kTilePlaces + kTilePad];
  size_t first = 0, count = 0;
};
// Fills the tile that begins with position `first`, which must be less than places.size().
void fill_tile(const PlaceView& places, size_t first, const glm::dvec3& origin_m, PlaceTile& tile);

}  // namespace sightline
