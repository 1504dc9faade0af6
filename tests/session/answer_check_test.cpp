// An answer with a number that is not finite does not go out.
#include "server/session/answer_check.h"

#include <cmath>
#include <limits>

#include "tests/session/game.h"

namespace sightline::test {
namespace {

SessionAnswer good_answer() {
  Game game;
  SessionAnswer answer = game.play(game.tick().move(kAnn, {-1, 1, 0}));
  answer.step.view_s = 1.0;
  answer.step.targets[0].forecast = SightForecast{.ahead_s = 1.0, .share = 1.0, .confidence = 1.0, .loss_s = 0.5};
  return answer;
}

TEST(AnswerCheck, TakesWhatASessionAnswers) {
  EXPECT_TRUE(check_finite(good_answer()));
}

TEST(AnswerCheck, RefusesEachNumberThatIsNotFinite) {
  using Number = double& (*)(SessionAnswer&);
  const Number numbers[] = {
      [](SessionAnswer& a) -> double& { return a.step.camera.pose.position_m.y; },
      [](SessionAnswer& a) -> double& { return a.step.camera.pose.rotation.w; },
      [](SessionAnswer& a) -> double& { return a.step.camera.velocity_mps.z; },
      [](SessionAnswer& a) -> double& { return a.step.camera.acceleration_mps2.x; },
      [](SessionAnswer& a) -> double& { return a.step.camera.angular_velocity_radps.y; },
      [](SessionAnswer& a) -> double& { return a.lens.vertical_fov_rad; },
      [](SessionAnswer& a) -> double& { return a.target_from_camera.position_m.x; },
      [](SessionAnswer& a) -> double& { return a.unrotated_from_camera.rotation.z; },
      [](SessionAnswer& a) -> double& { return *a.step.view_s; },
      [](SessionAnswer& a) -> double& { return a.step.targets[0].visible_share; },
      [](SessionAnswer& a) -> double& { return a.step.targets[0].filtered_share; },
      [](SessionAnswer& a) -> double& { return a.step.targets[0].picture_share; },
      [](SessionAnswer& a) -> double& { return a.step.targets[1].distance_m; },
      [](SessionAnswer& a) -> double& { return a.step.targets[0].forecast->ahead_s; },
      [](SessionAnswer& a) -> double& { return a.step.targets[0].forecast->share; },
      [](SessionAnswer& a) -> double& { return a.step.targets[0].forecast->confidence; },
      [](SessionAnswer& a) -> double& { return *a.step.targets[0].forecast->loss_s; },
  };
  for (size_t i = 0; i < std::size(numbers); ++i) {
    SCOPED_TRACE(i);
    for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
      SessionAnswer answer = good_answer();
      numbers[i](answer) = bad;
      const Status refused = check_finite(answer);
      ASSERT_FALSE(refused);
      EXPECT_EQ(refused.error().code, ErrorCode::kInternal);
      EXPECT_FALSE(refused.error().message.empty());
    }
  }
}

// Without the check before every ray Embree would end the process.
TEST(AnswerCheck, SamplersRefuseViewsThatAreNotFinite) {
  Game game;
  const auto device = make_embree_sampler_device();
  const auto sampler = device->make_sampler();
  const double nan = std::nan(""), far = 1e19;
  for (const auto spoil : {+[](MapRequest&r, double bad) { r.view.eye_m.x = bad; },
                           +[](MapRequest&r, double bad) { r.view.world_from_view[2].y = bad; },
                           +[](MapRequest&r, double bad) { r.view.right = bad; },
                           +[](MapRequest&r, double bad) { r.view.jitter.x = bad; }})
    for (const double bad : {nan, far}) {
      std::vector<MapRequest> requests(3);
      spoil(requests[1], bad);
      std::vector<DepthMap> maps;
      const Status taken = sampler->take(game.session->mirror(), requests, maps);
      ASSERT_FALSE(taken);
      EXPECT_EQ(taken.error().code, ErrorCode::kInternal);
    }
  std::vector<MapRequest> far_away(1);
  far_away[0].far_m = nan;
  std::vector<DepthMap> maps;
  EXPECT_FALSE(sampler->take(game.session->mirror(), far_away, maps));
  far_away[0].far_m = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(sampler->take(game.session->mirror(), far_away, maps));
}

}  // namespace
}  // namespace sightline::test
