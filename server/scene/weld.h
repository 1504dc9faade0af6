// Vertices at one place made one. Files part vertices for the sake of normals and texture coordinates, which nothing
// here needs: a flat-shaded mesh has up to six at each corner.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace sightline {

// Gives vertices whose positions are equal bit for bit one entry of `positions`, the first of them, and redirects
// `indices`; the order stays, and positions that no index names stay too. Every index must name a position. Takes time
// in proportion to the positions whatever they are: where a hash table would have to search long, a few equal ones are
// left apart. (meshopt_generateVertexRemap does the same without that bound, and files are not to be trusted.)
void weld(std::vector<glm::vec3>& positions, std::vector<uint32_t>& indices);

}  // namespace sightline
