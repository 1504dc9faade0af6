// Wrong input on the wire gives a typed error that names the field. Nothing is half applied, and no other session is
// affected.
#include <gtest/gtest.h>

#include <limits>

#include "tests/service/service_world.h"

namespace sightline {
namespace {

using testing::Test;

TEST(ControlInput, ATickBeforeOpenEndsTheCall) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.send(move_tick(1, 1, 0.0));
  const grpc::Status status = stream.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(fields_of(status), std::vector<std::string>{"open"});
}

TEST(ControlInput, AnEmptyFirstMessageEndsTheCall) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.send_empty();
  EXPECT_EQ(stream.finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST(ControlInput, ACallWithoutAnyMessageEndsWithAnError) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.half_close();
  EXPECT_EQ(stream.finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST(ControlInput, AnOpenThatIsWrongNamesTheField) {
  const ServiceWorld world;
  v1::OpenSession open = open_with_boxes(2);
  open.mutable_targets(1)->set_id(99);
  Stream stream(world.channel());
  stream.send(open);
  const grpc::Status status = stream.finish();
  EXPECT_FALSE(status.ok());
  ASSERT_EQ(fields_of(status).size(), 1u) << status.error_message();
  EXPECT_EQ(fields_of(status)[0], "open.targets[1].id");
  EXPECT_EQ(world.stats().open_sessions(), 0u);
}

TEST(ControlInput, ASecondOpenIsRefusedAndTheSessionLivesOn) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  stream.send(open_with_boxes(1));
  const auto refused = stream.read();
  ASSERT_TRUE(refused && refused->has_tick_error());
  EXPECT_EQ(refused->tick_error().code(), v1::TickError::CODE_FAILED_PRECONDITION);
  EXPECT_EQ(refused->tick_error().field_violations(0).field(), "open");
  stream.send(move_tick(1, 1, 0.1));
  EXPECT_TRUE(stream.read()->has_camera());
}

TEST(ControlInput, AnEmptyMessageOnALiveSessionIsRefusedAndTheSessionLivesOn) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  stream.send_empty();
  const auto refused = stream.read();
  ASSERT_TRUE(refused && refused->has_tick_error());
  EXPECT_EQ(refused->tick_error().code(), v1::TickError::CODE_INVALID_ARGUMENT);
  stream.send(move_tick(1, 1, 0.1));
  EXPECT_TRUE(stream.read()->has_camera());
}

// The valid half of the refused tick must not be applied either, so the hash must equal the hash of a session without
// the tick.
TEST(ControlInput, ARefusedTickLeavesNoTraceAndOthersGoOn) {
  const ServiceWorld world;
  Stream told_wrong(world.channel()), other(world.channel());
  const uint64_t start = told_wrong.open(open_with_boxes(3)).mirror_hash();
  ASSERT_EQ(other.open(open_with_boxes(3)).mirror_hash(), start);

  v1::Tick wrong = move_tick(1, 1, 5.0);
  wrong.mutable_transforms()->add_ids(2);
  for (const double value : {0.0, std::numeric_limits<double>::quiet_NaN(), 0.0}) {
    wrong.mutable_transforms()->add_positions(value);
  }
  told_wrong.send(wrong);
  const auto refused = told_wrong.read();
  ASSERT_TRUE(refused && refused->has_tick_error());
  EXPECT_EQ(refused->tick_error().sequence(), 1u);
  EXPECT_EQ(refused->tick_error().code(), v1::TickError::CODE_INVALID_ARGUMENT);
  ASSERT_EQ(refused->tick_error().field_violations_size(), 1);
  EXPECT_TRUE(refused->tick_error().field_violations(0).field().starts_with("tick.transforms.positions["))
      << refused->tick_error().field_violations(0).field();

  for (Stream* stream : {&told_wrong, &other}) stream->send(move_tick(1, 3, -1.0));
  const auto after = told_wrong.read(), reference = other.read();
  ASSERT_TRUE(after && after->has_camera());
  ASSERT_TRUE(reference && reference->has_camera());
  EXPECT_EQ(after->camera().mirror_hash(), reference->camera().mirror_hash());
  EXPECT_EQ(after->camera().pose().SerializeAsString(), reference->camera().pose().SerializeAsString());
}

// An invalid value of settings or limits, the field in which it is sent, and a part of the expected error message.
struct BadValue {
  const char* field;
  const char* range;
  void (*set)(v1::Settings&, tuning::v1alpha1::Tuning&, v1::CameraLimits&);
};
tuning::v1alpha1::FilterSettings& filter_of(tuning::v1alpha1::Tuning& tuning) {
  return *tuning.mutable_aggregate()->mutable_filter();
}
const BadValue kBadValues[] = {
    {"tuning.aggregate.filter.alpha", "0 or in [1e-06, 1]", [](auto&, auto& t, auto&) { filter_of(t).set_alpha(1.5); }},
    {"tuning.aggregate.filter.alpha", "0 or in [1e-06, 1]",
     [](auto&, auto& t, auto&) { filter_of(t).set_alpha(-0.1); }},
    {"tuning.aggregate.filter.n", "[1, 64]", [](auto&, auto& t, auto&) { filter_of(t).set_n(0); }},
    {"tuning.aggregate.filter.n", "[1, 64]", [](auto&, auto& t, auto&) { filter_of(t).set_n(65); }},
    {"tuning.aggregate.filter.window_s", "[1e-06, 1]", [](auto&, auto& t, auto&) { filter_of(t).set_window_s(0); }},
    {"tuning.aggregate.filter.hidden_threshold", "0 or in [1e-06, 0.3]",
     [](auto&, auto& t, auto&) { filter_of(t).set_visible_threshold(0.3), filter_of(t).set_hidden_threshold(0.4); }},
    {"tuning.aggregate.candidates", "[27, 32768]",
     [](auto&, auto& t, auto&) { t.mutable_aggregate()->set_candidates(UINT32_MAX); }},
    {"tuning.bound.horizon_s", "[0.05, 2]", [](auto&, auto& t, auto&) { t.mutable_bound()->set_horizon_s(2.5); }},
    {"tuning.bound.max_horizon_s", "[0.5, 2]",
     [](auto&, auto& t, auto&) { t.mutable_bound()->set_horizon_s(0.5), t.mutable_bound()->set_max_horizon_s(2.5); }},
    {"tuning.bound.paper_n", "[1, 1e+06]", [](auto&, auto& t, auto&) { t.mutable_bound()->set_paper_n(0); }},
    {"tuning.sample.resolution", "[2, 64]", [](auto&, auto& t, auto&) { t.mutable_sample()->set_resolution(0); }},
    {"tuning.sample.points", "[0, 16]", [](auto&, auto& t, auto&) { t.mutable_sample()->set_points(17); }},
    {"settings.prediction_s", "0 or in [1e-06, 2]", [](auto& s, auto&, auto&) { s.set_prediction_s(2.01); }},
    {"tuning.move.cost", "above 0",
     [](auto&, auto& t, auto&) {
       tuning::v1alpha1::CostWeights& cost = *t.mutable_move()->mutable_cost();
       cost.set_occlusion(0), cost.set_distance(0), cost.set_route(0);
     }},
    {"settings.max_distance_m", "(1, 10000]",
     [](auto& s, auto&, auto&) { s.set_min_distance_m(1), s.set_max_distance_m(1); }},
    {"settings.framing_margin", "0 or in [1e-06, 0.9]",
     [](auto& s, auto&, auto&) { s.set_framing_margin(std::numeric_limits<double>::quiet_NaN()); }},
    {"settings.preset", "named values",
     [](auto& s, auto&, auto&) { s.set_preset(static_cast<v1::Settings::Preset>(7)); }},
    {"limits.max_speed_mps", "[1e-06, 1000]", [](auto&, auto&, auto& l) { l.set_max_speed_mps(-1); }},
    {"limits.max_acceleration_mps2", "[1e-06, 10000]", [](auto&, auto&, auto& l) { l.set_max_acceleration_mps2(0); }},
    {"limits.max_angular_speed_radps", "[1e-06, 100]",
     [](auto&, auto&, auto& l) { l.set_max_angular_speed_radps(-3); }},
    {"limits.max_angular_acceleration_radps2", "[1e-06, 1000]",
     [](auto&, auto&, auto& l) { l.set_max_angular_acceleration_radps2(-12); }},
    {"limits.body_radius_m", "0 or in [1e-06, 10]", [](auto&, auto&, auto& l) { l.set_body_radius_m(-0.3); }},
};

TEST(ControlInput, ABadSettingOrLimitAtTheOpeningIsNamedWithItsRange) {
  const ServiceWorld world;
  for (const BadValue& bad : kBadValues) {
    SCOPED_TRACE(bad.field);
    v1::OpenSession open = open_with_boxes(2);
    bad.set(*open.mutable_settings(), *open.mutable_tuning(), *open.mutable_limits());
    Stream stream(world.channel());
    stream.send(open);
    const grpc::Status status = stream.finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(fields_of(status), std::vector<std::string>{std::string("open.") + bad.field});
    EXPECT_NE(status.error_message().find(bad.range), std::string::npos) << status.error_message();
  }
}

// The tick is valid except for one value. It moves a target and starts from another preset, and nothing of it may be
// applied.
TEST(ControlInput, ABadSettingOrLimitOnALiveSessionRefusesTheWholeTick) {
  const ServiceWorld world;
  Stream told_wrong(world.channel()), other(world.channel());
  for (Stream* stream : {&told_wrong, &other}) stream->open(open_with_boxes(3));
  uint64_t sequence = 0;
  for (const BadValue& bad : kBadValues) {
    SCOPED_TRACE(bad.field);
    v1::Tick wrong = move_tick(++sequence, 1, 5.0);
    wrong.mutable_settings()->set_preset(v1::Settings::PRESET_PAPER);
    wrong.mutable_limits()->set_max_speed_mps(0.5);
    bad.set(*wrong.mutable_settings(), *wrong.mutable_tuning(), *wrong.mutable_limits());
    told_wrong.send(wrong);
    const auto refused = told_wrong.read();
    ASSERT_TRUE(refused && refused->has_tick_error());
    EXPECT_EQ(refused->tick_error().sequence(), sequence);
    EXPECT_EQ(refused->tick_error().code(), v1::TickError::CODE_INVALID_ARGUMENT);
    ASSERT_EQ(refused->tick_error().field_violations_size(), 1);
    const auto& violation = refused->tick_error().field_violations(0);
    EXPECT_EQ(violation.field(), std::string("tick.") + bad.field);
    EXPECT_NE(violation.description().find(bad.range), std::string::npos) << violation.description();

    ++sequence;
    for (Stream* stream : {&told_wrong, &other}) stream->send(move_tick(sequence, 1, 0.05 * sequence));
    auto after = told_wrong.read(), reference = other.read();
    ASSERT_TRUE(after && after->has_camera() && reference && reference->has_camera());
    for (auto* reply : {&*after, &*reference}) reply->mutable_camera()->clear_stage_times();
    EXPECT_EQ(after->SerializeAsString(), reference->SerializeAsString());
  }
}

TEST(ControlInput, AnUnknownIdAsksForAResync) {
  const ServiceWorld world;
  Stream stream(world.channel());
  const v1::SessionOpened opened = stream.open(open_with_boxes(2));
  stream.send(move_tick(1, 77, 0.0));
  const auto refused = stream.read();
  ASSERT_TRUE(refused && refused->has_tick_error());
  EXPECT_EQ(refused->tick_error().code(), v1::TickError::CODE_NOT_FOUND);
  ASSERT_TRUE(refused->tick_error().has_resync());
  EXPECT_EQ(refused->tick_error().resync().mirror_revision(), opened.mirror_revision());
  EXPECT_EQ(refused->tick_error().resync().mirror_hash(), opened.mirror_hash());
}

TEST(ControlInput, ATickThatComesTwiceIsRefusedOnce) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  for (int i = 0; i < 2; ++i) stream.send(move_tick(1, 1, 0.5));
  int answers = 0, refusals = 0;
  for (int i = 0; i < 2; ++i) {
    const auto reply = stream.read();
    ASSERT_TRUE(reply);
    answers += reply->has_camera();
    refusals += reply->has_tick_error();
  }
  EXPECT_EQ(answers, 1);
  EXPECT_EQ(refusals, 1);
}

