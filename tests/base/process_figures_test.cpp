#include "server/base/process_figures.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <ctime>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>

namespace sightline {
namespace {

// The number behind a word at the start of a line of a file in /proc/self, which process_figures() does not read.
uint64_t number_after(const std::string& file, const std::string& word) {
  std::ifstream in("/proc/self/" + file);
  for (std::string line; std::getline(in, line);)
    if (line.starts_with(word)) {
      std::istringstream rest(line.substr(word.size()));
      uint64_t number = 0;
      rest >> number;
      return number;
    }
  ADD_FAILURE() << "no " << word << " in " << file;
  return 0;
}

TEST(ProcessFigures, AreThoseOfTheKernelsOtherFiles) {
  const ProcessFigures figures = process_figures();
  const uint64_t resident_bytes = number_after("status", "VmRSS:") * 1024,
                 virtual_bytes = number_after("status", "VmSize:") * 1024;
  EXPECT_NEAR(static_cast<double>(figures.resident_bytes), static_cast<double>(resident_bytes),
              0.2 * static_cast<double>(resident_bytes));
  EXPECT_NEAR(static_cast<double>(figures.virtual_bytes), static_cast<double>(virtual_bytes),
              0.05 * static_cast<double>(virtual_bytes));
  EXPECT_EQ(figures.max_descriptors, number_after("limits", "Max open files"));
  EXPECT_EQ(figures.threads, number_after("status", "Threads:"));
}

TEST(ProcessFigures, CountOpenDescriptorsAndThreads) {
  const ProcessFigures before = process_figures();
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const std::jthread other([](const std::stop_token& stop) {
    while (!stop.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  });
  const ProcessFigures after = process_figures();
  EXPECT_EQ(after.open_descriptors, before.open_descriptors + 2);
  EXPECT_EQ(after.threads, before.threads + 1);
  ::close(ends[0]), ::close(ends[1]);
}

TEST(ProcessFigures, TellTheTimeSinceTheStartAndTheTimeOfTheProcessor) {
  const ProcessFigures before = process_figures();
  const auto busy_s = [] { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; };
  for (const double until_s = busy_s() + 0.1; busy_s() < until_s;) continue;
  const ProcessFigures after = process_figures();
  EXPECT_GE(after.cpu_s, before.cpu_s + 0.07) << "the kernel counts in steps of 10 ms";
  EXPECT_NEAR(after.cpu_s, busy_s(), 0.05);
  EXPECT_NEAR(after.start_s, before.start_s, 0.5);
  const double now_s = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  EXPECT_NEAR(after.start_s + after.uptime_s, now_s, 2.0) << "the kernel counts whole seconds of its start";
}

TEST(ProcessFigures, TheBusyTimeOfAThreadGrowsWhileItRuns) {
  const auto before = busy_time_of_thread(::gettid());
  const auto begin = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() - begin < std::chrono::milliseconds(100)) {
  }
  EXPECT_GT(busy_time_of_thread(::gettid()) - before, std::chrono::milliseconds(50));
}

TEST(ProcessFigures, AThreadThatIsNotThereWasNeverBusy) {
  EXPECT_EQ(busy_time_of_thread(0).count(), 0);
}

}  // namespace
}  // namespace sightline
