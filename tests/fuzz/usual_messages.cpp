#include "tests/fuzz/usual_messages.h"

#include <cmath>

#include "server/wire/from_proto_scene.h"

namespace sightline::test {
namespace {

void set(v1::Vec3& out, double x, double y, double z) {
  out.set_x(x), out.set_y(y), out.set_z(z);
}

v1::Shape box(double x, double y, double z) {
  v1::Shape shape;
  set(*shape.mutable_box()->mutable_half_extent(), x, y, z);
  return shape;
}

v1::Shape capsule(double radius, double half_height) {
  v1::Shape shape;
  shape.mutable_capsule()->set_radius(radius), shape.mutable_capsule()->set_half_height(half_height);
  return shape;
}

}  // namespace

std::vector<v1::Shape> usual_shapes() {
  std::vector<v1::Shape> shapes{capsule(0.3, 0.6), box(0.2, 0.9, 0.2), box(2, 2, 0.2)};
  shapes.emplace_back().mutable_sphere()->set_radius(0.5);
  v1::Shape& cylinder = shapes.emplace_back();
  cylinder.mutable_cylinder()->set_radius(0.4), cylinder.mutable_cylinder()->set_half_height(0.8);
  v1::Shape& compound = shapes.emplace_back();
  for (int i = 0; i < 2; ++i) {
    v1::Shape::Part& part = *compound.mutable_compound()->add_parts();
    *part.mutable_shape() = capsule(0.2, 0.5);
    part.mutable_rotation()->set_w(1);
    part.mutable_shape()->mutable_offset()->set_x(0.5 * i);
  }
  return shapes;
}

std::shared_ptr<const Geometry> geometry_of(const v1::Shape& shape, SceneLibrary& library, GeometryStore& store) {
  v1::NewInstance instance;
  instance.set_id(1);
  *instance.mutable_shape() = shape;
  const Convention convention;
  const SceneSource source{library, store};
  return InstanceReader(source, convention).read(instance, "")->geometry;
}

void UsualMessages::place(v1::Pose3& out) {
  set(*out.mutable_position(), in(-6, 6), in(0, 2), in(-6, 6));
  out.mutable_rotation()->set_w(1);
}

void UsualMessages::add_instance(v1::NewInstance& out, uint64_t id) {
  const auto shapes = usual_shapes();
  out.set_id(id);
  *out.mutable_shape() = shapes[random_.next_below(static_cast<uint32_t>(shapes.size()))];
  place(*out.mutable_pose());
  set(*out.mutable_scale(), units_per_m_, units_per_m_, units_per_m_);
}

void UsualMessages::fill(google::protobuf::Message& message) {
  if (auto* added = dynamic_cast<v1::NewInstance*>(&message)) add_instance(*added, next_id_++);
  if (auto* changed = dynamic_cast<v1::AttributeChange*>(&message)) changed->set_id(1);
  if (auto* target = dynamic_cast<v1::Target*>(&message)) target->set_id(1 + random_.next_below(4));
  if (auto* rotation = dynamic_cast<v1::Quat*>(&message)) rotation->set_w(1);
  if (auto* shape = dynamic_cast<v1::Shape*>(&message)) *shape = box(0.5, 0.5, 0.5);
  if (auto* camera = dynamic_cast<v1::ObservedCamera*>(&message)) place(*camera->mutable_pose());
  if (auto* part = dynamic_cast<v1::Shape::Part*>(&message)) *part->mutable_shape() = box(0.5, 0.5, 0.5);
  if (auto* custom = dynamic_cast<v1::CustomConvention*>(&message)) {
    custom->set_x(v1::CustomConvention::AXIS_PLUS_X), custom->set_y(v1::CustomConvention::AXIS_PLUS_Y),
        custom->set_z(v1::CustomConvention::AXIS_PLUS_Z);
    custom->set_camera_forward(v1::CustomConvention::AXIS_MINUS_Z),
        custom->set_camera_up(v1::CustomConvention::AXIS_PLUS_Y);
    custom->set_metres_per_unit(1);
  }
}

v1::OpenSession UsualMessages::open() {
  v1::OpenSession open;
  const uint32_t convention = random_.next_below(10);
  if (convention < 5) open.mutable_convention()->set_preset(static_cast<v1::Convention::Preset>(1 + convention));
  if (convention == 5) {
    open.mutable_convention()->set_preset(v1::Convention::PRESET_CUSTOM);
    fill(*open.mutable_convention()->mutable_custom());
  }
  if (random_.next_below(2) == 0) open.mutable_settings()->set_preset(v1::Settings::PRESET_PAPER);
  if (open.convention().preset() == v1::Convention::PRESET_UNREAL) units_per_m_ = 100;
  open.set_seed(random_.next_u32());
  targets_ = 1 + random_.next_below(4);
  instances_ = targets_ + random_.next_below(6);
  for (; next_id_ <= instances_; ++next_id_) add_instance(*open.add_instances(), next_id_);
  for (uint64_t id = 1; id <= targets_; ++id) {
    v1::Target& target = *open.add_targets();
    target.set_id(id);
    if (random_.next_below(4) == 0) target.set_required(false);
    if (id == targets_ && instances_ > targets_ && random_.next_below(2) == 0) target.add_part_ids(targets_ + 1);
  }
  place(*open.mutable_camera());
  open.mutable_diagnostics()->set_candidates(random_.next_below(8) == 0);
  open.mutable_diagnostics()->set_depth_maps(random_.next_below(16) == 0);
  return open;
}

v1::Tick UsualMessages::tick(uint64_t sequence, double time_s) {
  v1::Tick tick;
  tick.set_sequence(sequence + 1);
  tick.set_time_s(time_s + 1.0 / 60);
  if (random_.next_below(4) == 0) tick.set_dt_s(1.0 / 60);
  const bool sends_velocities = random_.next_below(4) == 0;
  for (uint64_t id = 1; id <= targets_ + 1 && id <= instances_; ++id) {
    tick.mutable_transforms()->add_ids(id);
    const double angle = 0.03 * static_cast<double>(sequence) + static_cast<double>(id);
    for (const double at : {3 * std::cos(angle), 0.9, 3 * std::sin(angle)})
      tick.mutable_transforms()->add_positions(at * units_per_m_);
    for (int i = 0; sends_velocities && i < 3; ++i)
      tick.mutable_transforms()->add_velocities(static_cast<float>(in(-1, 1)));
  }
  if (random_.next_below(40) == 0) fill(*tick.mutable_delta()->add_added_instances());
  if (random_.next_below(40) == 0) fill(*tick.mutable_targets()->add_targets());
  if (random_.next_below(40) == 0)
    fill(*tick.mutable_observed_camera()), tick.mutable_observed_camera()->set_cut(random_.next_below(2) == 0);
  if (random_.next_below(40) == 0) tick.mutable_settings()->set_cut_after_s(0.5);
  if (random_.next_below(40) == 0) tick.mutable_step_control()->set_merge_into_next(true);
  if (random_.next_below(20) == 0) tick.mutable_step_control()->set_quality_level(random_.next_below(6));
  return tick;
}

}  // namespace sightline::test
