#include "server/service/self_test.h"

#include <string>
#include <utility>
#include <vector>

#include "server/session/session.h"
#include "server/wire/from_proto.h"

namespace sightline {
namespace {

constexpr uint64_t kFree = 1, kHidden = 2, kWall = 3;

void add_box(v1::OpenSession& open, uint64_t id, double x, double z, double half_width, double half_height) {
  v1::NewInstance& instance = *open.add_instances();
  instance.set_id(id);
  v1::Vec3& half = *instance.mutable_shape()->mutable_box()->mutable_half_extent();
  half.set_x(half_width), half.set_y(half_height), half.set_z(0.2);
  instance.mutable_pose()->mutable_position()->set_x(x);
  instance.mutable_pose()->mutable_position()->set_z(z);
}

// The camera is at z = 8 and looks along -z. The wall stands between it and the second target.
v1::OpenSession small_scene() {
  v1::OpenSession open;
  open.mutable_camera()->mutable_position()->set_z(8.0);
  add_box(open, kFree, -2.0, 0.0, 0.2, 0.5);
  add_box(open, kHidden, 2.0, 0.0, 0.2, 0.5);
  add_box(open, kWall, 1.0, 4.0, 0.9, 2.0);
  for (const uint64_t id : {kFree, kHidden}) open.add_targets()->set_id(id);
  return open;
}

Result<SessionAnswer> first_answer(const ServiceParts& parts) {
  std::vector<std::string> warnings;
  auto options = session_options_from_proto(small_scene(), SceneSource{parts.scenes, parts.geometry}, warnings);
  if (!options) return tl::unexpected(std::move(options.error()));
  options->extents = &parts.extents;
  auto session = Session::open(std::move(*options), parts.sampler.make_sampler(), parts.clock);
  if (!session) return tl::unexpected(std::move(session.error()));
  TickInput tick;
  tick.sequence = 1;
  if (Status applied = (*session)->apply(tick); !applied) return tl::unexpected(std::move(applied.error()));
  return (*session)->step();
}

}  // namespace

Status compute_first_step(const ServiceParts& parts) {
  const auto answer = first_answer(parts);
  if (!answer) return tl::unexpected(answer.error());
  const double free = answer->step.targets[0].visible_share, hidden = answer->step.targets[1].visible_share;
  if (free == 1.0 && hidden == 0.0) return {};
  return fail(ErrorCode::kInternal, "",
              "the step that the daemon tries at its start is wrong: " + std::to_string(free) +
                  " of the free target and " + std::to_string(hidden) +
                  " of the hidden one are visible, 1 and 0 are right");
}

}  // namespace sightline
