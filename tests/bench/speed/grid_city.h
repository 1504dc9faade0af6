// A city on a grid of configurable size and detail, for measuring growth. Streets run between blocks. A group that
// includes the targets walks along the middle street, movers walk along all streets, and props stand at the kerbs.
#pragma once

#include <memory>
#include <vector>

#include "server/sample/extent.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"

namespace sightline::bench {

struct GridCityOptions {
  int blocks_a_side = 20;    // even
  int cells = 8;             // every face of a block is cut into cells x cells: 12 cells^2 triangles
  bool own_geometry = true;  // every block has a geometry of its own; else all blocks of a street share one
  int targets = 2;           // [1, kMaxTargets]
  // number of walkers in the group, from which the targets are chosen evenly; 0: the targets alone
  int group = 0;
  int movers = 0;  // moving occluders beyond the group
  int props = 0;   // small static instances, all of one geometry
};

// Deterministic. Single-threaded.
class GridCity {
 public:
  explicit GridCity(const GridCityOptions& options);

  // Moves everything that moves to its pose and velocity at this tick of 1/60 s. Returns the time that the mirror
  // needed, in milliseconds.
  double advance(int tick);

  const SceneMirror& mirror() const { return mirror_; }
  const std::vector<Target>& targets() const { return targets_; }
  // The tables of the targets' shapes, by target.
  const std::vector<const ExtentTable*>& tables() const { return tables_; }
  // The camera's start: behind the targets and above them.
  Pose camera() const;
  size_t triangles() const;

 private:
  void add_blocks(SceneDelta& delta);
  void add_props(SceneDelta& delta);
  void add_walkers(SceneDelta& delta);
  Pose walker_pose(int walker, int tick) const;
  int walkers() const { return options_.group + options_.movers; }

  const GridCityOptions options_;
  GeometryStore store_;
  ExtentCache extents_;
  SceneMirror mirror_;
  std::vector<Target> targets_;
  std::vector<std::shared_ptr<const ExtentTable>> held_tables_;
  std::vector<const ExtentTable*> tables_;
  TransformUpdate update_;
};

}  // namespace sightline::bench
