// Linked into every test program of a mutation run: writes which mutants each test comes past, and how long it takes,
// to the file that SIGHTLINE_REACH_REPORT names. One line a test: seconds, the test's name, the numbers of the mutants.
//
// Constants of namespaces are evaluated once, before all tests, and what SetUpTestSuite makes serves all tests of its
// suite. Their mutants count for each test that may depend on them.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <vector>

#include "tests/mutation/switch.h"

namespace {

size_t size_of_map() {
  struct stat status {};
  const char* const path = std::getenv("SIGHTLINE_REACHED");
  return mutation::reached && path && ::stat(path, &status) == 0 ? static_cast<size_t>(status.st_size) : 0;
}

class ReachListener final : public testing::EmptyTestEventListener {
 public:
  explicit ReachListener(const char* path) : report_(path, std::ios::app), size_(size_of_map()) {}

 private:
  void OnTestProgramStart(const testing::UnitTest&) override { of_program_ = take(); }

  void OnTestSuiteStart(const testing::TestSuite&) override {
    take();  // of the former suite's end
    of_suite_.clear();
  }

  void OnTestStart(const testing::TestInfo&) override {
    const std::vector<size_t> before = take();
    of_suite_.insert(of_suite_.end(), before.begin(), before.end());
  }

  void OnTestEnd(const testing::TestInfo& test) override {
    if (size_ == 0) return;
    report_ << static_cast<double>(test.result()->elapsed_time()) / 1e3 << ' ' << test.test_suite_name() << '.'
            << test.name();
    for (const std::vector<size_t>& numbers : {of_program_, of_suite_, take()})
      for (const size_t number : numbers) report_ << ' ' << number;
    report_ << (test.result()->Failed() ? " failed\n" : "\n") << std::flush;
  }

  // The numbers in the map, which is empty afterwards.
  std::vector<size_t> take() const {
    std::vector<size_t> numbers;
    unsigned char* const end = mutation::reached + size_;
    for (unsigned char* at = mutation::reached; size_ > 0 && at < end; ++at) {
      at = static_cast<unsigned char*>(std::memchr(at, 1, static_cast<size_t>(end - at)));
      if (!at) break;
      numbers.push_back(static_cast<size_t>(at - mutation::reached));
      *at = 0;
    }
    return numbers;
  }

  std::ofstream report_;
  size_t size_;
  std::vector<size_t> of_program_, of_suite_;
};

const bool listening = [] {
  const char* const path = std::getenv("SIGHTLINE_REACH_REPORT");
  if (path) testing::UnitTest::GetInstance()->listeners().Append(new ReachListener(path));
  return path != nullptr;
}();

}  // namespace
