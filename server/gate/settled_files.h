// Files that are read again while the process runs, each time as a whole set: the certificate and its key, or the
// access file.
//
// A file that is written in place is empty or cut off for a while, and what is there then may still be valid. So new
// contents count only when nothing about the files has changed for kSettle: their contents, size, times and identity;
// and when no process has one of them open for writing, as far as the system tells, or one holds it open for kPatience.
// A file that is replaced by a rename settles after the same time.
//
//   SettledFiles files({{path, "--access-file"}});
//   const auto first = files.read();                 // at the start: as they are
//   if (auto news = files.look(steady_clock::now())) // later, again and again; more often while settling()
//     take(*news);
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/base/hash.h"

namespace sightline {

// Not thread-safe.
class SettledFiles {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Texts = std::vector<std::string>;  // one a file
  static constexpr std::chrono::milliseconds kSettle{1000}, kPatience{30'000};

  struct File {
    std::string path;  // empty: there is none, and its text is empty
    std::string flag;  // the field of errors
  };
  explicit SettledFiles(std::vector<File> files) : files_(std::move(files)) {}

  // The contents now. Fails as read_small_file does.
  Result<Texts> read();
  // Contents, or an error, that differ from the last ones that were returned and have settled. Nothing: there are none.
  std::optional<Result<Texts>> look(Time now);
  // A change has been seen that has not settled yet: look again after kSettle.
  bool settling() const { return changing_.has_value(); }

 private:
  struct Look {
    Result<Texts> texts;
    ContentHash contents{};  // of the texts, or of the error
    ContentHash state{};     // of the contents, the sizes, the times and the identities
    bool being_written = false;
  };
  Look look_at_all() const;

  struct Change {
    ContentHash state;
    Time since;
  };
  std::vector<File> files_;
  ContentHash returned_{};
  std::optional<Change> changing_;
};

}  // namespace sightline
