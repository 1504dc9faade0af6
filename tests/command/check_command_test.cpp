// Each warning of `sightline check` on a level that deserves it, and a level much like it that does not.
#include "client/check/check_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/check/plan_picture.h"
#include "client/check/wandering.h"
#include "server/scene/primitives.h"
#include "tests/support/glb_builder.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// A level file under construction. All nodes are below one root, so that a test can turn and scale the whole.
class LevelFile : public GlbBuilder {
 public:
  LevelFile() { add("nodes", {{"name", "root"}, {"children", nlohmann::json::array()}}); }

  int mesh(const std::string& name, const MeshData& data, int material = -1) {
    std::vector<float> values;
    for (const glm::vec3& p : data.positions) values.insert(values.end(), {p.x, p.y, p.z});
    nlohmann::json primitive = {{"attributes", {{"POSITION", floats(values)}}},
                                {"indices", accessor(data.indices, "SCALAR", kUnsignedInt)}};
    if (material >= 0) primitive["material"] = material;
    return add("meshes", {{"name", name}, {"primitives", nlohmann::json::array({primitive})}});
  }
  nlohmann::json& node(const std::string& name, int mesh, const glm::vec3& at = {0, 0, 0}) {
    const int index = add("nodes", {{"name", name}, {"mesh", mesh}, {"translation", {at.x, at.y, at.z}}});
    json["nodes"][0]["children"].push_back(index);
    return json["nodes"][index];
  }
  // A closed box whose middle is at `at`.
  nlohmann::json& box(const std::string& name, const glm::vec3& size, const glm::vec3& at, int material = -1) {
    return node(name, mesh(name, *tessellate(BoxShape{0.5f * size}), material), at);
  }
  // A rectangle from the origin along `right` and `up`, whose front is towards right x up.
  nlohmann::json& plane(const std::string& name, const glm::vec3& right, const glm::vec3& up, const glm::vec3& at,
                        int material = -1) {
    return node(name, mesh(name, {{{0, 0, 0}, right, right + up, up}, {0, 1, 2, 0, 2, 3}}, material), at);
  }
  int material(const std::string& name, const nlohmann::json& members) {
    nlohmann::json item = {{"name", name}};
    item.update(members);
    return add("materials", item);
  }
  nlohmann::json& root() { return json["nodes"][0]; }
  void set_of_all(const char* attribute, const nlohmann::json& value) {
    for (auto& item : json["nodes"])
      if (item.contains("mesh")) item["extras"]["sightline"][attribute] = value;
  }
};

// A room of 20 x 15 m with walls 0.3 m thick and 3 m high, and a pillar.
LevelFile room() {
  LevelFile level;
  level.box("floor", {20, 0.2, 15}, {0, -0.1, 0});
  level.box("west", {0.3, 3, 15}, {-9.85, 1.5, 0});
  level.box("east", {0.3, 3, 15}, {9.85, 1.5, 0});
  level.box("north", {20, 3, 0.3}, {0, 1.5, -7.35});
  level.box("south", {20, 3, 0.3}, {0, 1.5, 7.35});
  level.box("pillar", {1, 3, 1}, {3, 1.5, 2});
  return level;
}

class CheckCommand : public testing::Test {
 protected:
  std::string write(const LevelFile& level) const {
    const auto bytes = level.glb();
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return path;
  }
  json check(const LevelFile& level) {
    CheckOptions options{write(level), "none"};
    options.json = true;
    std::ostringstream out;
    status = run_check_command(options, out, err);
    return json::parse(out.str(), nullptr, false);
  }
  // Each as "kind: text".
  std::vector<std::string> warnings(const LevelFile& level) {
    std::vector<std::string> texts;
    for (const json& warning : check(level).value("warnings", json::array({{{"kind", "unread"}, {"text", err.str()}}})))
      texts.push_back(warning["kind"].get<std::string>() + ": " + warning["text"].get<std::string>());
    return texts;
  }

  const test::TemporaryFolder folder;
  const fs::path path = folder / "level.glb";
  std::ostringstream err;
  int status = -1;
};

TEST_F(CheckCommand, ASoundLevelHasNoWarnings) {
  EXPECT_THAT(warnings(room()), IsEmpty());
  EXPECT_EQ(status, 0);
}

TEST_F(CheckCommand, ALevelInAnotherUnitIsWarnedOf) {
  LevelFile level = room();
  level.root()["scale"] = {200, 200, 200};
  EXPECT_THAT(warnings(level),
              ElementsAre(AllOf(HasSubstr("scale: "), HasSubstr("4000 m long"), HasSubstr("is 40 m"))));
  level.root()["scale"] = {0.002, 0.002, 0.002};
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("scale: "), HasSubstr("0.04 m long"), HasSubstr("is 4 m"))));
  level.root()["scale"] = {90, 90, 90};
  EXPECT_THAT(warnings(level), IsEmpty());
}

