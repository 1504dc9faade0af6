// The commands on recordings: `sightline info`, `verify`, `recover`, `dump` and `cut`. None overwrites a file.
//
// Each run_..._command prints to `out` and returns its exit status: 0 done; 1 it did not work, or the answer is "not
// sound", with the reason on `err`. `progress` draws a progress bar on `err`.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "client/base/progress_bar.h"
#include "client/base/verb.h"
#include "server/record/byte_io.h"
#include "server/record/mcap_loss.h"

namespace sightline {

// How far the chunks of a file may unpack.
struct ReadLimit {
  double max_unpacked_gib = 0.0;  // 0: as McapLimits has it by the size of the file

  McapLimits limits() const;
};

// Lists what recordings contain. A file that cannot be read does not keep the others from being listed.
struct InfoOptions {
  std::vector<std::string> files = {};
  ReadLimit read = {};
  bool json = false;  // one JSON object a line for each file
  bool progress = false;
};
int run_info_command(const InfoOptions& options, std::ostream& out, std::ostream& err);

// Checks whether recordings are whole and consistent. 0: every file is sound, or was recovered and states its losses.
struct VerifyOptions {
  std::vector<std::string> files = {};
  ReadLimit read = {};
  bool json = false;  // one JSON object a line for each file
  bool progress = false;
};
int run_verify_command(const VerifyOptions& options, std::ostream& out, std::ostream& err);

// Makes a sound copy of a damaged or unfinished file, and verifies it. 0: nothing that the file holds was lost. 1:
// something was lost, and the copy holds the rest.
struct RecoverOptions {
  std::string file = {};
  ReadLimit read = {};
  std::string out = {};  // a new file
  bool json = false;     // one JSON object
  bool progress = false;
};
int run_recover_command(const RecoverOptions& options, std::ostream& out, std::ostream& err);

// Prints the messages of a recording, or of any MCAP file, as lines of JSON: {"topic", "sequence", "log_time_ns",
// "publish_time_ns", "message"}. A message that cannot be decoded has "error" instead of "message". Ends without an
// error when the reader of `out` has closed it.
struct DumpOptions {
  std::string file = {};
  ReadLimit read = {};
  std::vector<std::string> topics = {};  // empty: all
  // Seconds of log time since the first message of the file: start <= t < end.
  double start_s = 0.0;
  double end_s = std::numeric_limits<double>::infinity();
  uint64_t limit = std::numeric_limits<uint64_t>::max();  // lines
  std::string out = {};                                   // a new file; empty: `out`
  bool progress = false;
};
int run_dump_command(const DumpOptions& options, std::ostream& out, std::ostream& err);

// Copies a part of a recording into a recording of its own. Exit status 2: the range is empty.
struct CutOptions {
  std::string file = {};
  ReadLimit read = {};
  std::string out = {};  // a new file
  // Seconds of log time since the first message of the file, as client/recordings/cut.h takes them.
  double start_s = 0.0;
  double end_s = std::numeric_limits<double>::infinity();
  bool json = false;  // one JSON object
  bool progress = false;
};
int run_cut_command(const CutOptions& options, std::ostream& out, std::ostream& err);

// Adds all of them to the command.
std::vector<Verb> add_recording_verbs(CLI::App& app);

// A file whose reading shows on `bar`, which must outlive it. Fails as open_file_source does.
Result<std::shared_ptr<const ByteSource>> open_watched(const std::string& path, ProgressBar& bar,
                                                       const std::string& what);

}  // namespace sightline
