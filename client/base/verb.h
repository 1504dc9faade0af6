// A sub-command of `sightline`: its flags, and what it does.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace sightline {

// Exit status of the command when its flags cannot be used. 0 means done. 1 means that it failed, or that the answer is
// "no": the recordings differ, or the file is damaged.
inline constexpr int kWrongFlags = 2;

// Each sub-command has a function add_..._verb(app), which adds it to the command line. `run` returns the exit status.
struct Verb {
  CLI::App* command = nullptr;
  std::function<int()> run;
};

}  // namespace sightline
