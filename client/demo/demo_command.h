// `sightline demo`: starts a daemon and lets it steer a camera through a generated scene. Then it prints a table of how
// well the camera did beside a plain follow camera, and leaves the page of the session.
#pragma once

#include <ostream>
#include <string>

#include "client/base/verb.h"
#include "server/base/error.h"

namespace sightline {

struct DemoOptions {
  std::string scene = "rooms";  // name of a generated scene
  // folder for the files; empty: a folder of the working folder, or of the temporary folder
  std::string out;
  std::string sampler = "auto";
  std::string daemon;        // path of sightlined
  double duration_s = 12.0;  // of the scene, > 0
  bool json = false;         // one JSON object instead of text, as of `sightline drive`
  bool progress = false;     // a bar on `err`
};

// 0 when the scene was played to its end and the page was written, else 1 with the reason on `err`.
int run_demo_command(const DemoOptions& options, std::ostream& out, std::ostream& err);

// `program`: the path of this program; sightlined is expected beside it.
Verb add_demo_verb(CLI::App& app, const std::string& program);

}  // namespace sightline
