// The guide tells what a camera can expect from a place on. It is the result of a dynamic program (costs_to_go.h), kept
// for every stage.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "client/ceiling/places.h"

namespace sightline {

// The cost of a point from which there is no way.
inline constexpr double kNoWayCost = 1000.0;

class Guide {
 public:
  // `grid` must outlive the guide.
  Guide(const PlaceGrid& grid, size_t stages);

  // The costs of a stage, by place: of its picture alone, and from there to the end, that picture included.
  void keep(size_t stage, std::span<const float> pictures, std::span<const float> to_go);

  // The values of the place nearest to a point, in the point's cell or one next to it. Both are 0 after the last stage,
  // and kNoWayCost where no place is near. Stored in steps of 1/200 (pictures) and 1/64 (to go) of a picture.
  double picture(const glm::dvec3& point_m, size_t stage) const;
  double to_go(const glm::dvec3& point_m, size_t stage) const;

 private:
  struct Stage {
    std::vector<uint8_t> pictures;
    float least_to_go = 0.0f;
    std::vector<uint16_t> above;  // to_go - least_to_go
  };
  uint32_t place_near(const glm::dvec3& point_m) const;

  const PlaceGrid& grid_;
  std::vector<Stage> stages_;
};

}  // namespace sightline
