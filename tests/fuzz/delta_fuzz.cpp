// libFuzzer chooses structural changes and transforms of a scene, right and wrong ones, and sends them to a mirror and
// to a plain model (tests/support/plain_mirror.h). Both must take and refuse the same ones, and hold the same scene
// after each.
#include <cstdlib>

#include "server/scene/primitives.h"
#include "tests/fuzz/byte_feed.h"
#include "tests/support/plain_mirror.h"

namespace {

using namespace sightline;
using test::ByteFeed;

// Few ids, so that they meet; now and then one that no client may choose.
uint64_t id_from(ByteFeed& feed) {
  const uint8_t choice = feed.byte();
  return choice < 250 ? choice % 16 : choice < 253 ? kAssetIdBit | choice % 4 : feed.take<uint64_t>();
}

// Mostly small numbers, sometimes any bits.
double number_from(ByteFeed& feed) {
  const auto choice = static_cast<int8_t>(feed.byte());
  return choice == -128 ? feed.take<double>() : choice * 0.25;
}

glm::dvec3 vector_from(ByteFeed& feed) {
  const double x = number_from(feed), y = number_from(feed);
  return {x, y, number_from(feed)};
}

Pose pose_from(ByteFeed& feed) {
  Pose pose;
  pose.position_m = vector_from(feed);
  const uint8_t choice = feed.byte();
  if (choice < 64) return pose;
  pose.rotation = choice < 224 ? glm::angleAxis(choice * 0.03, glm::dvec3(0.6, 0, 0.8))
                               : glm::dquat(number_from(feed), vector_from(feed));
  return pose;
}

InstanceAttributes attributes_from(ByteFeed& feed) {
  InstanceAttributes attributes;
  const uint8_t bits = feed.byte();
  attributes.layers = bits >> 4;
  attributes.occludes = bits & 1, attributes.collides = bits & 2, attributes.visible = bits & 4;
  if (bits & 8) attributes.opacity = static_cast<float>(number_from(feed));
  return attributes;
}

std::shared_ptr<const Geometry> geometry_from(ByteFeed& feed) {
  static const std::shared_ptr<const Geometry> kinds[] = {nullptr,
                                                          build_geometry(tessellate(BoxShape{}).value()).value(),
                                                          build_geometry(tessellate(CylinderShape{}).value()).value()};
  return kinds[feed.byte() % 8 == 0 ? 0 : 1 + feed.byte() % 2];
}

SceneDelta delta_from(ByteFeed& feed) {
  SceneDelta delta;
  const uint8_t head = feed.byte();
  if (head % 8 == 7) delta.base_revision = feed.byte() % 16;
  delta.asset_ids_allowed = head & 128;
  for (int left = feed.byte() % 4; left > 0; --left) delta.remove.push_back(id_from(feed));
  for (int left = feed.byte() % 4; left > 0; --left) {
    NewInstance& added = delta.add.emplace_back();
    added.id = id_from(feed);
    added.geometry = geometry_from(feed);
    added.pose = pose_from(feed);
    const uint8_t choice = feed.byte();
    if (choice > 200) added.linear = glm::dmat3(vector_from(feed), vector_from(feed), vector_from(feed));
    added.attributes = attributes_from(feed);
    added.moving = choice & 1;
  }
  for (int left = feed.byte() % 4; left > 0; --left) delta.change.push_back({id_from(feed), attributes_from(feed)});
  return delta;
}

TransformUpdate transforms_from(ByteFeed& feed) {
  TransformUpdate update;
  const uint8_t head = feed.byte();
  for (int left = head % 4; left > 0; --left) {
    update.ids.push_back(id_from(feed));
    if (head < 250 || left > 1) update.poses.push_back(pose_from(feed));
    if (head & 32) update.velocities_mps.push_back(vector_from(feed));
  }
  return update;
}

// Compares all that clients and later stages can see of the mirror.
void compare(const SceneMirror& mirror, const test::PlainMirror& plain) {
  if (mirror.revision() != plain.revision() || mirror.size() != plain.size() || mirror.hash() != plain.hash())
    std::abort();
  size_t live = 0, moving = 0;
  for (const Instance& instance : mirror.instances()) {
    if (!instance.geometry) continue;
    ++live, moving += instance.moving;
    if (!plain.records().contains(instance.id) || mirror.find(instance.id) != &instance) std::abort();
  }
  if (live != plain.size() || moving != mirror.moving_slots().size()) std::abort();
  for (size_t i = 0; i < mirror.moving_slots().size(); ++i) {
    if (!mirror.instances()[mirror.moving_slots()[i]].moving) std::abort();
    if (i > 0 && mirror.moving_slots()[i - 1] >= mirror.moving_slots()[i]) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  ByteFeed feed(data, size);
  SceneMirror mirror;
  test::PlainMirror plain;
  while (!feed.empty()) {
    const SceneDelta delta = delta_from(feed);
    const TransformUpdate transforms = transforms_from(feed);
    const uint64_t version = mirror.version();
    const Status applied = mirror.apply(delta, transforms);
    if (applied.has_value() != plain.apply(delta, transforms)) std::abort();
    if (!applied && (applied.error().field.empty() || mirror.version() != version)) std::abort();
    compare(mirror, plain);
  }
  return 0;
}
