// Files with a sound container and damaged messages. No checksum finds the damage, yet every verb must end with an
// answer. The test does not look at the answers; the sanitizers check that no verb reads beyond its data.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "client/recordings/commands.h"
#include "client/replay/compare_command.h"
#include "client/replay/replay_command.h"
#include "client/report/report_command.h"
#include "server/base/random.h"
#include "server/sample/embree_sampler.h"
#include "tests/replay/replayed.h"
#include "tests/report/recorded_yard.h"
#include "tests/support/temporary_folder.h"

namespace sightline::test {
namespace {

// Changes some bytes of one message in `one_in`, as long as the result still parses.
class Damage {
 public:
  Damage(uint64_t seed, uint32_t one_in) : dice_(seed, 0, RandomPurpose::kTest), one_in_(one_in) {}

  template <typename Message>
  Message of(const Message& message) {
    std::string bytes = message.SerializeAsString();
    if (bytes.empty() || dice_.next_below(one_in_) > 0) return message;
    for (uint32_t k = 1 + dice_.next_below(3); k > 0; --k)
      bytes[dice_.next_below(static_cast<uint32_t>(bytes.size()))] ^= static_cast<char>(1 + dice_.next_below(255));
    Message damaged;
    if (!damaged.ParseFromString(bytes)) return message;
    ++done_;
    return damaged;
  }
  size_t done() const { return done_; }

 private:
  CounterRandom dice_;
  const uint32_t one_in_;
  size_t done_ = 0;
};

std::string damaged(const std::string& bytes, Damage& damage) {
  const Recording recording = open_recording(bytes);
  std::string out;
  RecordingWriter writer(std::make_unique<StringSink>(out), damage.of(recording.info()));
  const auto put = [&](const auto& message, uint64_t log_ns) {
    EXPECT_TRUE(writer.write(damage.of(message), log_ns).has_value());
  };
  put(recording.open_session(), recording.start_ns());
  put(recording.opened(), recording.start_ns());
  recording.read({}, [&](RecordedEvent& event) {
    std::visit([&](const auto& message) { put(message, event.log_ns); }, event.message);
    return true;
  });
  EXPECT_TRUE(writer.finish().has_value());
  return out;
}

class DamagedMessages : public testing::Test {
 protected:
  std::string put(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return (folder_ / name).string();
  }
  // A new name each time, because verbs do not overwrite files.
  std::string fresh() { return (folder_ / std::to_string(++files_)).string(); }

  // Counts the commands that succeeded; the others must have given a reason.
  template <typename Options, typename Run>
  void run(const char* verb, const Options& options, const Run& command) {
    std::ostringstream out, err;
    const int status = command(options, out, err);
    EXPECT_TRUE(status == 0 || status == 1) << verb;
    EXPECT_TRUE(status == 0 || !out.str().empty() || !err.str().empty()) << verb;
    ended_well_[verb] += status == 0;
  }

  void run_all(const std::string& file, const std::string& sound) {
    run("info", InfoOptions{.files = {file}}, run_info_command);
    run("verify", VerifyOptions{.files = {file}}, run_verify_command);
    run("dump", DumpOptions{.file = file}, run_dump_command);
    run("cut", CutOptions{.file = file, .out = fresh(), .start_s = 0.4}, run_cut_command);
    run("compare", CompareOptions{.a = sound, .b = file}, run_compare_command);
    ReplayCommandOptions replay;
    replay.file = file, replay.out = fresh();
    run("replay", replay, [](const auto& options, std::ostream& out, std::ostream& err) {
      std::istringstream in;
      return run_replay_command(options, in, out, err);
    });
    ReportOptions page;
    page.recording = file, page.out = fresh();
    page.page.pictures = 1;
    page.page.picture_width = 64;
    run("report", page, run_report_command);
  }

  const TemporaryFolder folder_;
  size_t files_ = 0;
  std::map<std::string, size_t> ended_well_;
};

TEST_F(DamagedMessages, AreSurvivedByEveryVerb) {
  constexpr int kFiles = 40;
  const auto sampler = make_embree_sampler_device();
  const std::string bytes = record_yard(*sampler, {.ticks = 50}).bytes;
  const std::string sound = put("sound.mcap", bytes);
  size_t damages = 0;
  for (int i = 0; i < kFiles; ++i) {
    SCOPED_TRACE(i);
    Damage damage(static_cast<uint64_t>(i), i % 2 == 0 ? 3 : 40);
    run_all(put("damaged.mcap", damaged(bytes, damage)), sound);
    damages += damage.done();
  }
  EXPECT_GT(damages, 10u * kFiles);
  for (const char* verb : {"info", "dump", "cut", "report"}) EXPECT_GT(ended_well_[verb], 0u) << verb;
  EXPECT_LT(ended_well_["replay"], static_cast<size_t>(kFiles));
}

}  // namespace
}  // namespace sightline::test
