// libFuzzer writes configuration files. A file that is refused is refused with a reason. One that is taken can be
// printed, and what is printed says the same.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <sstream>
#include <string>
#include <string_view>
#include <variant>

#include "server/flags.h"

namespace {

using namespace sightline;

// The exit status and the output of sightlined with such a file.
struct Run {
  int code = 0;
  std::string out, err;
};

Run run(std::string_view config, const char* what) {
  // Made once: it takes far longer than reading a file.
  static CommandLine command_line;
  const int file = memfd_create("config", 0);
  if (file < 0 || write(file, config.data(), config.size()) != static_cast<ssize_t>(config.size())) std::abort();
  const std::string path = "/proc/self/fd/" + std::to_string(file);
  const char* const arguments[] = {"sightlined", "--config", path.c_str(), what};
  std::ostringstream out, err;
  std::streambuf* const former_out = std::cout.rdbuf(out.rdbuf());
  std::streambuf* const former_err = std::cerr.rdbuf(err.rdbuf());
  const Command command = command_line.parse(4, arguments);
  std::cout.rdbuf(former_out);
  std::cerr.rdbuf(former_err);
  close(file);
  // what is left is to try the flags
  if (std::holds_alternative<CheckConfig>(command)) return {0, out.str(), err.str()};
  if (!std::holds_alternative<Exit>(command)) std::abort();
  return {std::get<Exit>(command).code, out.str(), err.str()};
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const Run checked = run(text, "--check-config");
  if (checked.code != 0) {
    if (checked.code != 2 || checked.err.empty()) std::abort();
    return 0;
  }
  const Run printed = run(text, "--print-config");
  if (printed.code != 0) std::abort();
  const Run again = run(printed.out, "--print-config");
  if (again.code != 0 || again.out != printed.out) std::abort();
  return 0;
}
