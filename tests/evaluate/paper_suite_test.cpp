// `sightline evaluate --suite paper`: the tables' arithmetic on made-up runs, and the whole on a moment of each scene.
#include "client/evaluate/paper_suite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "client/evaluate/evaluate_command.h"
#include "client/evaluate/paper_tables.h"
#include "server/gl/software_renderer.h"
#include "server/step/paper_settings.h"
#include "tests/evaluate/table_files.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Key;

// ---- settings ----

TEST(PaperRows, AreThePaperPresetWithOneThingChanged) {
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
  EXPECT_EQ(paper_stability(0, 0).aggregate.filter.mode, FilterMode::kNone);
  EXPECT_EQ(paper_stability(8, 15).move.strategy, Strategy::kBasic);
  EXPECT_EQ(paper_stability(8, 15).move.prediction_s, 0.0);
}

TEST(PaperRows, PrintedTimesOfTable1AddUpAsFarAsThePaperRoundsThem) {
  for (const int r : kTimedResolutions) {
    const PaperTiming* row = paper_timing(r);
    ASSERT_TRUE(row);
    EXPECT_NEAR(row->render_ms + row->intersect_ms + row->select_ms, row->total_ms, 0.06);
  }
  EXPECT_FALSE(paper_timing(6));
}

// ---- arithmetic ----

TEST(SpreadOver, ValuesIsTheirMeanMedianLeastAndMost) {
  const Spread odd = spread_of({5, 1, 3}), even = spread_of({4, 1, 2, 9}), none = spread_of({});
  EXPECT_EQ(odd.mean, 3);
  EXPECT_EQ(odd.median, 3);
  EXPECT_EQ(odd.least, 1);
  EXPECT_EQ(odd.most, 5);
  EXPECT_EQ(even.mean, 4);
  EXPECT_EQ(even.median, 3);
  EXPECT_EQ(none.most, 0);
}

RunRecord made_up(std::string scene, uint64_t seed, std::string_view policy) {
  RunRecord run;
  run.scene = std::move(scene);
  run.seed = seed;
  run.policy = policy;
  run.metrics.pictures = 10;
  return run;
}

RunRecord travelled(uint64_t seed, std::string_view policy, double d_c_m, double d_s_heights) {
  RunRecord run = made_up("fence", seed, policy);
  run.metrics.d_c_m = d_c_m;
  run.metrics.d_s_heights = d_s_heights;
  run.reaction.delays_s = {9.0};  // of the fence alone: must not be counted
  return run;
}

RunRecord reacted(uint64_t seed, std::string_view policy, std::vector<double> delays_s,
                  double mean_regain_s) {
  RunRecord run = made_up("fence-board", seed, policy);
  run.metrics.d_c_m = 1000.0;  // of the board: must not be counted
  run.reaction.occlusions = delays_s.size();
  run.reaction.delays_s = std::move(delays_s);
  run.reaction.mean_regain_s = mean_regain_s;
  run.reaction.unanswered = 1;
  return run;
}

TEST(Table3, DividesSeedBySeedAndPoolsTheReactionsToTheBoard) {
  const std::vector<RunRecord> runs{travelled(1, "0/0", 100, 8),         travelled(1, "6/10", 10, 0),
                                    travelled(2, "0/0", 40, 4),          travelled(2, "6/10", 20, 1),
                                    reacted(1, "6/10", {0.1, 0.5}, 2.0), reacted(2, "6/10", {0.3}, 5.0)};
  std::ostringstream out;
  write_table3(out, runs);
  const auto columns = columns_of(out.str());
  EXPECT_THAT(columns.at("stability"), ElementsAre("0/0", "3/5", "6/10", "8/15", "sightline"));
  EXPECT_THAT(columns.at("runs"), ElementsAre("2", "0", "2", "0", "0"));
  const auto filtered = [&](const char* column) { return columns.at(column)[2]; };
  EXPECT_EQ(filtered("d_c_m_median"), "15");
  EXPECT_EQ(filtered("d_c_ratio_least"), "2");
  EXPECT_EQ(filtered("d_c_ratio_most"), "10");
  EXPECT_EQ(filtered("d_c_ratio_median"), "6");
  EXPECT_EQ(filtered("d_s_ratio_least"), "4");
  EXPECT_EQ(filtered("d_s_ratio_most"), "inf");
  EXPECT_EQ(columns.at("d_c_ratio_mean")[0], "1");
  EXPECT_EQ(filtered("occlusions"), "3");
  EXPECT_EQ(filtered("unanswered"), "2");
  EXPECT_DOUBLE_EQ(std::stod(filtered("mean_reaction_s")), 0.3);
  EXPECT_EQ(filtered("p95_reaction_s"), "0.5");
  EXPECT_DOUBLE_EQ(std::stod(filtered("mean_regain_s")), 3.0);
  EXPECT_EQ(columns.at("mean_reaction_s")[0], "") << "never tried is not answered at once";
  EXPECT_EQ(filtered("paper_d_c"), "4.1");
  EXPECT_EQ(columns.at("paper_d_c")[4], "");
}

