// The instances of a session that is played through: which there are in which frames, and where those stand that move.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "client/page/session_page.h"
#include "server/scene/mirror.h"

namespace sightline {

// So many frames without a movement are a rest: what rests is not told from frame to frame.
inline constexpr size_t kRestFrames = 60;

class InstanceTimeline {
 public:
  // Names by id; ids without one are called by their number on the page.
  explicit InstanceTimeline(std::unordered_map<uint64_t, std::string> names) : names_(std::move(names)) {}

  // The mirror as it is at frame `frame`: 0, then 1, and so on. Costs little while the scene's structure stays.
  void take_in(const SceneMirror& mirror, size_t frame);

  // Fills the page's instances and movers. Nothing else may be called after it.
  void give(SessionPage& page);

 private:
  // One stretch of frames in which an instance was shown, stayed what it is, and did not rest between movements.
  struct Part {
    PageInstance shown;
    glm::dmat3 linear{1.0};
    Pose start;               // where it stood until it first moved
    size_t still_frames = 0;  // how many of its frames it stood there
    std::vector<Pose> poses;  // from then on
    size_t rest_frames = 0;   // at their end, like the one before
    bool moving = false;
  };

  void compare(const SceneMirror& mirror, size_t frame);
  void begin(const Instance& instance, size_t frame);
  void move(const Instance& instance, size_t frame);
  void rest(const Instance& instance, size_t frame);
  bool is_same(const Part& part, const Instance& instance) const;

  std::unordered_map<uint64_t, std::string> names_;
  std::vector<Part> parts_;
  std::unordered_map<uint64_t, size_t> present_;  // by id: its open part
  std::unordered_set<uint64_t> moved_;            // ids
  uint64_t static_version_ = UINT64_MAX, moving_version_ = UINT64_MAX;
};

}  // namespace sightline
