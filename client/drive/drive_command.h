// `sightline drive SCENARIO.glb`: plays a scenario against a server and reports how well the camera did.
#pragma once

#include <ostream>
#include <string>

#include "client/base/connection_flags.h"
#include "server/base/camera.h"
#include "server/base/error.h"

namespace sightline {

struct DriveOptions {
  std::string scenario;  // path
  std::string server;    // address
  ConnectionFlags connection = {};
  double rate_hz = 60.0;    // (0, 1000]
  double duration_s = 0.0;  // 0: the animation's
  uint64_t seed = 1;
  // what the session's settings start from, of preset_names() (client/base/wire_presets.h)
  std::string preset = "sightline";
  // see read_shot_text (client/shots/named_shots.h); empty: the scenario's first pose
  std::string shot;
  // folder for trace.csv, metrics.json, contact.png and comparison.png; made when missing
  std::string out = "out";
  std::string page;       // file for the page of the session (session_page.h); empty: none
  bool lockstep = false;  // --fast
  bool truth = true;      // judge the run and the follow baseline
  int picture_every = 1;  // judge every n-th frame's picture
  bool json = false;      // one JSON object on `out` instead of text
  bool progress = false;  // a bar on `err`
};

// 0 when the run was played to its end and all files were written, else 1 with the reason on `err`.
int run_drive_command(const DriveOptions& options, std::ostream& out, std::ostream& err);

}  // namespace sightline
