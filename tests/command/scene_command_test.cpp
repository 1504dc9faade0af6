#include "client/command/scene_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/glb_builder.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;

class SceneCommand : public testing::Test {
 protected:
  std::string print(const std::vector<std::byte>& bytes) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    std::ostringstream out;
    status = run_scene_command(path.string(), out, err);
    return out.str();
  }

  const test::TemporaryFolder folder;
  const fs::path path = folder / "scene.glb";
  std::ostringstream err;
  int status = -1;
};

GlbBuilder full_file() {
  GlbBuilder file;
  const int guard = file.triangle_node();
  file.json["nodes"][guard].update({{"name", "Guard"}, {"translation", {2, 0, 0}}});
  file.json["nodes"][guard]["extras"]["sightline"] = {
      {"role", "target"}, {"weight", 2}, {"required", false}, {"opacity", 0.5}, {"collides", false}};
  file.json["nodes"][guard]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = file.floats(
      {0, 0, 0, 0, 0, 8});
  file.json["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  file.add("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.5235987755982988}, {"znear", 0.25}}}});
  file.add("nodes", {{"camera", 0}});
  file.add("materials", {{"alphaMode", "MASK"}});
  file.animation(guard, "translation", "LINEAR", {0, 2.5}, {0, 0, 0, 1, 0, 0});
  file.json["animations"][0]["name"] = "walk";
  return file;
}

TEST_F(SceneCommand, SaysWhatAFileContains) {
  const std::string text = print(full_file().glb());
  EXPECT_EQ(status, 0) << err.str();
  EXPECT_THAT(text, AllOf(HasSubstr("1 stored, 2 as instanced"),
                          HasSubstr("1.00 x 1.00 x 8.00 m, from (2.00, 0.00, 0.00) to (3.00, 1.00, 8.00)"),
                          HasSubstr("extensions  EXT_mesh_gpu_instancing"), ContainsRegex("hash +[0-9a-f]{32}")));
  EXPECT_THAT(text,
              ContainsRegex("Guard +2.00 0.00 0.00 +0 +2 +target, weight 2, optional +opacity 0.5, does not collide"));
  EXPECT_THAT(text, AllOf(ContainsRegex("0 +30.0 degrees +free +0.250 m"), ContainsRegex("walk +2.50 s +1 +2"),
                          HasSubstr("\nwarnings\n  materials[0].alphaMode: what a texture masks")));
}

TEST_F(SceneCommand, SaysTheSameAsJson) {
  print(full_file().glb());
  std::ostringstream out;
  EXPECT_EQ(run_scene_command(path.string(), out, err, true), 0);
  const auto json = nlohmann::json::parse(out.str());
  EXPECT_EQ(json.at("file"), path.string());
  EXPECT_EQ(json.at("extents"), (nlohmann::json{{"min_m", {2.0, 0.0, 0.0}}, {"max_m", {3.0, 1.0, 8.0}}}));
  EXPECT_EQ(json.at("triangles"), 2);
  EXPECT_EQ(json.at("geometries"), 1);
  EXPECT_EQ(json.at("extensions"), nlohmann::json({"EXT_mesh_gpu_instancing"}));
  ASSERT_EQ(json.at("nodes").size(), 2u);
  EXPECT_EQ(json.at("nodes")[0], (nlohmann::json{{"name", "Guard"},
                                                 {"parent", -1},
                                                 {"position_m", {2.0, 0.0, 0.0}},
                                                 {"mesh", 0},
                                                 {"instances", 2},
                                                 {"role", "target, weight 2, optional"},
                                                 {"attributes", "opacity 0.5, does not collide"}}));
  EXPECT_EQ(json.at("nodes")[1].at("mesh"), -1);
  EXPECT_EQ(json.at("nodes")[1].at("instances"), 0);
  ASSERT_EQ(json.at("meshes").size(), 1u);
  EXPECT_EQ(json.at("meshes")[0].at("triangles"), 1);
  EXPECT_EQ(json.at("meshes")[0].at("see_through_triangles"), 0);
  ASSERT_EQ(json.at("cameras").size(), 1u);
  EXPECT_NEAR(json.at("cameras")[0].at("vertical_fov_rad"), 0.5235987755982988, 1e-12);
  EXPECT_TRUE(json.at("cameras")[0].at("aspect").is_null()) << "free";
  EXPECT_EQ(json.at("cameras")[0].at("near_m"), 0.25);
  EXPECT_EQ(json.at("animations"), (nlohmann::json::array({{{"name", "walk"}, {"duration_s", 2.5}, {"channels", 1}}})));
  ASSERT_EQ(json.at("warnings").size(), 1u);
  EXPECT_THAT(json.at("warnings")[0].get<std::string>(), HasSubstr("materials[0].alphaMode"));
}

TEST_F(SceneCommand, WithoutTrianglesThereAreNoExtents) {
  GlbBuilder file;
  file.add("nodes", {{"name", "empty"}});
  const std::string text = print(file.glb());
  EXPECT_THAT(text, HasSubstr("extents     none\n"));
  EXPECT_THAT(text, testing::Not(HasSubstr("warnings")));
  std::ostringstream out;
  EXPECT_EQ(run_scene_command(path.string(), out, err, true), 0);
  EXPECT_TRUE(nlohmann::json::parse(out.str()).at("extents").is_null());
}

TEST_F(SceneCommand, LongTablesAreCutButRolesAreAlwaysListed) {
  GlbBuilder file;
  for (int i = 0; i < 200; ++i) file.add("nodes", {{"name", std::to_string(i) + "n"}});
  file.json["nodes"][180]["extras"]["sightline"]["role"] = "camera";
  const std::string text = print(file.glb());
  EXPECT_THAT(text, AllOf(HasSubstr("49n "), ContainsRegex("180n .*camera"), HasSubstr("... and 149 more")));
  EXPECT_THAT(text, testing::Not(HasSubstr("50n ")));
}

TEST_F(SceneCommand, ABrokenFileIsNamedOnTheErrorStream) {
  EXPECT_EQ(print(bytes_of("glTF")), "");
  EXPECT_EQ(status, 1);
  EXPECT_THAT(err.str(), HasSubstr("data loss: glb.header: the file ends inside the header"));
}

// A name in a file may hold control characters that would move the cursor or colour the terminal.
TEST_F(SceneCommand, ControlCharactersInNamesAreNotPrinted) {
  GlbBuilder file;
  file.add("nodes", {{"name", "a\x1b[31mb"}});
  EXPECT_THAT(print(file.glb()), HasSubstr("a?[31mb"));
}

}  // namespace
}  // namespace sightline
