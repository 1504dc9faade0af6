// One session as one HTML page that opens from disk without a network: the scene in 3D, what the camera did, what it
// saw and why. This header is the whole contract between whoever knows a session and the page: fill a SessionPage,
// write it.
//
// Frame: the canonical one (glTF: right-handed, +Y up, a camera looks along its own -Z), metres, seconds, radians,
// whatever the session's own convention was. The page's 3D engine draws positions in single precision: keep a session
// that plays far from its origin near it.
//
// How the page carries it: names and texts as JSON; every row of numbers as one typed array, all arrays together
// deflated (zlib) and in base64, which the page inflates by itself (page_data.h has the layout). Mesh positions take 16
// bits an axis over the mesh's bounds, cells 16 bits an axis over the bounds of their frame; what moves has single
// precision; the camera, times, shares and stage times are kept as they are.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/base/transform.h"
#include "server/scene/geometry.h"

namespace sightline {

// Numbers that a session does not know: the page shows a dash.
inline constexpr double kPageUnknown = std::numeric_limits<double>::quiet_NaN();

struct PageInstance {
  uint64_t id = 0;
  std::string name;                          // for people; empty: its id is shown
  std::shared_ptr<const Geometry> geometry;  // not null; equal pointers are stored once
  // Where it stands. Of an instance that moves (SessionPage::movers) only the linear part counts: what is applied
  // before its pose.
  Affine world_from_instance = identity_affine();
  bool occludes = true;
  bool moves = false;  // is drawn as what moves, also where no mover moves it
  // The frames in which it is there: [first_frame, end_frame). What is hidden, changed or at rest for a while stands in
  // the list several times, under one id and in frames of its own each time.
  size_t first_frame = 0, end_frame = std::numeric_limits<size_t>::max();
};

// What moves: where it stood in each frame of its instance's life.
struct PageMover {
  size_t instance = 0;      // index into SessionPage::instances; moves once only
  std::vector<Pose> poses;  // world_from_instance without its linear part
};

// All that were targets at any time of the session.
struct PageTarget {
  uint64_t id = 0;  // of the instances that are it, if any are there to be drawn
  std::string name;
  double weight = 1.0;
  bool required = true;
};

// What one frame knew of one target.
struct PageSight {
  bool present = true;    // false: no target in this frame, and nothing below is shown
  bool steered = true;    // it has a weight: the camera wants to see it
  glm::dvec3 aim_m{0.0};  // what the camera aims at, world; not finite: not known
  double visible_share = 0.0;        // of the sampled points, in this step, [0, 1]
  double filtered_share = 0.0;       // over the last steps, [0, 1]
  double true_share = kPageUnknown;  // of the target's pixels, by a re-render, [0, 1]; most frames have none
  std::string state;            // "VISIBLE", "PARTIAL", "OCCLUDED", "OFF_SCREEN": other words are shown grey
  double distance_m = 0.0;      // from the camera to aim_m
  uint64_t occluder_id = 0;     // what hides it; 0: nothing does
  double occluder_share = 0.0;  // of its points that are hidden, [0, 1]
};

// A place that the step looked at.
struct PageCell {
  glm::vec3 position_m{0.0f};
  uint32_t visible_targets = 0;  // bit i: SessionPage::targets[i] is seen from there in this step
};

// How many places each step had, by what is seen from them, as the last steps together have it.
struct PageCounts {
  uint32_t all_visible = 0, some_visible = 0, none_visible = 0;  // S_V, S_P, S_N
};

struct PageFrame {
  uint64_t sequence = 0;
  double time_s = 0.0;  // that the pose is meant for; never goes back
  Pose camera;          // world_from_camera
  double vertical_fov_rad = 0.0;
  glm::dvec3 velocity_mps{0.0};
  std::vector<PageSight> sights;  // as long as SessionPage::targets
  PageCounts counts;
  std::string status, reason;  // one word each
  std::string text;            // one sentence
  bool cut = false;            // the pose jumped on purpose
  uint32_t flags = 0;          // bit i: SessionPage::flags[i]
  uint32_t merged_ticks = 0;
  double queue_us = kPageUnknown;     // how long the newest tick waited for the step
  std::vector<float> stage_us;        // as long as SessionPage::stages
  double latency_ms = kPageUnknown;   // from the tick to its reply, as whoever tells the session saw them
  double clearance_m = kPageUnknown;  // from the camera to the nearest collider
  std::vector<PageCell> cells;        // may be empty; the page keeps at most kMaxPageCells in all
  int chosen_cell = -1;               // index into `cells`; -1: none
};

// What the camera saw at one frame.
struct PagePicture {
  size_t frame = 0;        // index into SessionPage::frames
  std::string media_type;  // "image/jpeg" or "image/png"
  std::vector<uint8_t> bytes;
};

// Something that happened at a frame, on the time line and in a list.
struct PageMark {
  size_t frame = 0;  // index into SessionPage::frames
  std::string kind;  // one word: "fault", "rejection" and "gap" are shown as trouble, others as notes
  std::string text;
};

// Settings, or whatever else is best read as they are.
struct PageSettings {
  std::string title;
  std::string json;  // one JSON value; empty: not known
};

// A figure of the run, ready to be read: one text for each of SessionPage::columns.
struct PageFigure {
  std::string name;
  std::vector<std::string> values;
};

struct SessionPage {
  std::string title;
  std::vector<std::string> notices;  // what one has to know before one believes the page; one sentence each
  std::vector<std::pair<std::string, std::string>>
      facts;                   // name, value: sampler, seed, scene, rate and so on
  double aspect = 16.0 / 9.0;  // of the picture, width / height, above 0
  double body_radius_m = 0.0;  // [0, 10]
  std::vector<PageInstance> instances;
  std::vector<PageTarget> targets;    // at most 32
  std::vector<PageMover> movers;
  std::vector<std::string> stages;    // names, in the order in which they run
  std::vector<std::string> flags;     // names; at most 32
  std::vector<PageFrame> frames;      // at least one
  std::vector<PagePicture> pictures;  // by frame, ascending
  std::vector<PageMark> marks;        // by frame, ascending
  std::vector<std::string> columns;   // of the figures
  std::vector<PageFigure> figures;
  std::vector<PageSettings> settings;
};

// Cells of every n-th frame are kept, n being the least that stays within this many; the page says which frame they are
// of.
inline constexpr size_t kMaxPageCells = 1'000'000;

// The page as text. Deterministic: equal sessions give equal bytes. A row of the wrong length, an index out of range,
// settings that are no JSON, or no frame at all is kInvalidArgument and the field says which.
Result<std::string> session_page(const SessionPage& session);
// The same into a file; kUnavailable with the path when it cannot be written.
Status write_session_page(const SessionPage& session, const std::string& path);

}  // namespace sightline
