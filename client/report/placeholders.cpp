#include "client/report/placeholders.h"

#include <algorithm>

#include "server/scene/mirror.h"

namespace sightline {
namespace {

bool of_a_file(uint64_t id) {
  return (id & kAssetIdBit) != 0;
}

// Keeps the transforms of the client's own instances. The scene's nodes do not exist, and naming them would refuse the
// whole tick.
void keep_clients_own(v1::Transforms& transforms) {
  v1::Transforms kept;
  const bool turns = transforms.rotations_size() == 4 * transforms.ids_size();
  const bool moves = transforms.velocities_size() == 3 * transforms.ids_size();
  for (int i = 0; i < transforms.ids_size() && transforms.positions_size() >= 3 * (i + 1); ++i) {
    if (of_a_file(transforms.ids(i))) continue;
    kept.add_ids(transforms.ids(i));
    for (int k = 0; k < 3; ++k) kept.add_positions(transforms.positions(3 * i + k));
    for (int k = 0; turns && k < 4; ++k) kept.add_rotations(transforms.rotations(4 * i + k));
    for (int k = 0; moves && k < 3; ++k) kept.add_velocities(transforms.velocities(3 * i + k));
  }
  transforms = std::move(kept);
}

template <typename List, typename IdOf>
void drop_of_a_file(List& list, IdOf id_of) {
  list.erase(std::remove_if(list.begin(), list.end(), [&](const auto& item) { return of_a_file(id_of(item)); }),
             list.end());
}

}  // namespace

v1::Shape Placeholders::ball() const {
  v1::Shape shape;
  shape.mutable_sphere()->set_radius(kPlaceholderRadiusM / convention_.metres_per_unit);
  return shape;
}

// Looks for each file once.
bool Placeholders::find(v1::NewInstance& instance) {
  const v1::MeshRef& mesh = instance.mesh();
  const std::string& key = mesh.has_scene_hash() ? mesh.scene_hash() : mesh.scene_name();
  bool& lacks = lacks_[key];
  if (lacks) return false;
  v1::OpenSession alone;
  *alone.add_instances() = instance;
  const Status found = scenes_.name_by_hash(alone);
  if (found) instance = alone.instances(0);
  lacks = !found;
  if (!found) missed_.push_back(found.error().message);
  return found.has_value();
}

bool Placeholders::find_scene(v1::OpenSession& open) {
  v1::OpenSession alone;
  *alone.mutable_scene() = open.scene();
  const Status found = scenes_.name_by_hash(alone);
  if (found) *open.mutable_scene() = alone.scene();
  if (!found) missed_.push_back(found.error().message);
  return found.has_value();
}

void Placeholders::replace(v1::NewInstance& instance) {
  if (instance.has_mesh() && !find(instance)) *instance.mutable_shape() = ball();
}

void Placeholders::replace(v1::OpenSession& open, bool without_scene) {
  for (v1::NewInstance& instance : *open.mutable_instances()) replace(instance);
  if (!open.has_scene()) return;
  without_scene_ = without_scene || !find_scene(open);
  if (!without_scene_) return;
  for (const v1::NodeBinding& binding : open.scene().bindings()) {
    v1::NewInstance& placeholder = *open.add_instances();
    placeholder.set_id(binding.id());
    *placeholder.mutable_shape() = ball();
  }
  open.clear_scene();
  drop_of_a_file(*open.mutable_targets(), [](const v1::Target& target) { return target.id(); });
}

void Placeholders::replace(v1::Tick& tick) {
  if (tick.has_delta())
    for (v1::NewInstance& instance : *tick.mutable_delta()->mutable_added_instances()) replace(instance);
  if (!without_scene_) return;
  if (tick.has_delta()) {
    v1::SceneDelta& delta = *tick.mutable_delta();
    delta.clear_base_revision();
    drop_of_a_file(*delta.mutable_removed_ids(), [](uint64_t id) { return id; });
    drop_of_a_file(*delta.mutable_changed_instances(), [](const v1::AttributeChange& change) { return change.id(); });
  }
  if (tick.has_targets())
    drop_of_a_file(*tick.mutable_targets()->mutable_targets(), [](const v1::Target& target) { return target.id(); });
  if (tick.has_transforms()) keep_clients_own(*tick.mutable_transforms());
}

}  // namespace sightline
