#include "server/base/memory_budget.h"

#include <algorithm>
#include <sstream>

namespace sightline {
namespace {

// Version 1 says "no limit" by the largest number of whole pages.
constexpr uint64_t kNoLimit = uint64_t{1} << 60;

}  // namespace

std::optional<uint64_t> parse_memory_max(const std::string& text) {
  std::istringstream words(text);
  uint64_t bytes = 0;
  if (!(words >> bytes) || bytes == 0 || bytes >= kNoLimit) return std::nullopt;
  return bytes;
}

std::optional<uint64_t> memory_limit(const ControlGroupPaths& groups, const std::string& root) {
  std::optional<uint64_t> tightest;
  const auto consider = [&](const std::string& text) {
    if (const auto limit = parse_memory_max(text); limit && (!tightest || *limit < *tightest)) tightest = limit;
  };
  visit_control_groups(root, groups.unified, "memory.max", consider);
  visit_control_groups(root + "/memory", groups.memory, "memory.limit_in_bytes", consider);
  return tightest;
}

MemoryBudgets memory_budgets(std::optional<uint64_t> limit_bytes) {
  const MemoryBudgets usual;
  if (!limit_bytes) return usual;
  const size_t limit = *limit_bytes >> 20;
  if (limit >= kMemoryBesideBudgets + usual.sum()) return usual;
  const double part = limit > kMemoryBesideBudgets
                          ? static_cast<double>(limit - kMemoryBesideBudgets) / static_cast<double>(usual.sum())
                          : 0.0;
  const auto of = [part](size_t mib, size_t least) {
    return std::max(least, static_cast<size_t>(static_cast<double>(mib) * part));
  };
  MemoryBudgets budgets;
  budgets.geometry = of(usual.geometry, 8);
  budgets.sessions = of(usual.sessions, 8);
  budgets.session = std::min(usual.session, budgets.sessions * 3 / 4);
  budgets.messages = of(usual.messages, 16);
  budgets.max_message_memory = std::clamp<size_t>(budgets.messages / 3, 8, usual.max_message_memory);
  budgets.max_upload = of(usual.max_upload, 4);
  budgets.kept_uploads = of(usual.kept_uploads, 2);
  budgets.transport = of(usual.transport, 16);
  return budgets;
}

}  // namespace sightline
