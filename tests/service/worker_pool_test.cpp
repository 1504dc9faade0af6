#include "server/service/worker_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>
#include <string>
#include <vector>

namespace sightline {
namespace {

TEST(WorkerPool, ClientsTakeTurnsAndTheTasksOfOneKeepTheirOrder) {
  std::vector<std::string> done;
  {
    WorkerPool pool(1);
    std::promise<void> go;
    pool.post([held = go.get_future().share()] { held.wait(); });
    for (const char* name : {"many 1", "many 2", "many 3"}) pool.post([&done, name] { done.emplace_back(name); }, "many");
    for (const char* name : {"other 1", "other 2"}) pool.post([&done, name] { done.emplace_back(name); }, "other");
    go.set_value();
  }
  EXPECT_THAT(done, testing::ElementsAre("many 1", "other 1", "many 2", "other 2", "many 3"));
}

}  // namespace
}  // namespace sightline
