// A page as text: read back by the test's own base64, zlib and JSON, and compared with what was put in.
#include "client/page/session_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "client/page/page_data.h"

namespace sightline::test {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::shared_ptr<const Geometry> tent(float height_m) {
  MeshData mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 0, 3}, {0.7f, height_m, 0.9f}};
  mesh.indices = {0, 1, 2, 0, 1, 3, 1, 2, 3};
  return *build_geometry(mesh);
}

// Two targets, one of them moving, and a wall with two instances.
SessionPage session_of(size_t frames) {
  SessionPage session;
  session.title = "A & <b>";
  session.facts = {{"seed", "7"}};
  const auto low = tent(1.0f), high = tent(4.0f);
  const auto at = [](double x) { return make_affine({x, 0, 0}, {1, 0, 0, 0}, {1, 2, 1}); };
  session.instances = {{1, "guard", low, identity_affine(), true},
                       {5, "wall", high, at(5), true},
                       {uint64_t{1} << 63, "</script><script>", high, at(9), true}};
  session.targets = {{1, "guard", 1.0, true}, {2, "ghost", 0.0, false}};
  session.movers = {{0, {}}};
  session.stages = {"scene", "move"};
  session.flags = {"late"};
  session.columns = {"run"};
  session.figures = {{"length", {"3 m"}}};
  session.settings = {{"asked for", R"({"preset": "X"})"}, {"unknown", ""}};
  for (size_t i = 0; i < frames; ++i) {
    const double k = static_cast<double>(i);
    PageFrame& frame = session.frames.emplace_back();
    frame.sequence = i + 1;
    frame.time_s = k / 60;
    frame.camera = {{0.1 * k, 2, 1e-9 + k}, glm::dquat(0.5, 0.5, -0.5, 0.5)};
    frame.vertical_fov_rad = 0.7;
    session.movers[0].poses.push_back({{k, 0, 0}, {1, 0, 0, 0}});
    frame.sights.resize(2);
    frame.sights[0] = {true, true, {k, 1, 0}, 0.25, 0.5, 0.125, "PARTIAL", 3.5 + k, uint64_t{1} << 63, 0.75};
    frame.sights[1].state = "OFF_SCREEN";
    frame.counts = {7, 8, 9};
    frame.status = i % 2 ? "HOLDING" : "TRACKING";
    frame.stage_us = {10.5f, static_cast<float>(i)};
    frame.flags = i == 1 ? 1u : 0u;
    frame.cut = i == 2;
  }
  return session;
}

std::string between(const std::string& text, const std::string& before, const std::string& after) {
  const size_t from = text.find(before) + before.size();
  return text.substr(from, text.find(after, from) - from);
}

std::vector<uint8_t> decoded(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<uint8_t> bytes;
  uint32_t word = 0;
  int bits = 0;
  for (const char c : text) {
    if (c == '=') break;
    word = word << 6 | static_cast<uint32_t>(digits.find(c));
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes.push_back(static_cast<uint8_t>(word >> bits));
  }
  return bytes;
}

std::vector<uint8_t> inflated(const std::vector<uint8_t>& bytes) {
  std::vector<uint8_t> out(64 << 20);
  uLongf size = out.size();
  EXPECT_EQ(uncompress(out.data(), &size, bytes.data(), bytes.size()), Z_OK);
  out.resize(size);
  return out;
}

struct ReadPage {
  json session;
  std::vector<uint8_t> data;

  explicit ReadPage(const std::string& html)
      : session(json::parse(between(html, "id=\"session\">", "</script>"))),
        data(inflated(decoded(between(html, "id=\"data\">", "</script>")))) {}
  template <typename T>
  std::vector<T> array(const std::string& name, const std::string& type) const {
    const json& entry = session.at("arrays").at(name);
    EXPECT_EQ(entry[0], type) << name;
    EXPECT_EQ(entry[1].get<size_t>() % 8, 0u) << name;
    std::vector<T> values(entry[2].get<size_t>());
    EXPECT_LE(entry[1].get<size_t>() + sizeof(T) * values.size(), data.size());
    std::memcpy(values.data(), data.data() + entry[1].get<size_t>(), sizeof(T) * values.size());
    return values;
  }
};

