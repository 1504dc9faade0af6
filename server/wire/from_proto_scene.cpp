#include "server/wire/from_proto_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "server/base/check.h"
#include "server/scene/primitives.h"
#include "server/wire/from_proto_values.h"

namespace sightline {
namespace {

constexpr double kMinSizeM = 1e-4, kMaxSizeM = 1e5;
constexpr double kMinScale = 1e-4, kMaxScale = 1e4;
constexpr double kMinUnitM = 1e-6, kMaxUnitM = 1e6;
constexpr double kMaxOffsetM = 1e5;
// Geometry is kept in single precision: a smaller shape, so far from its instance's origin, would lose its form.
constexpr double kMinSizePerOffset = 1e-6;
constexpr int kMaxParts = 64;
constexpr char kAxisNames[] = "xyz";

Status check_client_id(uint64_t id, const std::string& field) {
  if (id != 0 && id < kAssetIdBit) return {};
  std::string text = "must be in [1, 2^63), got " + std::to_string(id);
  // Engines number objects by signed numbers, and a negative one has become this id by the extension of its sign.
  if (const auto negative = static_cast<int64_t>(id); negative < 0 && negative >= std::numeric_limits<int32_t>::min())
    text += ", which is " + std::to_string(negative) +
            " as a signed number; convert a 32-bit id to an unsigned one first: " +
            std::to_string(static_cast<uint32_t>(id));
  return invalid(field, std::move(text));
}

std::string axis_field(const std::string& field, int axis) {
  return field + '.' + kAxisNames[axis];
}

// A size in client units, checked in metres, where its range is stated.
Status read_size(double wire, double metres_per_unit, double min_m, const std::string& field, float& out_m) {
  const double size_m = wire * metres_per_unit;
  out_m = static_cast<float>(size_m);
  if (wire == 0 && min_m == 0) return {};
  if (size_m >= kMinSizeM && size_m <= kMaxSizeM) {
    out_m = std::clamp(out_m, 1e-4f, 1e5f);  // rounding to float must not leave the range
    return {};
  }
  char text[128];
  std::snprintf(text, sizeof text, "must be in [1e-4, 1e5] m%s, got %g m", min_m == 0 ? " or 0" : "", size_m);
  return invalid(field, text);
}

Result<Shape> read_box(const v1::Shape::Box& wire, const Convention& c, const std::string& field) {
  const std::string name = field + ".half_extent";
  glm::dvec3 units(0.0);
  if (Status ok = read_vector(wire.half_extent(), name, units); !ok) return tl::unexpected(ok.error());
  glm::vec3 client_m;
  for (int axis = 0; axis < 3; ++axis)
    if (Status ok = read_size(units[axis], c.metres_per_unit, kMinSizeM, axis_field(name, axis), client_m[axis]); !ok)
      return tl::unexpected(ok.error());
  return BoxShape{glm::vec3(scale_from_client(c, client_m))};
}

Result<Shape> read_sphere(const v1::Shape::Sphere& wire, const Convention& c, const std::string& field) {
  SphereShape sphere;
  Status ok = read_size(wire.radius(), c.metres_per_unit, kMinSizeM, field + ".radius", sphere.radius_m);
  if (!ok) return tl::unexpected(ok.error());
  return sphere;
}

// Capsule and cylinder need no rotation, because the image of the client's up axis is canonical +Y or -Y.
template <typename Round, typename Wire>
Result<Shape> read_round(const Wire& wire, double min_half_height_m, const Convention& c, const std::string& field) {
  Round round;
  Status ok = read_size(wire.radius(), c.metres_per_unit, kMinSizeM, field + ".radius", round.radius_m);
  if (ok)
    ok = read_size(wire.half_height(), c.metres_per_unit, min_half_height_m, field + ".half_height",
                   round.half_height_m);
  if (!ok) return tl::unexpected(ok.error());
  return round;
}

Result<Shape> read_shape(const v1::Shape& wire, const Convention& c, const std::string& field) {
  switch (wire.shape_case()) {
    case v1::Shape::kBox:
      return read_box(wire.box(), c, field + ".box");
    case v1::Shape::kSphere:
      return read_sphere(wire.sphere(), c, field + ".sphere");
    case v1::Shape::kCapsule:
      return read_round<CapsuleShape>(wire.capsule(), 0.0, c, field + ".capsule");
    case v1::Shape::kCylinder:
      return read_round<CylinderShape>(wire.cylinder(), kMinSizeM, c, field + ".cylinder");
    case v1::Shape::kCompound:
      return invalid(field + ".compound", "a part must be a box, sphere, capsule or cylinder");
    case v1::Shape::SHAPE_NOT_SET:
      break;
  }
  return invalid(field, "must be a box, sphere, capsule, cylinder or compound");
}

Status read_offset(const v1::Shape& wire, const Convention& c, const std::string& field, glm::dvec3& out_m) {
  const std::string name = field + ".offset";
  glm::dvec3 units(0.0);
  if (Status ok = read_vector(wire.offset(), name, units); !ok) return ok;
  out_m = vector_from_client(c, units);
  for (int axis = 0; axis < 3; ++axis)
    if (std::abs(units[axis]) * c.metres_per_unit > kMaxOffsetM)
      return invalid(axis_field(name, axis), "must be within 1e5 m");
  return {};
}

double least_size_m(const Shape& shape) {
  if (const auto* box = std::get_if<BoxShape>(&shape))
    return std::min({box->half_extent_m.x, box->half_extent_m.y, box->half_extent_m.z});
  if (const auto* sphere = std::get_if<SphereShape>(&shape)) return sphere->radius_m;
  if (const auto* capsule = std::get_if<CapsuleShape>(&shape)) return capsule->radius_m;
  const auto& cylinder = std::get<CylinderShape>(shape);
  return std::min(cylinder.radius_m, cylinder.half_height_m);
}

Status check_form(const Shape& shape, const glm::dvec3& offset_m, const std::string& field) {
  const double offset = glm::length(offset_m), least_m = least_size_m(shape);
  if (least_m >= kMinSizePerOffset * offset) return {};
  char text[128];
  std::snprintf(text, sizeof text, "must be at most 1e6 times the shape's least size, which is %g m, got %g m", least_m,
                offset);
  return invalid(field, text);
}

// A shape that is no compound, turned by `rotation` (client) about its centre and moved by `body_m` beyond its own
// offset.
Result<PlacedShape> read_part(const v1::Shape& wire, const glm::dquat& rotation, const glm::dvec3& body_m,
                              const Convention& c, const std::string& field) {
  auto shape = read_shape(wire, c, field);
  if (!shape) return tl::unexpected(std::move(shape.error()));
  glm::dvec3 offset_m(0.0);
  if (Status ok = read_offset(wire, c, field, offset_m); !ok) return tl::unexpected(ok.error());
  if (Status ok = check_form(*shape, body_m + offset_m, field + ".offset"); !ok) return tl::unexpected(ok.error());
  return PlacedShape{*shape, {body_m + offset_m, rotation_from_client(c, rotation)}};
}

// The shapes of a body, in the frame of its instance.
Result<std::vector<PlacedShape>> read_body(const v1::Shape& wire, const Convention& c, const std::string& field) {
  std::vector<PlacedShape> body;
  const auto add = [&](Result<PlacedShape> part) -> Status {
    if (!part) return tl::unexpected(std::move(part.error()));
    body.push_back(std::move(*part));
    return {};
  };
  Status ok;
  if (!wire.has_compound()) {
    ok = add(read_part(wire, {1, 0, 0, 0}, {0, 0, 0}, c, field));
  } else {
    const std::string list = field + ".compound.parts";
    const int count = wire.compound().parts_size();
    if (count < 1 || count > kMaxParts) return invalid(list, "must hold 1 to 64 shapes, got " + std::to_string(count));
    glm::dvec3 body_m(0.0);
    ok = read_offset(wire, c, field, body_m);
    for (int i = 0; ok && i < count; ++i) {
      const v1::Shape::Part& part = wire.compound().parts(i);
      const std::string name = indexed(list, static_cast<size_t>(i));
      glm::dquat rotation(1, 0, 0, 0);
      if (part.has_rotation()) ok = read_rotation(part.rotation(), name + ".rotation", rotation);
      if (ok) ok = add(read_part(part.shape(), rotation, body_m, c, name + ".shape"));
    }
  }
  if (!ok) return tl::unexpected(std::move(ok.error()));
  return body;
}

// A single shape at its instance's origin is the mesh of that shape, to the bit.
Result<MeshData> tessellate_body(const std::vector<PlacedShape>& body) {
  const bool is_plain = body.size() == 1 && body[0].body_from_shape.position_m == glm::dvec3(0.0) &&
                        body[0].body_from_shape.rotation == glm::dquat(1, 0, 0, 0);
  return is_plain ? tessellate(body[0].shape) : tessellate(std::span<const PlacedShape>(body));
}

Status read_scale(const v1::Vec3& wire, const std::string& field, glm::dvec3& out) {
  const glm::dvec3 scale(wire.x(), wire.y(), wire.z());
  for (int axis = 0; axis < 3; ++axis) {
    const std::string name = axis_field(field, axis);
    if (Status ok = check_range(name.c_str(), scale[axis], kMinScale, kMaxScale); !ok) return ok;
  }
  out = scale;
  return {};
}

Status read_attributes(const v1::Attributes& wire, const std::string& field, InstanceAttributes& out) {
  if (wire.has_layers()) out.layers = wire.layers();
  if (wire.has_opacity()) out.opacity = wire.opacity();
  if (wire.has_occludes()) out.occludes = wire.occludes();
  if (wire.has_collides()) out.collides = wire.collides();
  if (wire.has_visible()) out.visible = wire.visible();
  const std::string opacity = field + ".opacity";
  return check_range(opacity.c_str(), out.opacity, 0.0, 1.0);
}

Result<std::shared_ptr<const SceneAsset>> find_by_hash(const std::string& hex, const SceneSource& source,
                                                       const std::string& field) {
  ContentHash hash;
  if (!from_hex(hex, hash)) return invalid(field, "must be 32 hexadecimal digits");
  auto asset = source.library.find(hash, source.reader);
  if (!asset) return fail(asset.error().code, field, asset.error().message);
  return asset;
}

Result<std::shared_ptr<const SceneAsset>> find_by_name(const std::string& name, const SceneSource& source,
                                                       const std::string& field) {
  auto asset = source.library.load_named(name, source.work);
  if (!asset) return fail(asset.error().code, field, asset.error().message);
  return asset;
}

Result<std::vector<NodeBinding>> read_bindings(const v1::SceneRef& wire, const std::string& field) {
  std::vector<NodeBinding> bindings;
  for (int i = 0; i < wire.bindings_size(); ++i) {
    const v1::NodeBinding& binding = wire.bindings(i);
    if (Status ok = check_client_id(binding.id(), indexed(field, static_cast<size_t>(i)) + ".id"); !ok)
      return tl::unexpected(ok.error());
    bindings.push_back({binding.node(), binding.id()});
  }
  return bindings;
}

tl::unexpected<Error> wrong_count(const char* field, int got, const char* of, int expected) {
  return invalid(std::string("tick.transforms.") + field,
                 "must hold " + std::to_string(expected) + " numbers (" + of + "), got " + std::to_string(got));
}

Status check_counts(const v1::Transforms& wire) {
  const int n = wire.ids_size();
  if (wire.positions_size() / 3 != n || wire.positions_size() % 3 != 0)
    return wrong_count("positions", wire.positions_size(), "3 for each id", 3 * n);
  if (wire.rotations_size() != 0 && (wire.rotations_size() / 4 != n || wire.rotations_size() % 4 != 0))
    return wrong_count("rotations", wire.rotations_size(), "4 for each id, or none", 4 * n);
  if (wire.velocities_size() != 0 && (wire.velocities_size() / 3 != n || wire.velocities_size() % 3 != 0))
    return wrong_count("velocities", wire.velocities_size(), "3 for each id, or none", 3 * n);
  if (wire.angular_velocities_size() != 0 &&
      (wire.angular_velocities_size() / 3 != n || wire.angular_velocities_size() % 3 != 0))
    return wrong_count("angular_velocities", wire.angular_velocities_size(), "3 for each id, or none", 3 * n);
  return {};
}

// The first number that is not finite, among `count` of them.
template <typename Numbers>
Status check_finite(const Numbers& numbers, const char* field) {
  for (int i = 0; i < numbers.size(); ++i)
    if (!std::isfinite(numbers[i]))
      return invalid(indexed(std::string("tick.transforms.") + field, static_cast<size_t>(i)),
                     "must be finite, got " + std::to_string(numbers[i]));
  return {};
}

// Rotation i of the packed array, x y z w on the wire.
glm::dquat packed_rotation(const v1::Transforms& wire, int i) {
  return {wire.rotations(4 * i + 3), wire.rotations(4 * i), wire.rotations(4 * i + 1), wire.rotations(4 * i + 2)};
}

template <typename Numbers>
glm::dvec3 packed_vector(const Numbers& numbers, int i) {
  return {numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]};
}

}  // namespace

