#include "tests/report/recorded_yard.h"

#include <gtest/gtest.h>

#include <cmath>

#include "client/scenario/scenario_session.h"
#include "server/wire/from_proto_values.h"

namespace sightline::test {
namespace {

constexpr uint64_t kStartNs = 1'700'000'000'000'000'000;
const glm::dvec3 kOriginM(1000, 20, -500);

// The yard is defined in the canonical frame and sent in the client's convention.
class Yard {
 public:
  explicit Yard(const RecordedYardOptions& options) : options_(options) {
    v1::Convention wire;
    wire.set_preset(options.convention);
    EXPECT_TRUE(read_convention(wire, "", c_));
    c_.origin_m = kOriginM;
  }

  v1::OpenSession open() const {
    v1::OpenSession open;
    open.mutable_convention()->set_preset(options_.convention);
    set(vector_to_client(c_, kOriginM), *open.mutable_world_origin());
    open.set_seed(5);
    open.set_label("yard");
    *open.add_instances() = box(1, {20, 0.1, 20}, {0, -0.1, 0});
    *open.add_instances() = box(2, {4, 2, 0.2}, {0, 2, -6});
    *open.add_instances() = box(kYardPillar, {0.5, 2, 0.5}, {1.5, 2, 3});
    for (const uint64_t id : {kYardFirst, kYardSecond, kYardThird}) *open.add_instances() = person(id);
    open.add_targets()->set_id(kYardFirst);
    open.add_targets()->set_id(kYardSecond);
    const Pose camera{{0, 3, 12}, look_rotation({0, -0.15, -1}, {0, 1, 0}, {1, 0, 0})};
    set_pose(camera_to_client(c_, camera), open.mutable_camera());
    open.mutable_tuning()->mutable_sample()->set_points(static_cast<uint32_t>(options_.points));
    open.mutable_diagnostics()->set_candidates(options_.candidates);
    return open;
  }

  v1::Tick tick(int i) const {
    v1::Tick tick;
    tick.set_sequence(static_cast<uint64_t>(i) + 1);
    tick.set_time_s(3.0 + i / 60.0);
    const double t = i / 60.0;
    move(kYardFirst, {3 * std::sin(t), 1, 3 * std::cos(t)}, t, tick);
    move(kYardSecond, {-2 * std::cos(0.5 * t), 1, 0}, 0, tick);
    if (options_.eventful) happen(i, tick);
    return tick;
  }

 private:
  void happen(int i, v1::Tick& tick) const {
    const double t = i / 60.0;
    if (i == kYardRefused) tick.mutable_transforms()->set_ids(0, 999);
    if (i == kYardCrateComes)
      *tick.mutable_delta()->add_added_instances() = box(kYardCrate, {0.4, 0.4, 0.4}, {0, 0.4, 2});
    if (i > kYardCrateComes && i < kYardCrateGoes) move(kYardCrate, {t, 0.4, 2}, 0, tick);
    if (i == kYardCrateGoes) tick.mutable_delta()->add_removed_ids(kYardCrate);
    if (i == kYardTargetsChange) {
      tick.mutable_targets()->add_targets()->set_id(kYardThird);
      tick.mutable_targets()->add_targets()->set_id(kYardFirst);
    }
    if (i == kYardPillarHides || i == kYardPillarShows) {
      v1::AttributeChange& change = *tick.mutable_delta()->add_changed_instances();
      change.set_id(kYardPillar);
      change.mutable_attributes()->set_visible(i == kYardPillarShows);
    }
    if (i == kYardSettings) {
      tick.mutable_settings()->set_move_response_s(0.3);
      tick.mutable_limits()->set_max_speed_mps(4.0);
    }
  }

  static void set(const glm::dvec3& v, v1::Vec3& out) { out.set_x(v.x), out.set_y(v.y), out.set_z(v.z); }

  v1::NewInstance box(uint64_t id, const glm::dvec3& half_extent_m, const glm::dvec3& place_m) const {
    v1::NewInstance instance;
    instance.set_id(id);
    set(glm::abs(vector_to_client(c_, half_extent_m)), *instance.mutable_shape()->mutable_box()->mutable_half_extent());
    set_pose(client_pose(place_m, 0), instance.mutable_pose());
    return instance;
  }

  v1::NewInstance person(uint64_t id) const {
    v1::NewInstance instance;
    instance.set_id(id);
    v1::Shape::Capsule& capsule = *instance.mutable_shape()->mutable_capsule();
    capsule.set_radius(0.35 / c_.metres_per_unit);
    capsule.set_half_height(0.55 / c_.metres_per_unit);
    set_pose(client_pose({static_cast<double>(id) - 11.0, 1, -1}, 0), instance.mutable_pose());
    return instance;
  }

