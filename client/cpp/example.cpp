// Moves two people behind a pillar, and prints where the camera goes: example [ADDRESS].
#include <cmath>
#include <cstdio>

#include "client/cpp/camera.h"

namespace v1 = sightline::v1;

constexpr uint64_t kAnna = 1, kBen = 2, kPillar = 3;

void add_person(v1::OpenSession& open, uint64_t id) {
  v1::NewInstance& person = *open.add_instances();
  person.set_id(id);
  person.mutable_shape()->mutable_capsule()->set_radius(0.3);
  person.mutable_shape()->mutable_capsule()->set_half_height(0.6);
  open.add_targets()->set_id(id);
}

void move(v1::Tick& tick, uint64_t id, double x) {  // in metres; +Y is up
  tick.mutable_transforms()->add_ids(id);
  for (const double value : {x, 0.9, 0.0}) tick.mutable_transforms()->add_positions(value);
}

int main(int argc, char** argv) {
  v1::OpenSession open;
  open.mutable_camera()->mutable_position()->set_y(1.6);
  open.mutable_camera()->mutable_position()->set_z(6.0);
  for (const uint64_t id : {kAnna, kBen}) add_person(open, id);
  v1::NewInstance& pillar = *open.add_instances();
  pillar.set_id(kPillar);
  v1::Vec3& half = *pillar.mutable_shape()->mutable_box()->mutable_half_extent();
  half.set_x(0.5), half.set_y(2.0), half.set_z(0.5);
  pillar.mutable_pose()->mutable_position()->set_z(2.0);

  auto camera = sightline::Camera::open({argc > 1 ? argv[1] : "127.0.0.1:50151"}, open);
  if (!camera) return std::fprintf(stderr, "%s\n", to_string(camera.error()).c_str()), 1;
  for (int frame = 0; frame < 300; ++frame) {
    v1::Tick tick;
    tick.set_time_s(frame / 60.0);
    move(tick, kAnna, 3 * std::sin(frame / 60.0) - 0.6);
    move(tick, kBen, 3 * std::sin(frame / 60.0) + 0.6);
    const auto answer = camera->tick(tick);
    if (!answer) return std::fprintf(stderr, "%s\n", to_string(answer.error()).c_str()), 1;
    const auto* reply = std::get_if<v1::CameraReply>(&*answer);
    if (!reply) continue;  // refused: a TickError, which names the field
    const v1::Vec3& p = reply->pose().position();
    std::printf("%.2f s  camera (%.2f, %.2f, %.2f)  visible %.0f%% %.0f%%\n", reply->time_s(), p.x(), p.y(), p.z(),
                100 * reply->targets(0).visible_share(), 100 * reply->targets(1).visible_share());
  }
  return camera->close() ? 0 : 1;
}
