// Random scene deltas to a service that has more work than time: delta_storm COUNT [SEED]. A plain model
// (tests/support/plain_mirror.h) receives the same deltas. Exits with 0 when
//   - every reply has the revision and the hash of the model after the tick that it answers,
//   - exactly the ticks are refused that the model refuses,
//   - received = answered + merged + refused, as the client counts and as the service counts.
#include <grpcpp/grpcpp.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "server/base/random.h"
#include "server/scene/primitives.h"
#include "tests/service/service_world.h"
#include "tests/support/plain_mirror.h"

namespace {

using namespace sightline;

constexpr uint64_t kTargets = 2, kMostIds = 60;
// Ticks that wait for an answer at most: the client sends more than can be answered, but not all at once.
constexpr uint64_t kMostWaiting = 40;

// The model after a tick.
struct Expected {
  uint64_t revision = 0, hash = 0;
  bool refused = false;
};

class DeltaMaker {
 public:
  explicit DeltaMaker(uint64_t seed) : random_(seed, 0, RandomPurpose::kTest) {
    SceneDelta first;
    for (uint64_t id = 1; id <= kTargets; ++id) first.add.push_back(box(id, 1.5 * static_cast<double>(id - 1), 0));
    if (!model_.apply(first, {})) std::abort();
  }

  // The next tick, and what must come of it.
  v1::Tick next(Expected& expected) {
    SceneDelta delta;
    TransformUpdate moves;
    if (random_.next_below(16) == 0) delta.base_revision = model_.revision() + (random_.next_below(4) == 0);
    for (uint32_t left = random_.next_below(3); left > 0; --left) delta.remove.push_back(some_id(true));
    for (uint32_t left = random_.next_below(3); left > 0; --left)
      delta.add.push_back(box(some_id(false), offset(), offset()));
    for (uint32_t left = random_.next_below(2); left > 0; --left)
      delta.change.push_back({some_id(true), {.layers = random_.next_u32(), .opacity = opacity()}});
    for (uint32_t left = random_.next_below(3); left > 0; --left) {
      moves.ids.push_back(random_.next_below(2) == 0 ? 1 + random_.next_below(kTargets) : some_id(true));
      moves.poses.push_back({{offset(), 0, offset()}, {1, 0, 0, 0}});
    }
    expected.refused = !model_.apply(delta, moves);
    expected.revision = model_.revision(), expected.hash = model_.hash();
    return message(delta, moves);
  }

 private:
  // The id of a box that is there, or is not; now and then any id, so that some deltas are wrong. Targets stay.
  uint64_t some_id(bool taken) {
    uint64_t id = 0;
    for (int tries = 0; tries < 20; ++tries) {
      id = kTargets + 1 + random_.next_below(kMostIds - kTargets);
      if (model_.records().contains(id) == taken || random_.next_below(200) == 0) break;
    }
    return id;
  }
  double offset() { return 0.25 * static_cast<double>(random_.next_below(80)) - 10; }
  float opacity() { return 0.25f * static_cast<float>(random_.next_below(5)); }

  static NewInstance box(uint64_t id, double x, double z) {
    static GeometryStore store;
    static const auto geometry = store.intern(tessellate(BoxShape{{0.25f, 0.5f, 0.25f}}).value()).value();
    NewInstance instance;
    instance.id = id, instance.geometry = geometry, instance.pose.position_m = {x, 0, z};
    return instance;
  }

  v1::Tick message(const SceneDelta& delta, const TransformUpdate& moves) {
    v1::Tick tick;
    tick.set_sequence(++sequence_);
    tick.set_time_s(static_cast<double>(sequence_) / 60);
    v1::SceneDelta& wire = *tick.mutable_delta();
    if (delta.base_revision) wire.set_base_revision(*delta.base_revision);
    for (const uint64_t id : delta.remove) wire.add_removed_ids(id);
    for (const NewInstance& added : delta.add) write_box(added, *wire.add_added_instances());
    for (const AttributeChange& change : delta.change) {
      v1::AttributeChange& changed = *wire.add_changed_instances();
      changed.set_id(change.id);
      changed.mutable_attributes()->set_layers(change.attributes.layers);
      changed.mutable_attributes()->set_opacity(change.attributes.opacity);
    }
    for (size_t i = 0; i < moves.ids.size(); ++i) {
      tick.mutable_transforms()->add_ids(moves.ids[i]);
      for (int axis = 0; axis < 3; ++axis) tick.mutable_transforms()->add_positions(moves.poses[i].position_m[axis]);
    }
    return tick;
  }

 public:
  static void write_box(const NewInstance& instance, v1::NewInstance& wire) {
    wire.set_id(instance.id);
    v1::Vec3& half = *wire.mutable_shape()->mutable_box()->mutable_half_extent();
    half.set_x(0.25), half.set_y(0.5), half.set_z(0.25);
    wire.mutable_pose()->mutable_position()->set_x(instance.pose.position_m.x);
    wire.mutable_pose()->mutable_position()->set_z(instance.pose.position_m.z);
  }
  v1::OpenSession opening() const {
    v1::OpenSession open;
    open.mutable_camera()->mutable_position()->set_y(2);
    open.mutable_camera()->mutable_position()->set_z(8);
    for (const auto& [id, record] : model_.records()) {
      write_box(record, *open.add_instances());
      open.add_targets()->set_id(id);
    }
    return open;
  }
  uint64_t hash() const { return model_.hash(); }

