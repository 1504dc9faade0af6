// How much memory the daemon's budgets may take together, by default.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "server/base/control_group.h"

namespace sightline {

// The tightest limit, in bytes, of the control groups `groups` (version 2 and version 1) and of all their parents;
// nothing where none has one. `root` is the folder in which the control groups are mounted.
std::optional<uint64_t> memory_limit(const ControlGroupPaths& groups, const std::string& root = kControlGroupRoot);

// The limit in bytes of one `memory.max` or `memory.limit_in_bytes` file; nothing for "max", for the huge number by
// which version 1 says the same, and for malformed text.
std::optional<uint64_t> parse_memory_max(const std::string& text);

// The defaults of the flags of the same names, in MiB.
struct MemoryBudgets {
  size_t geometry = 192;  // the sampler takes as much again
  size_t sessions = 256;  // of all
  size_t session = 64;    // of one
  size_t messages = 128;
  size_t max_message_memory = 32;
  size_t max_upload = 64;    // uploads in progress take twice as much
  size_t kept_uploads = 64;  // a part of the geometry
  size_t transport = 128;    // of gRPC, for what came and is not complete

  // The memory in MiB that the budgets take together when all are used up at once.
  size_t sum() const { return 2 * geometry + sessions + messages + 2 * max_upload + transport; }
};
// The memory in MiB that the process takes beside its budgets: code, threads, connections, and what the allocator does
// not give back.
inline constexpr size_t kMemoryBesideBudgets = 96;

// Budgets that fit a limit together, as far as each stays usable. Without a limit, or with one that has room for them,
// they are those above.
MemoryBudgets memory_budgets(std::optional<uint64_t> limit_bytes);

}  // namespace sightline
