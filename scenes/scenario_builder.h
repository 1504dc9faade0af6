// A scenario under construction: what every generator shares. The format is described in scenes/README.md: a
// glTF file whose nodes carry roles in their extras and whose moving nodes are driven by one animation named
// "scenario".
#pragma once

#include <cstddef>
#include <glm/glm.hpp>
#include <string>
#include <utility>
#include <vector>

#include "scenes/glb_writer.h"
#include "scenes/path.h"
#include "server/scene/asset.h"

namespace sightline::scenes {

inline constexpr double kKeysPerSecond = 60.0;
inline constexpr double kBodyRadius_m = 0.3;
inline constexpr double kBodyHeight_m = 1.8;

// Keys of a moving node in the world; parallel arrays.
struct Motion {
  std::vector<double> times_s;
  std::vector<glm::dvec3> positions_m;
  std::vector<glm::dquat> rotations;

  void add(double time_s, const glm::dvec3& position_m, const glm::dquat& rotation);
};

// Keys over [0, duration_s] of a walker on the floor that faces its direction of travel. Targets have 60 a second.
Motion walk(const TimedPath& path, double duration_s, double keys_per_second = kKeysPerSecond);

// The limits that a scenario is made for, as the extras of its camera.
struct CameraMotion {
  double max_speed_mps = 0.0;
  double max_acceleration_mps2 = 0.0;
};

// When a body is a target: [from, to) in seconds, in the order of time. Empty: always.
using TargetTimes = std::vector<std::pair<double, double>>;

// "column", 3 -> "column-3".
std::string numbered(std::string name, int number);

class ScenarioBuilder {
 public:
  explicit ScenarioBuilder(double duration_s) : duration_s_(duration_s) {}

  int add_mesh(const std::string& name, const MeshData& mesh, const glm::vec3& color);
  void add_static(const std::string& name, int mesh, const glm::dvec3& position_m,
                  const glm::dquat& rotation = {1, 0, 0, 0}, const InstanceAttributes& attributes = {});
  // A character 1.8 m high and 0.6 m across with its feet at the node's origin, facing +Z: a capsule, and
  // below it in the hierarchy a visor.
  void add_character(const std::string& name, const Motion& motion, const TargetTimes& during = {});
  // A target of another shape.
  void add_target(const std::string& name, int mesh, const Motion& motion, double weight = 1.0,
                  const TargetTimes& during = {});
  void add_occluder(const std::string& name, int mesh, const Motion& motion, const InstanceAttributes& attributes);
  // Where the camera starts, and how fast it may move; 0 leaves the default of the session.
  void add_camera(const glm::dvec3& eye_m, const glm::dvec3& at_m, const CameraMotion& motion = {});

  double duration_s() const { return duration_s_; }
  std::vector<std::byte> write() const { return writer_.finish("scenario"); }

 private:
  int add_moving(const std::string& name, int mesh, const Motion& motion, nlohmann::ordered_json role);

  double duration_s_;
  GlbWriter writer_;
  int body_mesh_ = -1;
  int visor_mesh_ = -1;
};

// Colours that distinguish the parts of a picture.
namespace colors {
inline constexpr glm::vec3 kFloor{0.35f, 0.34f, 0.32f}, kStone{0.62f, 0.58f, 0.50f}, kWall{0.70f, 0.66f, 0.60f},
    kCurtain{0.55f, 0.12f, 0.12f}, kWood{0.42f, 0.27f, 0.14f}, kBody{0.90f, 0.55f, 0.15f}, kVisor{0.1f, 0.1f, 0.12f},
    kLeaf{0.16f, 0.36f, 0.12f}, kMetal{0.30f, 0.33f, 0.36f}, kCar{0.20f, 0.30f, 0.55f};
}  // namespace colors

}  // namespace sightline::scenes
