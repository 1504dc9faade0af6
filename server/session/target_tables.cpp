#include "server/session/target_tables.h"

#include <set>

namespace sightline {
namespace {

using Geometries = std::set<std::shared_ptr<const Geometry>>;

std::set<uint64_t> ids_of(const std::vector<Target>& targets) {
  std::set<uint64_t> ids;
  for (const Target& target : targets) {
    ids.insert(target.instance_id);
    ids.insert(target.part_ids.begin(), target.part_ids.end());
  }
  return ids;
}

void add_shapes(const std::vector<NewInstance>& instances, const std::set<uint64_t>& ids, Geometries& geometries) {
  for (const NewInstance& instance : instances)
    if (instance.geometry && ids.contains(instance.id)) geometries.insert(instance.geometry);
}

Status build(const Geometries& geometries, ExtentCache& tables, WorkLimit& work, const char* field) {
  for (const auto& geometry : geometries) {
    if (tables.get(geometry, &work)) continue;
    Error error = work.error();
    error.field = field;
    return tl::unexpected(std::move(error));
  }
  return {};
}

}  // namespace

Status build_target_tables(const SessionOptions& options, ExtentCache& tables, WorkLimit& work) {
  if (options.settings.sample.points == 0) return {};
  Geometries geometries;
  add_shapes(options.instances, ids_of(options.targets), geometries);
  return build(geometries, tables, work, "open.targets");
}

Status build_target_tables(const Session& session, const TickInput& tick, ExtentCache& tables, WorkLimit& work) {
  if ((tick.settings ? *tick.settings : session.settings()).sample.points == 0) return {};
  const std::set<uint64_t> ids = ids_of(tick.targets ? *tick.targets : session.targets());
  Geometries geometries;
  add_shapes(tick.delta.add, ids, geometries);
  for (const uint64_t id : ids)
    if (const Instance* instance = session.mirror().find(id); instance && instance->geometry)
      geometries.insert(instance->geometry);
  return build(geometries, tables, work, "tick.targets");
}

}  // namespace sightline