TEST_F(CheckCommand, ALevelOnItsEdgeIsWarnedOf) {
  const double half = std::sqrt(0.5);
  LevelFile level = room();
  level.root()["rotation"] = {half, 0, 0, half};  // about x, as a file with Z up that was not converted
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("up_axis: "), HasSubstr("along z"))));
  level.root()["rotation"] = {0, 0, half, half};
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("up_axis: "), HasSubstr("along x"))));
  level.root()["rotation"] = {0, half, 0, half};  // about y: a level that faces another way
  EXPECT_THAT(warnings(level), IsEmpty());
}

TEST_F(CheckCommand, AHighNarrowHouseStandsUpright) {
  LevelFile level;
  level.box("house", {30, 30, 8}, {0, 15, 0});
  for (int storey = 0; storey < 10; ++storey)
    level.box("floor", {29, 0.2, 7}, {0, 3.f * static_cast<float>(storey) + 0.5f, 0});
  EXPECT_THAT(warnings(level), IsEmpty());
}

TEST_F(CheckCommand, ThinWallsAreNamed) {
  LevelFile level = room();
  level.box("screen", {4, 3, 0.01}, {0, 1.5, 0});
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("thin_walls: "), HasSubstr("screen (2"))));
  LevelFile thick = room();
  thick.box("screen", {4, 3, 0.04}, {0, 1.5, 0});
  thick.box("poster", {0.6, 0.8, 0.01}, {0, 1.5, -7.1});
  thick.box("carpet", {4, 0.01, 4}, {0, 0.05, 0});
  EXPECT_THAT(warnings(thick), IsEmpty());
}

TEST_F(CheckCommand, ADoubleSidedPlaneIsAThinWall) {
  LevelFile level = room();
  const int both = level.material("cloth", {{"doubleSided", true}});
  level.plane("curtain", {4, 0, 0}, {0, 3, 0}, {-2, 0, 0}, both);
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("thin_walls: "), HasSubstr("curtain"))));
}

// Some exporters write a double-sided surface as two triangles of opposite order.
TEST_F(CheckCommand, APlaneWithBothItsSidesIsAThinWall) {
  LevelFile level = room();
  level.node("curtain", level.mesh("curtain", {{{0, 0, 0}, {4, 0, 0}, {4, 3, 0}, {0, 3, 0}},
                                               {0, 1, 2, 0, 2, 3, 2, 1, 0, 3, 2, 0}}));
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("thin_walls: "), HasSubstr("curtain"))));
}

TEST_F(CheckCommand, SurfacesWithOneSideAreNamed) {
  LevelFile level = room();
  level.plane("backdrop", {4, 0, 0}, {0, 3, 0}, {-2, 0, 0});
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("one_sided: "), HasSubstr("backdrop (12 m2)"))));
  LevelFile roofed = room();
  roofed.plane("ceiling", {20, 0, 0}, {0, 0, 15}, {-10, 3, -7.5});  // faces down
  EXPECT_THAT(warnings(roofed), ElementsAre(AllOf(HasSubstr("one_sided: "), HasSubstr("ceiling"))));
}

TEST_F(CheckCommand, GroundMayHaveOneSide) {
  LevelFile level = room();
  level.plane("ground", {0, 0, 60}, {60, 0, 0}, {-30, -0.3, -30});
  EXPECT_THAT(warnings(level), IsEmpty());
}

// Two boards of one mesh with a whole face in common are one wall.
TEST_F(CheckCommand, BoardsThatTouchAreAsThickAsBothTogether) {
  for (const float thickness : {0.012f, 0.008f}) {
    LevelFile level = room();
    MeshData both = *tessellate(BoxShape{{2, 1.5f, 0.5f * thickness}});
    const auto first = static_cast<uint32_t>(both.positions.size());
    const MeshData board = both;
    for (const glm::vec3& p : board.positions) both.positions.push_back(p + glm::vec3(0, 0, thickness));
    for (const uint32_t index : board.indices) both.indices.push_back(first + index);
    level.node("wall", level.mesh("wall", both), {0, 1.5f, -2});
    if (2.0f * thickness > 0.02f)
      EXPECT_THAT(warnings(level), IsEmpty());
    else
      EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("thin_walls: "), HasSubstr("wall ("))));
  }
}

