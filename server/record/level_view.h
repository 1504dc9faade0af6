// Viewers see the scene file of a session as triangles, with the places and names of its nodes. The messages of a
// session name the file but do not hold it. So this view is made from the session itself, once, when it opens.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "foxglove/scene.pb.h"
#include "server/base/transform.h"
#include "server/scene/mirror.h"
#include "server/session/convention.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

struct LevelNode {
  Pose rest;               // world_from_instance when the session opened, in the viewers' world
  glm::dmat3 linear{1.0};  // applied before it, canonical axes
  glm::dvec3 centre_m{0};  // of its bounding box, in the instance's frame before `linear`, canonical axes
  std::string name;        // of the node; empty: the client bound no name to it
};

struct LevelView {
  std::map<uint64_t, LevelNode> nodes;  // instances that the client gave no shape, by id
  foxglove::SceneUpdate shapes;         // their triangles, each in the frame "instance/<id>"
  uint64_t triangles = 0;
  uint64_t left_out = 0;  // triangles of the smallest nodes, beyond kMostTriangles
  static constexpr uint64_t kMostTriangles = 100'000;
};

// `convention`: with the session's world origin. Takes time in proportion to the triangles, at most kMostTriangles of
// them.
LevelView level_view_of(const SceneMirror& mirror, const Convention& convention, const v1::OpenSession& open,
                        uint64_t time_ns);

// The frame of an instance in messages for viewers: "instance/<id>".
std::string viewer_frame_of(uint64_t id);

}  // namespace sightline
