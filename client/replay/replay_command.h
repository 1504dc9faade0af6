// `sightline replay FILE`: takes the steps of a recording again and compares the replies. With other settings, it shows
// what they change.
#pragma once

#include <istream>
#include <limits>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "client/base/connection_flags.h"
#include "client/base/verb.h"

namespace sightline {

struct ReplayCommandOptions {
  std::string file = {};
  std::string server = {};          // host:port or unix:/path; empty: in this process
  ConnectionFlags connection = {};  // to the server
  double wait_s = 30.0;             // for a server that is not there or went away
  std::optional<double> rate = {};  // times real time; none: as fast as possible
  bool by_hand = false;             // one step at a time, on commands from the input
  double start_s = 0.0;             // from here on at `rate` or by hand; everything before as fast as possible
  double end_s = std::numeric_limits<double>::infinity();
  std::string sampler = "recorded";  // or "auto", "egl", "embree"
  size_t threads = 0;                // for the depth maps of a step, Embree only; 0: replay_threads()
  std::string scene_dir = {};
  std::vector<std::string> scenes = {};  // files
  std::vector<std::string> set = {};     // KEY=VALUE
  bool truth = false;
  size_t truth_every = 6;
  std::string out = {};  // a recording of the new replies; empty: none
  bool json = false;     // one JSON object instead of text; not by hand
  bool progress = false;
};

// Exit status 0: all replies are equal, or alike where they cannot be equal (client/README.md). Also 0 when settings
// were changed. 1: they differ, or the replay failed with the reason on `err`. 2: the options are invalid.
int run_replay_command(const ReplayCommandOptions& options, std::istream& in, std::ostream& out, std::ostream& err);

Verb add_replay_verb(CLI::App& app);

}  // namespace sightline
