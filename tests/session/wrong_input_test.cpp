// Wrong input that a session refuses, at the opening and with a tick. The error names the field, and nothing is
// applied.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/session/checks.h"
#include "server/session/session.h"
#include "tests/session/game.h"

namespace sightline::test {
namespace {

struct WrongTick {
  const char* field;
  ErrorCode code;
  void (*spoil)(Game&, TickMaker&);
};

void PrintTo(const WrongTick& wrong, std::ostream* out) {
  *out << wrong.field;
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
using E = ErrorCode;

Target broken_target(void (*breaks)(Target&)) {
  Target target = Game::target(kAnn);
  breaks(target);
  return target;
}

// A tick that moves a target and changes settings and limits, all of them valid.
StepSettings& otherwise_good(TickMaker& tick) {
  tick.move(kAnn, {-3, 1, 0});
  tick.limits = CameraLimits{.max_speed_mps = 0.1};
  return tick.settings.emplace(preset_settings(Preset::kPaper));
}

const WrongTick kWrongTicks[] = {
    {"tick.sequence", E::kInvalidArgument, [](Game&, TickMaker& t) { t.sequence = 3; }},
    {"tick.sequence", E::kInvalidArgument, [](Game&, TickMaker& t) { t.sequence = 0; }},
    {"tick.time_s", E::kInvalidArgument, [](Game&, TickMaker& t) { t.time_s = 0.0; }},
    {"tick.time_s", E::kInvalidArgument, [](Game&, TickMaker& t) { t.time_s = kNan; }},
    {"tick.time_s", E::kInvalidArgument, [](Game&, TickMaker& t) { t.time_s = kInf; }},
    {"tick.dt_s", E::kInvalidArgument, [](Game&, TickMaker& t) { t.dt_s = -0.01; }},
    {"tick.dt_s", E::kInvalidArgument, [](Game&, TickMaker& t) { t.dt_s = kNan; }},
    {"tick.dt_s", E::kInvalidArgument, [](Game&, TickMaker& t) { t.dt_s = kInf; }},
    {"tick.time_s", E::kInvalidArgument, [](Game&, TickMaker& t) { t.time_s = 1e120; }},
    {"tick.dt_s", E::kInvalidArgument, [](Game&, TickMaker& t) { t.dt_s = 1e120; }},
    {"tick.transforms.ids[1]", E::kNotFound, [](Game&, TickMaker& t) { t.move(kAnn, {}).move(99, {}); }},
    {"tick.transforms.ids[1]", E::kInvalidArgument, [](Game&, TickMaker& t) { t.move(kAnn, {}).move(kAnn, {}); }},
    {"tick.transforms.positions[3]", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.move(kAnn, {}).move(kBob, {kNan, 0, 0});
     }},
    {"tick.transforms.positions[0]", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.move(kAnn, {2e9, 0, 0});
     }},
    {"tick.transforms.rotations[0]", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.move(kAnn, {}).transforms.poses[0].rotation = {2, 0, 0, 0};
     }},
    {"tick.transforms.velocities[0]", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.move(kAnn, {}).at_speed({0, 2e6, 0});
     }},
    {"tick.transforms.velocities[3]", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.move(kAnn, {}).move(kBob, {}).transforms.velocities_mps = {{1, 0, 0}, {0, 0, 2e6}};
     }},
    {"tick.transforms.velocities", E::kInvalidArgument,
     [](Game&, TickMaker& t) { t.move(kAnn, {}).transforms.velocities_mps.resize(2); }},
    {"tick.transforms.positions", E::kInvalidArgument, [](Game&, TickMaker& t) { t.transforms.ids = {kAnn}; }},
    {"tick.delta.base_revision", E::kFailedPrecondition, [](Game&, TickMaker& t) { t.delta.base_revision = 44; }},
    {"tick.delta.removed_ids[1]", E::kNotFound,
     [](Game&, TickMaker& t) {
       t.delta.remove = {kCrate, 99};
     }},
    {"tick.delta.removed_ids[1]", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.delta.remove = {kCrate, kCrate};
     }},
    {"tick.delta.removed_ids[1]", E::kFailedPrecondition,
     [](Game&, TickMaker& t) {
       t.delta.remove = {kCrate, kBob};
     }},
    {"tick.delta.added_instances[0].id", E::kAlreadyExists,
     [](Game& g, TickMaker& t) { t.delta.add = {g.make(kWall, SphereShape{}, {})}; }},
    {"tick.delta.added_instances[0].id", E::kInvalidArgument,
     [](Game& g, TickMaker& t) { t.delta.add = {g.make(kAssetIdBit | 3, SphereShape{}, {})}; }},
    {"tick.delta.added_instances[0].pose.position", E::kInvalidArgument,
     [](Game& g, TickMaker& t) {
       t.delta.add = {g.make(20, SphereShape{}, {0, kInf, 0})};
     }},
    {"tick.delta.added_instances[0].scale", E::kInvalidArgument,
     [](Game& g, TickMaker& t) {
       t.delta.add = {g.make(20, SphereShape{}, {})};
       t.delta.add[0].linear = glm::dmat3(0.0);
     }},
    {"tick.delta.added_instances[0].scale", E::kInvalidArgument,
     [](Game& g, TickMaker& t) {
       t.delta.add = {g.make(20, SphereShape{1e5f}, {})};
       t.delta.add[0].linear = glm::dmat3(2e4);
     }},
    {"tick.delta.changed_instances[0].id", E::kNotFound,
     [](Game&, TickMaker& t) {
       t.delta.change = {{99, {}}};
     }},
    {"tick.targets.targets", E::kResourceExhausted,
     [](Game&, TickMaker& t) { t.targets.emplace(33, Game::target(kAnn)); }},
    {"tick.targets.targets[1].id", E::kInvalidArgument,
     [](Game&, TickMaker& t) { t.targets.emplace(2, Game::target(kAnn)); }},
    {"tick.targets.targets[0].id", E::kNotFound, [](Game&, TickMaker& t) { t.targets = {Game::target(99)}; }},
    {"tick.targets.targets[0].id", E::kNotFound,
     [](Game&, TickMaker& t) {
       t.delta.remove = {kBob};
       t.targets = {Game::target(kBob)};
     }},
    {"tick.targets.targets[0].weight", E::kInvalidArgument,
     [](Game&, TickMaker& t) { t.targets = {broken_target([](Target& x) { x.weight = -1; })}; }},
    {"tick.targets.targets[0].weight", E::kInvalidArgument,
     [](Game&, TickMaker& t) { t.targets = {broken_target([](Target& x) { x.weight = kNan; })}; }},
    {"tick.targets.targets[0].weight", E::kInvalidArgument,
     [](Game&, TickMaker& t) { t.targets = {broken_target([](Target& x) { x.weight = 1e-200; })}; }},
    {"tick.targets.targets[0].aim_offset", E::kInvalidArgument,
     [](Game& g, TickMaker& t) {  // within 1e9 m, but not with the scale
       t.delta.add = {g.make(20, SphereShape{}, {})};
       t.delta.add[0].linear = glm::dmat3(1e4);
       t.targets = {Game::target(20)};
       t.targets->front().aim_offset_m = glm::dvec3(1e6, 0, 0);
     }},
    {"tick.targets.targets[0].aim_offset", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.targets = {broken_target([](Target& x) { x.aim_offset_m = glm::dvec3(0, 0, 1e10); })};
     }},
    {"tick.targets.targets[0].attached_ids[1]", E::kNotFound,
     [](Game&, TickMaker& t) { t.targets = {broken_target([](Target& x) {
                                 x.attached_ids = {kWall, 99};
                               })}; }},
    {"tick.targets.targets[0].ignored_ids[0]", E::kNotFound,
     [](Game&, TickMaker& t) { t.targets = {broken_target([](Target& x) { x.ignored_ids = {99}; })}; }},
    {"tick.targets.targets[0].part_ids[1]", E::kNotFound,
     [](Game&, TickMaker& t) { t.targets = {broken_target([](Target& x) {
                                 x.part_ids = {kWall, 99};
                               })}; }},
    {"tick.targets.targets[0].part_ids[0]", E::kNotFound,
     [](Game&, TickMaker& t) {
       t.delta.remove = {kCrate};
       t.targets = {broken_target([](Target& x) { x.part_ids = {kCrate}; })};
     }},
    {"tick.targets.targets[0].part_ids[1]", E::kInvalidArgument,
     [](Game&, TickMaker& t) { t.targets = {broken_target([](Target& x) {
                                 x.part_ids = {kWall, kWall};
                               })}; }},
    {"tick.targets.targets[0].part_ids[0]", E::kInvalidArgument,
     [](Game&, TickMaker& t) { t.targets = {broken_target([](Target& x) { x.part_ids = {kAnn}; })}; }},
    {"tick.targets.targets[0].part_ids[1]", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.targets = {broken_target([](Target& x) { x.part_ids = {kWall, kBob}; }), Game::target(kBob)};
     }},
    {"tick.targets.targets[1].part_ids[0]", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.targets = {broken_target([](Target& x) { x.part_ids = {kWall}; }), Game::target(kBob)};
       t.targets->back().part_ids = {kWall};
     }},
    {"tick.targets.targets[0].part_ids", E::kResourceExhausted,
     [](Game&, TickMaker& t) { t.targets = {broken_target([](Target& x) { x.part_ids.assign(65, kWall); })}; }},
    {"tick.observed_camera.pose.position", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.observed_camera = seen_at({kNan, 0, 0}, true);
     }},
    {"tick.observed_camera.pose.rotation", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.observed_camera = {{{0, 0, 0}, {0.9, 0, 0, 0}}, {}, true};
     }},
    {"tick.observed_camera.velocity", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.observed_camera = {{}, {0, 1e200, 0}, true};
     }},
    {"tick.observed_camera.angular_velocity", E::kInvalidArgument,
     [](Game&, TickMaker& t) {
       t.observed_camera = {{}, {0, 0, 0}, false, {0, 1001, 0}};
     }},
    {"tick.lens.field_of_view", E::kInvalidArgument,
     [](Game&, TickMaker& t) { t.lens.emplace().vertical_fov_rad = 3; }},
    {"tick.lens.aspect", E::kInvalidArgument, [](Game&, TickMaker& t) { t.lens.emplace().aspect = 11; }},
    {"tick.lens.near_m", E::kInvalidArgument, [](Game&, TickMaker& t) { t.lens.emplace().near_m = 0; }},
    {"tick.lens.near_m", E::kInvalidArgument, [](Game&, TickMaker& t) { t.lens.emplace().near_m = 1e-300; }},
    {"tick.lens", E::kInvalidArgument, [](Game&, TickMaker& t) { t.lens.emplace().near_m = 0.29; }},
    // These come with valid changes that would alter the answers if any of them were applied.
    {"tick.tuning.bound.horizon_s", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t).bound.horizon_s = 2.1; }},
    {"tick.tuning.sample.resolution", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t).sample.resolution = 1; }},
    {"tick.tuning.aggregate.filter.alpha", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t).aggregate.filter.alpha = 1.01; }},
    {"tick.tuning.aggregate.filter.n", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t).aggregate.filter.n = 0; }},
    {"tick.tuning.move.cost", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t).move.cost = {.occlusion = 0, .distance = 0, .route = 0}; }},
    {"tick.settings.dead_zone", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t).framing.dead_zone = kNan; }},
    {"tick.settings.max_vertical_fov_rad", E::kInvalidArgument,
     [](Game&, TickMaker& t) {  // valid by itself, but the near plane would reach out of the body
       otherwise_good(t).framing.min_vertical_fov_rad = 0.5, t.settings->framing.max_vertical_fov_rad = 2.6;
       t.limits.reset();
     }},
    {"tick.limits.max_acceleration_mps2", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t), t.limits->max_acceleration_mps2 = -1; }},
    {"tick.limits.max_jerk_mps3", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t), t.limits->max_jerk_mps3 = 1e-160; }},
    {"tick.limits.max_acceleration_mps2", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t), t.limits->max_acceleration_mps2 = 1e-300; }},
    {"tick.limits.body_radius_m", E::kInvalidArgument,
     [](Game&, TickMaker& t) { otherwise_good(t), t.limits->body_radius_m = 0.05; }},
    {"tick.transforms.ids[1]", E::kNotFound, [](Game&, TickMaker& t) { otherwise_good(t), t.move(99, {}); }},
};