TEST(Table2, HoldsTheModelsThePaperHasAndThoseItLacks) {
  RunRecord first = made_up("hall", 1, "RobustMove+Pred. 300"),
            second = made_up("hall", 2, "RobustMove+Pred. 300");
  first.metrics.r_n = 0.25;
  second.metrics.r_n = 0.75;
  std::ostringstream out;
  write_table2(out, std::vector<RunRecord>{first, second});
  const auto columns = columns_of(out.str());
  EXPECT_THAT(columns.at("model"),
              ElementsAre("Basic", "RobustMove", "Basic", "Basic", "Basic", "RobustMove", "RobustMove",
                          "RobustMove", "sightline", "follow", "spring-arm", "raycast"));
  EXPECT_THAT(columns.at("prediction_ms"),
              ElementsAre("0", "0", "100", "300", "500", "100", "300", "500", "", "", "", ""));
  EXPECT_THAT(columns.at("paper_r_n"), ElementsAre("0.1232", "0.0747", "0.0332", "0.0112", "0.0502", "0.0059",
                                                   "0", "0.0141", "", "", "", ""));
  EXPECT_EQ(columns.at("r_n_mean")[6], "0.5");
  EXPECT_EQ(columns.at("r_n_least")[6], "0.25");
  EXPECT_EQ(columns.at("pictures")[6], "20");
  EXPECT_EQ(columns.at("runs")[5], "0");
}

// ---- the whole ----

class PaperSuite : public testing::Test {
 protected:
  void SetUp() override { prepare_software_rendering(); }

  std::map<std::string, std::string> play(const std::string& name, int jobs) const {
    EvaluateOptions options;
    options.suite = "paper";
    options.seeds = 2;
    options.duration_s = 0.3;
    options.timed_frames = 2;
    options.jobs = jobs;
    options.out = folder_ / name;
    std::ostringstream out, err;
    EXPECT_EQ(run_evaluate_command(options, out, err), 0) << err.str();
    return files_in(options.out);
  }

  const test::TemporaryFolder folder_;
};

bool is_time(const std::string& column) {
  return column.find("_ms") != std::string::npos && column != "prediction_ms" &&
         !column.starts_with("paper_");
}

TEST_F(PaperSuite, WritesThreeTablesTheSameWithOneJobAndWithTwoButForTimes) {
  auto one = play("one", 1), two = play("two", 2);
  for (const char* table : {"table1.csv", "table2.csv", "table3.csv"}) {
    auto first = columns_of(one.at(table)), second = columns_of(two.at(table));
    EXPECT_EQ(std::erase_if(first, [](const auto& column) { return is_time(column.first); }),
              std::erase_if(second, [](const auto& column) { return is_time(column.first); }));
    EXPECT_EQ(first, second) << table;
    one.erase(table), two.erase(table);
  }
  EXPECT_EQ(one, two);
  EXPECT_THAT(one, Contains(Key("plots/table3-offset.svg")));
  EXPECT_THAT(one, Contains(Key("plots/table2-r_n.svg")));
}

TEST_F(PaperSuite, HasARowForEverySamplerResolutionModelAndStability) {
  const auto files = play("rows", 2);
  const auto timed = columns_of(files.at("table1.csv"));
  const auto& samplers = timed.at("sampler");
  EXPECT_EQ(std::count(samplers.begin(), samplers.end(), "embree"), 8)
      << "four resolutions under two settings";
  EXPECT_EQ(samplers.size() % 8, 0u);
  EXPECT_THAT(timed.at("frames"), Each("2"));
  for (size_t i = 0; i < samplers.size(); ++i) {
    const int r = std::stoi(timed.at("r")[i]), samples = std::stoi(timed.at("samples")[i]);
    EXPECT_GT(samples, r * r * r / 2);
    EXPECT_LE(samples, 2 * r * r * r);
    EXPECT_LE(std::stod(timed.at("sample_p50_ms")[i]), std::stod(timed.at("total_p95_ms")[i]));
  }
  const auto models = columns_of(files.at("table2.csv")), stabilities = columns_of(files.at("table3.csv"));
  EXPECT_EQ(models.at("model").size(), model_rows().size());
  EXPECT_THAT(models.at("runs"), Each("2"));
  EXPECT_EQ(stabilities.at("stability").size(), stability_rows().size());
  EXPECT_THAT(stabilities.at("runs"), Each("2"));
}

TEST_F(PaperSuite, RefusesPoliciesAndScenes) {
  EvaluateOptions options;
  options.suite = "paper";
  options.policies = {"follow"};
  options.out = folder_ / "none";
  std::ostringstream out, err;
  EXPECT_EQ(run_evaluate_command(options, out, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("policy"));
  options.policies.clear();
  options.scenes = {"hall"};
  EXPECT_EQ(run_evaluate_command(options, out, err), 1);
  EXPECT_FALSE(std::filesystem::exists(options.out));
}

}  // namespace
}  // namespace sightline