  Pose client_pose(const glm::dvec3& place_m, double yaw) const {
    return {position_to_client(c_, place_m), rotation_to_client(c_, glm::angleAxis(yaw, glm::dvec3(0, 1, 0)))};
  }

  void move(uint64_t id, const glm::dvec3& place_m, double yaw, v1::Tick& tick) const {
    v1::Transforms& transforms = *tick.mutable_transforms();
    const Pose pose = client_pose(place_m, yaw);
    transforms.add_ids(id);
    for (const double value : {pose.position_m.x, pose.position_m.y, pose.position_m.z})
      transforms.add_positions(value);
    for (const double value : {pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w})
      transforms.add_rotations(static_cast<float>(value));
  }

  const RecordedYardOptions& options_;
  Convention c_;
};

v1::RecordingInfo info_of(const SamplerDevice& sampler, const RecordedYardOptions& options) {
  v1::RecordingInfo info;
  info.set_sampler(sampler.kind());
  info.set_session_id("recorded-yard");
  info.set_label("yard");
  info.set_server_version("1.2.3");
  info.set_seed(5);
  info.set_part(1);
  info.set_start_time_ns(kStartNs);
  info.set_snapshot_ticks(options.snapshot_ticks);
  return info;
}

// A session without a clock has none.
void set_times(int i, v1::StageTimes& times) {
  const auto k = static_cast<float>(i);
  times.set_queue_us(10 + k);
  times.set_scene_us(1 + k), times.set_bound_us(2), times.set_sample_us(100 + k);
  times.set_aggregate_us(40), times.set_move_us(20 + 2 * k);
  times.set_total_us(163 + 4 * k);
}

template <typename Message>
void put(RecordingWriter& writer, const Message& message, uint64_t log_ns) {
  EXPECT_TRUE(writer.write(message, log_ns).has_value());
}

void put_trouble(RecordingWriter& writer, int i, uint64_t log_ns) {
  if (i == kYardFault) {
    v1::Fault fault;
    fault.set_sequence(static_cast<uint64_t>(i) + 1);
    fault.set_stage("sample");
    fault.set_message("the device was away <for a moment>");
    put(writer, fault, log_ns);
  }
  if (i == kYardGap) {
    v1::Gap gap;
    gap.set_reason(v1::Gap::REASON_QUEUE_FULL);
    gap.set_messages(2);
    put(writer, gap, log_ns);
  }
}

}  // namespace

RecordedYard record_yard(SamplerDevice& sampler, const RecordedYardOptions& options) {
  const Yard yard(options);
  LocalWorld world("", sampler);
  auto session = LocalSession::open(yard.open(), world);
  EXPECT_TRUE(session.has_value()) << to_string(session.error());
  RecordedYard recorded;
  RecordingWriter writer(std::make_unique<StringSink>(recorded.bytes), info_of(sampler, options));
  put(writer, yard.open(), kStartNs);
  put(writer, (*session)->opened(), kStartNs);
  for (int i = 0; i < options.ticks; ++i) {
    const uint64_t log_ns = kStartNs + static_cast<uint64_t>(i + 1) * 16'666'667;
    const v1::Tick tick = yard.tick(i);
    v1::TickError rejection;
    put(writer, tick, log_ns);
    const bool applied = (*session)->apply(tick, rejection);
    EXPECT_EQ(applied, !(options.eventful && i == kYardRefused)) << rejection.message();
    if (!applied) put(writer, rejection, log_ns);
    if (options.eventful) put_trouble(writer, i, log_ns);
    if (!applied || (options.eventful && i % 25 == 3)) continue;  // refused, or merged into the next
    v1::CameraReply reply;
    EXPECT_TRUE((*session)->step(options.eventful && i % 40 == 5 ? 3 : 0, reply).has_value());
    set_times(i, *reply.mutable_stage_times());
    put(writer, reply, log_ns + 1'500'000);
    recorded.replies.push_back(std::move(reply));
    if (options.memory_every > 0 && recorded.replies.size() % static_cast<size_t>(options.memory_every) == 0) {
      v1::StepMemory memory;
      (*session)->write_memory(memory);
      put(writer, memory, log_ns + 2'000'000);
    }
  }
  if (options.finished) {
    EXPECT_TRUE(writer.finish().has_value());
  }
  return recorded;
}

}  // namespace sightline::test
