// Compares an InstanceTimeline with a plain log of the mirror at each frame, over random additions, removals, movements
// and rests.
#include "client/report/instance_timeline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

namespace sightline {
namespace {

struct Seen {
  Pose pose;
  bool occludes = true;
};
using Note = std::map<uint64_t, Seen>;  // of one frame: what was shown

std::shared_ptr<const Geometry> tent(float height_m) {
  MeshData mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 0, 3}, {0.7f, height_m, 0.9f}};
  mesh.indices = {0, 1, 2, 0, 1, 3, 1, 2, 3};
  return *build_geometry(mesh);
}

Note note_of(const SceneMirror& mirror) {
  Note note;
  for (const Instance& instance : mirror.instances())
    if (instance.geometry && instance.attributes.visible) note[instance.id] = {instance.pose, instance.occludes()};
  return note;
}

// Reads the same from the page.
Note note_of(const SessionPage& page, size_t frame) {
  Note note;
  std::map<size_t, const PageMover*> movers;
  for (const PageMover& mover : page.movers) movers[mover.instance] = &mover;
  for (size_t i = 0; i < page.instances.size(); ++i) {
    const PageInstance& instance = page.instances[i];
    if (frame < instance.first_frame || frame >= instance.end_frame) continue;
    Pose pose{instance.world_from_instance[3], {1, 0, 0, 0}};
    if (movers.contains(i)) pose = movers.at(i)->poses.at(frame - instance.first_frame);
    EXPECT_TRUE(note.emplace(instance.id, Seen{pose, instance.occludes}).second) << "twice in frame " << frame;
  }
  return note;
}

// A mirror with random changes of every kind.
class World {
 public:
  explicit World(uint32_t seed) : random_(seed) {
    for (uint64_t id = 1; id <= 6; ++id) add(id);
  }

  void frame() {
    SceneDelta delta;
    TransformUpdate update;
    for (uint64_t id = 1; id <= 6; ++id) happen(id, delta, update);
    ASSERT_TRUE(mirror_.apply(delta, update).has_value());
  }
  const SceneMirror& mirror() const { return mirror_; }

 private:
  bool one_in(uint32_t n) { return random_() % n == 0; }
  Pose anywhere() {
    const auto at = [this] { return static_cast<double>(random_() % 100); };
    return {{at(), at(), at()}, {1, 0, 0, 0}};
  }

  void add(uint64_t id) {
    SceneDelta delta;
    delta.add = {new_instance(id)};
    ASSERT_TRUE(mirror_.apply(delta, {}).has_value());
  }
  NewInstance new_instance(uint64_t id) {
    NewInstance instance;
    instance.id = id, instance.geometry = id % 2 ? low_ : high_, instance.pose = anywhere();
    return instance;
  }

  void happen(uint64_t id, SceneDelta& delta, TransformUpdate& update) {
    if (!mirror_.find(id)) {
      if (one_in(20)) delta.add.push_back(new_instance(id));
      return;
    }
    if (one_in(150)) {
      delta.remove.push_back(id);
      if (one_in(2)) delta.add.push_back(new_instance(id));  // added again in the same update
      return;
    }
    if (one_in(120)) {
      InstanceAttributes attributes;
      attributes.visible = !one_in(2), attributes.occludes = !one_in(3);
      delta.change.push_back({id, attributes});
    }
    // Stretches of movement and rest. A resting instance may still get its unchanged pose.
    if (one_in(50)) moves_[id] = !moves_[id];
    if (!moves_[id] && !one_in(2)) return;
    update.ids.push_back(id);
    update.poses.push_back(moves_[id] ? anywhere() : mirror_.find(id)->pose);
  }

  std::mt19937 random_;
  SceneMirror mirror_;
  std::map<uint64_t, bool> moves_;
  const std::shared_ptr<const Geometry> low_ = tent(1.0f), high_ = tent(4.0f);
};

TEST(InstanceTimeline, EveryFrameIsAsTheMirrorWas) {
  for (uint32_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    World world(seed);
    InstanceTimeline timeline({{1, "one"}});
    std::vector<Note> notes;
    for (size_t frame = 0; frame < 600; ++frame) {
      world.frame();
      timeline.take_in(world.mirror(), frame);
      notes.push_back(note_of(world.mirror()));
    }
    SessionPage page;
    page.frames.resize(600);
    timeline.give(page);
    for (size_t frame = 0; frame < notes.size(); ++frame) {
      const Note told = note_of(page, frame);
      ASSERT_EQ(told.size(), notes[frame].size()) << frame;
      for (const auto& [id, seen] : notes[frame]) {
        ASSERT_TRUE(told.contains(id)) << id << " in frame " << frame;
        EXPECT_EQ(told.at(id).pose.position_m, seen.pose.position_m) << id << " in frame " << frame;
        EXPECT_EQ(told.at(id).occludes, seen.occludes) << id << " in frame " << frame;
      }
    }
    for (const PageMover& mover : page.movers) {
      const PageInstance& instance = page.instances[mover.instance];
      EXPECT_EQ(mover.poses.size(), std::min<size_t>(600, instance.end_frame) - instance.first_frame);
    }
    for (const PageInstance& instance : page.instances) EXPECT_EQ(instance.name, instance.id == 1 ? "one" : "");
  }
}

// A thousand things that were moved once must not cost a pose in every frame.
TEST(InstanceTimeline, WhatRestsCostsNoPoses) {
  SceneMirror mirror;
  SceneDelta delta;
  for (uint64_t id = 1; id <= 100; ++id) {
    NewInstance& instance = delta.add.emplace_back();
    instance.id = id, instance.geometry = tent(1.0f);
  }
  ASSERT_TRUE(mirror.apply(delta, {}).has_value());
  InstanceTimeline timeline({});
  for (size_t frame = 0; frame < 2000; ++frame) {
    TransformUpdate update;
    if (frame % 1000 == 500)
      for (uint64_t id = 1; id <= 100; ++id) {
        update.ids.push_back(id);
        update.poses.push_back({{static_cast<double>(frame), 0, 0}, {1, 0, 0, 0}});
      }
    ASSERT_TRUE(mirror.apply({}, update).has_value());
    timeline.take_in(mirror, frame);
  }
  SessionPage page;
  timeline.give(page);
  size_t poses = 0;
  for (const PageMover& mover : page.movers) poses += mover.poses.size();
  EXPECT_LE(poses, 100 * 2 * (1 + kRestFrames));
  EXPECT_TRUE(std::all_of(page.instances.begin(), page.instances.end(), [](const PageInstance& i) { return i.moves; }));
}

}  // namespace
}  // namespace sightline