void expect_same_session(const Session& a, const Session& b) {
  EXPECT_EQ(a.mirror().revision(), b.mirror().revision());
  EXPECT_EQ(a.mirror().hash(), b.mirror().hash());
  EXPECT_EQ(a.mirror().size(), b.mirror().size());
  EXPECT_EQ(a.mirror().find(kAnn)->velocity_mps, b.mirror().find(kAnn)->velocity_mps);
  EXPECT_EQ(a.carried().camera.pose.position_m, b.carried().camera.pose.position_m);
  EXPECT_EQ(a.carried().camera.pose.rotation, b.carried().camera.pose.rotation);
  EXPECT_EQ(a.carried().camera.velocity_mps, b.carried().camera.velocity_mps);
  EXPECT_EQ(a.carried().shot.is_set, b.carried().shot.is_set);
  ASSERT_EQ(a.targets().size(), b.targets().size());
  for (size_t i = 0; i < a.targets().size(); ++i) {
    EXPECT_EQ(a.targets()[i].instance_id, b.targets()[i].instance_id);
    EXPECT_EQ(a.targets()[i].weight, b.targets()[i].weight);
  }
}

void expect_same_answer(const SessionAnswer& a, const SessionAnswer& b) {
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.time_s, b.time_s);
  EXPECT_EQ(a.merged_ticks, b.merged_ticks);
  EXPECT_EQ(a.revision, b.revision);
  EXPECT_EQ(a.hash, b.hash);
  EXPECT_EQ(a.cut, b.cut);
  EXPECT_EQ(a.lens.vertical_fov_rad, b.lens.vertical_fov_rad);
  EXPECT_EQ(place_of(a), place_of(b));
  EXPECT_EQ(a.step.camera.pose.rotation, b.step.camera.pose.rotation);
  EXPECT_EQ(a.step.camera.velocity_mps, b.step.camera.velocity_mps);
  EXPECT_EQ(a.step.reason, b.step.reason);
  EXPECT_EQ(a.step.chosen_candidate, b.step.chosen_candidate);
}

