// Follows the instances of a session from frame to frame: which ones exist in which frames, and where the moving ones
// stand.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "client/page/session_page.h"
#include "server/scene/mirror.h"

namespace sightline {

// An instance rests after this many frames without movement. A resting instance has no pose for each frame.
inline constexpr size_t kRestFrames = 60;

class InstanceTimeline {
 public:
  // Names by id. The page shows the id of an instance without a name.
  explicit InstanceTimeline(std::unordered_map<uint64_t, std::string> names) : names_(std::move(names)) {}

  // Takes the mirror at frame `frame`: 0, then 1, and so on. Cheap while the structure of the scene stays the same.
  void take_in(const SceneMirror& mirror, size_t frame);

  // Fills the page's instances and movers. Call nothing else afterwards.
  void give(SessionPage& page);

 private:
  // One stretch of frames in which an instance was shown, did not change, and did not rest between movements.
  struct Part {
    PageInstance shown;
    glm::dmat3 linear{1.0};
    Pose start;               // its pose until it first moved
    size_t still_frames = 0;  // frames at `start`
    std::vector<Pose> poses;  // poses after that
    size_t rest_frames = 0;   // equal poses at the end
    bool moving = false;
  };

  void compare(const SceneMirror& mirror, size_t frame);
  void begin(const Instance& instance, size_t frame);
  void move(const Instance& instance, size_t frame);
  void rest(const Instance& instance, size_t frame);
  bool is_same(const Part& part, const Instance& instance) const;

  std::unordered_map<uint64_t, std::string> names_;
  std::vector<Part> parts_;
  std::unordered_map<uint64_t, size_t> present_;  // by id: index of its open part
  std::unordered_set<uint64_t> moved_;            // ids
  uint64_t static_version_ = UINT64_MAX, moving_version_ = UINT64_MAX;
};

}  // namespace sightline