 private:
  CounterRandom random_;
  test::PlainMirror model_;
  uint64_t sequence_ = 0;
};

struct Counts {
  uint64_t answered = 0, merged = 0, refused = 0, degraded = 0, wrong = 0;
  uint64_t all() const { return answered + merged + refused; }
};

void complain(Counts& counts, uint64_t sequence, const char* what) {
  if (++counts.wrong <= 10) std::printf("tick %llu: %s\n", static_cast<unsigned long long>(sequence), what);
}

void take(const v1::ControlResponse& reply, const std::vector<Expected>& expected, Counts& counts) {
  if (reply.has_tick_error()) {
    ++counts.refused;
    if (!expected[reply.tick_error().sequence()].refused)
      complain(counts, reply.tick_error().sequence(), "refused, but the model takes it");
  } else if (reply.has_camera()) {
    const v1::CameraReply& camera = reply.camera();
    const Expected& model = expected[camera.sequence()];
    ++counts.answered;
    counts.merged += camera.merged_ticks(), counts.degraded += camera.flags().degraded();
    if (model.refused) complain(counts, camera.sequence(), "answered, but the model refuses it");
    if (camera.mirror_hash() != model.hash || camera.mirror_revision() != model.revision)
      complain(counts, camera.sequence(), "another scene than the model's");
  }
}

// Another session, which has the stepping thread while the storm wants it.
void live_beside(const ServiceWorld& world, const std::atomic<bool>& ends) {
  while (!ends) {
    Stream stream(world.channel());
    stream.open(open_with_boxes(4));
    for (uint64_t i = 1; i <= 500 && !ends; ++i) {
      stream.send(move_tick(i, 1, 0.1));
      if (!stream.read()) break;
    }
  }
}

int storm(uint64_t count, uint64_t seed) {
  WorldOptions options;
  options.threads = 1;
  options.real_time = true;
  ServiceWorld world(options);
  world.device.make_maps_cost(std::chrono::microseconds(100));

  DeltaMaker maker(seed);
  std::vector<Expected> expected(count + 1);
  const v1::OpenSession open = maker.opening();
  std::vector<v1::Tick> ticks;
  for (uint64_t i = 1; i <= count; ++i) ticks.push_back(maker.next(expected[i]));

  const v1::GetServerStatsResponse before = world.stats();
  std::atomic<bool> ends{false};
  std::thread other([&] { live_beside(world, ends); });
  grpc::ClientContext context;
  const auto stub = v1::CameraControlService::NewStub(world.channel());
  const auto call = stub->Control(&context);
  v1::ControlRequest request;
  *request.mutable_open() = open;
  call->Write(request);
  v1::ControlResponse reply;
  if (!call->Read(&reply) || !reply.has_opened()) return std::puts("the session did not open"), 1;

  Counts counts;
  std::atomic<uint64_t> newest{0};
  std::thread reader([&] {
    while (call->Read(&reply)) {
      take(reply, expected, counts);
      newest = std::max(newest.load(), reply.has_camera() ? reply.camera().sequence() : reply.tick_error().sequence());
    }
    newest = count;  // the writer waits no longer, even after an error
  });
  for (v1::Tick& tick : ticks) {
    while (tick.sequence() > newest + kMostWaiting) std::this_thread::sleep_for(std::chrono::microseconds(200));
    request.mutable_tick()->Swap(&tick);
    call->Write(request);
  }
  call->WritesDone();
  reader.join();
  const grpc::Status status = call->Finish();
  ends = true;
  other.join();

  // The other session's ticks are answered one by one, so the sums hold for both together.
  const v1::GetServerStatsResponse after = world.stats();
  const uint64_t received = after.ticks() - before.ticks();
  const uint64_t done = after.steps() - before.steps() + after.merged_ticks() - before.merged_ticks() +
                        after.refused_ticks() - before.refused_ticks();
  std::printf(
      "%llu deltas: %llu answered, %llu merged, %llu refused, %llu of the answers degraded; the service received %llu "
      "ticks in all and "
      "answered, merged or refused %llu\n",
      static_cast<unsigned long long>(count), static_cast<unsigned long long>(counts.answered),
      static_cast<unsigned long long>(counts.merged), static_cast<unsigned long long>(counts.refused),
      static_cast<unsigned long long>(counts.degraded), static_cast<unsigned long long>(received),
      static_cast<unsigned long long>(done));
  if (!status.ok()) std::printf("the session ended with %s\n", status.error_message().c_str());
  if (counts.merged == 0) std::puts("nothing was merged: there was no overload");
  const bool good = status.ok() && counts.wrong == 0 && counts.all() == count && received == done && counts.merged > 0;
  std::puts(good ? "passed" : "failed");
  return good ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) return std::fputs("usage: delta_storm COUNT [SEED]\n", stderr), 2;
  return storm(std::strtoull(argv[1], nullptr, 10), argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1);
}