ReadPage read_page(const SessionPage& session) {
  const auto html = session_page(session);
  EXPECT_TRUE(html) << to_string(html.error());
  return ReadPage(*html);
}

std::string refused(const SessionPage& session) {
  const auto html = session_page(session);
  if (html) return "not refused";
  EXPECT_EQ(html.error().code, ErrorCode::kInvalidArgument);
  return html.error().field;
}

TEST(SessionPage, Base64IsAsInRfc4648) {
  const auto of = [](const std::string& text) {
    return to_base64({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  };
  EXPECT_EQ(of(""), "");
  EXPECT_EQ(of("f"), "Zg==");
  EXPECT_EQ(of("fo"), "Zm8=");
  EXPECT_EQ(of("foo"), "Zm9v");
  EXPECT_EQ(of("foobar"), "Zm9vYmFy");
  EXPECT_EQ(of("\xff\xfe\xfd"), "//79");
}

TEST(SessionPage, FramesComeBackAsTheyWere) {
  const ReadPage page = read_page(session_of(4));
  const auto time_s = page.array<double>("time_s", "f64"), camera = page.array<double>("camera", "f64");
  ASSERT_EQ(time_s.size(), 4u);
  ASSERT_EQ(camera.size(), 28u);
  EXPECT_EQ(time_s[3], 3.0 / 60);
  EXPECT_THAT(std::vector<double>(camera.begin() + 21, camera.end()),
              ElementsAre(0.1 * 3, 2, 1e-9 + 3, 0.5, -0.5, 0.5, 0.5));  // x, y, z, w
  EXPECT_THAT(page.array<uint8_t>("cut", "u8"), ElementsAre(0, 0, 1, 0));
  EXPECT_THAT(page.array<uint32_t>("flags", "u32"), ElementsAre(0, 1, 0, 0));
  EXPECT_THAT(page.array<float>("stage_us", "f32"), ElementsAre(10.5f, 0, 10.5f, 1, 10.5f, 2, 10.5f, 3));
  const json& words = page.session.at("words");
  const auto status = page.array<uint32_t>("status", "u32");
  EXPECT_EQ(words[status[0]], "TRACKING");
  EXPECT_EQ(words[status[1]], "HOLDING");
  EXPECT_EQ(status[0], status[2]);
}

TEST(SessionPage, SightsComeBackAsTheyWere) {
  const ReadPage page = read_page(session_of(2));
  EXPECT_THAT(page.array<double>("visible_share", "f64"), ElementsAre(0.25, 0, 0.25, 0));
  EXPECT_THAT(page.array<double>("filtered_share", "f64"), ElementsAre(0.5, 0, 0.5, 0));
  EXPECT_THAT(page.array<double>("distance_m", "f64"), ElementsAre(3.5, 0, 4.5, 0));
  EXPECT_THAT(page.array<double>("occluder_share", "f64"), ElementsAre(0.75, 0, 0.75, 0));
  EXPECT_THAT(page.array<float>("aim_m", "f32"), ElementsAre(0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0));
  std::vector<std::string> states;
  for (const uint32_t state : page.array<uint32_t>("state", "u32")) states.push_back(page.session.at("words")[state]);
  EXPECT_THAT(states, ElementsAre("PARTIAL", "OFF_SCREEN", "PARTIAL", "OFF_SCREEN"));
  const auto truth = page.array<double>("true_share", "f64");
  EXPECT_EQ(truth[0], 0.125);
  EXPECT_TRUE(std::isnan(truth[1]));
  EXPECT_THAT(page.array<int32_t>("occluder", "i32"), ElementsAre(0, -1, 0, -1));
  EXPECT_EQ(page.session.at("occluders")[0], "9223372036854775808");  // a double cannot hold this number
  EXPECT_EQ(page.session.at("instances")[2].at("id"), "9223372036854775808");
}

TEST(SessionPage, EqualMeshesAreStoredOnceAndComeBackWithinAStep) {
  const SessionPage session = session_of(1);
  const ReadPage page = read_page(session);
  ASSERT_EQ(page.session.at("meshes").size(), 2u);
  EXPECT_EQ(page.session.at("instances")[1].at("mesh"), page.session.at("instances")[2].at("mesh"));
  const auto positions = page.array<uint16_t>("mesh_positions", "u16");
  const auto indices = page.array<int32_t>("mesh_indices", "i32");
  const json& mesh = page.session.at("meshes")[1];
  const Geometry& geometry = *session.instances[1].geometry;
  ASSERT_EQ(mesh.at("vertices"), geometry.positions.size());
  for (size_t v = 0; v < geometry.positions.size(); ++v)
    for (size_t axis = 0; axis < 3; ++axis) {
      const float step = mesh.at("step")[axis];
      const float value = mesh.at("low")[axis].get<float>() +
                          step * static_cast<float>(positions[3 * (mesh.at("first_vertex").get<size_t>() + v) + axis]);
      EXPECT_NEAR(value, geometry.positions[v][static_cast<int>(axis)], 0.51f * step);
    }
  int32_t index = 0;
  for (size_t i = 0; i < geometry.indices.size(); ++i) {
    index += indices[mesh.at("first_index").get<size_t>() + i];
    EXPECT_EQ(static_cast<uint32_t>(index), geometry.indices[i]);
  }
}

TEST(SessionPage, CellsComeBackWithinAStepAndInTheirFrames) {
  SessionPage session = session_of(3);
  session.frames[1].cells = {{{1, 2, 3}, 3}, {{1.5f, 2, -3}, 1}, {{1.2f, 2, 0.1f}, 0}};
  session.frames[1].chosen_cell = 2;
  const ReadPage page = read_page(session);
  EXPECT_THAT(page.array<uint32_t>("cell_frame", "u32"), ElementsAre(1));
  EXPECT_THAT(page.array<int32_t>("cell_chosen", "i32"), ElementsAre(2));
  EXPECT_THAT(page.array<uint32_t>("cell_mask", "u32"), ElementsAre(3, 1, 0));
  const auto low = page.array<float>("cell_low", "f32"), high = page.array<float>("cell_high", "f32");
  const auto position = page.array<uint16_t>("cell_position", "u16");
  for (size_t i = 0; i < 3; ++i)
    for (size_t axis = 0; axis < 3; ++axis) {
      const float step = (high[axis] - low[axis]) / 65535.0f;
      EXPECT_NEAR(low[axis] + step * static_cast<float>(position[3 * i + axis]),
                  session.frames[1].cells[i].position_m[static_cast<int>(axis)], 0.51f * step + 1e-6f);
    }
}

TEST(SessionPage, WhatMovesComesBackMoverAfterMoverForItsLifeAlone) {
  SessionPage session = session_of(4);
  session.instances[1].first_frame = 1, session.instances[1].end_frame = 3;
  session.movers.push_back({1, {{{7, 8, 9}, {1, 0, 0, 0}}, {{7.5, 8, 9}, {1, 0, 0, 0}}}});
  const ReadPage page = read_page(session);
  const auto poses = page.array<float>("mover_poses", "f32");
  ASSERT_EQ(poses.size(), 7u * (4 + 2));
  EXPECT_EQ(poses[7 * 3], 3.0f);
  EXPECT_EQ(page.session.at("movers")[1], json({{"instance", 1}, {"first_pose", 4}}));
  EXPECT_THAT(std::vector<float>(poses.begin() + 7 * 5, poses.end()), ElementsAre(7.5f, 8, 9, 0, 0, 0, 1));
  EXPECT_EQ(page.session.at("instances")[1].at("life"), json({1, 3}));
  EXPECT_FALSE(page.session.at("instances")[0].contains("life"));
}

TEST(SessionPage, TransformsOfInstancesComeBackColumnByColumn) {
  const ReadPage page = read_page(session_of(1));
  const auto transforms = page.array<float>("instance_transforms", "f32");
  ASSERT_EQ(transforms.size(), 3u * 12);
  EXPECT_THAT(std::vector<float>(transforms.begin(), transforms.begin() + 12),
              ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0));
  EXPECT_THAT(std::vector<float>(transforms.begin() + 12, transforms.begin() + 24),
              ElementsAre(1, 0, 0, 0, 2, 0, 0, 0, 1, 5, 0, 0));
}

TEST(SessionPage, NumbersOfAFrameComeBackAsTheyWere) {
  SessionPage session = session_of(2);
  PageFrame& frame = session.frames[1];
  frame.velocity_mps = {1, 2, 3}, frame.merged_ticks = 4, frame.queue_us = 5, frame.latency_ms = 6,
  frame.clearance_m = 7;
  frame.text = "words", frame.reason = "ON_TRAIL";
  const ReadPage page = read_page(session);
  EXPECT_THAT(page.array<double>("sequence", "f64"), ElementsAre(1, 2));
  EXPECT_THAT(page.array<double>("fov_rad", "f64"), ElementsAre(0.7, 0.7));
  EXPECT_THAT(page.array<float>("velocity_mps", "f32"), ElementsAre(0, 0, 0, 1, 2, 3));
  EXPECT_THAT(page.array<uint32_t>("counts", "u32"), ElementsAre(7, 8, 9, 7, 8, 9));
  EXPECT_THAT(page.array<uint32_t>("merged", "u32"), ElementsAre(0, 4));
  EXPECT_EQ(page.array<float>("queue_us", "f32")[1], 5.0f);
  EXPECT_EQ(page.array<float>("latency_ms", "f32")[1], 6.0f);
  EXPECT_EQ(page.array<float>("clearance_m", "f32")[1], 7.0f);
  EXPECT_EQ(page.session.at("words")[page.array<uint32_t>("text", "u32")[1]], "words");
  EXPECT_EQ(page.session.at("words")[page.array<uint32_t>("reason", "u32")[1]], "ON_TRAIL");
}

TEST(SessionPage, TargetsThatAreNoneInAFrameAreMarkedSo) {
  SessionPage session = session_of(3);
  session.frames[1].sights[0].present = false;
  session.frames[2].sights[1].steered = false;
  const ReadPage page = read_page(session);
  EXPECT_THAT(page.array<uint32_t>("present", "u32"), ElementsAre(3, 2, 3));
  EXPECT_THAT(page.array<uint32_t>("steered", "u32"), ElementsAre(3, 2, 1));
}

TEST(SessionPage, NoticesMarksAndSettingsComeBackAsTheyWere) {
  SessionPage session = session_of(2);
  session.notices = {"a < b"};
  session.marks = {{1, "fault", "it \"broke\""}};
  const ReadPage page = read_page(session);
  EXPECT_EQ(page.session.at("notices"), json({"a < b"}));
  EXPECT_EQ(page.session.at("marks"), json({{{"frame", 1}, {"kind", "fault"}, {"text", "it \"broke\""}}}));
  EXPECT_EQ(page.session.at("settings")[0], json({{"title", "asked for"}, {"value", {{"preset", "X"}}}}));
  EXPECT_TRUE(page.session.at("settings")[1].at("value").is_null());
}

TEST(SessionPage, TooManyCellsAreThinnedByWholeFrames) {
  SessionPage session = session_of(24);
  for (PageFrame& frame : session.frames) frame.cells.resize(kMaxPageCells / 10);
  const ReadPage page = read_page(session);
  // The 24 frames hold 2.4 times as many cells as may be kept, so those of every third frame stay.
  EXPECT_THAT(page.array<uint32_t>("cell_frame", "u32"), ElementsAre(0, 3, 6, 9, 12, 15, 18, 21));
  EXPECT_EQ(page.array<uint32_t>("cell_mask", "u32").size(), 8 * kMaxPageCells / 10);
}

TEST(SessionPage, AsManyCellsAsMayBeKeptAreKept) {
  SessionPage session = session_of(4);
  for (PageFrame& frame : session.frames) frame.cells.resize(kMaxPageCells / 4);
  EXPECT_THAT(read_page(session).array<uint32_t>("cell_frame", "u32"), ElementsAre(0, 1, 2, 3));
  session.frames[0].cells.resize(kMaxPageCells / 4 + 1);
  EXPECT_THAT(read_page(session).array<uint32_t>("cell_frame", "u32"), ElementsAre(0, 2));
}

TEST(SessionPage, NamesCannotEndTheirScriptOrTitle) {
  const auto html = session_page(session_of(1));
  ASSERT_TRUE(html);
  EXPECT_EQ(between(*html, "<title>", "</title>"), "A &amp; &lt;b> – Sightline");
  EXPECT_EQ(ReadPage(*html).session.at("instances")[2].at("name"), "</script><script>");
  EXPECT_EQ(html->find("</script><script>\""), std::string::npos);
}

TEST(SessionPage, AsksForNothingFromElsewhere) {
  const auto html = session_page(session_of(1));
  ASSERT_TRUE(html);
  EXPECT_THAT(*html, HasSubstr("default-src 'none'"));
  EXPECT_EQ(html->find("src=\"http"), std::string::npos);
  EXPECT_EQ(html->find("href=\"http"), std::string::npos);
  EXPECT_EQ(html->find("{{"), std::string::npos);
}

TEST(SessionPage, EqualSessionsGiveEqualBytes) {
  EXPECT_EQ(*session_page(session_of(5)), *session_page(session_of(5)));
}

TEST(SessionPage, WhatDoesNotFitTogetherIsRefusedByName) {
  EXPECT_EQ(refused(SessionPage()), "frames");
  const auto changed = [](auto change) {
    SessionPage session = session_of(3);
    change(session);
    return refused(session);
  };
  EXPECT_EQ(changed([](SessionPage& s) { s.movers[0].poses.pop_back(); }), "movers[0].poses");
  EXPECT_EQ(changed([](SessionPage& s) { s.instances[0].end_frame = 2; }), "movers[0].poses");
  EXPECT_EQ(changed([](SessionPage& s) { s.movers.push_back(s.movers[0]); }), "movers[1]");
  EXPECT_EQ(changed([](SessionPage& s) { s.marks.push_back({3, "fault", "x"}); }), "marks[0].frame");
  EXPECT_EQ(changed([](SessionPage& s) { s.frames[2].sights.pop_back(); }), "frames[2].sights");
  EXPECT_EQ(changed([](SessionPage& s) { s.frames[0].stage_us.push_back(1); }), "frames[0].stage_us");
  EXPECT_EQ(changed([](SessionPage& s) { s.frames[0].chosen_cell = 0; }), "frames[0].chosen_cell");
  EXPECT_EQ(changed([](SessionPage& s) { s.frames[2].time_s = 0; }), "frames[2].time_s");
  EXPECT_EQ(changed([](SessionPage& s) { s.frames[0].time_s = 1; }), "frames[1].time_s");
  EXPECT_EQ(changed([](SessionPage& s) { s.frames[1].camera.position_m.x = kPageUnknown; }), "frames[1]");
  EXPECT_EQ(changed([](SessionPage& s) { s.frames[1].time_s = kPageUnknown; }), "frames[1]");
  EXPECT_EQ(changed([](SessionPage& s) { s.frames[2].camera.rotation.w = kPageUnknown; }), "frames[2]");
  EXPECT_EQ(changed([](SessionPage& s) { s.instances[1].geometry.reset(); }), "instances[1].geometry");
  EXPECT_EQ(changed([](SessionPage& s) { s.aspect = 0; }), "aspect");
  EXPECT_EQ(changed([](SessionPage& s) { s.movers[0].instance = 3; }), "movers[0]");
  EXPECT_EQ(changed([](SessionPage& s) { s.targets.resize(33); }), "targets");
  EXPECT_EQ(changed([](SessionPage& s) { s.flags.resize(33); }), "flags");
  EXPECT_NE(changed([](SessionPage& s) { s.flags.resize(32); }), "flags") << "as many as a number has bits";
  EXPECT_EQ(changed([](SessionPage& s) { s.pictures.push_back({3, "image/png", {}}); }), "pictures[0].frame");
  EXPECT_EQ(changed([](SessionPage& s) { s.columns.clear(); }), "figures[0].values");
  EXPECT_EQ(changed([](SessionPage& s) { s.settings[1].json = "{"; }), "settings[1].json");
}

TEST(SessionPage, AFileThatCannotBeWrittenIsNamed) {
  const auto folder = std::filesystem::temp_directory_path() / "sightline-no-such-folder" / "page.html";
  const Status written = write_session_page(session_of(1), folder);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(written.error().field, folder);
}

}  // namespace
}  // namespace sightline::test