Result<NewInstance> InstanceReader::read(const v1::NewInstance& wire, const std::string& field) {
  NewInstance out;
  out.id = wire.id();
  if (Status ok = check_client_id(wire.id(), field + ".id"); !ok) return tl::unexpected(ok.error());
  Pose pose;
  if (Status ok = read_pose(wire.pose(), field + ".pose", pose); !ok) return tl::unexpected(ok.error());
  out.pose = pose_from_client(convention_, pose);
  glm::dvec3 scale(1.0);
  if (wire.has_scale())
    if (Status ok = read_scale(wire.scale(), field + ".scale", scale); !ok) return tl::unexpected(ok.error());
  const glm::dvec3 s = scale_from_client(convention_, scale);
  out.linear = glm::dmat3({s.x, 0, 0}, {0, s.y, 0}, {0, 0, s.z});
  if (Status ok = read_attributes(wire.attributes(), field + ".attributes", out.attributes); !ok)
    return tl::unexpected(ok.error());
  auto geometry = read_geometry(wire, field);
  if (!geometry) return tl::unexpected(std::move(geometry.error()));
  out.geometry = std::move(*geometry);
  return out;
}

std::vector<std::shared_ptr<const SceneAsset>> InstanceReader::assets() const {
  std::vector<Asset> assets;
  for (const auto& [name, asset] : assets_) assets.push_back(asset);
  return assets;
}