class WrongTicks : public testing::TestWithParam<WrongTick> {};

TEST_P(WrongTicks, AreNamedAndLeaveNoTrace) {
  Game tried, spared;  // only the first one receives the wrong tick
  const auto both = [&](auto play) { play(tried), play(spared); };
  for (int i = 1; i <= 3; ++i) both([&](Game& g) { g.play(g.tick().move(kAnn, {-1 + 0.02 * i, 1, 0})); });

  TickMaker wrong = tried.tick();
  GetParam().spoil(tried, wrong);
  const Status refused = tried.session->apply(wrong);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().field, GetParam().field) << refused.error().message;
  EXPECT_EQ(refused.error().code, GetParam().code) << to_string(refused.error());
  EXPECT_FALSE(refused.error().message.empty());
  expect_same_session(*tried.session, *spared.session);

  tried.sequence = spared.sequence, tried.time_s = spared.time_s;
  for (int i = 4; i <= 6; ++i) {
    const auto good = [i](Game& g) { return g.play(g.tick().move(kAnn, {-1 + 0.02 * i, 1, 0})); };
    expect_same_answer(good(tried), good(spared));
  }
}

INSTANTIATE_TEST_SUITE_P(All, WrongTicks, testing::ValuesIn(kWrongTicks));

// ---- opening ----

