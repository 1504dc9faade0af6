#include "server/service/upload_places.h"

#include <gtest/gtest.h>

#include <optional>

namespace sightline {
namespace {

using std::chrono::seconds;
using OnePlace = std::optional<UploadPlaces::Place>;

TEST(UploadPlaces, OneClientHasAtMostHalfOfThem) {
  UploadPlaces places(4, 1000);
  OnePlace first, second, third, others;
  places.take(first, "many", [] {});
  places.take(second, "many", [] {});
  places.take(third, "many", [] {});
  places.take(others, "other", [] {});
  EXPECT_TRUE(first && second && others);
  EXPECT_FALSE(third);
  second.reset();
  places.take(third, "many", [] {});
  EXPECT_TRUE(third);
}

TEST(UploadPlaces, TheOnlyOneIsForEveryone) {
  UploadPlaces places(1, 1000);
  OnePlace one, another;
  places.take(one, "me", [] {});
  places.take(another, "you", [] {});
  EXPECT_TRUE(one);
  EXPECT_FALSE(another);
}

TEST(UploadPlaces, AtTheEndAllAreCancelledOnceAndNoneBegins) {
  UploadPlaces places(4, 1000);
  OnePlace first, second, late;
  int cancelled = 0;
  places.take(first, "me", [&] { ++cancelled; });
  places.take(second, "you", [&] { ++cancelled; });
  EXPECT_FALSE(places.ended());
  places.end_all();
  places.end_all();
  EXPECT_EQ(cancelled, 2);
  EXPECT_TRUE(places.ended());
  EXPECT_FALSE(first->complete());
  places.take(late, "other", [] {});
  EXPECT_FALSE(late);
}

TEST(UploadPlaces, AnUploadIsLateByItsSize) {
  EXPECT_FALSE(UploadPlaces::is_late(0, seconds(59)));
  EXPECT_TRUE(UploadPlaces::is_late(0, seconds(61)));
  constexpr size_t kBytes = size_t{64} << 20;
  EXPECT_FALSE(UploadPlaces::is_late(kBytes, seconds(17 * 60)));
  EXPECT_TRUE(UploadPlaces::is_late(kBytes, seconds(19 * 60)));
}

}  // namespace
}  // namespace sightline
