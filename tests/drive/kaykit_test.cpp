// A level of real game assets (KayKit Dungeon, CC0): read, composed, and steered through. The assets stand in
// the folder that SIGHTLINE_ASSETS names, or beside the repository in shared/assets/kaykit-dungeon.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numbers>

#include "scenes/glb_writer.h"
#include "server/scene/gltf.h"
#include "server/scene/primitives.h"
#include "tests/drive/drive_support.h"
#include "tests/support/daemon_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

fs::path assets_folder() {
  if (const char* folder = std::getenv("SIGHTLINE_ASSETS")) return folder;
  return fs::path(SIGHTLINE_SOURCE_DIR) / "../shared/assets/kaykit-dungeon";
}

// One asset as one mesh, every drawable in its pose. Parts that are attached to another part (the leaf in a door frame)
// are left out, so that doorways are open.
MeshData baked(const fs::path& file, GeometryStore& store) {
  const auto asset = read_gltf_file(file, store);
  if (!asset) throw std::runtime_error(file.string() + ": " + to_string(asset.error()));
  const std::vector<Affine> world = rest_world_from_node(**asset);
  MeshData mesh;
  for (size_t k = 0; k < world.size(); ++k) {
    const AssetNode& node = (*asset)->nodes[k];
    if (node.mesh < 0 || node.parent >= 0) continue;
    const Geometry& geometry = *(*asset)->meshes[node.mesh];
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const glm::vec3& p : geometry.positions) mesh.positions.emplace_back(transform_point(world[k], glm::dvec3(p)));
    for (const uint32_t index : geometry.indices) mesh.indices.push_back(first + index);
  }
  return mesh;
}

// Four rooms in a row along +X, each of 3 x 3 floor tiles of 4 m. There is a doorway between each two, props along the
// walls and a pillar in the middle. Two walkers go from the first room to the last, round the pillars.
class Level {
 public:
  explicit Level(fs::path folder) : folder_(std::move(folder)) {}

  std::vector<std::byte> write() {
    for (int room = 0; room < kRooms; ++room) add_room(room);
    const int person = writer_.add_mesh("person", *tessellate(CapsuleShape{0.3f, 0.6f}), {0.9f, 0.5f, 0.1f});
    add_walker("anna", person, kStartX + kApart);
    add_walker("ben", person, kStartX);
    const glm::dvec3 eye(1.6, 2.3, 8.2), at(kStartX + kApart / 2, 0.9, kMiddle);
    writer_.add_node({"eye",
                      -1,
                      -1,
                      writer_.add_camera(0.9, 16.0 / 9.0, 0.1),
                      eye,
                      look_rotation(at - eye, {0, 1, 0}, {1, 0, 0}),
                      {{"sightline", {{"role", "camera"}}}}});
    return writer_.finish("scenario");
  }

  size_t pieces() const { return pieces_; }
  size_t distinct() const { return meshes_.size(); }

 private:
  static constexpr int kRooms = 4, kTiles = 3;
  static constexpr double kTile = 4.0, kRoom = kTiles * kTile, kMiddle = kRoom / 2;
  static constexpr double kStartX = 2.1, kApart = 2.4, kSpeed = 1.5, kDuration = 27.0;

  void add(const std::string& asset, const glm::dvec3& at, double yaw_degrees = 0.0) {
    auto found = meshes_.find(asset);
    if (found == meshes_.end()) {
      const MeshData mesh = baked(folder_ / (asset + ".glb"), store_);
      found = meshes_.emplace(asset, writer_.add_mesh(asset, mesh, {0.6f, 0.6f, 0.6f})).first;
    }
    const glm::dquat yaw = glm::angleAxis(yaw_degrees * std::numbers::pi / 180, glm::dvec3(0, 1, 0));
    writer_.add_node({asset + "-" + std::to_string(pieces_++), -1, found->second, -1, at, yaw, nullptr});
  }

  void add_room(int room) {
    static const std::array<const char*, 4> kFloors{"floor_tile_large", "floor_dirt_large", "floor_wood_large",
                                                    "floor_tile_large"};
    const double x0 = room * kRoom;
    for (int i = 0; i < kTiles; ++i)
      for (int j = 0; j < kTiles; ++j) add(kFloors[room], {x0 + (i + 0.5) * kTile, 0, (j + 0.5) * kTile});
    add_long_walls(x0, room);
    for (int j = 0; j < kTiles; ++j) {
      add(room > 0 && j == 1 ? "wall_doorway" : "wall", {x0, 0, (j + 0.5) * kTile}, 90);
      if (room == kRooms - 1) add("wall_broken", {x0 + kRoom, 0, (j + 0.5) * kTile}, -90);
    }
    add(room % 2 ? "pillar_decorated" : "pillar", {x0 + kMiddle, 0, kMiddle});
    add_props(x0, room);
  }

