// Evaluation: the cases that the command plays, and the files that it writes.
#include "client/evaluate/evaluate_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <sstream>

#include "client/evaluate/evaluation.h"
#include "client/evaluate/evaluation_tables.h"
#include "scenes/catalog.h"
#include "scenes/hall.h"
#include "server/paper/paper_settings.h"
#include "server/scene/gltf.h"
#include "server/wire/settings_to_proto.h"
#include "tests/evaluate/table_files.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using Random = std::mt19937_64;

double unit(Random& random) {
  return std::uniform_real_distribution<double>(0.0, 1.0)(random);
}

class EvaluateCommand : public testing::Test {
 protected:
  EvaluateOptions short_options(const std::string& name) const {
    EvaluateOptions options;
    options.scenes = {"hall"};
    options.seeds = 2;
    options.duration_s = 1.0;
    options.picture_every = 20;
    options.out = folder_ / name;
    return options;
  }
  const test::TemporaryFolder folder_;
};

TEST_F(EvaluateCommand, WritesTheSameBytesWithOneJobAndWithMany) {
  std::ostringstream out, err;
  EvaluateOptions one = short_options("one"), many = short_options("many");
  one.jobs = 1;
  many.jobs = 3;
  ASSERT_EQ(run_evaluate_command(one, out, err), 0) << err.str();
  ASSERT_EQ(run_evaluate_command(many, out, err), 0) << err.str();
  auto first = files_in(one.out), second = files_in(many.out);
  EXPECT_EQ(first.erase("timing.csv"), 1u);
  EXPECT_EQ(second.erase("timing.csv"), 1u);
  EXPECT_EQ(first.size(), 3u);
  EXPECT_EQ(first, second);
}

TEST(Evaluation, TellsHowFarItIs) {
  const std::vector<PolicyEntry> follow{policies().front()};
  std::vector<double> shares;
  EvaluationOptions options{.rate_hz = 10.0, .duration_s = 0.0, .picture_every = 1, .jobs = 1, .progress = {}};
  options.progress = [&](double share) { shares.push_back(share); };
  auto walk = scenes::make_hall({.duration_s = 2.0});
  const SceneCase hall{"hall", 1,
                       [&](GeometryStore& store) { return Scenario::from_asset(*read_gltf(walk, nullptr, store)); }};
  const auto runs = evaluate(std::vector<SceneCase>{hall}, follow, options);
  ASSERT_TRUE(runs) << to_string(runs.error());
  ASSERT_GE(shares.size(), 2 * 21u) << "while it plays and while it judges";
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_EQ(shares.front(), 0.0);
  EXPECT_LT(shares[20], 0.2) << "playing is the smaller part";
  EXPECT_NEAR(shares.back(), 1.0, 1e-12);
  EXPECT_EQ((*runs)[0].metrics.frames, 21u);
}

TEST_F(EvaluateCommand, WritesARowARunAndARowAPicture) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("tables");
  options.policies = {"sightline", "follow"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto files = files_in(options.out);
  const auto runs = columns_of(files.at("runs.csv")), pictures = columns_of(files.at("pictures.csv"));
  EXPECT_THAT(runs.at("policy"), ElementsAre("\"follow\"", "\"sightline\"", "\"follow\"", "\"sightline\""));
  EXPECT_THAT(runs.at("seed"), ElementsAre("1", "1", "2", "2"));
  EXPECT_THAT(runs.at("frames"), ElementsAre("61", "61", "61", "61"));
  EXPECT_THAT(runs.at("pictures"), ElementsAre("4", "4", "4", "4"));
  EXPECT_EQ(runs.at("reported_pairs")[0], "") << "follow reports nothing";
  EXPECT_EQ(runs.at("reported_pairs")[1], "8") << "two targets in four pictures";
  EXPECT_EQ(runs.at("pair_volume_share")[1], "0") << "the default uses the lattice";
  for (const char* column : {"goal_jumps_per_s", "pair_volume_share", "tracking_while_lost", "lost_called_tracking",
                             "tracking_while_half_hidden"}) {
    EXPECT_EQ(runs.at(column)[0], "") << "follow has neither a goal nor a status";
    EXPECT_NE(runs.at(column)[1], "") << column;
  }
  ASSERT_EQ(pictures.at("time_s").size(), 16u);
  EXPECT_EQ(pictures.at("time_s")[3], "1");
  EXPECT_EQ(pictures.at("lost")[3], "0");
  EXPECT_EQ(pictures.at("tracking")[3], "") << "follow has no status";
  EXPECT_EQ(pictures.at("tracking")[7], "1");
  EXPECT_THAT(files.at("timing.csv"), HasSubstr("scene,seed,targets,policy,run_s,step_ms"));
  EXPECT_THAT(out.str(), HasSubstr("sightline"));
}