Result<std::shared_ptr<const Geometry>> InstanceReader::read_geometry(const v1::NewInstance& wire,
                                                                      const std::string& field) {
  if (wire.has_mesh()) return read_mesh(wire.mesh(), field + ".mesh");
  if (!wire.has_shape()) return invalid(field + ".geometry", "needs a shape or a mesh");
  auto body = read_body(wire.shape(), convention_, field + ".shape");
  if (!body) return tl::unexpected(std::move(body.error()));
  auto mesh = tessellate_body(*body);
  if (!mesh) return fail(mesh.error().code, field + ".shape", mesh.error().message);
  return source_.store.intern(std::move(*mesh));
}

Result<std::shared_ptr<const Geometry>> InstanceReader::read_mesh(const v1::MeshRef& wire, const std::string& field) {
  auto asset = find_asset(wire, field);
  if (!asset) return tl::unexpected(std::move(asset.error()));
  const std::vector<std::string>& names = (*asset)->mesh_names;
  const auto found = std::find(names.begin(), names.end(), wire.mesh());
  if (found == names.end()) return fail(ErrorCode::kNotFound, field + ".mesh", "the file has no mesh of that name");
  if (std::find(found + 1, names.end(), wire.mesh()) != names.end())
    return invalid(field + ".mesh", "the file has several meshes of that name");
  auto geometry = (*asset)->meshes[static_cast<size_t>(found - names.begin())];
  if (!geometry) return invalid(field + ".mesh", "has no triangles");
  return geometry;
}