  void add_long_walls(double x0, int room) {
    static const std::array<const char*, 8> kWalls{
        "wall_arched", "wall_cracked", "wall_archedwindow_gated", "wall_gated",
        "wall_pillar", "wall_shelves", "wall_window_open",        "wall_archedwindow_open"};
    static const std::array<const char*, 2> kBanners{"banner_blue", "banner_triple_red"};
    for (int i = 0; i < kTiles; ++i) {
      const double x = x0 + (i + 0.5) * kTile;
      add(i == 1 ? kWalls[2 * room] : "wall", {x, 0, 0});
      add(i == 1 ? kWalls[2 * room + 1] : "wall", {x, 0, kRoom}, 180);
      if (i == 0) add(kBanners[room % 2], {x, 0, 0});
    }
  }

  // Positions that leave the walkers their way and, in the first room, leave the camera its start.
  void add_props(double x0, int room) {
    static const std::array<const char*, 16> kCorner{"barrel_small_stack",
                                                     "bed_frame",
                                                     "box_stacked",
                                                     "crates_stacked",
                                                     "table_medium",
                                                     "table_long",
                                                     "table_small_decorated_A",
                                                     "shelves",
                                                     "box_large",
                                                     "chair",
                                                     "stool",
                                                     "column",
                                                     "barrel_small",
                                                     "barrier_column",
                                                     "trunk_large_A",
                                                     "chest"};
    static const std::array<const char*, 4> kMiddles{"barrel_large", "keg", "chest", "trunk_large_A"};
    const std::array<glm::dvec3, 4> corners{{{2.4, 0, 2.0}, {9.6, 0, 2.0}, {9.6, 0, 10.0}, {2.4, 0, 10.0}}};
    for (size_t k = 0; k < corners.size(); ++k)
      if (room > 0 || k != 3) add(kCorner[4 * room + k], corners[k] + glm::dvec3(x0, 0, 0), 90.0 * double(k));
    add(kMiddles[room], {x0 + kMiddle, 0, 1.6});
    add(kMiddles[(room + 1) % 4], {x0 + kMiddle, 0, kRoom - 1.6}, 180);
  }

  // The way goes straight through the doorways and passes the pillars 2.2 m to the side, left and right in turn.
  static glm::dvec3 way(double x) {
    const double side = static_cast<int>(std::floor(x / kRoom)) % 2 ? -2.2 : 2.2;
    const double swing = std::sin(std::numbers::pi * x / kRoom);
    return {x, 1.0, kMiddle + side * swing * swing};
  }

  void add_walker(const std::string& name, int mesh, double from_x) {
    const int node = writer_.add_node(
        {name, -1, mesh, -1, way(from_x), {1, 0, 0, 0}, {{"sightline", {{"role", "target"}}}}});
    std::vector<float> times;
    std::vector<glm::vec3> places;
    for (int k = 0; k <= 30 * kDuration; ++k) {
      times.push_back(static_cast<float>(k) / 30.0f);
      places.emplace_back(way(from_x + kSpeed * times.back()));
    }
    writer_.animate(node, times, places, std::vector<glm::quat>(times.size(), glm::quat(1, 0, 0, 0)));
  }

  const fs::path folder_;
  GeometryStore store_;
  scenes::GlbWriter writer_;
  std::map<std::string, int> meshes_;
  size_t pieces_ = 0;
};

TEST(RealAssets, TheCameraIsSteeredThroughALevelOfThem) {
  if (!fs::exists(assets_folder() / "wall.glb"))
    GTEST_SKIP() << "no KayKit Dungeon assets in " << assets_folder() << "; SIGHTLINE_ASSETS names another folder";
  Level level(assets_folder());
  const auto glb = level.write();
  EXPECT_GE(level.pieces(), 60u);
  EXPECT_GE(level.distinct(), 25u);
  const test::DaemonProcess daemon;
  const test::Driven driven = test::drive(daemon.address(), glb, {.rate_hz = 30.0, .picture_every = 3});
  ASSERT_FALSE(driven.frames.empty());
  test::keep_picture("kaykit", glb, driven);
  EXPECT_EQ(driven.run.body_collisions, 0u);
  EXPECT_EQ(driven.run.limit_violations, 0u);
  EXPECT_GT(driven.path.back().camera.position_m.x, 30.0) << "it followed through the doorways";
  EXPECT_GT(driven.run.all_seen, 0.7);
  EXPECT_GT(driven.run.mean_visible_share, 0.5);
  EXPECT_GT(driven.follow.body_collisions, 0u)
      << "a level that a camera without avoidance passes unharmed shows little";
}

}  // namespace
}  // namespace sightline
