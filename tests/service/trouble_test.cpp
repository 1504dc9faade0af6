// Failures of clients, disks and devices. Each one affects only the session that it belongs to.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "server/service/inbox.h"
#include "tests/service/service_world.h"
#include "tests/support/glb_builder.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

template <typename Condition>
void wait_until(const Condition& condition) {
  while (!condition()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

WorldOptions with_open_timeout(std::chrono::milliseconds timeout) {
  WorldOptions options;
  options.limits.open_timeout = timeout;
  return options;
}

// A scene folder with one file.
class SceneFolder {
 public:
  SceneFolder() {
    GlbBuilder builder;
    builder.triangle_node();
    builder.json["meshes"][0]["name"] = "triangle";
    const std::vector<std::byte> file = builder.glb();
    std::ofstream(folder_ / "one.glb")
        .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  }
  std::string path() const { return folder_.path(); }

 private:
  const test::TemporaryFolder folder_;
};

v1::Tick spawn_tick(uint64_t sequence, uint64_t id) {
  v1::Tick tick;
  tick.set_sequence(sequence);
  tick.set_time_s(static_cast<double>(sequence) / 60.0);
  v1::NewInstance& added = *tick.mutable_delta()->add_added_instances();
  added.set_id(id);
  added.mutable_mesh()->set_scene_name("one.glb");
  added.mutable_mesh()->set_mesh("triangle");
  return tick;
}

TEST(Trouble, ACallThatSaysNothingEndsAndGivesItsPlaceBack) {
  const ServiceWorld world(with_open_timeout(std::chrono::milliseconds(50)));
  Stream silent(world.channel());
  const grpc::Status status = silent.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_NE(status.error_message().find("--open-timeout-s"), std::string::npos) << status.error_message();
  EXPECT_EQ(world.streams.size(), 0u);
}

TEST(Trouble, AnOpenSessionMayBeSilentForAsLongAsItLikes) {
  const ServiceWorld world(with_open_timeout(std::chrono::milliseconds(50)));
  Stream quiet(world.channel());
  quiet.open(open_with_boxes(2));
  for (int i = 0; i < 3; ++i) Stream(world.channel()).finish();  // each sends nothing until its timeout
  quiet.send(move_tick(1, 1, 0.1));
  const auto reply = quiet.read();
  EXPECT_TRUE(reply && reply->has_camera());
}

TEST(Trouble, AnExceptionInAStepEndsItsSessionOnly) {
  ServiceWorld world;
  Stream unlucky(world.channel()), other(world.channel());
  unlucky.open(open_with_boxes(2));
  other.open(open_with_boxes(2));
  world.device.throw_next();
  unlucky.send(move_tick(1, 1, 0.1));
  EXPECT_EQ(unlucky.finish().error_code(), grpc::StatusCode::INTERNAL);
  other.send(move_tick(1, 1, 0.1));
  const auto reply = other.read();
  EXPECT_TRUE(reply && reply->has_camera());
}

TEST(Trouble, AStepThatMakesNoFiniteNumbersEndsItsSessionOnly) {
  ServiceWorld world;
  Stream unlucky(world.channel()), other(world.channel());
  unlucky.open(open_with_boxes(2));
  other.open(open_with_boxes(2));
  world.device.fail_next({ErrorCode::kInternal, "", "the camera's pose is not a finite number"});
  unlucky.send(move_tick(1, 1, 0.1));
  const grpc::Status status = unlucky.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INTERNAL);
  EXPECT_NE(status.error_message().find("the camera's pose is not a finite number"), std::string::npos)
      << status.error_message();
  wait_until([&] { return world.closed_with(grpc::StatusCode::INTERNAL) == 1; });
  other.send(move_tick(1, 1, 0.1));
  const auto reply = other.read();
  EXPECT_TRUE(reply && reply->has_camera());
}

TEST(Trouble, AStepThatFailsSaysThatItsTickWasApplied) {
  ServiceWorld world;
  Stream stream(world.channel());
  const uint64_t at_first = stream.open(open_with_boxes(2)).mirror_hash();
  world.device.fail_next({ErrorCode::kUnavailable, "", "the device was lost"});
  stream.send(move_tick(1, 1, 0.1));
  const auto failed = stream.read();
  ASSERT_TRUE(failed && failed->has_tick_error());
  EXPECT_NE(failed->tick_error().message().find("the tick was applied"), std::string::npos);
  v1::Tick empty;
  empty.set_sequence(2);
  empty.set_time_s(1.0);
  stream.send(empty);
  const auto next = stream.read();
  ASSERT_TRUE(next && next->has_camera());
  EXPECT_NE(next->camera().mirror_hash(), at_first);
  EXPECT_EQ(next->camera().merged_ticks(), 1u);
}

// Reading scenes may take seconds, and when a server stops, dozens of calls may wait for it.
TEST(Trouble, ACallThatEndedBeforeItsTurnIsNotOpenedAnyMore) {
  ServiceWorld world;
  Stream stream(world.channel());
  {
    const HeldLoaders held(world.loaders);
    stream.send(open_with_boxes(2));
    wait_until([&] { return world.clock_calls() > 0; });
    world.streams.end_all({grpc::StatusCode::UNAVAILABLE, "the server stopped"});
  }
  EXPECT_EQ(stream.finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(world.device.samplers_made(), 0u);
}

// There is one scheduler thread. If it had read the file, the mesh would be there when the other session is answered.
TEST(Trouble, AFileThatATickNamesIsReadByALoaderAndNoStepWaits) {
  const SceneFolder folder;
  ServiceWorld world({.scene_dir = folder.path(), .threads = 1});
  Stream spawning(world.channel()), other(world.channel());
  spawning.open(open_with_boxes(2));
  other.open(open_with_boxes(2));
  const size_t geometries = world.geometry_count();
  {
    const HeldLoaders held(world.loaders);
    const uint64_t before = world.clock_calls();
    spawning.send(spawn_tick(1, 50));
    wait_until([&] { return world.clock_calls() > before; });
    for (uint64_t i = 1; i <= 3; ++i) {
      other.send(move_tick(i, 1, 0.1));
      const auto reply = other.read();
      EXPECT_TRUE(reply && reply->has_camera());
    }
    EXPECT_EQ(world.geometry_count(), geometries);
    spawning.send(move_tick(2, 50, 1.0));
  }
  uint64_t answered = 0;
  while (answered < 2) {
    const auto reply = spawning.read();
    ASSERT_TRUE(reply && reply->has_camera()) << reply->ShortDebugString();
    answered = reply->camera().sequence();
  }
  EXPECT_EQ(world.geometry_count(), geometries + 1);
}

// The same for the table of a shape that a tick's settings need. Once the table exists, no loader is needed.
TEST(Trouble, ATableThatNewSettingsNeedIsBuiltByALoaderAndNoStepWaits) {
  ServiceWorld world({.threads = 1});
  Stream changing(world.channel()), other(world.channel());
  v1::OpenSession without_points = open_with_boxes(2);
  without_points.mutable_tuning()->mutable_sample()->set_points(0);
  changing.open(without_points);
  other.open(without_points);
  v1::Tick points = move_tick(1, 1, 0.1);
  points.mutable_tuning()->mutable_sample()->set_points(2);
  {
    const HeldLoaders held(world.loaders);
    const uint64_t before = world.clock_calls();
    changing.send(points);
    wait_until([&] { return world.clock_calls() > before; });
    for (uint64_t i = 1; i <= 3; ++i) {
      other.send(move_tick(i, 1, 0.1));
      const auto reply = other.read();
      EXPECT_TRUE(reply && reply->has_camera());
    }
    EXPECT_EQ(world.table_count(), 0u);
  }
  ASSERT_TRUE(changing.read()->has_camera());
  EXPECT_EQ(world.table_count(), 1u) << "both targets have one shape";

  const HeldLoaders held(world.loaders);
  points.set_sequence(4), points.set_time_s(1.0);
  other.send(points);
  const auto reply = other.read();
  EXPECT_TRUE(reply && reply->has_camera());
}

TEST(Trouble, AMeshThatIsInMemoryNeedsNoLoader) {
  const SceneFolder folder;
  ServiceWorld world({.scene_dir = folder.path()});
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  stream.send(spawn_tick(1, 50));
  ASSERT_TRUE(stream.read()->has_camera());
  const HeldLoaders held(world.loaders);
  stream.send(spawn_tick(2, 51));
  const auto reply = stream.read();
  EXPECT_TRUE(reply && reply->has_camera());
}

TEST(Trouble, AnErrorAboutALongNameStillArrives) {
  const SceneFolder folder;
  const ServiceWorld world({.scene_dir = folder.path()});
  v1::OpenSession open = open_with_boxes(1);
  open.mutable_scene()->set_name("one.glb");
  v1::NodeBinding& binding = *open.mutable_scene()->add_bindings();
  for (int i = 0; i < 20'000; ++i) binding.mutable_node()->append("\u00e9");
  binding.set_id(9);
  Stream stream(world.channel());
  stream.send(open);
  const grpc::Status status = stream.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND) << status.error_message();
  EXPECT_EQ(fields_of(status), std::vector<std::string>{"open.scene.bindings[0].node"});
}

TEST(Trouble, TheInboxCountsBytesInMemory) {
  v1::ControlRequest hollow;
  for (int i = 0; i < 1000; ++i) hollow.mutable_tick()->mutable_delta()->add_added_instances();
  ASSERT_LT(hollow.ByteSizeLong(), 3000u);
  Inbox inbox(100, 20'000);
  inbox.push(hollow, 0);
  EXPECT_TRUE(inbox.full());
}

// Parses the tick from its wire format.
double memory_by_count(const v1::ControlRequest& tick) {
  v1::ControlRequest read;
  EXPECT_TRUE(read.ParseFromString(tick.SerializeAsString()));
  return static_cast<double>(read.SpaceUsedLong()) / static_cast<double>(Inbox::bytes_of(read));
}

// Fills `part` of a small tick with each of its message fields, one after another; repeated fields get one more element
// each time. Does the same within those messages. Returns the largest ratio of a tick's memory to the size that the
// inbox counts for it. Compound shapes may hold compound shapes on the wire, so it goes `depth` messages deep.
double most_memory_by_count(v1::ControlRequest& tick, google::protobuf::Message& part, int depth = 14) {
  double most = memory_by_count(tick);
  if (depth == 0) return most;
  const google::protobuf::Reflection& reflection = *part.GetReflection();
  for (int i = 0; i < part.GetDescriptor()->field_count(); ++i) {
    const google::protobuf::FieldDescriptor* field = part.GetDescriptor()->field(i);
    if (field->message_type() == nullptr) continue;
    auto* inner = field->is_repeated() ? reflection.AddMessage(&part, field) : reflection.MutableMessage(&part, field);
    most = std::max(most, most_memory_by_count(tick, *inner, depth - 1));
    while (field->is_repeated() && tick.ByteSizeLong() <= Inbox::kSmallTick) {
      most = std::max(most, memory_by_count(tick));
      reflection.AddMessage(&part, field);
    }
    reflection.ClearField(&part, field);
  }
  return most;
}

TEST(Trouble, NoSmallTickTakesMoreMemoryThanItCountsFor) {
  v1::ControlRequest tick;
  const double most = most_memory_by_count(tick, *tick.mutable_tick());
  EXPECT_LE(most, 1.0);
  EXPECT_GT(most, 0.7) << "it counts for needlessly much";
}

// Small ticks fill the inbox by their number, before their bytes do. Ticks that are large on the wire count with their
// exact size.
TEST(Trouble, BytesOfTheInboxDoNotKeepSmallTicksOut) {
  const ServiceLimits limits;
  Inbox inbox(limits.inbox_messages + 1, limits.inbox_bytes);
  for (size_t i = 0; i < limits.inbox_messages; ++i) {
    EXPECT_FALSE(inbox.full());
    v1::ControlRequest request;
    request.mutable_tick()->set_sequence(i + 1);
    request.mutable_tick()->mutable_transforms()->mutable_ids()->Resize(20, 7);
    inbox.push(std::move(request), 0);
  }
  v1::ControlRequest large;
  large.mutable_tick()->mutable_transforms()->mutable_ids()->Resize(1000, 7);
  EXPECT_EQ(Inbox::bytes_of(large), large.SpaceUsedLong());
}

// A message counts from its arrival until it is worked through, also when it was put back meanwhile.
TEST(Trouble, TheInboxCountsTheBytesOfWhatIsInIt) {
  v1::ControlRequest tick;
  tick.mutable_tick()->set_sequence(1);
  Inbox inbox(100, 3 * Inbox::bytes_of(tick));
  const auto fill = [&] {
    for (int i = 0; i < 3; ++i) {
      EXPECT_FALSE(inbox.full()) << i;
      inbox.push(tick, 0);
    }
    EXPECT_TRUE(inbox.full());
  };
  fill();
  for (int i = 0; i < 3; ++i) (void)inbox.take_one();
  fill();
  std::deque<Inbox::Message> taken;
  inbox.take_all(taken);
  fill();
  inbox.clear();
  EXPECT_FALSE(inbox.full());
  inbox.put_back(taken);
  EXPECT_TRUE(inbox.full()) << "what was put back counts again";
  (void)inbox.take_one();
  EXPECT_FALSE(inbox.full());
}

TEST(Trouble, WhatIsPutBackIntoTheInboxIsTheOldestAgain) {
  Inbox inbox(100, 100'000);
  for (uint64_t i = 1; i <= 3; ++i) {
    v1::ControlRequest request;
    request.mutable_tick()->set_sequence(i);
    inbox.push(request, 0);
  }
  std::deque<Inbox::Message> taken;
  inbox.take_all(taken);
  EXPECT_TRUE(inbox.empty());
  taken.pop_front();
  v1::ControlRequest newer;
  newer.mutable_tick()->set_sequence(4);
  inbox.push(newer, 0);
  inbox.put_back(taken);
  EXPECT_TRUE(taken.empty());
  for (uint64_t i = 2; i <= 4; ++i) EXPECT_EQ(inbox.take_one().request.tick().sequence(), i);
  EXPECT_TRUE(inbox.empty());
}

}  // namespace
}  // namespace sightline