Result<InstanceReader::Asset> InstanceReader::find_asset(const v1::MeshRef& wire, const std::string& field) {
  const bool by_hash = wire.has_scene_hash();
  if (!by_hash && !wire.has_scene_name()) return invalid(field + ".source", "needs scene_name or scene_hash");
  const std::string& key = by_hash ? wire.scene_hash() : wire.scene_name();
  if (const auto known = assets_.find(key); known != assets_.end()) return known->second;
  auto asset = by_hash ? find_by_hash(key, source_, field + ".scene_hash")
                       : find_by_name(key, source_, field + ".scene_name");
  if (asset) assets_[key] = *asset;
  return asset;
}

Result<LoadedScene> read_scene(const v1::SceneRef& wire, const SceneSource& source, const Convention& convention,
                               const std::string& field) {
  if (wire.source_case() == v1::SceneRef::SOURCE_NOT_SET) return invalid(field + ".source", "needs name or hash");
  const double metres_per_unit = wire.has_metres_per_unit() ? wire.metres_per_unit() : 1.0;
  const std::string unit_field = field + ".metres_per_unit";
  if (Status ok = check_range(unit_field.c_str(), metres_per_unit, kMinUnitM, kMaxUnitM); !ok)
    return tl::unexpected(std::move(ok.error()));
  glm::dvec3 place(0.0);
  if (Status ok = read_vector(wire.position(), field + ".position", place); !ok)
    return tl::unexpected(std::move(ok.error()));
  auto bindings = read_bindings(wire, field + ".bindings");
  if (!bindings) return tl::unexpected(std::move(bindings.error()));
  auto asset = wire.has_hash() ? find_by_hash(wire.hash(), source, field + ".hash")
                               : find_by_name(wire.name(), source, field + ".name");
  if (!asset) return tl::unexpected(std::move(asset.error()));
  auto instances = instantiate(**asset, *bindings, source.store);
  if (!instances) {
    const Error& e = instances.error();
    return fail(e.code, e.field.starts_with("bindings") ? field + "." + e.field : field, e.message);
  }
  const glm::dvec3 from_file_m = convention.origin_m - vector_from_client(convention, place);
  for (NewInstance& instance : *instances) {
    instance.pose.position_m = instance.pose.position_m * metres_per_unit - from_file_m;
    instance.linear *= metres_per_unit;
  }
  return LoadedScene{std::move(*asset), std::move(*instances)};
}

