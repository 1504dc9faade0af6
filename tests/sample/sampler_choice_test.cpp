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

Result<EglDeviceInfo> device(const char* renderer, bool software) {
  EglDeviceInfo info;
  info.renderer = renderer, info.software = software;
  return info;
}
Result<EglDeviceInfo> hardware() {
  return device("Some GPU", false);
}
Result<EglDeviceInfo> software() {
  return device("llvmpipe (LLVM 15)", true);
}
Result<EglDeviceInfo> absent() {
  return fail(ErrorCode::kUnavailable, "--egl-device", "no EGL here");
}
Result<EglDeviceInfo> must_not_be_asked() {
  ADD_FAILURE() << "OpenGL was looked for although the sampler was named";
  return absent();
}

TEST(SamplerChoice, ANamedSamplerIsTakenWithoutAProbe) {
  for (const SamplerChoice named : {SamplerChoice::kEgl, SamplerChoice::kEmbree})
    EXPECT_EQ(decide_sampler(named, {}, must_not_be_asked)->sampler, named);
}

TEST(SamplerChoice, AutoTakesEglOnHardwareOnlyAndSaysWhy) {
  const auto on_hardware = decide_sampler(SamplerChoice::kAuto, {}, hardware);
  EXPECT_EQ(on_hardware->sampler, SamplerChoice::kEgl);
  EXPECT_NE(on_hardware->reason.find("Some GPU"), std::string::npos) << on_hardware->reason;
  const auto on_software = decide_sampler(SamplerChoice::kAuto, {}, software);
  EXPECT_EQ(on_software->sampler, SamplerChoice::kEmbree);
  EXPECT_NE(on_software->reason.find("llvmpipe"), std::string::npos) << on_software->reason;
  const auto on_nothing = decide_sampler(SamplerChoice::kAuto, {}, absent);
  EXPECT_EQ(on_nothing->sampler, SamplerChoice::kEmbree);
  EXPECT_NE(on_nothing->reason.find("no EGL here"), std::string::npos) << on_nothing->reason;
}

TEST(SamplerChoice, AutoNeverPassesOverAnExplicitWish) {
  EXPECT_EQ(decide_sampler(SamplerChoice::kAuto, {.device_index = 3}, absent).error().field, "--egl-device");
  EXPECT_FALSE(decide_sampler(SamplerChoice::kAuto, {.require_gpu = true}, absent));
}

// --- the daemon
// --------------------------------------------------------------------------------------------------

// Reads from the daemon's report which device EGL would use here.
bool egl_is_hardware_here() {
  std::istringstream lines(run_sightlined({"devices", "--sampler", "egl"}).output);
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with('*')) return line.find("(hardware") != std::string::npos;
  return false;
}

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

TEST(SamplerChoice, TheDaemonTakesEglWhereItIsHardware) {
  egl_is_hardware_here() ? expect_choice("egl", "in hardware") : expect_choice("embree", "OpenGL");
}

TEST(SamplerChoice, WithoutOpenGlTheDaemonTakesEmbree) {
  const NoOpenGl hidden;
  expect_choice("embree", "no OpenGL");
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
  EXPECT_NE(automatic.output.find("no OpenGL"), std::string::npos) << automatic.output;
  const RunResult required = run_sightlined({"devices", "--require-gpu"});
  EXPECT_EQ(required.output.find("\n*"), std::string::npos) << required.output;
}

TEST(SamplerChoice, AutoIsTheDefault) {
  const RunResult config = run_sightlined({"--print-config"});
  EXPECT_NE(config.output.find("sampler=\"auto\""), std::string::npos) << config.output;
}

}  // namespace
}  // namespace sightline
