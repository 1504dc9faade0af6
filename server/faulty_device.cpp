#include "server/faulty_device.h"

#include <atomic>
#include <charconv>
#include <chrono>
#include <map>
#include <new>
#include <stdexcept>
#include <thread>

#include "server/sample/egl_sampler.h"

namespace sightline {
namespace {

constexpr char kField[] = "--inject-fault";

const std::map<std::string, FaultKind> kKinds{{"context-loss", FaultKind::kContextLoss},
                                              {"sampler", FaultKind::kSampler},
                                              {"exception", FaultKind::kException},
                                              {"memory", FaultKind::kMemory},
                                              {"hang", FaultKind::kHang}};

class FaultyDevice final : public SamplerDevice {
 public:
  FaultyDevice(SamplerDevice& device, const FaultPlan& plan)
      : device_(device), egl_(dynamic_cast<EglSamplerDevice*>(&device)), plan_(plan) {}

  std::unique_ptr<Sampler> make_sampler() override { return device_.make_sampler(); }
  size_t best_batch() const override { return device_.best_batch(); }
  std::string kind() const override { return device_.kind(); }
  std::string renderer() const override { return device_.renderer(); }
  size_t geometry_bytes() const override { return device_.geometry_bytes(); }
  void forget_unused() override { device_.forget_unused(); }

  void take_all(std::span<TakeJob> jobs) override {
    const bool meets_fault = ++calls_ % plan_.every == 0;
    if (meets_fault) happens();
    device_.take_all(jobs);
    if (meets_fault && plan_.kind == FaultKind::kSampler && !jobs.empty())
      jobs.front().taken = fail(ErrorCode::kUnavailable, "", "an injected fault of the sampler");
  }

 private:
  void happens() {
    switch (plan_.kind) {
      case FaultKind::kContextLoss:
        return egl_->simulate_context_loss();
      case FaultKind::kException:
        throw std::runtime_error("an injected exception");
      case FaultKind::kMemory:
        throw std::bad_alloc();
      case FaultKind::kHang:
        return std::this_thread::sleep_for(std::chrono::seconds(kHangSeconds));
      case FaultKind::kSampler:
      case FaultKind::kNone:
        break;
    }
  }

  SamplerDevice& device_;
  EglSamplerDevice* const egl_;
  const FaultPlan plan_;
  std::atomic<uint64_t> calls_{0};
};

}  // namespace

Result<FaultPlan> parse_fault_plan(const std::string& text) {
  const size_t colon = text.find(':');
  const auto kind = kKinds.find(text.substr(0, colon));
  FaultPlan plan;
  const char* const end = text.data() + text.size();
  const char* const number = colon == std::string::npos ? end : text.data() + colon + 1;
  const auto [read, error] = std::from_chars(number, end, plan.every);
  if (kind == kKinds.end() || error != std::errc() || read != end || plan.every == 0)
    return invalid(kField,
                   "KIND:N is needed, with context-loss, sampler, exception, memory or hang, and N > 0; got " + text);
  plan.kind = kind->second;
  return plan;
}

Result<std::unique_ptr<SamplerDevice>> make_faulty_device(SamplerDevice& device, const FaultPlan& plan) {
  if (plan.kind == FaultKind::kContextLoss && !dynamic_cast<EglSamplerDevice*>(&device))
    return invalid(kField, "context-loss needs --sampler egl");
  return std::make_unique<FaultyDevice>(device, plan);
}

}  // namespace sightline
