#include "client/report/instance_timeline.h"

#include <utility>

namespace sightline {
namespace {

bool is_shown(const Instance& instance) {
  return instance.geometry != nullptr && instance.attributes.visible;
}

bool stands_where(const Pose& a, const Pose& b) {
  return a.position_m == b.position_m && a.rotation == b.rotation;
}

}  // namespace

void InstanceTimeline::take_in(const SceneMirror& mirror, size_t frame) {
  if (mirror.static_version() != static_version_ || mirror.moving_version() != moving_version_) compare(mirror, frame);
  static_version_ = mirror.static_version(), moving_version_ = mirror.moving_version();
  for (const uint32_t slot : mirror.moving_slots()) {
    const Instance& instance = mirror.instances()[slot];
    if (is_shown(instance)) move(instance, frame);
  }
}

void InstanceTimeline::move(const Instance& instance, size_t frame) {
  size_t& open = present_.at(instance.id);
  if (!parts_[open].moving) {
    // The client sent the pose that it already has: it has not moved.
    if (stands_where(parts_[open].start, instance.pose)) return;
    moved_.insert(instance.id);
    if (frame - parts_[open].shown.first_frame > kRestFrames) {
      parts_[open].shown.end_frame = frame;
      begin(instance, frame);
    }
    parts_[open].moving = true;
    parts_[open].still_frames = frame - parts_[open].shown.first_frame;
  }
  Part& part = parts_[open];
  const bool rests = !part.poses.empty() && stands_where(part.poses.back(), instance.pose);
  part.rest_frames = rests ? part.rest_frames + 1 : 0;
  part.poses.push_back(instance.pose);
  if (part.rest_frames >= kRestFrames) rest(instance, frame);
}

// The resting frames become a part of their own without movement.
void InstanceTimeline::rest(const Instance& instance, size_t frame) {
  Part& part = parts_[present_.at(instance.id)];
  const size_t since = frame + 1 - part.rest_frames;
  part.poses.resize(part.poses.size() - part.rest_frames);
  part.shown.end_frame = since;
  begin(instance, since);
}

bool InstanceTimeline::is_same(const Part& part, const Instance& instance) const {
  // An instance that was removed and added again under the same id is not moving at first.
  const bool goes_on = instance.moving || (!part.moving && stands_where(part.start, instance.pose));
  return goes_on && part.shown.geometry == instance.geometry && part.shown.occludes == instance.occludes() &&
         part.linear == instance.linear;
}

void InstanceTimeline::compare(const SceneMirror& mirror, size_t frame) {
  for (auto it = present_.begin(); it != present_.end();) {
    const Instance* instance = mirror.find(it->first);
    if (instance && is_shown(*instance) && is_same(parts_[it->second], *instance)) {
      ++it;
      continue;
    }
    parts_[it->second].shown.end_frame = frame;
    it = present_.erase(it);
  }
  for (const Instance& instance : mirror.instances())
    if (is_shown(instance) && !present_.contains(instance.id)) begin(instance, frame);
}

void InstanceTimeline::begin(const Instance& instance, size_t frame) {
  present_[instance.id] = parts_.size();
  Part& part = parts_.emplace_back();
  const auto named = names_.find(instance.id);
  part.shown = {.id = instance.id,
                .name = named == names_.end() ? std::string() : named->second,
                .geometry = instance.geometry,
                .world_from_instance = instance.world_from_instance,
                .occludes = instance.occludes(),
                .first_frame = frame};
  part.linear = instance.linear;
  part.start = instance.pose;
}

void InstanceTimeline::give(SessionPage& page) {
  for (Part& part : parts_) {
    part.shown.moves = moved_.contains(part.shown.id);
    if (part.moving) {
      const glm::dmat3& linear = part.linear;
      part.shown.world_from_instance = Affine(linear[0], linear[1], linear[2], glm::dvec3(0.0));
      PageMover& mover = page.movers.emplace_back(PageMover{page.instances.size(), {}});
      mover.poses.assign(part.still_frames, part.start);
      mover.poses.insert(mover.poses.end(), part.poses.begin(), part.poses.end());
    }
    page.instances.push_back(std::move(part.shown));
  }
}

}  // namespace sightline
