// The end of a daemon whose orderly end takes too long.
#include "server/service/last_resort.h"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <mutex>
#include <string>

namespace sightline {
namespace {

using std::chrono::milliseconds;

constexpr std::chrono::hours kNever{1};

// What was called, in its order.
class Calls {
 public:
  void note(char call) {
    const std::lock_guard lock(mutex_);
    calls_ += call;
  }
  std::string all() const {
    const std::lock_guard lock(mutex_);
    return calls_;
  }

 private:
  mutable std::mutex mutex_;
  std::string calls_;
};

TEST(LastResort, RescuesAndThenEnds) {
  Calls calls;
  std::promise<void> ended;
  LastResort resort([&] {
    calls.note('e');
    ended.set_value();
  });
  resort.arm(milliseconds(5), [&] { calls.note('r'); });
  ended.get_future().wait();
  EXPECT_EQ(calls.all(), "re");
}

TEST(LastResort, EndsAlthoughTheRescueHangs) {
  std::promise<void> ended, let_go;
  const std::shared_future<void> held(let_go.get_future());
  LastResort resort([&] { ended.set_value(); }, milliseconds(20));
  resort.arm(milliseconds(0), [held] { held.wait(); });
  ended.get_future().wait();
  let_go.set_value();
}

TEST(LastResort, ANewTimeReplacesTheFormerOne) {
  Calls calls;
  std::promise<void> ended;
  LastResort resort([&] { ended.set_value(); });
  resort.arm(kNever, [&] { calls.note('1'); });
  resort.arm(milliseconds(5), [&] { calls.note('2'); });
  ended.get_future().wait();
  EXPECT_EQ(calls.all(), "2");
}

TEST(LastResort, DoesNothingAtAnOrderlyEnd) {
  Calls calls;
  {
    LastResort unarmed([&] { calls.note('e'); }), armed([&] { calls.note('e'); });
    armed.arm(kNever, [&] { calls.note('r'); });
  }
  EXPECT_EQ(calls.all(), "");
}

}  // namespace
}  // namespace sightline