TEST_F(CheckCommand, AMirroredBodyIsNotTurnedInsideOut) {
  LevelFile level = room();
  level.root()["scale"] = {-1, 1, 1};
  EXPECT_THAT(warnings(level), IsEmpty());
}

// A surface of 80 x 80 rectangles, 12,800 triangles.
MeshData ground() {
  constexpr uint32_t kCells = 80, kRow = kCells + 1;
  MeshData mesh;
  for (uint32_t z = 0; z < kRow; ++z)
    for (uint32_t x = 0; x < kRow; ++x)
      mesh.positions.emplace_back(0.2f * static_cast<float>(x), 0, 0.2f * static_cast<float>(z));
  for (uint32_t z = 0; z < kCells; ++z)
    for (uint32_t x = 0; x < kCells; ++x) {
      const uint32_t a = z * kRow + x, b = a + kRow;
      mesh.indices.insert(mesh.indices.end(), {a, b, a + 1, a + 1, b, b + 1});
    }
  return mesh;
}

TEST_F(CheckCommand, OneMeshWithNearlyAllTrianglesIsNamed) {
  LevelFile level = room();
  level.node("Everything", level.mesh("Everything.001", ground()), {-8, 0.1f, -8});
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("one_mesh: "), HasSubstr("Everything.001 holds 99.6 %"))));
  MeshData half = ground();
  half.indices.resize(half.indices.size() / 2);
  level.node("Half", level.mesh("Half", half), {-8, 0.2f, -8});
  EXPECT_THAT(warnings(level), IsEmpty());
}

// Blender writes a custom property of True as 1, older versions and newer ones as true.
TEST_F(CheckCommand, ALevelWithoutCollidersIsWarnedOf) {
  for (const json& no : {json(false), json(0)}) {
    LevelFile level = room();
    level.set_of_all("collides", no);
    EXPECT_THAT(warnings(level), ElementsAre(HasSubstr("no_colliders: "))) << no;
    level.json["nodes"][1]["extras"]["sightline"]["collides"] = no.is_boolean() ? json(true) : json(1);
    EXPECT_THAT(warnings(level), IsEmpty()) << no;
  }
}

TEST_F(CheckCommand, ManySmallThingsThatAllCollideAreWarnedOf) {
  LevelFile level = room();
  const int stone = level.mesh("stone", *tessellate(BoxShape{glm::vec3(0.1f)}));
  for (int i = 0; i < 20; ++i) level.node("stone", stone, {0.4f * static_cast<float>(i) - 4, 0.1f, 0});
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("all_collide: "), HasSubstr("also 20 things"))));
  level.json["nodes"].back()["extras"]["sightline"]["collides"] = 0;
  EXPECT_THAT(warnings(level), IsEmpty());
}

TEST_F(CheckCommand, ALevelInWhichNothingHidesIsWarnedOf) {
  LevelFile level = room();
  level.set_of_all("occludes", false);
  EXPECT_THAT(warnings(level), ElementsAre(HasSubstr("nothing_hides: ")));
  LevelFile house;
  const int glass = house.material("glass",
                                   {{"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", 1}}}}}});
  house.box("greenhouse", {8, 3, 8}, {0, 1.5, 0}, glass);
  EXPECT_THAT(warnings(house), ElementsAre(HasSubstr("nothing_hides: ")));
  house.box("trunk", {1, 3, 1}, {0, 1.5, 0});
  EXPECT_THAT(warnings(house), IsEmpty());
  EXPECT_THAT(check(house)["see_through_materials"], ElementsAre("glass"));
}

TEST_F(CheckCommand, AnEmptyLevelIsWarnedOfAndDrawn) {
  LevelFile level;
  EXPECT_THAT(warnings(level), ElementsAre(HasSubstr("nothing_hides: "), HasSubstr("no_colliders: ")));
  std::ostringstream out;
  EXPECT_EQ(run_check_command({write(level), folder / "plan.png"}, out, err), 0) << err.str();
  EXPECT_GT(fs::file_size(folder / "plan.png"), 0u);
}

// The level is fine, and its targets are giants.
TEST_F(CheckCommand, TargetsInAnotherUnitAreWarnedOf) {
  LevelFile level = room();
  level.box("Guard", {30, 90, 30}, {0, 45, 0})["extras"]["sightline"]["role"] = "target";
  level.add("nodes", {{"name", "Eye"}, {"extras", {{"sightline", {{"role", "camera"}}}}}});
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("scale: open.targets"), HasSubstr("90 m long"),
                                                 testing::Not(HasSubstr("a hundredth")))));
}