uint64_t hits_of(const ServiceWorld& world, const std::string& limit) {
  const v1::GetServerStatsResponse stats = world.stats();
  for (const v1::LimitCount& hit : stats.limits())
    if (hit.limit() == limit) return hit.count();
  return 0;
}

TEST(ControlInput, AnOversizeMessageEndsItsCallOnly) {
  const ServiceWorld world({.max_message_bytes = 64 << 10});
  Stream good(world.channel()), oversize(world.channel());
  good.open(open_with_boxes(2));
  oversize.open(open_with_boxes(2));
  v1::Tick huge = move_tick(1, 1, 0.0);
  for (int i = 0; i < 40'000; ++i) huge.mutable_transforms()->add_positions(0.0);
  oversize.send(huge);
  const grpc::Status status = oversize.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(status.error_message().find("65536 are allowed (--max-message-mib)"), std::string::npos)
      << status.error_message();
  EXPECT_EQ(hits_of(world, "max-message-mib"), 1u);
  good.send(move_tick(1, 1, 0.1));
  EXPECT_TRUE(good.read()->has_camera());
}

// gRPC refuses it by its length, without taking it in.
TEST(ControlInput, AMessageFarOverTheLimitEndsItsCallOnly) {
  const ServiceWorld world({.max_message_bytes = 64 << 10});
  Stream good(world.channel()), oversize(world.channel());
  good.open(open_with_boxes(2));
  oversize.open(open_with_boxes(2));
  v1::Tick huge = move_tick(1, 1, 0.0);
  for (int i = 0; i < 400'000; ++i) huge.mutable_transforms()->add_positions(0.0);
  oversize.send(huge);
  EXPECT_EQ(oversize.finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  good.send(move_tick(1, 1, 0.1));
  EXPECT_TRUE(good.read()->has_camera());
}

TEST(ControlInput, ASceneNameThatLeavesTheFolderIsRefused) {
  const ServiceWorld world({.scene_dir = testing::TempDir()});
  for (const char* name : {"../etc/passwd.glb", "/etc/passwd.glb", "a/../../b.glb", ""}) {
    v1::OpenSession open = open_with_boxes(1);
    open.mutable_scene()->set_name(name);
    Stream stream(world.channel());
    stream.send(open);
    const grpc::Status status = stream.finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << name;
    ASSERT_EQ(fields_of(status).size(), 1u) << name;
    EXPECT_EQ(fields_of(status)[0], "open.scene.name");
  }
}

}  // namespace
}  // namespace sightline
