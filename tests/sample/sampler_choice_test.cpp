// Which sampler a daemon takes: the decision by itself, and the daemon's choice on this machine.
#include "server/sample/sampler_choice.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/service/daemon.h"
#include "tests/service/service_world.h"

namespace sightline {
namespace {

// --- the decision
// ------------------------------------------------------------------------------------------------

Result<EglDeviceInfo> some_gpu() {
  EglDeviceInfo info;
  info.renderer = "Some GPU", info.software = false;
  return info;
}
Result<EglDeviceInfo> absent() {
  return fail(ErrorCode::kUnavailable, "--egl-device", "no EGL here");
}
Result<EglDeviceInfo> must_not_be_asked() {
  ADD_FAILURE() << "OpenGL was looked for although nobody asked for it";
  return absent();
}

TEST(SamplerChoice, ANamedSamplerIsTakenWithoutAProbe) {
  for (const SamplerChoice named : {SamplerChoice::kEgl, SamplerChoice::kEmbree})
    EXPECT_EQ(decide_sampler(named, {}, must_not_be_asked)->sampler, named);
}

TEST(SamplerChoice, AutoTakesEmbreeWithoutAProbeAndSaysWhy) {
  const auto decision = decide_sampler(SamplerChoice::kAuto, {}, must_not_be_asked);
  EXPECT_EQ(decision->sampler, SamplerChoice::kEmbree);
  EXPECT_NE(decision->reason.find("faster"), std::string::npos) << decision->reason;
}

TEST(SamplerChoice, AutoTakesEglWhereADeviceIsNamedOrAGpuRequired) {
  for (const EglOptions& options : {EglOptions{.device_index = 0}, EglOptions{.require_gpu = true}}) {
    const auto decision = decide_sampler(SamplerChoice::kAuto, options, some_gpu);
    EXPECT_EQ(decision->sampler, SamplerChoice::kEgl);
    EXPECT_NE(decision->reason.find(options.require_gpu ? "--require-gpu" : "--egl-device"), std::string::npos)
        << decision->reason;
    EXPECT_NE(decision->reason.find("Some GPU"), std::string::npos) << decision->reason;
  }
}

TEST(SamplerChoice, AutoNeverPassesOverAnExplicitWish) {
  EXPECT_EQ(decide_sampler(SamplerChoice::kAuto, {.device_index = 3}, absent).error().field, "--egl-device");
  EXPECT_FALSE(decide_sampler(SamplerChoice::kAuto, {.require_gpu = true}, absent));
}

// --- the daemon
// --------------------------------------------------------------------------------------------------

// Hides every OpenGL from the processes that are started in its scope.
class NoOpenGl {
 public:
  NoOpenGl() { ::setenv(kVendors, "/dev/null", 1); }
  ~NoOpenGl() { ::unsetenv(kVendors); }

 private:
  static constexpr const char* kVendors = "__EGL_VENDOR_LIBRARY_FILENAMES";
};

// The daemon must report the same choice to clients and in its log.
void expect_choice(const std::string& kind, const std::string& part_of_reason) {
  Daemon daemon({"--listen", "127.0.0.1:0", "--sampler", "auto", "--log-format", "json"});
  ASSERT_TRUE(daemon.wait_until_ready()) << daemon.errors();
  const v1::GetServerInfoResponse info = server_info(connect(daemon.addresses().front()));
  EXPECT_EQ(info.sampler(), kind);
  EXPECT_NE(info.sampler_reason().find(part_of_reason), std::string::npos) << info.sampler_reason();
  std::istringstream lines(daemon.errors());
  int told = 0;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json event = nlohmann::json::parse(line, nullptr, false);
    if (event.value("message", "") != "sampler") continue;
    ++told;
    EXPECT_EQ(event["kind"], kind);
    EXPECT_EQ(event["reason"], info.sampler_reason());
  }
  EXPECT_EQ(told, 1) << daemon.errors();
}

TEST(SamplerChoice, TheDaemonTakesEmbree) {
  expect_choice("embree", "faster");
}

TEST(SamplerChoice, TheDaemonTakesEmbreeAlsoWithoutOpenGl) {
  const NoOpenGl hidden;
  expect_choice("embree", "faster");
}

TEST(SamplerChoice, ARequiredGpuThatIsNotThereEndsTheStart) {
  const NoOpenGl hidden;
  const RunResult result = run_sightlined({"--listen", "127.0.0.1:0", "--require-gpu"});
  EXPECT_GT(result.exit_code, 0);
  EXPECT_NE(result.errors.find("cannot start"), std::string::npos) << result.errors;
}

TEST(SamplerChoice, TheDeviceReportMarksTheOneInUseAndSaysWhy) {
  const NoOpenGl hidden;
  const RunResult automatic = run_sightlined({"devices"});
  EXPECT_NE(automatic.output.find("\n*     embree"), std::string::npos) << automatic.output;
  EXPECT_NE(automatic.output.find("used because: it was faster"), std::string::npos) << automatic.output;
  const RunResult required = run_sightlined({"devices", "--require-gpu"});
  EXPECT_EQ(required.output.find("\n*"), std::string::npos) << required.output;
}

TEST(SamplerChoice, AutoIsTheDefault) {
  const RunResult config = run_sightlined({"--print-config"});
  EXPECT_NE(config.output.find("sampler=\"auto\""), std::string::npos) << config.output;
}

}  // namespace
}  // namespace sightline
