// A sub-command of `sightline`: its flags, and what it does.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace sightline {

// Exit status of the command when its flags cannot be used. Done is 0. Failure is 1, and so is the answer "no" (the
// recordings differ, the file is damaged).
inline constexpr int kWrongFlags = 2;

// Each sub-command has a function add_..._verb(app), which adds it to the command line. `run` returns the exit status.
struct Verb {
  CLI::App* command = nullptr;
  std::function<int()> run;
};

}  // namespace sightline
