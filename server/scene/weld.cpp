#include "server/scene/weld.h"

#include <bit>
#include <cstring>
#include <span>

#include "server/base/hash.h"

namespace sightline {
namespace {

constexpr uint32_t kFree = UINT32_MAX;
constexpr size_t kLongestSearch = 64;

std::span<const std::byte> bytes_of(const glm::vec3& position) {
  return std::as_bytes(std::span(&position, 1));
}

// A hash table of the merged positions so far.
class Known {
 public:
  explicit Known(size_t positions) : slots_(std::bit_ceil(positions + positions / 3 + 1), kFree) {}

  // Returns the index of an equal position. Without one, stores `next` as the index of this position and returns it.
  uint32_t find_or_add(const glm::vec3& position, const std::vector<glm::vec3>& welded, uint32_t next) {
    const size_t mask = slots_.size() - 1, first = hash64_bytes(bytes_of(position)) & mask;
    for (size_t k = 0; k < kLongestSearch; ++k) {
      uint32_t& slot = slots_[(first + k) & mask];
      if (slot == kFree) return slot = next;
      if (std::memcmp(&welded[slot], &position, sizeof position) == 0) return slot;
    }
    return next;
  }

 private:
  std::vector<uint32_t> slots_;  // indices into the welded positions
};

}  // namespace

bool weld(std::vector<glm::vec3>& positions, std::vector<uint32_t>& indices, WorkLimit::Part& work) {
  Known known(positions.size());
  std::vector<uint32_t> place(positions.size());
  // Merges in place: the write position never passes the read position.
  uint32_t count = 0;
  for (size_t i = 0; i < positions.size(); ++i) {
    if (work.ends()) return false;
    place[i] = known.find_or_add(positions[i], positions, count);
    if (place[i] == count) positions[count++] = positions[i];
  }
  if (count == positions.size()) return true;
  positions.resize(count);
  for (uint32_t& index : indices) index = place[index];
  return true;
}

}  // namespace sightline