Status read_target(const v1::Target& wire, const Convention& convention, const std::string& field, Target& out) {
  out.instance_id = wire.id();
  if (wire.has_weight()) out.weight = wire.weight();
  if (wire.has_required()) out.required = wire.required();
  if (wire.has_layer_mask()) out.layer_mask = wire.layer_mask();
  out.attached_ids.assign(wire.attached_ids().begin(), wire.attached_ids().end());
  out.ignored_ids.assign(wire.ignored_ids().begin(), wire.ignored_ids().end());
  out.part_ids.assign(wire.part_ids().begin(), wire.part_ids().end());
  if (!wire.has_aim_offset()) return {};
  glm::dvec3 offset(0.0);
  if (Status ok = read_vector(wire.aim_offset(), field + ".aim_offset", offset); !ok) return ok;
  out.aim_offset_m = vector_from_client(convention, offset);
  return {};
}

Status read_delta(const v1::SceneDelta& wire, InstanceReader& instances, const std::string& field, SceneDelta& out) {
  if (wire.has_base_revision()) out.base_revision = wire.base_revision();
  out.remove.assign(wire.removed_ids().begin(), wire.removed_ids().end());
  for (int i = 0; i < wire.added_instances_size(); ++i) {
    auto instance = instances.read(wire.added_instances(i),
                                   indexed(field + ".added_instances", static_cast<size_t>(i)));
    if (!instance) return tl::unexpected(std::move(instance.error()));
    out.add.push_back(std::move(*instance));
  }
  for (int i = 0; i < wire.changed_instances_size(); ++i) {
    AttributeChange change{wire.changed_instances(i).id(), {}};
    const std::string path = indexed(field + ".changed_instances", static_cast<size_t>(i)) + ".attributes";
    if (Status ok = read_attributes(wire.changed_instances(i).attributes(), path, change.attributes); !ok) return ok;
    out.change.push_back(change);
  }
  return {};
}

Status read_transforms(const v1::Transforms& wire, const Convention& convention, TickInput& out) {
  if (Status ok = check_counts(wire); !ok) return ok;
  if (Status ok = check_finite(wire.positions(), "positions"); !ok) return ok;
  if (Status ok = check_finite(wire.rotations(), "rotations"); !ok) return ok;
  if (Status ok = check_finite(wire.velocities(), "velocities"); !ok) return ok;
  if (Status ok = check_finite(wire.angular_velocities(), "angular_velocities"); !ok) return ok;

  out.transforms.ids.assign(wire.ids().begin(), wire.ids().end());
  out.transforms.poses.resize(out.transforms.ids.size());
  out.keeps_rotations = wire.rotations_size() == 0;
  for (int i = 0; i < wire.ids_size(); ++i) {
    Pose& pose = out.transforms.poses[static_cast<size_t>(i)];
    pose.position_m = position_from_client(convention, packed_vector(wire.positions(), i));
    if (out.keeps_rotations) continue;
    const glm::dquat rotation = packed_rotation(wire, i);
    if (!is_unit(rotation))
      return invalid(indexed("tick.transforms.rotations", 4 * static_cast<size_t>(i)),
                     "must have unit length within 1e-3, got length " + std::to_string(glm::length(rotation)));
    pose.rotation = rotation_from_client(convention, glm::normalize(rotation));
  }
  for (int i = 0; i < wire.velocities_size() / 3; ++i)
    out.transforms.velocities_mps.push_back(vector_from_client(convention, packed_vector(wire.velocities(), i)));
  for (int i = 0; i < wire.angular_velocities_size() / 3; ++i)
    out.transforms.angular_velocities_radps.push_back(
        angular_velocity_from_client(convention, packed_vector(wire.angular_velocities(), i)));
  return {};
}

}  // namespace sightline
