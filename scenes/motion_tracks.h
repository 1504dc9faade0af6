// Reads recorded motion from a folder. One recording holds 137 people who walk round the corner of a corridor
// (experiments of Forschungszentrum Juelich, IAS-7, as in the reference tests of PedPy, MIT). The other holds the
// players and the ball of a football attack (Last Row, Friends of Tracking Data). The recordings are not part of this
// project.
#pragma once

#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline::scenes {

// Name of the environment variable that holds the folder when no option does.
inline constexpr const char* kMotionVariable = "SIGHTLINE_MOTION";

// `folder` if it is not empty, else the value of kMotionVariable, else empty.
std::string motion_folder(const std::string& folder);

// One body: where it was at `first_s`, and each 1 / rate_hz seconds after that. On the floor: x and z; y is the height
// of the head, or of the ball.
struct Track {
  int id = 0;
  double first_s = 0.0, rate_hz = 0.0;
  std::vector<glm::dvec3> positions_m;

  double last_s() const { return first_s + static_cast<double>(positions_m.size() - 1) / rate_hz; }
  // By a cubic through the neighbouring samples. Before the first sample and after the last one the body goes straight
  // on along x or z, at its mean speed of the first or the last second.
  glm::dvec3 position_m(double time_s) const;
};

// In the order of their ids. The corner: the corridor comes along +x, 3 m wide (-1.5 to 1.5 in z), turns at the origin,
// and goes on along -z. kNotFound: `folder` is empty or lacks the file. kInvalidArgument: a line that is no sample.
Result<std::vector<Track>> read_corner(const std::string& folder);
// The middle of the pitch is the origin, x along its 105 m. The ball has id 0, and its height as y; players have 1.8 m.
Result<std::vector<Track>> read_attack(const std::string& folder);

}  // namespace sightline::scenes
