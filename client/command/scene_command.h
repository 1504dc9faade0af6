// `sightline scene FILE`: what a scene file contains, as text for a person or as JSON.
#pragma once

#include <ostream>
#include <string>

namespace sightline {

// Prints to `out`: hash, extents, triangles, memory, extensions; then tables of nodes (with roles and
// attributes), meshes, cameras and animations; then warnings. Long tables are cut, but a node with a role or
// attributes of its own is always listed. With `json` it prints one JSON object instead, in which nothing is cut.
// Returns 0, or 1 with the reason on `err` when the file cannot be read.
int run_scene_command(const std::string& path, std::ostream& out, std::ostream& err, bool json = false);

}  // namespace sightline