TEST_F(EvaluateCommand, DrawsASheetOfEachRun) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("sheets");
  options.policies = {"sightline", "follow"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  EXPECT_FALSE(files_in(options.out).contains("sheets/hall-1-follow.jpg")) << "only if asked for";
  options.sheets = true;
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto files = files_in(options.out);
  std::set<std::string> sheets;
  for (const std::string name : {"hall-1-follow", "hall-1-sightline", "hall-2-follow", "hall-2-sightline"}) {
    const std::string& bytes = files.at("sheets/" + name + ".jpg");
    EXPECT_EQ(bytes.substr(0, 3), "\xff\xd8\xff") << "a JPEG file";
    sheets.insert(bytes);
  }
  EXPECT_EQ(sheets.size(), 4u) << "no two runs look alike";
}

TEST_F(EvaluateCommand, WritesWhatTheReasonsSay) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("reasons");
  options.policies = {"sightline", "follow"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto rows = columns_of(files_in(options.out).at("reasons.csv"));
  ASSERT_FALSE(rows.at("policy").empty());
  for (const std::string& policy : rows.at("policy")) EXPECT_EQ(policy, "\"sightline\"") << "follow gives no reasons";
  int claims = 0;
  for (const std::string& count : rows.at("claims")) claims += std::stoi(count);
  EXPECT_GE(claims, 4) << "a picture every 20 frames, of two runs";
}

TEST_F(EvaluateCommand, TellsTheShareOfPairVolumesWithEitherSampler) {
  for (const std::string sampler : {"embree", "egl"}) {
    std::ostringstream out, err;
    EvaluateOptions options = short_options("pairs-" + sampler);
    options.policies = {"paper"};
    options.sampler = sampler;
    const int status = run_evaluate_command(options, out, err);
    if (status != 0 && sampler == "egl" && !std::getenv("SIGHTLINE_REQUIRE_EGL")) GTEST_SKIP() << err.str();
    ASSERT_EQ(status, 0) << err.str();
    EXPECT_THAT(columns_of(files_in(options.out).at("runs.csv")).at("pair_volume_share"), ElementsAre("1", "1"))
        << sampler;
  }
}

TEST_F(EvaluateCommand, PlaysTheCeilingOnlyWhenAsked) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("default");
  options.seeds = 1;
  options.duration_s = 0.2;
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto runs = columns_of(files_in(options.out).at("runs.csv"));
  EXPECT_THAT(runs.at("policy"),
              ElementsAre("\"follow\"", "\"spring-arm\"", "\"raycast\"", "\"paper\"", "\"sightline\""));
  EXPECT_THAT(runs.at("most_joint"), ElementsAre("", "", "", "", ""));
  EXPECT_THAT(out.str(), Not(HasSubstr("100.0 %"))) << "no ceiling, no share of it";
}

// At its start the hall hides nothing, so the ceiling sees all, and the default's share of it is its own joint share.
TEST_F(EvaluateCommand, ShowsTheShareOfTheCeiling) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("ceiling");
  options.seeds = 1;
  options.duration_s = 0.4;
  options.picture_every = 6;
  options.policies = {"sightline", "ceiling"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto runs = columns_of(files_in(options.out).at("runs.csv"));
  EXPECT_THAT(runs.at("policy"), ElementsAre("\"sightline\"", "\"ceiling\""));
  EXPECT_THAT(runs.at("joint_visible_share"), ElementsAre("1", "1"));
  EXPECT_THAT(runs.at("most_joint"), ElementsAre("", "1"));
  EXPECT_THAT(runs.at("limit_violations"), ElementsAre("0", "0"));
  EXPECT_THAT(out.str(), HasSubstr("100.0 %"));
}

