// Linked into every test program of a mutation run: writes which mutants each test comes past, and how long it takes, to the file
// that SIGHTLINE_REACH_REPORT names. One line a test: seconds, the test's name, the numbers of the mutants.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>

#include "tests/mutation/switch.h"

namespace {

class ReachListener final : public testing::EmptyTestEventListener {
 public:
  explicit ReachListener(const char* path) : report_(path, std::ios::app) {}

 private:
  void OnTestEnd(const testing::TestInfo& test) override {
    struct stat status {};
    if (!mutation::reached || ::stat(std::getenv("SIGHTLINE_REACHED"), &status) != 0) return;
    const auto size = static_cast<size_t>(status.st_size);
    report_ << static_cast<double>(test.result()->elapsed_time()) / 1e3 << ' ' << test.test_suite_name() << '.' << test.name();
    for (size_t id = 0; id < size; ++id)
      if (mutation::reached[id]) report_ << ' ' << id;
    report_ << (test.result()->Failed() ? " failed\n" : "\n") << std::flush;
    std::memset(mutation::reached, 0, size);
  }

  std::ofstream report_;
};

const bool listening = [] {
  const char* const path = std::getenv("SIGHTLINE_REACH_REPORT");
  if (path) testing::UnitTest::GetInstance()->listeners().Append(new ReachListener(path));
  return path != nullptr;
}();

}  // namespace
