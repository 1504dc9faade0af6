// Merges vertices at equal positions. Files split vertices for normals and texture coordinates, which nothing here
// needs: a flat-shaded mesh has up to six at each corner.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "server/base/work_limit.h"

namespace sightline {

// Keeps the first of all positions that are equal bit for bit and redirects `indices`. The order of the positions
// stays, and unused positions are kept. Every index must be valid. The time is proportional to the number of positions
// for any input. Where the hash table would have to search long, equal positions may therefore stay separate.
// meshopt_generateVertexRemap has no such bound, and files are not trusted. False when the work had to end; the mesh is
// spoilt then.
bool weld(std::vector<glm::vec3>& positions, std::vector<uint32_t>& indices, WorkLimit::Part& work);

}  // namespace sightline