TEST_F(CheckCommand, RolesAreCountedAndWrongOnesTold) {
  LevelFile level = room();
  level.box("Guard", {0.6, 1.8, 0.6}, {0, 0.9, 0})["extras"]["sightline"] = {{"role", "target"}, {"required", 1}};
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("roles: "), HasSubstr("role \"camera\""))));
  EXPECT_EQ(check(level)["roles"], nullptr);
  level.add("nodes", {{"name", "Eye"}, {"extras", {{"sightline", {{"role", "camera"}}}}}});
  EXPECT_THAT(warnings(level), IsEmpty());
  EXPECT_EQ(check(level)["roles"], (json{{"targets", 1}, {"occluders", 0}}));
  level.add("nodes", {{"name", "Nobody"}, {"extras", {{"sightline", {{"role", "target"}}}}}});
  EXPECT_THAT(warnings(level), ElementsAre(AllOf(HasSubstr("roles: "), HasSubstr("\"Nobody\" has no triangles"))));
}

TEST_F(CheckCommand, WarningsOfTheReaderAreTold) {
  LevelFile level = room();
  level.material("leaf", {{"alphaMode", "MASK"}});
  EXPECT_THAT(warnings(level), ElementsAre(HasSubstr("file: materials[0].alphaMode")));
}

TEST_F(CheckCommand, WarningsAreAFailureWhereThatIsAskedFor) {
  LevelFile level = room();
  std::ostringstream out;
  CheckOptions options{write(level), "none"};
  options.strict = true;
  EXPECT_EQ(run_check_command(options, out, err), 0);
  level.set_of_all("occludes", false);
  write(level);
  EXPECT_EQ(run_check_command(options, out, err), 1);
  options.strict = false;
  EXPECT_EQ(run_check_command(options, out, err), 0);
}

TEST_F(CheckCommand, AFileThatCannotBeReadIsAnErrorThatNamesTheField) {
  LevelFile level = room();
  level.json["nodes"][1]["mesh"] = 99;
  EXPECT_TRUE(check(level).is_discarded());
  EXPECT_EQ(status, 1);
  EXPECT_THAT(err.str(), AllOf(HasSubstr("level.glb: "), HasSubstr("nodes[1].mesh")));
}

TEST_F(CheckCommand, TheSummarySaysWhatTheLevelHolds) {
  LevelFile level = room();
  level.json["nodes"][1]["extras"]["sightline"]["collides"] = false;
  level.json["nodes"][2]["extras"]["sightline"]["visible"] = 0;
  const CheckOptions options{write(level), folder / "plan.png"};
  std::ostringstream out;
  EXPECT_EQ(run_check_command(options, out, err), 0) << err.str();
  EXPECT_THAT(out.str(), AllOf(HasSubstr("20.00 m along x, 3.20 m high, 15.00 m along z"),
                               HasSubstr("60 as instanced, 48 stored"), HasSubstr("5: 5 hide, 4 collide"),
                               HasSubstr("roles        none"), HasSubstr("plan.png"), HasSubstr("warnings     none")));
  EXPECT_GT(fs::file_size(folder / "plan.png"), 0u);
}