TEST_F(EvaluateCommand, SaysWhatItCannotFind) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("nothing");
  options.scenes = {"no-such-scene"};
  EXPECT_EQ(run_evaluate_command(options, out, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("no-such-scene"));
  options = short_options("nothing");
  options.policies = {"teleport"};
  EXPECT_EQ(run_evaluate_command(options, out, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("teleport"));
}

// A filter that equals the preset's gives the preset's settings; another strategy does not.
TEST_F(EvaluateCommand, PlaysSettingsOfOnesOwnAsPolicies) {
  std::ostringstream out, err;
  EvaluateOptions options = short_options("own");
  options.policies = {"sightline"};
  options.settings = {R"(same={"settings":{"preset":"PRESET_SIGHTLINE"}})",
                      R"(basic={"settings":{"prediction_s":0},"tuning":{"move":{"strategy":"STRATEGY_BASIC"}}})"};
  ASSERT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
  const auto runs = columns_of(files_in(options.out).at("runs.csv"));
  EXPECT_THAT(std::span(runs.at("policy")).first(3), ElementsAre("\"sightline\"", "\"same\"", "\"basic\""));
  const auto& path_m = runs.at("d_c_m");
  EXPECT_EQ(path_m[1], path_m[0]);
  EXPECT_NE(path_m[2], path_m[0]);
}

TEST_F(EvaluateCommand, SaysWhichSettingIsWrong) {
  const std::pair<const char*, const char*> cases[] = {
      {"nothing", "settings"},
      {"a b={}", "settings"},
      {"x={", "settings.x"},
      {R"(x={"tuning":{"move":{"speed":1}}})", "settings.x"},
      {R"(x={"label":"y"})", "settings.x"},
      {R"(x={"settings":{"prediction_s":3}})", "settings.x.settings.prediction_s"},
      {R"(x={"tuning":{"aggregate":{"filter":{"alpha":1.5}}}})", "settings.x.tuning.aggregate.filter.alpha"},
      {"sightline={}", "settings"}};
  for (const auto& [text, field] : cases) {
    EvaluateOptions options = short_options("wrong");
    options.settings = {text};
    std::ostringstream out, err;
    EXPECT_EQ(run_evaluate_command(options, out, err), 1) << text;
    EXPECT_THAT(err.str(), HasSubstr(std::string(field).append(":"))) << text;
  }
}

TEST(EvaluateCases, WithoutNamesAreEverySceneOfTheStudyAtEverySeed) {
  EvaluateOptions options;
  options.seeds = 2;
  const auto cases = cases_of(options);
  ASSERT_TRUE(cases);
  std::map<std::string, int> seeds_of;
  for (const SceneCase& scene : *cases) ++seeds_of[scene.name];
  EXPECT_EQ(seeds_of.at("hall"), 2);
  std::vector<std::string> sized;
  for (const auto& [name, seeds] : seeds_of) {
    EXPECT_EQ(seeds, 2) << name;
    if (name.starts_with("arena") || name.starts_with("crowd")) sized.push_back(name);
  }
  EXPECT_THAT(sized, ElementsAre("arena-2", "arena-3", "arena-4", "arena-5", "arena-6", "arena-7", "arena-8", "crowd-0",
                                 "crowd-10", "crowd-20", "crowd-35"));
  GeometryStore store;
  for (const SceneCase& scene : *cases) {
    if (scene.name != "arena-7") continue;
    EXPECT_EQ(scene.load(store)->targets().size(), 7u);
  }
}

TEST(EvaluateCases, OfAGroupAreItsScenesFromTheFirstSeedOn) {
  EvaluateOptions options;
  options.groups = {"levels"};
  options.seeds = 2;
  options.first_seed = 101;
  const auto cases = cases_of(options);
  ASSERT_TRUE(cases);
  ASSERT_EQ(cases->size(), 2 * scenes::scenes_of(scenes::SceneGroup::kLevels).size());
  EXPECT_EQ((*cases)[0].name, "level-rooms-one");
  EXPECT_EQ((*cases)[0].seed, 101u);
  EXPECT_EQ((*cases)[1].seed, 102u);
  GeometryStore store;
  const auto scenario = (*cases)[1].load(store);
  ASSERT_TRUE(scenario);
  EXPECT_NE(scenario->asset().hash, (*cases)[0].load(store)->asset().hash) << "another seed, another level";
}

TEST(EvaluateCases, SayWhichGroupOrFolderIsMissing) {
  EvaluateOptions options;
  options.groups = {"no-such-group"};
  ASSERT_FALSE(cases_of(options));
  EXPECT_EQ(cases_of(options).error().field, "group");
  options.groups = {"tiles"};
  options.tiles = "no-such-folder";
  ASSERT_FALSE(cases_of(options));
  EXPECT_EQ(cases_of(options).error().field, "tiles");
}

// Every line of the settings file, by name.
std::map<std::string, std::string> paper_settings() {
  std::ifstream file(PAPER_SETTINGS);
  std::map<std::string, std::string> settings;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with('#')) continue;
    const auto named = read_named_settings(line);
    if (!named) throw std::runtime_error(to_string(named.error()));
    settings[named->name] = settings_to_proto(named->settings).SerializeAsString();
  }
  return settings;
}

