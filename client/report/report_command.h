// `sightline report`: a recording as one HTML page, or two recordings side by side.
#pragma once

#include <ostream>
#include <string>

#include "client/base/verb.h"
#include "client/report/page.h"

namespace sightline {

struct ReportOptions {
  std::string recording;
  std::string beside;  // a second recording, shown on the right; empty: none
  std::string out;     // empty: beside the recording, .html in the place of .mcap
  RecordingPageOptions page;
  bool json = false;      // print one JSON object instead of text
  bool progress = false;  // draw a progress bar on `err`
};

// 0, or 1 with a line on `err` that names what is at fault.
int run_report_command(const ReportOptions& options, std::ostream& out, std::ostream& err);

Verb add_report_verb(CLI::App& app);

}  // namespace sightline