struct WrongOpen {
  const char* field;
  ErrorCode code;
  void (*spoil)(SessionOptions&);
};

void PrintTo(const WrongOpen& wrong, std::ostream* out) {
  *out << wrong.field;
}

const WrongOpen kWrongOpens[] = {
    {"open.convention.custom.metres_per_unit", E::kInvalidArgument,
     [](SessionOptions& o) { o.convention.metres_per_unit = 0; }},
    {"open.world_origin", E::kInvalidArgument, [](SessionOptions& o) { o.convention.origin_m.z = 2e15; }},
    {"open.camera.position", E::kInvalidArgument, [](SessionOptions& o) { o.camera.position_m.x = kNan; }},
    {"open.camera.rotation", E::kInvalidArgument,
     [](SessionOptions& o) {
       o.camera.rotation = {0, 0, 0, 0};
     }},
    {"open.lens.aspect", E::kInvalidArgument, [](SessionOptions& o) { o.lens.aspect = 0.05; }},
    {"open.limits.max_speed_mps", E::kInvalidArgument, [](SessionOptions& o) { o.limits.max_speed_mps = 0; }},
    {"open.limits.body_radius_m", E::kInvalidArgument, [](SessionOptions& o) { o.limits.body_radius_m = 0.1; }},
    {"open.limits.body_radius_m", E::kInvalidArgument,
     [](SessionOptions& o) {  // fits as it is, but not at the widest zoom
       o.settings.framing.min_vertical_fov_rad = 0.5;
       o.settings.framing.max_vertical_fov_rad = 2.6;
     }},
    {"open.tuning.bound.horizon_s", E::kInvalidArgument, [](SessionOptions& o) { o.settings.bound.horizon_s = 3; }},
    {"open.tuning.sample.resolution", E::kInvalidArgument,
     [](SessionOptions& o) { o.settings.sample.resolution = 65; }},
    {"open.tuning.aggregate.candidates", E::kInvalidArgument,
     [](SessionOptions& o) { o.settings.aggregate.candidates = 26; }},
    {"open.settings.max_distance_m", E::kInvalidArgument,
     [](SessionOptions& o) { o.settings.move.min_distance_m = 0, o.settings.move.max_distance_m = 1e-9; }},
    {"open.settings.max_distance_m", E::kInvalidArgument,
     [](SessionOptions& o) { o.settings.move.max_distance_m = 0.5; }},
    {"open.settings.framing_margin", E::kInvalidArgument,
     [](SessionOptions& o) { o.settings.framing.framing_margin = 1; }},
    {"open.label", E::kInvalidArgument, [](SessionOptions& o) { o.label.assign(65, 'x'); }},
    {"open.instances[2].id", E::kInvalidArgument, [](SessionOptions& o) { o.instances[2].id = 0; }},
    {"open.instances[3].id", E::kInvalidArgument, [](SessionOptions& o) { o.instances[3].id = kAnn; }},
    {"open.instances[1].id", E::kInvalidArgument,
     [](SessionOptions& o) {  // two of the four are the scene file's
       o.scene_instances = 2;
       o.instances[3].id = kAnn;
     }},
    {"open.instances[0].id", E::kInvalidArgument,
     [](SessionOptions& o) {  // the first of the client's
       o.scene_instances = 2;
       o.instances[2].id = 0;
     }},
    {"open.scene", E::kInvalidArgument,
     [](SessionOptions& o) {
       o.scene_instances = 2;
       o.instances[0].pose.position_m.z = 2e9;
     }},
    {"open.targets[1].id", E::kNotFound, [](SessionOptions& o) { o.targets[1].instance_id = 99; }},
    {"open.targets[1].id", E::kInvalidArgument, [](SessionOptions& o) { o.targets[1].instance_id = kAnn; }},
    {"open.targets[1].part_ids[0]", E::kNotFound, [](SessionOptions& o) { o.targets[1].part_ids = {99}; }},
    {"open.targets[1].part_ids[1]", E::kInvalidArgument,
     [](SessionOptions& o) {
       o.targets[1].part_ids = {kCrate, kAnn};
     }},
    {"open.targets", E::kResourceExhausted, [](SessionOptions& o) { o.targets.assign(33, Game::target(kAnn)); }},
};

