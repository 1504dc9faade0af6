// A verb of the command `sightline`: how its flags are told, and what it does.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace sightline {

// Made by add_..._verb(app), one a file, which adds the sub-command with its flags. `run` answers the exit status: 0 done,
// 1 it did not work or the answer is "no" (differs, damaged), 2 wrong flags.
struct Verb {
  CLI::App* command = nullptr;
  std::function<int()> run;
};

}  // namespace sightline
