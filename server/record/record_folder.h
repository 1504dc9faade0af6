// A bounded ring of recordings in one folder. The oldest files are removed when all of them take too many bytes, when
// they are too old, or when the disk has too little space left. Only files with our name pattern are counted and
// removed, and never one that is being written.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/record/byte_io.h"

namespace sightline {

struct RecordFile {
  std::string name;  // within the folder
  uint64_t bytes = 0;
  uint64_t modified_ns = 0;  // since 1970 (UTC)
};

// The few calls that the ring makes to a file system, so that a test can make any of them fail.
class RecordFileSystem {
 public:
  virtual ~RecordFileSystem() = default;
  // Creates the folder with its parents; succeeds when it exists.
  virtual Status make_folder(const std::string& folder) = 0;
  virtual Result<std::unique_ptr<ByteSink>> create(const std::string& folder, const std::string& name) = 0;
  virtual Result<std::vector<RecordFile>> list(const std::string& folder) = 0;
  virtual Status remove(const std::string& folder, const std::string& name) = 0;
  virtual bool exists(const std::string& folder, const std::string& name) = 0;
  virtual Result<uint64_t> free_bytes(const std::string& folder) = 0;
};

std::unique_ptr<RecordFileSystem> system_files();

struct RecordLimits {
  uint64_t max_total_bytes = uint64_t{4} << 30;     // of all recordings in the folder
  uint64_t max_file_bytes = uint64_t{256} << 20;    // then the session continues in the next part
  uint64_t max_age_s = 0;                           // 0: files of any age stay
  uint64_t free_reserve_bytes = uint64_t{1} << 30;  // kept free on the disk
};

// Not thread-safe.
class RecordFolder {
 public:
  // `files` must outlive it.
  RecordFolder(std::string folder, RecordLimits limits, RecordFileSystem& files);

  // Creates a new file, and the folder when it is missing.
  Result<std::unique_ptr<ByteSink>> create(const std::string& name);
  // False when the file was removed while it was written.
  bool exists(const std::string& name) const { return files_.exists(folder_, name); }

  // Removes a file that holds nothing.
  Status remove(const std::string& name) { return files_.remove(folder_, name); }

  // Removes the oldest files until the rest is within the limits. A file that cannot be removed is left alone and does
  // not count any more: it must not stop the recording. Fails with kResourceExhausted when only files that are being
  // written are left and the disk's reserve or the total is still exceeded. Fails as the file system fails.
  Status make_room(uint64_t now_ns, const std::set<std::string>& being_written);

  uint64_t removed_files() const { return removed_; }
  // The files that `make_room` could not remove the last time that it tried, with the reasons.
  const std::vector<Error>& stuck_files() const { return stuck_; }
  // Makes a file and removes it again: the reason why nothing can be recorded here.
  Status try_out();
  const RecordLimits& limits() const { return limits_; }

 private:
  const std::string folder_;
  const RecordLimits limits_;
  RecordFileSystem& files_;
  uint64_t removed_ = 0;
  std::vector<Error> stuck_;
};

// "sightline-20261121T193054.123Z-<session>-p001.mcap": sorts by time. Bytes of the session that are not letters,
// digits, - or _ become _, and no more than 64 of them are taken.
std::string recording_name(uint64_t start_time_ns, const std::string& session_id, uint32_t part);
// True for files that a RecordFolder may remove.
bool is_recording_name(const std::string& name);

}  // namespace sightline