class WrongOpens : public testing::TestWithParam<WrongOpen> {};

TEST_P(WrongOpens, AreNamed) {
  Game game;
  SessionOptions options = game.make_options();
  GetParam().spoil(options);
  const auto device = make_embree_sampler_device();
  const auto opened = Session::open(std::move(options), device->make_sampler(), nullptr);
  ASSERT_FALSE(opened.has_value());
  EXPECT_EQ(opened.error().field, GetParam().field) << opened.error().message;
  EXPECT_EQ(opened.error().code, GetParam().code);
}

INSTANTIATE_TEST_SUITE_P(All, WrongOpens, testing::ValuesIn(kWrongOpens));

// ---- the checks by themselves ----

std::string field_of(const Status& status) {
  return status ? "" : status.error().field;
}

TEST(SessionChecks, EveryCoordinateIsFiniteAndWithinABillionMetres) {
  Game game;
  const SceneDelta nothing;
  const IdsAfter ids(game.session->mirror(), nothing);
  for (int axis = 0; axis < 3; ++axis) {
    const auto check = [&](double coordinate) {
      Pose pose;
      pose.position_m[axis] = coordinate;
      Target target = Game::target(kAnn);
      target.aim_offset_m = pose.position_m;
      return field_of(check_pose(pose, "p")) + " " + field_of(check_targets({target}, ids, "t"));
    };
    for (const double coordinate : {-1e9, 0.0, 1e9}) EXPECT_EQ(check(coordinate), " ") << axis << ' ' << coordinate;
    for (const double coordinate : {std::nextafter(1e9, kInf), -1.1e9, kInf, -kInf, kNan})
      EXPECT_EQ(check(coordinate), "p.position t[0].aim_offset") << axis << ' ' << coordinate;
  }
}