TEST(PaperSettings, AreTheRowsOfThePapersTables) {
  std::map<std::string, std::string> rows;
  const auto add = [&](const std::string& name, const StepSettings& settings) {
    rows[name] = settings_to_proto(settings).SerializeAsString();
  };
  for (const auto& [name, strategy] : {std::pair("basic", Strategy::kBasic), std::pair("robust", Strategy::kRobust)}) {
    add(name, paper_row(strategy, 0.0));
    for (const int ms : {100, 300, 500})
      add(std::string(name).append("-").append(std::to_string(ms)), paper_row(strategy, 0.001 * ms));
  }
  add("center", center_row(0.0));
  for (const int ms : {100, 300, 500}) add("center-" + std::to_string(ms), center_row(0.001 * ms));
  for (const auto& [a, n] : {std::pair(0, 0), std::pair(3, 5), std::pair(6, 10), std::pair(8, 15)}) {
    const std::string window = std::to_string(a) + "-" + std::to_string(n);
    add("stability-" + window, paper_stability(a, n));
    add("agile-" + window, agile_stability(a, n));
  }
  EXPECT_EQ(paper_settings(), rows);
}

TEST(PaperSettings, AreThePaperPresetWithOnePartChanged) {
  const StepSettings paper = preset_settings(Preset::kPaper), row = paper_row(Strategy::kBasic, 0.1);
  EXPECT_EQ(row.aggregate.filter.mode, FilterMode::kNone);
  EXPECT_EQ(row.move.strategy, Strategy::kBasic);
  EXPECT_EQ(row.move.prediction_s, 0.1);
  EXPECT_EQ(row.bound.mode, paper.bound.mode);
  EXPECT_EQ(row.aggregate.volume, paper.aggregate.volume);
  EXPECT_EQ(row.sample.points, paper.sample.points);
  EXPECT_EQ(row.sample.jitter, paper.sample.jitter);
  const FilterSettings filter = paper_stability(3, 5).aggregate.filter;
  EXPECT_EQ(filter.mode, FilterMode::kJoint);
  EXPECT_EQ(filter.alpha, 0.6);
  EXPECT_EQ(filter.n, 5);
  EXPECT_EQ(paper_stability(8, 15).move.strategy, Strategy::kBasic);
}

TEST(ExactText, ReadsBackAsTheSameDouble) {
  Random random(7);
  for (int i = 0; i < 1000; ++i) {
    const double value = (unit(random) - 0.5) * std::pow(10.0, 40 * (unit(random) - 0.5));
    EXPECT_EQ(std::stod(exact_text(value)), value);
  }
  EXPECT_EQ(exact_text(0.1), "0.1");
}

}  // namespace
}  // namespace sightline
