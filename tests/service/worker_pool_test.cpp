#include "server/service/worker_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <string>
#include <thread>
#include <vector>

namespace sightline {
namespace {

TEST(WorkerPool, ClientsTakeTurnsAndTheTasksOfOneKeepTheirOrder) {
  std::vector<std::string> done;
  {
    WorkerPool pool(1);
    std::promise<void> go;
    pool.post([held = go.get_future().share()] { held.wait(); });
    for (const char* name : {"many 1", "many 2", "many 3"})
      pool.post([&done, name] { done.emplace_back(name); }, "many");
    for (const char* name : {"other 1", "other 2"}) pool.post([&done, name] { done.emplace_back(name); }, "other");
    go.set_value();
  }
  EXPECT_THAT(done, testing::ElementsAre("many 1", "other 1", "many 2", "other 2", "many 3"));
}

// One client's tasks hold all threads but one, whatever their number. Another client's task ends meanwhile.
TEST(WorkerPool, OneClientLeavesAThreadToTheOthers) {
  std::promise<void> go;
  const auto held = go.get_future().share();
  std::atomic<int> began{0}, ended{0};
  {
    WorkerPool pool(3, 5);
    for (int i = 0; i < 5; ++i)
      pool.post(
          [&, held] {
            ++began;
            held.wait();
            ++ended;
          },
          "many");
    std::promise<void> other;
    pool.post([&] { other.set_value(); }, "other");
    other.get_future().wait();
    while (began < 2) std::this_thread::yield();
    EXPECT_EQ(began, 2);
    EXPECT_EQ(ended, 0);
    go.set_value();
  }
  EXPECT_EQ(ended, 5) << "the pool ends with all that was posted";
}

}  // namespace
}  // namespace sightline
