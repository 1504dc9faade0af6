#include "server/record/record_folder.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "sightline-", kSuffix = ".mcap";
constexpr uint64_t kSecondNs = 1'000'000'000;

Error unavailable(const std::string& folder, const std::error_code& code) {
  const bool full = code_of_system_error(code.value()) == ErrorCode::kResourceExhausted;
  return Error{full ? ErrorCode::kResourceExhausted : ErrorCode::kUnavailable, folder, code.message()};
}

uint64_t modified_ns(const fs::directory_entry& entry, std::error_code& code) {
  const auto time = std::chrono::file_clock::to_sys(entry.last_write_time(code));
  return static_cast<uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count());
}

class SystemFiles final : public RecordFileSystem {
 public:
  Status make_folder(const std::string& folder) override {
    std::error_code code;
    fs::create_directories(folder, code);
    if (code) return tl::unexpected(unavailable(folder, code));
    return {};
  }
  Result<std::unique_ptr<ByteSink>> create(const std::string& folder, const std::string& name) override {
    return create_file_sink((fs::path(folder) / name).string());
  }
  Result<std::vector<RecordFile>> list(const std::string& folder) override {
    std::vector<RecordFile> found;
    std::error_code code;
    fs::directory_iterator entry(folder, code);
    for (; !code && entry != fs::directory_iterator(); entry.increment(code)) {
      // A file that disappears during the listing is skipped.
      std::error_code of_entry;
      if (!entry->is_regular_file(of_entry)) continue;
      const uint64_t bytes = entry->file_size(of_entry);
      const uint64_t time_ns = modified_ns(*entry, of_entry);
      if (!of_entry) found.push_back({entry->path().filename().string(), bytes, time_ns});
    }
    if (code) return tl::unexpected(unavailable(folder, code));
    return found;
  }
  Status remove(const std::string& folder, const std::string& name) override {
    std::error_code code;
    fs::remove(fs::path(folder) / name, code);
    if (code) return tl::unexpected(unavailable(name, code));
    return {};
  }
  bool exists(const std::string& folder, const std::string& name) override {
    std::error_code code;
    return fs::exists(fs::path(folder) / name, code);
  }
  Result<uint64_t> free_bytes(const std::string& folder) override {
    std::error_code code;
    const fs::space_info space = fs::space(folder, code);
    if (code) return tl::unexpected(unavailable(folder, code));
    return uint64_t{space.available};
  }
};

}  // namespace

std::unique_ptr<RecordFileSystem> system_files() {
  return std::make_unique<SystemFiles>();
}

RecordFolder::RecordFolder(std::string folder, RecordLimits limits, RecordFileSystem& files)
    : folder_(std::move(folder)), limits_(limits), files_(files) {}

Result<std::unique_ptr<ByteSink>> RecordFolder::create(const std::string& name) {
  if (Status ok = files_.make_folder(folder_); !ok) return tl::unexpected(ok.error());
  return files_.create(folder_, name);
}

Status RecordFolder::make_room(uint64_t now_ns, const std::set<std::string>& being_written) {
  stuck_.clear();
  if (Status ok = files_.make_folder(folder_); !ok) return ok;
  Result<std::vector<RecordFile>> found = files_.list(folder_);
  if (!found) return tl::unexpected(found.error());
  std::erase_if(*found, [](const RecordFile& file) { return !is_recording_name(file.name); });
  uint64_t total = 0;
  for (const RecordFile& file : *found) total += file.bytes;
  std::erase_if(*found, [&](const RecordFile& file) { return being_written.contains(file.name); });
  std::sort(found->begin(), found->end(), [](const RecordFile& a, const RecordFile& b) {
    return std::tie(a.modified_ns, a.name) < std::tie(b.modified_ns, b.name);
  });

  Result<uint64_t> free = files_.free_bytes(folder_);
  if (!free) return tl::unexpected(free.error());
  for (const RecordFile& file : *found) {
    const bool old = limits_.max_age_s > 0 && now_ns / kSecondNs > file.modified_ns / kSecondNs + limits_.max_age_s;
    if (!old && total <= limits_.max_total_bytes && *free >= limits_.free_reserve_bytes) break;
    total -= file.bytes;
    if (Status ok = files_.remove(folder_, file.name); !ok) {
      stuck_.push_back(std::move(ok.error()));
      continue;
    }
    ++removed_;
    if (free = files_.free_bytes(folder_); !free) return tl::unexpected(free.error());
  }
  if (*free < limits_.free_reserve_bytes)
    return fail(ErrorCode::kResourceExhausted, folder_,
                "the disk has " + std::to_string(*free) + " bytes left, " + std::to_string(limits_.free_reserve_bytes) +
                    " are kept for others");
  if (total > limits_.max_total_bytes)
    return fail(ErrorCode::kResourceExhausted, folder_,
                "recordings being written take " + std::to_string(total) + " bytes, at most " +
                    std::to_string(limits_.max_total_bytes) + " are allowed");
  return {};
}

Status RecordFolder::try_out() {
  const std::string name = std::string(kPrefix) + "test-" + std::to_string(::getpid()) + ".tmp";
  if (Status ok = files_.make_folder(folder_); !ok) return ok;
  (void)files_.remove(folder_, name);  // of a daemon that was killed
  if (auto made = files_.create(folder_, name); !made) return tl::unexpected(std::move(made.error()));
  return files_.remove(folder_, name);
}

std::string recording_name(uint64_t start_time_ns, const std::string& session_id, uint32_t part) {
  const std::time_t seconds = static_cast<std::time_t>(start_time_ns / kSecondNs);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char time[32], rest[48];
  std::strftime(time, sizeof time, "%Y%m%dT%H%M%S", &utc);
  std::snprintf(rest, sizeof rest, ".%03uZ-", static_cast<unsigned>(start_time_ns / 1'000'000 % 1000));
  std::string name(kPrefix);
  name.append(time).append(rest);
  for (const char c : session_id.substr(0, 64)) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' ||
                       c == '_';
    name.push_back(plain ? c : '_');
  }
  std::snprintf(rest, sizeof rest, "-p%03u", part);
  return name.append(rest).append(kSuffix);
}

bool is_recording_name(const std::string& name) {
  return name.size() > kPrefix.size() + kSuffix.size() && name.starts_with(kPrefix) && name.ends_with(kSuffix) &&
         name.find('/') == std::string::npos;
}

}  // namespace sightline
