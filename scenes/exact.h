// Arithmetic that gives the same bits with every compiler and C library. It uses only +, -, *, / and sqrt, which IEEE
// 754 rounds correctly. The library is built with -ffp-contract=off for the same reason.
#pragma once

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>

#include "server/base/random.h"

namespace sightline::scenes {

// The nearest multiple of 1/1024 m: what every coordinate of a still mesh or node is. Exact as a float up to
// 16 km.
double snap(double metres);
glm::dvec3 snap(const glm::dvec3& metres);
// The nearest multiple of 1/65536 m: for keys of a motion, where a coarser grid would show as acceleration.
glm::dvec3 snap_key(const glm::dvec3& metres);

// A snapped number in [low, high) metres.
double snapped_in(CounterRandom& random, double low, double high);

// (cos, sin) of a whole number of turns; any finite argument up to 1e6. Errs by less than 1e-12.
glm::dvec2 circle_point(double turns);

// The rotation about +Y by which +Z (the front of a glTF model) faces the unit direction (x, z).
glm::dquat facing(const glm::dvec2& direction_xz);
// The rotation about +Y by a multiple of 90 degrees.
glm::dquat quarter_turns(int count);
// The rotation of a camera at `eye_m` (looking along its -Z, never rolled) that shows `at_m` in the middle.
// The two may not stand above one another.
glm::dquat looking(const glm::dvec3& eye_m, const glm::dvec3& at_m);

}  // namespace sightline::scenes