TEST(SessionChecks, ARotationSpeedOrTurnMayBeAsLargeAsItsRangeSays) {
  const auto turned = [](double length) { return field_of(check_pose({{0, 0, 0}, {0, length, 0, 0}}, "p")); };
  for (const double length : {0.9991, 1.0009}) EXPECT_EQ(turned(length), "") << length;
  for (const double length : {0.0, 0.9989, 1.0011, kNan, kInf}) EXPECT_EQ(turned(length), "p.rotation") << length;
  EXPECT_EQ(field_of(check_speed({0, 0, -1e6}, "v")), "");
  EXPECT_EQ(field_of(check_speed({999'999, 0, 100}, "v")), "");
  EXPECT_EQ(field_of(check_speed({0, 1.01e6, 0}, "v")), "v");
  EXPECT_EQ(field_of(check_speed({8e5, 8e5, 0}, "v")), "v") << "it is the length that counts";
  EXPECT_EQ(field_of(check_turn({0, -1000, 0}, "w")), "");
  EXPECT_EQ(field_of(check_turn({800, 0, 800}, "w")), "w");
  EXPECT_EQ(field_of(check_turn({kNan, 0, 0}, "w")), "w");
}

TEST(SessionChecks, AnInstanceOfTwoBodiesIsToldWhichHasItAlready) {
  Game game;
  const SceneDelta nothing;
  const IdsAfter ids(game.session->mirror(), nothing);
  const auto told = [&](std::vector<uint64_t> anns, std::vector<uint64_t> bobs) {
    std::vector<Target> targets{Game::target(kAnn), Game::target(kBob)};
    targets[0].part_ids = std::move(anns), targets[1].part_ids = std::move(bobs);
    const Status checked = check_targets(targets, ids, "t");
    return checked ? "" : checked.error().field + " " + checked.error().message;
  };
  EXPECT_EQ(told({kWall}, {kCrate}), "");
  EXPECT_EQ(told({kWall, kBob}, {}), "t[0].part_ids[1] is t[1] already");
  EXPECT_EQ(told({}, {kWall, kAnn}), "t[1].part_ids[1] is t[0] already");
  EXPECT_EQ(told({}, {kBob}), "t[1].part_ids[0] is t[1] already");
  EXPECT_EQ(told({kCrate, kWall}, {kWall}), "t[1].part_ids[0] is a part of t[0] already");
  EXPECT_EQ(told({}, {kCrate, kWall, kCrate}), "t[1].part_ids[2] is a part of t[1] already");
}

}  // namespace
}  // namespace sightline::test