TEST_F(CheckCommand, APlanThatCannotBeWrittenIsAFailure) {
  std::ostringstream out;
  EXPECT_EQ(run_check_command({write(room()), folder / "none" / "plan.png"}, out, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("plan.png"));
}

// Two rooms behind one another with a doorway between them, under a roof.
LevelFile two_rooms() {
  LevelFile level = room();
  level.box("north wall", {8, 3, 0.3}, {-6, 1.5, 0});
  level.box("south wall", {10, 3, 0.3}, {5, 1.5, 0});
  level.box("roof", {20, 0.2, 15}, {0, 3.1, 0});
  return level;
}

TEST_F(CheckCommand, PeopleStandOnFloorsWithRoomForThem) {
  LevelFile level = two_rooms();
  level.box("table", {2, 0.8, 2}, {-5, 0.4, 4});
  const auto read = read_level(write(level));
  ASSERT_TRUE(read) << to_string(read.error());
  const std::vector<StandingPlace> places = standing_places(*read);
  // The rooms are 20 x 15 m with the walls. Half a metre along each wall, the table and the pillar are lost.
  EXPECT_GT(places.size(), 600u);
  EXPECT_LT(places.size(), 1200u);
  bool north = false, south = false;
  for (const StandingPlace& place : places) {
    const glm::dvec3& p = place.foot_m;
    EXPECT_NEAR(p.y, 0.0, 1e-3) << "not on the roof, and not on the table";
    EXPECT_FALSE(std::abs(p.x + 5) < 1.3 && std::abs(p.z - 4) < 1.3) << p.x << ' ' << p.z;
    EXPECT_LT(std::abs(p.x), 9.4);
    (p.z < 0 ? north : south) = true;
    for (const uint32_t other : place.neighbours) EXPECT_LT(glm::distance(p, places[other].foot_m), 0.75);
  }
  EXPECT_TRUE(north && south) << "through the doorway";
}

TEST_F(CheckCommand, WanderersKeepToTheFloorAndOutOfWalls) {
  const auto read = read_level(write(two_rooms()));
  ASSERT_TRUE(read) << to_string(read.error());
  const auto scenario = wandering_in(*read, standing_places(*read), 1);
  ASSERT_TRUE(scenario) << to_string(scenario.error());
  ASSERT_EQ(scenario->targets().size(), 2u);
  double farthest_m = 0.0;
  for (double time_s = 0.0; time_s <= kWalkS; time_s += 0.1) {
    const std::vector<Pose> poses = scenario->poses_at(time_s);
    for (const Pose& pose : poses) {
      EXPECT_NEAR(pose.position_m.y, 0.0, 0.01) << time_s;
      EXPECT_LT(std::abs(pose.position_m.x), 9.4) << time_s;
      EXPECT_LT(std::abs(pose.position_m.z), 7.0) << time_s;
      const bool in_doorway = pose.position_m.x > -1.75 && pose.position_m.x < -0.25;
      EXPECT_TRUE(in_doorway || std::abs(pose.position_m.z) > 0.4) << time_s << ' ' << pose.position_m.x;
    }
    EXPECT_LT(glm::distance(poses[0].position_m, poses[1].position_m), 2.0) << time_s;
    farthest_m = std::max(farthest_m, glm::distance(poses[0].position_m, scenario->poses_at(0.0)[0].position_m));
  }
  EXPECT_GT(farthest_m, 5.0) << "they walk";
}

TEST_F(CheckCommand, ALevelCanBePlayed) {
  CheckOptions options{write(room()), "none", true};
  options.json = true;
  std::ostringstream out;
  ASSERT_EQ(run_check_command(options, out, err), 0) << err.str();
  const json told = json::parse(out.str())["play"];
  EXPECT_TRUE(told["wandered"]);
  EXPECT_EQ(told["duration_s"], kWalkS);
  EXPECT_EQ(told["targets"].size(), 2u);
  EXPECT_GT(told["joint_whole_share"], 0.2);
  EXPECT_EQ(told["body_collisions"], 0);
}

TEST_F(CheckCommand, ALevelWithoutAFloorCannotBePlayed) {
  LevelFile level;
  level.box("wall", {20, 3, 0.3}, {0, 1.5, 0});
  std::ostringstream out;
  EXPECT_EQ(run_check_command({write(level), "none", true}, out, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("has no floor with room for people"));
}

// The rows of dark pixels in a column of the picture, from the first to the last above the caption.
int dark_rows(const Picture& picture, int x, int end_y) {
  int first = -1, last = -2;
  for (int y = 0; y < end_y; ++y)
    if (picture.at(x, y)[0] < 60) first = first < 0 ? y : first, last = y;
  return last - first + 1;
}

TEST_F(CheckCommand, ThePlanShowsAPersonToScale) {
  for (const double scale : {1.0, 0.5}) {
    LevelFile level = room();
    level.root()["scale"] = {scale, scale, scale};
    const auto read = read_level(write(level));
    ASSERT_TRUE(read) << to_string(read.error());
    const Picture plan = draw_plan(*read, facts_of(*read));
    // The plan is 760 pixels wide and stands 24 pixels from the edges; the middle of the person is 168 pixels right of
    // it.
    const double pixels_per_m = 760 / (20.0 * scale);
    const int through_leg = static_cast<int>(24 + 760 + 24 + 120 + 0.05 * pixels_per_m);
    EXPECT_NEAR(dark_rows(plan, through_leg, 604), 1.8 * pixels_per_m, 2) << scale;
    // The wall in the west is dark at its sides, and the floor is light.
    EXPECT_LT(plan.at(24, 24 + 285)[0], 80);
    EXPECT_GT(plan.at(24 + 200, 24 + 285)[0], 200);
  }
}

TEST_F(CheckCommand, ThePlanOfALevelOfAFewCentimetresHasRoomForThePerson) {
  LevelFile level = room();
  level.root()["scale"] = {0.002, 0.002, 0.002};
  const auto read = read_level(write(level));
  ASSERT_TRUE(read) << to_string(read.error());
  const Picture plan = draw_plan(*read, facts_of(*read));
  EXPECT_LT(plan.width, 400);
  EXPECT_GT(plan.height, 640);
}

}  // namespace
}  // namespace sightline
