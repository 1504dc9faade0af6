// A small world in one line, so that a test reads as a story:
//
//   World world;
//   world.add_box(7, {0, 1, 0}, {1, 1, 0.1});
//   world.add_target(1, {0, 1, -5});
//   world.step(0.016);
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "server/sample/embree_sampler.h"
#include "server/scene/mirror.h"
#include "server/scene/primitives.h"
#include "server/step/step.h"
#include "tests/support/plain_settings.h"

namespace sightline::test {

class World {
 public:
  explicit World(std::unique_ptr<SamplerDevice> device = make_embree_sampler_device())
      : device_(std::move(device)), sampler_(device_->make_sampler()) {}

  void add(uint64_t id, const Shape& shape, const glm::dvec3& at, InstanceAttributes attributes = {}) {
    auto geometry = store_.intern(*tessellate(shape));
    ASSERT_TRUE(geometry.has_value()) << to_string(geometry.error());
    SceneDelta delta;
    delta.add.push_back({id, *geometry, Pose{at, {1, 0, 0, 0}}, glm::dmat3(1.0), attributes});
    const auto ok = mirror.apply(delta, {});
    ASSERT_TRUE(ok.has_value()) << to_string(ok.error());
  }
  void add_box(uint64_t id, const glm::dvec3& at, const glm::vec3& half_extent, InstanceAttributes attributes = {}) {
    add(id, BoxShape{half_extent}, at, attributes);
  }
  // A standing person: a capsule 1.8 m high whose centre is at `at`.
  void add_target(uint64_t id, const glm::dvec3& at, bool required = true, double weight = 1.0) {
    add(id, CapsuleShape{0.3f, 0.6f}, at);
    Target target;
    target.instance_id = id;
    target.required = required;
    target.weight = weight;
    targets.push_back(target);
  }
  void move(uint64_t id, const glm::dvec3& to, const glm::dvec3& velocity = {}) {
    TransformUpdate update;
    update.ids = {id};
    update.poses = {Pose{to, {1, 0, 0, 0}}};
    update.velocities_mps = {velocity};
    const auto ok = mirror.apply({}, update);
    ASSERT_TRUE(ok.has_value()) << to_string(ok.error());
  }
  void place(const glm::dvec3& at, const glm::dvec3& look_at) {
    stepper.place_camera(Pose{at, look_rotation(look_at - at, {0, 1, 0}, {1, 0, 0})}, glm::dvec3(0.0));
  }
  StepResult step(double dt_s) {
    std::vector<std::shared_ptr<const ExtentTable>> tables;
    std::vector<const ExtentTable*> extents, part_extents;
    const auto table_of = [&](const Instance& instance) {
      return tables.emplace_back(extent_cache_.get(instance.geometry)).get();
    };
    for (const Target& target : targets) {
      extents.push_back(table_of(*mirror.find(target.instance_id)));
      for (const uint64_t id : target.part_ids) {
        const Instance* part = mirror.find(id);
        part_extents.push_back(part ? table_of(*part) : nullptr);
      }
    }
    const StepInput input{mirror, targets, limits, settings, lens, seed, tick++, dt_s, extents, part_extents, &shot};
    auto result = stepper.take(input, *sampler_, [] { return int64_t{0}; });
    if (!result) throw std::runtime_error(to_string(result.error()));
    return *result;
  }
  const CameraState& camera() const { return stepper.carried().camera; }
  const SightCounts& counts() const { return stepper.dump().sights.counts; }
  const StepDump& dump() const { return stepper.dump(); }
  uint64_t maps_taken() const { return sampler_->maps_taken(); }

  SceneMirror mirror;
  std::vector<Target> targets;
  CameraLimits limits;
  StepSettings settings = plain_settings();
  Lens lens;
  AskedShot shot;
  uint64_t seed = 1, tick = 0;
  Stepper stepper;

 private:
  GeometryStore store_;
  ExtentCache extent_cache_;
  std::unique_ptr<SamplerDevice> device_;
  std::unique_ptr<Sampler> sampler_;
};

}  // namespace sightline::test
