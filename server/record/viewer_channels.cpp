#include "server/record/viewer_channels.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "foxglove/camera.pb.h"
#include "foxglove/frames.pb.h"
#include "foxglove/scene.pb.h"
#include "server/wire/from_proto_values.h"
#include "server/wire/short_name.h"

namespace sightline {
namespace {

constexpr char kWorld[] = "world", kCamera[] = "camera", kOptical[] = "camera_optical";
// Width of the picture in the calibration; a lens has no pixels.
constexpr int kPictureWidth = 1280;
constexpr double kFrustumDepthM = 1.0;

struct Colour {
  double r, g, b, a;
};
constexpr Colour kShapeColour{0.62, 0.66, 0.72, 0.55}, kTargetColour{0.98, 0.78, 0.20, 0.9},
    kCameraColour{0.15, 0.45, 0.95, 1.0};

Colour colour_of(v1::TargetState state) {
  switch (state) {
    case v1::TARGET_STATE_VISIBLE:
      return {0.10, 0.75, 0.30, 1.0};
    case v1::TARGET_STATE_PARTIAL:
      return {0.95, 0.70, 0.10, 1.0};
    case v1::TARGET_STATE_OCCLUDED:
      return {0.90, 0.20, 0.20, 1.0};
    default:
      return {0.60, 0.60, 0.60, 1.0};
  }
}

void set(foxglove::Color& out, const Colour& colour) {
  out.set_r(colour.r);
  out.set_g(colour.g);
  out.set_b(colour.b);
  out.set_a(colour.a);
}

template <typename Wire>  // Vector3, Point3
void set(Wire& out, const glm::dvec3& v) {
  out.set_x(v.x);
  out.set_y(v.y);
  out.set_z(v.z);
}

void set(foxglove::Quaternion& out, const glm::dquat& q) {
  out.set_x(q.x);
  out.set_y(q.y);
  out.set_z(q.z);
  out.set_w(q.w);
}

void set(foxglove::Pose& out, const Pose& pose) {
  set(*out.mutable_position(), pose.position_m);
  set(*out.mutable_orientation(), pose.rotation);
}

void set_time(google::protobuf::Timestamp& out, uint64_t time_ns) {
  out.set_seconds(static_cast<int64_t>(time_ns / 1'000'000'000));
  out.set_nanos(static_cast<int32_t>(time_ns % 1'000'000'000));
}

glm::dvec3 vector_of(const v1::Vec3& wire) {
  return {wire.x(), wire.y(), wire.z()};
}

Pose pose_of(const v1::Pose3& wire) {
  Pose pose{vector_of(wire.position()), {1, 0, 0, 0}};
  if (wire.has_rotation())
    pose.rotation = glm::normalize(
        glm::dquat(wire.rotation().w(), wire.rotation().x(), wire.rotation().y(), wire.rotation().z()));
  return pose;
}

// Converts from the canonical frame to the viewer's world, which follows the convention ROS.
Pose to_viewer(const Pose& canonical) {
  const Convention viewer = ros_convention();
  return {position_to_client(viewer, canonical.position_m), rotation_to_client(viewer, canonical.rotation)};
}

glm::dvec3 extent_to_viewer(const glm::dvec3& canonical) {
  return glm::abs(vector_to_client(ros_convention(), canonical));
}

void add_frame(foxglove::FrameTransforms& out, uint64_t time_ns, const char* parent, const std::string& child,
               const Pose& parent_from_child) {
  foxglove::FrameTransform& frame = *out.add_transforms();
  set_time(*frame.mutable_timestamp(), time_ns);
  frame.set_parent_frame_id(parent);
  frame.set_child_frame_id(child);
  set(*frame.mutable_translation(), parent_from_child.position_m);
  set(*frame.mutable_rotation(), parent_from_child.rotation);
}

// `place`: of the shape's centre in the entity; `up_m`: how far above it, along the shape's own axis, the sphere is.
void add_sphere(foxglove::SceneEntity& entity, const Colour& colour, const Pose& place, double up_m,
                const glm::dvec3& size_m) {
  foxglove::SpherePrimitive& sphere = *entity.add_spheres();
  set(*sphere.mutable_pose(), Pose{place.position_m + place.rotation * glm::dvec3(0, 0, up_m), place.rotation});
  set(*sphere.mutable_size(), size_m);
  set(*sphere.mutable_color(), colour);
}

void add_cylinder(foxglove::SceneEntity& entity, const Colour& colour, const Pose& place, const glm::dvec3& size_m) {
  foxglove::CylinderPrimitive& cylinder = *entity.add_cylinders();
  set(*cylinder.mutable_pose(), place);
  set(*cylinder.mutable_size(), size_m);
  cylinder.set_bottom_scale(1.0);
  cylinder.set_top_scale(1.0);
  set(*cylinder.mutable_color(), colour);
}

// The offset of a shape in its instance, in the viewer's frame.
glm::dvec3 offset_of(const v1::Shape& wire, const glm::dvec3& scale, const Convention& c) {
  return vector_to_client(ros_convention(), scale * vector_from_client(c, vector_of(wire.offset())));
}

// A shape that is no compound, with its centre at `place` in the entity. Long axes are along the client's up, which is
// the viewer's Z. An uneven scale is applied along the axes of the shape, which is exact for shapes that are not
// turned.
void add_part(foxglove::SceneEntity& entity, const v1::Shape& wire, const Pose& place, const glm::dvec3& scale,
              const Colour& colour, const Convention& c) {
  const auto sized = [&](double x, double y, double z) {  // canonical units of the client's length
    return extent_to_viewer(scale * glm::dvec3(x, y, z) * c.metres_per_unit);
  };
  switch (wire.shape_case()) {
    case v1::Shape::kBox: {
      foxglove::CubePrimitive& cube = *entity.add_cubes();
      set(*cube.mutable_pose(), place);
      set(*cube.mutable_size(),
          2.0 * extent_to_viewer(scale * extent_from_client(c, vector_of(wire.box().half_extent()))));
      set(*cube.mutable_color(), colour);
      return;
    }
    case v1::Shape::kSphere:
      return add_sphere(entity, colour, place, 0.0,
                        2.0 * sized(wire.sphere().radius(), wire.sphere().radius(), wire.sphere().radius()));
    case v1::Shape::kCapsule: {
      const double r = wire.capsule().radius(), h = wire.capsule().half_height();
      const glm::dvec3 round = 2.0 * sized(r, r, r), middle = 2.0 * sized(r, h, r);
      if (h > 0) add_cylinder(entity, colour, place, middle);
      add_sphere(entity, colour, place, middle.z / 2, round);
      add_sphere(entity, colour, place, -middle.z / 2, round);
      return;
    }
    case v1::Shape::kCylinder: {
      const double r = wire.cylinder().radius();
      return add_cylinder(entity, colour, place, 2.0 * sized(r, wire.cylinder().half_height(), r));
    }
    case v1::Shape::kCompound:
    case v1::Shape::SHAPE_NOT_SET:
      return;
  }
}

void add_shape(foxglove::SceneEntity& entity, const v1::NewInstance& instance, const Colour& colour,
               const Convention& c) {
  const v1::Shape& body = instance.shape();
  const glm::dvec3 scale = scale_from_client(c, instance.has_scale() ? vector_of(instance.scale()) : glm::dvec3(1.0));
  const glm::dvec3 offset = offset_of(body, scale, c);
  if (!body.has_compound()) return add_part(entity, body, {offset, {1, 0, 0, 0}}, scale, colour, c);
  for (const v1::Shape::Part& part : body.compound().parts()) {
    v1::Pose3 turn;
    *turn.mutable_rotation() = part.rotation();
    const glm::dquat rotation = part.has_rotation() ? pose_of(turn).rotation : glm::dquat(1, 0, 0, 0);
    const glm::dquat turned = rotation_to_client(ros_convention(), rotation_from_client(c, rotation));
    add_part(entity, part.shape(), {offset + offset_of(part.shape(), scale, c), turned}, scale, colour, c);
  }
}

void start_entity(foxglove::SceneEntity& entity, uint64_t time_ns, const std::string& frame, const std::string& id) {
  set_time(*entity.mutable_timestamp(), time_ns);
  entity.set_frame_id(frame);
  entity.set_id(id);
  entity.set_frame_locked(true);
}

foxglove::LinePrimitive& add_lines(foxglove::SceneEntity& entity, const Colour& colour, double thickness_px) {
  foxglove::LinePrimitive& lines = *entity.add_lines();
  lines.set_type(foxglove::LinePrimitive::LINE_LIST);
  set(*lines.mutable_pose(), Pose{});
  lines.set_thickness(thickness_px);
  lines.set_scale_invariant(true);
  set(*lines.mutable_color(), colour);
  return lines;
}

void add_line(foxglove::LinePrimitive& lines, const glm::dvec3& from, const glm::dvec3& to) {
  set(*lines.add_points(), from);
  set(*lines.add_points(), to);
}

// In the frame "camera": forward is +X, left +Y, up +Z.
void add_frustum(foxglove::SceneEntity& entity, double vertical_fov_rad, double aspect) {
  foxglove::LinePrimitive& lines = add_lines(entity, kCameraColour, 2.0);
  const double up = kFrustumDepthM * std::tan(vertical_fov_rad / 2), left = up * aspect;
  const glm::dvec3 corners[] = {{kFrustumDepthM, left, up},
                                {kFrustumDepthM, -left, up},
                                {kFrustumDepthM, -left, -up},
                                {kFrustumDepthM, left, -up}};
  for (int i = 0; i < 4; ++i) {
    add_line(lines, {0, 0, 0}, corners[i]);
    add_line(lines, corners[i], corners[(i + 1) % 4]);
  }
}

// Nodes of the scene file have no known pose before they move.
bool has_place(const SessionSnapshot::Instance& instance) {
  return instance.moved || instance.given;
}

void emit_log(foxglove::Log::Level level, const std::string& name, const std::string& text, uint64_t time_ns,
              const ViewerChannels::Emit& emit) {
  foxglove::Log log;
  set_time(*log.mutable_timestamp(), time_ns);
  log.set_level(level);
  log.set_name(name);
  log.set_message(text);
  emit(RecordTopic::kLog, log);
}

}  // namespace

void ViewerChannels::take_open(const v1::OpenSession& open, const LevelView* level) {
  level_ = level;
  *first_targets_.mutable_targets() = open.targets();
  Convention read;
  client_ = read_convention(open.convention(), "", read) ? read : gltf_convention();
  take_lens(open.lens());
}

// A lens that every session refuses must not decide the height of a picture, even where the rejection was lost.
void ViewerChannels::take_lens(const v1::Lens& wire) {
  Lens lens;
  if (read_lens(wire, client_, "lens", lens)) aspect_ = lens.aspect;
}

template <typename Visit>
void ViewerChannels::for_each_shown(Visit visit) const {
  size_t shown = 0;
  for (const auto& [id, instance] : session_.instances()) {
    if (!instance.there() || !has_place(instance)) continue;
    if (++shown > kMaxInstances) return;
    visit(id, instance);
  }
}

// The viewer's world stays where the client's was at the opening.
void ViewerChannels::follow_shift() {
  const auto& shift = session_.shift();
  client_.origin_m = vector_from_client(client_, {shift[0], shift[1], shift[2]});
}

// In the viewer's world. A node that was moved but never turned keeps its rotation of the file.
Pose ViewerChannels::place_of(uint64_t id, const SessionSnapshot::Instance& instance) const {
  const auto node = level_ && !instance.given ? level_->nodes.find(id)
                                              : std::map<uint64_t, LevelNode>::const_iterator();
  const bool of_level = level_ && !instance.given && node != level_->nodes.end();
  if (of_level && !instance.moved) return node->second.rest;
  Pose pose = instance.given ? pose_of(instance.given->pose()) : Pose{};
  if (instance.moved) pose.position_m = {instance.position[0], instance.position[1], instance.position[2]};
  const auto& r = instance.rotation;
  if (instance.turned) pose.rotation = glm::normalize(glm::dquat(r[3], r[0], r[1], r[2]));
  Convention then = client_;
  if (!instance.moved && !instance.added) then.origin_m = glm::dvec3(0.0);  // its pose is from before the shift
  Pose place = to_viewer(pose_from_client(then, pose));
  if (of_level && !instance.turned) place.rotation = node->second.rest.rotation;
  return place;
}

// Empty: the instance is not there, or its place is not known.
std::optional<Pose> ViewerChannels::place_of(uint64_t id) const {
  const auto instance = session_.instances().find(id);
  const bool in_level = level_ && level_->nodes.contains(id);
  if (instance == session_.instances().end()) return in_level ? std::optional(level_->nodes.at(id).rest) : std::nullopt;
  if (!instance->second.there() || !(has_place(instance->second) || in_level)) return std::nullopt;
  return place_of(id, instance->second);
}

const v1::Target* ViewerChannels::target_of(uint64_t id) const {
  const v1::TargetList& list = session_.targets() ? *session_.targets() : first_targets_;
  for (const v1::Target& target : list.targets())
    if (target.id() == id) return &target;
  return nullptr;
}

// The point that the camera aims at: where sight lines end. As in a step (targets_now.cpp).
std::optional<glm::dvec3> ViewerChannels::aim_of(uint64_t id) const {
  const std::optional<Pose> place = place_of(id);
  if (!place) return std::nullopt;
  glm::dmat3 linear(1.0);
  glm::dvec3 aim_m(0.0);
  const auto instance = session_.instances().find(id);
  const bool given = instance != session_.instances().end() && instance->second.given;
  if (level_ && !given) {
    const auto node = level_->nodes.find(id);
    if (node != level_->nodes.end()) linear = node->second.linear, aim_m = node->second.centre_m;
  } else if (given && instance->second.given->has_scale()) {
    const glm::dvec3 scale = scale_from_client(client_, vector_of(instance->second.given->scale()));
    linear = glm::dmat3(glm::dvec3(scale.x, 0, 0), glm::dvec3(0, scale.y, 0), glm::dvec3(0, 0, scale.z));
  }
  const v1::Target* target = target_of(id);
  if (target && target->has_aim_offset()) aim_m = vector_from_client(client_, vector_of(target->aim_offset()));
  return place->position_m + place->rotation * vector_to_client(ros_convention(), linear * aim_m);
}

std::string ViewerChannels::name_of(uint64_t id) const {
  if (level_)
    if (const auto node = level_->nodes.find(id); node != level_->nodes.end() && !node->second.name.empty())
      return node->second.name;
  return "target " + std::to_string(id);
}

// A node of the scene file that never moved.
bool ViewerChannels::is_at_rest(uint64_t id) const {
  const auto instance = session_.instances().find(id);
  if (instance == session_.instances().end()) return true;
  return instance->second.there() && !instance->second.given && !instance->second.moved;
}

bool ViewerChannels::was_removed(uint64_t id) const {
  const auto instance = session_.instances().find(id);
  return instance != session_.instances().end() && (!instance->second.there() || instance->second.given);
}

void ViewerChannels::emit_still(uint64_t time_ns, const Emit& emit) {
  follow_shift();
  shown_deltas_ = session_.deltas();
  foxglove::FrameTransforms frames;
  // The viewer's camera looks along +X; the frame of a picture looks along +Z, with +Y down.
  add_frame(frames, time_ns, kCamera, kOptical, {{0, 0, 0}, {0.5, -0.5, 0.5, -0.5}});
  foxglove::SceneUpdate shapes;
  foxglove::SceneEntityDeletion& all = *shapes.add_deletions();
  set_time(*all.mutable_timestamp(), time_ns);
  all.set_type(foxglove::SceneEntityDeletion::ALL);
  size_t nodes = 0;
  if (level_)
    for (const auto& [id, node] : level_->nodes)
      if (is_at_rest(id) && ++nodes <= kMaxInstances)
        add_frame(frames, time_ns, kWorld, viewer_frame_of(id), node.rest);
  for_each_shown([&](uint64_t id, const SessionSnapshot::Instance& instance) {
    if (!instance.moved) add_frame(frames, time_ns, kWorld, viewer_frame_of(id), place_of(id, instance));
    if (!instance.given || !instance.given->has_shape()) return;
    foxglove::SceneEntity& entity = *shapes.add_entities();
    start_entity(entity, time_ns, viewer_frame_of(id), viewer_frame_of(id));
    add_shape(entity, *instance.given, target_of(id) ? kTargetColour : kShapeColour, client_);
  });
  emit(RecordTopic::kStaticFrames, frames);
  emit(RecordTopic::kShapes, shapes);
  if (level_ && shown_deltas_ > 0) emit_removed(time_ns, emit);
}

void ViewerChannels::emit_level(uint64_t time_ns, const Emit& emit) const {
  if (!level_ || level_->shapes.entities().empty()) return;
  emit(RecordTopic::kLevel, level_->shapes);
  if (shown_deltas_ > 0) emit_removed(time_ns, emit);
  if (level_->left_out > 0)
    emit_log(foxglove::Log::INFO, "record",
             std::to_string(level_->left_out) + " triangles of the smallest nodes are left out of /scene/level",
             time_ns, emit);
}

// Nodes of the scene file that are not there any more.
void ViewerChannels::emit_removed(uint64_t time_ns, const Emit& emit) const {
  foxglove::SceneUpdate update;
  for (const auto& [id, node] : level_->nodes) {
    if (!was_removed(id)) continue;
    foxglove::SceneEntityDeletion& gone = *update.add_deletions();
    set_time(*gone.mutable_timestamp(), time_ns);
    gone.set_type(foxglove::SceneEntityDeletion::MATCHING_ID);
    gone.set_id(viewer_frame_of(id));
  }
  if (!update.deletions().empty()) emit(RecordTopic::kLevel, update);
}

void ViewerChannels::take_reply(const v1::CameraReply& reply, uint64_t time_ns, const Emit& emit) {
  follow_shift();
  if (session_.lens()) take_lens(*session_.lens());
  if (session_.deltas() != shown_deltas_) emit_still(time_ns, emit);
  const Pose camera = camera_to_client(ros_convention(), camera_from_client(client_, pose_of(reply.pose())));
  emit_frames(camera, time_ns, emit);
  foxglove::PoseInFrame pose;
  set_time(*pose.mutable_timestamp(), time_ns);
  pose.set_frame_id(kWorld);
  set(*pose.mutable_pose(), camera);
  emit(RecordTopic::kCameraPose, pose);
  emit_calibration(reply, time_ns, emit);
  emit_sight(reply, camera, time_ns, emit);

  v1::VisibilitySample visibility;
  visibility.set_time_s(reply.time_s());
  *visibility.mutable_targets() = reply.targets();
  visibility.set_status(reply.status());
  visibility.set_reason(reply.reason());
  visibility.set_cut(reply.cut());
  emit(RecordTopic::kVisibility, visibility);

  const bool changed = reply.status() != last_status_ || reply.reason() != last_reason_;
  last_status_ = reply.status();
  last_reason_ = reply.reason();
  if (changed)
    emit_log(foxglove::Log::INFO, "camera", short_name(reply.status()) + ": " + reply.reason_text(), time_ns, emit);
}

void ViewerChannels::emit_frames(const Pose& camera, uint64_t time_ns, const Emit& emit) const {
  foxglove::FrameTransforms frames;
  add_frame(frames, time_ns, kWorld, kCamera, camera);
  for_each_shown([&](uint64_t id, const SessionSnapshot::Instance& instance) {
    if (instance.moved) add_frame(frames, time_ns, kWorld, viewer_frame_of(id), place_of(id, instance));
  });
  emit(RecordTopic::kFrames, frames);
}

void ViewerChannels::emit_calibration(const v1::CameraReply& reply, uint64_t time_ns, const Emit& emit) const {
  const double width = kPictureWidth, height = std::round(width / aspect_);
  const double focal_px = height / 2 / std::tan(fov_from_client(client_, reply.field_of_view(), aspect_) / 2);
  foxglove::CameraCalibration calibration;
  set_time(*calibration.mutable_timestamp(), time_ns);
  calibration.set_frame_id(kOptical);
  calibration.set_width(kPictureWidth);
  calibration.set_height(static_cast<uint32_t>(height));
  for (const double k : {focal_px, 0.0, width / 2, 0.0, focal_px, height / 2, 0.0, 0.0, 1.0}) calibration.add_k(k);
  for (const double r : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) calibration.add_r(r);
  for (const double p : {focal_px, 0.0, width / 2, 0.0, 0.0, focal_px, height / 2, 0.0, 0.0, 0.0, 1.0, 0.0})
    calibration.add_p(p);
  emit(RecordTopic::kCalibration, calibration);
}

void ViewerChannels::emit_sight(const v1::CameraReply& reply, const Pose& camera, uint64_t time_ns,
                                const Emit& emit) const {
  foxglove::SceneUpdate sight;
  foxglove::SceneEntity& frustum = *sight.add_entities();
  start_entity(frustum, time_ns, kCamera, kCamera);
  add_frustum(frustum, fov_from_client(client_, reply.field_of_view(), aspect_), aspect_);
  foxglove::SceneEntity& lines = *sight.add_entities();
  start_entity(lines, time_ns, kWorld, "sight");
  for (const v1::TargetVisibility& target : reply.targets()) {
    const std::optional<glm::dvec3> aim = aim_of(target.id());
    if (!aim) continue;
    const Colour colour = colour_of(target.state());
    add_line(add_lines(lines, colour, 1.5), camera.position_m, *aim);
    foxglove::TextPrimitive& text = *lines.add_texts();
    set(*text.mutable_pose(), Pose{*aim, {1, 0, 0, 0}});
    text.set_billboard(true);
    text.set_scale_invariant(true);
    text.set_font_size(14);
    set(*text.mutable_color(), colour);
    text.set_text(name_of(target.id()) + ": " + std::to_string(std::lround(100 * target.filtered_share())) + " %");
  }
  emit(RecordTopic::kSight, sight);
}

void ViewerChannels::take_rejection(const v1::TickError& rejection, uint64_t time_ns, const Emit& emit) const {
  emit_log(foxglove::Log::WARNING, "tick",
           "tick " + std::to_string(rejection.sequence()) + " refused: " + rejection.message(), time_ns, emit);
}

void ViewerChannels::take_fault(const v1::Fault& fault, uint64_t time_ns, const Emit& emit) const {
  emit_log(foxglove::Log::ERROR, fault.stage(), fault.message(), time_ns, emit);
}

void ViewerChannels::take_gap(const v1::Gap& gap, uint64_t time_ns, const Emit& emit) const {
  emit_log(foxglove::Log::WARNING, "record", std::to_string(gap.messages()) + " messages are missing: " + gap.text(),
           time_ns, emit);
}

}  // namespace sightline
