// A file system in memory. Tests can make it fail and remove things from it.
#pragma once

#include <map>
#include <set>
#include <string>

#include "server/record/record_folder.h"

namespace sightline::test {

class PretendedFiles final : public RecordFileSystem {
 public:
  struct File {
    std::shared_ptr<std::string> bytes = std::make_shared<std::string>();
    uint64_t modified_ns = 0;
  };

  // Held by the test.
  std::map<std::string, File> files;
  uint64_t now_ns = 0;
  bool folder_forbidden = false;  // creating and listing it fail
  bool files_forbidden = false;   // creating a file fails
  bool disk_full = false;         // writes fail
  std::set<std::string> stuck;    // these cannot be removed
  uint64_t capacity = uint64_t{1} << 40;
  uint64_t creations = 0;

  uint64_t total() const {
    uint64_t bytes = 0;
    for (const auto& [_, file] : files) bytes += file.bytes->size();
    return bytes;
  }
  void put(const std::string& name, size_t bytes, uint64_t modified_ns) {
    files[name] = {std::make_shared<std::string>(bytes, 'x'), modified_ns};
  }

  Status make_folder(const std::string& folder) override {
    if (folder_forbidden) return fail(ErrorCode::kUnavailable, folder, "no such folder");
    return {};
  }
  Result<std::unique_ptr<ByteSink>> create(const std::string&, const std::string& name) override {
    if (files.contains(name)) return fail(ErrorCode::kAlreadyExists, name, "exists");
    if (files_forbidden) return fail(ErrorCode::kUnavailable, name, "no such file");
    ++creations;
    File& file = files[name];
    file.modified_ns = now_ns;
    return std::make_unique<Sink>(*this, file.bytes);
  }
  Result<std::vector<RecordFile>> list(const std::string&) override {
    std::vector<RecordFile> found;
    for (const auto& [name, file] : files) found.push_back({name, file.bytes->size(), file.modified_ns});
    return found;
  }
  Status remove(const std::string&, const std::string& name) override {
    if (stuck.contains(name)) return fail(ErrorCode::kUnavailable, name, "Operation not permitted");
    files.erase(name);
    return {};
  }
  bool exists(const std::string&, const std::string& name) override { return files.contains(name); }
  Result<uint64_t> free_bytes(const std::string&) override { return capacity - std::min(capacity, total()); }

 private:
  class Sink final : public ByteSink {
   public:
    Sink(PretendedFiles& disk, std::shared_ptr<std::string> bytes) : disk_(disk), bytes_(std::move(bytes)) {}
    Status write(std::string_view bytes) override {
      if (disk_.disk_full) return fail(ErrorCode::kResourceExhausted, "disk", "is full");
      bytes_->append(bytes);
      return {};
    }

   private:
    PretendedFiles& disk_;
    const std::shared_ptr<std::string> bytes_;
  };
};

}  // namespace sightline::test
