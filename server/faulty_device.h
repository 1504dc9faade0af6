// A sampler device that fails on demand, for tests and drills (the hidden flag --inject-fault).
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "server/base/error.h"
#include "server/sample/sampler.h"

namespace sightline {

enum class FaultKind {
  kNone,
  kContextLoss,  // the graphics context is lost; only with EGL
  kSampler,      // the maps cannot be taken
  kException,    // the sampler throws, which none should do
  kMemory,       // no memory is left
  kHang          // the maps take kHangSeconds
};

struct FaultPlan {
  FaultKind kind = FaultKind::kNone;
  uint64_t every = 1;  // each n-th call for maps meets the fault
};

inline constexpr int kHangSeconds = 6;

// "context-loss:100". Fails with kInvalidArgument, field "--inject-fault".
Result<FaultPlan> parse_fault_plan(const std::string& text);

// `device` must outlive the result. Fails with kInvalidArgument, field "--inject-fault", if it cannot fail in this way.
Result<std::unique_ptr<SamplerDevice>> make_faulty_device(SamplerDevice& device, const FaultPlan& plan);

}  // namespace sightline
