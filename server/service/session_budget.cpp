#include "server/service/session_budget.h"

#include <algorithm>
#include <string>

namespace sightline {
namespace {

// Measured with 32 targets, the largest maps and the most candidates; smaller steps cost less for each.
constexpr double kMsOfRay = 150e-6, kMsOfLookup = 57e-6;
// For each point: measured with parts that lie inside each other, where every point is tested against all. Bones cost a
// tenth of it.
constexpr double kMsOfPart = 4e-3;

// The estimate was compared with the memory of 24 sessions of 1 to 32 targets, 100 to 32,768 candidates and maps of 7
// to 64 texels a side. It is between a tenth below that memory and three quarters above it.
constexpr size_t kBytesOfSession = 512 << 10, kBytesOfCandidate = 340, kBytesOfTexel = 16;

std::string mib(size_t bytes) {
  return std::to_string(bytes >> 20) + " MiB";
}

}  // namespace

InstanceMemory::Answer InstanceMemory::change(const std::string& client, size_t former, size_t now) {
  if (now == former) return Answer::kDone;
  const MutexLock lock(mutex_);
  if (now < former) {
    bytes_ -= former - now;
    const auto its = clients_.find(client);
    if ((its->second -= former - now) == 0) clients_.erase(its);
    return Answer::kDone;
  }
  const size_t more = now - former;
  if (bytes_ + more > max_bytes_) return Answer::kAllFull;
  const auto its = clients_.find(client);
  if ((its == clients_.end() ? 0 : its->second) + more > max_client_bytes_) return Answer::kClientFull;
  clients_[client] += more;
  bytes_ += more;
  return Answer::kDone;
}

Status InstanceShare::resize(size_t instances, size_t shape_bytes, size_t state_bytes, const char* field) {
  const size_t bytes = instances * kBytesOfInstance + shape_bytes + state_bytes;
  const bool grows = bytes > bytes_;
  if (grows && limits_.session_bytes > 0 && bytes > limits_.session_bytes) {
    hit(Limit::kSessionMemory);
    return fail(ErrorCode::kResourceExhausted, field,
                std::to_string(instances) + " instances, their shapes and the state of the steps take " + mib(bytes) +
                    "; a session may have " + mib(limits_.session_bytes) + " (--session-memory-mib)");
  }
  if (const Status changed = change(bytes, field); !changed) return changed;
  bytes_ = bytes;
  return {};
}

Status InstanceShare::change(size_t bytes, const char* field) {
  switch (memory_ ? memory_->change(client_, bytes_, bytes) : InstanceMemory::Answer::kDone) {
    case InstanceMemory::Answer::kDone:
      return {};
    case InstanceMemory::Answer::kAllFull:
      hit(Limit::kSessionsMemory);
      return fail(
          ErrorCode::kResourceExhausted, field,
          "the sessions together have no memory left for these instances, shapes and targets (--sessions-memory-mib)");
    case InstanceMemory::Answer::kClientFull:
      break;
  }
  hit(Limit::kClientMemory);
  return fail(
      ErrorCode::kResourceExhausted, field,
      "the sessions of this client have no memory left for these instances, shapes and targets (--client-memory-mib)");
}

namespace {

// A pair volume has at most r^3: one for each column of either map and each row.
size_t most_candidates(const StepSettings& settings) {
  const auto of_lattice = static_cast<size_t>(std::max(settings.aggregate.candidates, 0)),
             side = static_cast<size_t>(settings.sample.resolution);
  return settings.aggregate.volume == Volume::kPair ? std::max(of_lattice, side * side * side) : of_lattice;
}

// The temporal volume over pair volumes looks each candidate up in the maps of the last steps.
size_t steps_looked_up(const StepSettings& settings) {
  const bool keeps_maps = settings.aggregate.volume == Volume::kPair &&
                          settings.aggregate.filter.mode == FilterMode::kJoint;
  return keeps_maps ? static_cast<size_t>(std::max(settings.aggregate.filter.n, 1)) : 1;
}

}  // namespace

size_t session_state_bytes(const StepSettings& settings, size_t targets) {
  const size_t candidates = most_candidates(settings);
  const auto points = static_cast<size_t>(std::max(settings.sample.points, 1)),
             side = static_cast<size_t>(settings.sample.resolution);
  // The depths of the last maps (PairHistory).
  const size_t steps = steps_looked_up(settings), kept = steps > 1 ? steps * side * side * sizeof(double) : 0;
  return kBytesOfSession + targets * (candidates * kBytesOfCandidate + points * side * side * kBytesOfTexel + kept);
}

double step_cost_ms(const StepSettings& settings, size_t targets, size_t parts) {
  const double points = std::max(settings.sample.points, 1);
  const double texels = static_cast<double>(settings.sample.resolution) * settings.sample.resolution;
  const double of_point_ms = texels * kMsOfRay +
                             static_cast<double>(most_candidates(settings) * steps_looked_up(settings)) * kMsOfLookup;
  return points * (static_cast<double>(targets) * of_point_ms + static_cast<double>(parts) * kMsOfPart);
}

Status check_step_cost(const StepSettings& settings, std::span<const Target> targets, const SessionLimits& limits,
                       const char* field) {
  size_t parts = 0;
  for (const Target& target : targets) parts += target.part_ids.size();
  const double cost_ms = step_cost_ms(settings, targets.size(), parts);
  if (limits.max_step_cost_ms == 0.0 || cost_ms <= limits.max_step_cost_ms) return {};
  const std::string with_parts = parts > 0 ? " with " + std::to_string(parts) + " parts" : "";
  return fail(ErrorCode::kResourceExhausted, field,
              "a step with these settings and " + std::to_string(targets.size()) + " targets" + with_parts +
                  " costs about " + std::to_string(static_cast<int>(cost_ms)) +
                  " ms (--max-step-cost-ms); lower points, resolution or candidates");
}

}  // namespace sightline
