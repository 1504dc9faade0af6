#include "server/wire/from_proto.h"

#include <algorithm>
#include <set>
#include <string_view>

#include "server/step/quality_level.h"
#include "server/wire/from_proto_scene.h"
#include "server/wire/from_proto_shot.h"
#include "server/wire/from_proto_values.h"
#include "server/wire/suspect_sizes.h"

namespace sightline {
namespace {

Status read_frame(const v1::OpenSession& open, Convention& out) {
  if (Status ok = read_convention(open.convention(), "open.", out); !ok) return ok;
  glm::dvec3 origin(0.0);
  if (Status ok = read_vector(open.world_origin(), "open.world_origin", origin); !ok) return ok;
  out.origin_m = vector_from_client(out, origin);
  return {};
}

Status read_instances(const v1::OpenSession& open, const SceneSource& source, SessionOptions& out,
                      std::vector<std::string>& warnings) {
  if (open.has_scene()) {
    auto scene = read_scene(open.scene(), source, out.convention, "open.scene");
    if (!scene) return tl::unexpected(std::move(scene.error()));
    warnings.insert(warnings.end(), scene->asset->warnings.begin(), scene->asset->warnings.end());
    out.scene = std::move(scene->asset);
    out.instances = std::move(scene->instances);
    out.scene_instances = out.instances.size();
  }
  InstanceReader reader(source, out.convention);
  for (int i = 0; i < open.instances_size(); ++i) {
    auto instance = reader.read(open.instances(i), indexed("open.instances", static_cast<size_t>(i)));
    if (!instance) return tl::unexpected(std::move(instance.error()));
    out.instances.push_back(std::move(*instance));
  }
  out.mesh_assets = reader.assets();
  return {};
}

template <typename Targets>
Status read_targets(const Targets& wire, const Convention& convention, const std::string& list,
                    std::vector<Target>& out) {
  for (const v1::Target& target : wire) {
    Target read;
    if (Status ok = read_target(target, convention, indexed(list, out.size()), read); !ok) return ok;
    out.push_back(std::move(read));
  }
  return {};
}

Status read_camera(const v1::OpenSession& open, SessionOptions& out) {
  if (!open.has_camera()) return invalid("open.camera", "is required: where the camera starts");
  Pose camera;
  if (Status ok = read_pose(open.camera(), "open.camera", camera); !ok) return ok;
  out.camera = camera_from_client(out.convention, camera);
  return read_lens(open.lens(), out.convention, "open.lens", out.lens);
}

Status read_open(const v1::OpenSession& open, const SceneSource& source, SessionOptions& out,
                 std::vector<std::string>& warnings) {
  if (open.label().size() > kMaxLabelBytes)
    return invalid("open.label", "at most 64 bytes, got " + std::to_string(open.label().size()));
  if (Status ok = read_frame(open, out.convention); !ok) return ok;
  if (Status ok = read_camera(open, out); !ok) return ok;
  if (Status ok = read_settings(open.settings(), open.tuning(), "open.", out.settings); !ok) return ok;
  if (open.settings().preset() == v1::Settings::PRESET_PAPER) out.limits = preset_limits(Preset::kPaper);
  read_limits(open.limits(), out.limits);
  if (Status ok = read_targets(open.targets(), out.convention, "open.targets", out.targets); !ok) return ok;
  if (Status ok = read_instances(open, source, out, warnings); !ok) return ok;
  // An empty shot too says which way models face, so that reports of a session without one are in the frame that the
  // client would ask in.
  if (Status ok = read_shot(open.shot(), out.convention, out.lens.aspect, "open.shot", out.shot);
      !ok && open.has_shot())
    return ok;
  out.shot.number = open.has_shot() ? 1 : 0;
  for (std::string& warning : suspect_sizes(out)) warnings.push_back(std::move(warning));
  for (std::string& warning : shot_warnings(out, "open.shot")) warnings.push_back(std::move(warning));
  out.seed = open.seed();
  out.diagnostics = {open.diagnostics().candidates(), open.diagnostics().depth_maps()};
  out.label = open.label();
  return {};
}

Status read_observed(const v1::ObservedCamera& wire, const Convention& convention, ObservedCamera& out) {
  if (!wire.has_pose()) return invalid("tick.observed_camera.pose", "is required");
  Pose pose;
  if (Status ok = read_pose(wire.pose(), "tick.observed_camera.pose", pose); !ok) return ok;
  out.pose = camera_from_client(convention, pose);
  glm::dvec3 velocity(0.0);
  if (Status ok = read_vector(wire.velocity(), "tick.observed_camera.velocity", velocity); !ok) return ok;
  out.velocity_mps = vector_from_client(convention, velocity);
  glm::dvec3 turning(0.0);
  if (Status ok = read_vector(wire.angular_velocity(), "tick.observed_camera.angular_velocity", turning); !ok)
    return ok;
  out.angular_velocity_radps = angular_velocity_from_client(convention, turning);
  out.cut = wire.cut();
  return {};
}

Status check_step_control(const v1::StepControl& step) {
  if (step.quality_level() <= kLowestQualityLevel) return {};
  return invalid("tick.step_control.quality_level", "must be in [0, " + std::to_string(kLowestQualityLevel) +
                                                        "], got " + std::to_string(step.quality_level()));
}

Status read_terms(const v1::Tick& tick, const Session& session, TickInput& out) {
  if (tick.has_lens())
    if (Status ok = read_lens(tick.lens(), session.convention(), "tick.lens", out.lens.emplace()); !ok) return ok;
  if (tick.has_shot())
    if (Status ok = read_shot(tick.shot(), session.convention(), out.lens.value_or(session.lens()).aspect, "tick.shot",
                              out.shot.emplace());
        !ok)
      return ok;
  if (tick.has_limits()) read_limits(tick.limits(), out.limits.emplace(session.limits()));
  if (!tick.has_settings() && !tick.has_tuning()) return {};
  return read_settings(tick.settings(), tick.tuning(), "tick.", out.settings.emplace(session.settings()));
}

// Positions in the tick are in the shifted world.
Status shift_world(const v1::Tick& tick, Convention& convention, TickInput& out) {
  glm::dvec3 shift(0.0);
  if (Status ok = read_vector(tick.world_shift(), "tick.world_shift", shift); !ok) return ok;
  out.world_shift_m = vector_from_client(convention, shift);
  convention.origin_m += out.world_shift_m;
  if (validate(convention)) return {};
  return invalid("tick.world_shift", "takes the world origin farther than 1e15 m");
}

Status read_tick(const v1::Tick& tick, const Session& session, const SceneSource& source, TickInput& out) {
  if (Status ok = check_step_control(tick.step_control()); !ok) return ok;
  Convention convention = session.convention();
  if (Status ok = shift_world(tick, convention, out); !ok) return ok;
  out.sequence = tick.sequence();
  out.time_s = tick.time_s();
  if (tick.has_dt_s()) out.dt_s = tick.dt_s();
  if (Status ok = read_transforms(tick.transforms(), convention, out); !ok) return ok;
  if (tick.has_delta()) {
    InstanceReader reader(source, convention);
    if (Status ok = read_delta(tick.delta(), reader, "tick.delta", out.delta); !ok) return ok;
    out.mesh_assets = reader.assets();
  }
  if (tick.has_targets()) {
    out.targets.emplace();
    Status ok = read_targets(tick.targets().targets(), convention, "tick.targets.targets", *out.targets);
    if (!ok) return ok;
  }
  if (tick.has_observed_camera())
    if (Status ok = read_observed(tick.observed_camera(), convention, out.observed_camera.emplace()); !ok) return ok;
  return read_terms(tick, session, out);
}

}  // namespace

Result<SessionOptions> session_options_from_proto(const v1::OpenSession& open, const SceneSource& source,
                                                  std::vector<std::string>& warnings) {
  SessionOptions options;
  if (Status ok = read_open(open, source, options, warnings); !ok) return tl::unexpected(ok.error());
  return options;
}

namespace {

bool reads_files(const v1::Tick& tick, SceneLibrary& library) {
  std::set<std::string_view> asked;
  for (const v1::NewInstance& added : tick.delta().added_instances()) {
    if (!added.has_mesh() || !added.mesh().has_scene_name()) continue;
    const std::string& name = added.mesh().scene_name();
    if (asked.insert(name).second && !library.is_loaded(name)) return true;
  }
  return false;
}

// Only a tick that changes the settings or the targets, or adds a mesh, can need a table that the session has not and
// that takes long.
bool builds_tables(const v1::Tick& tick, const Session& session) {
  std::set<uint64_t> meshes;
  for (const v1::NewInstance& added : tick.delta().added_instances())
    if (added.has_mesh()) meshes.insert(added.id());
  if (meshes.empty() && !tick.has_settings() && !tick.has_tuning() && !tick.has_targets()) return false;
  StepSettings settings = session.settings();
  if (!read_settings(tick.settings(), tick.tuning(), "tick.", settings) || settings.sample.points == 0) return false;
  const auto lacks = [&](uint64_t id) { return meshes.contains(id) || session.lacks_table(id); };
  if (tick.has_targets()) {
    const auto& targets = tick.targets().targets();
    return std::any_of(targets.begin(), targets.end(), [&](const auto& t) {
      return lacks(t.id()) || std::any_of(t.part_ids().begin(), t.part_ids().end(), lacks);
    });
  }
  const auto& targets = session.targets();
  return std::any_of(targets.begin(), targets.end(), [&](const Target& t) {
    return lacks(t.instance_id) || std::any_of(t.part_ids.begin(), t.part_ids.end(), lacks);
  });
}

}  // namespace

bool takes_long(const v1::Tick& tick, const Session& session, SceneLibrary& library) {
  return reads_files(tick, library) || builds_tables(tick, session);
}

Result<TickInput> tick_from_proto(const v1::Tick& tick, const Session& session, const SceneSource& source) {
  TickInput input;
  if (Status ok = read_tick(tick, session, source, input); !ok) return tl::unexpected(ok.error());
  return input;
}

}  // namespace sightline
