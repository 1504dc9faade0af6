// One session as one HTML page that opens from disk without a network: the scene in 3D, what the camera did, what it
// saw and why. This header is the contract between the page and the code that knows a session: fill a SessionPage, then
// write it.
//
// Frame: the canonical one (glTF: right-handed, +Y up, a camera looks along its own -Z), metres, seconds, radians. The
// page's 3D engine draws positions in single precision, so positions should be near the origin.
//
// Names and texts are JSON in the page. Every row of numbers is a typed array; all arrays together are deflated (zlib)
// and in base64 (page_data.h has the layout). Mesh positions have 16 bits an axis over the mesh's bounds, cells 16 bits
// an axis over the bounds of their frame, moving instances single precision. The camera, times, shares and stage times
// keep their precision.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/base/transform.h"
#include "server/scene/geometry.h"

namespace sightline {

// An unknown number: the page shows a dash.
inline constexpr double kPageUnknown = std::numeric_limits<double>::quiet_NaN();

struct PageInstance {
  uint64_t id = 0;
  std::string name;                          // empty: the page shows the id
  std::shared_ptr<const Geometry> geometry;  // not null; equal pointers are stored once
  // Its transform. For an instance that moves (SessionPage::movers), only the linear part counts, which is applied
  // before the pose.
  Affine world_from_instance = identity_affine();
  bool occludes = true;
  bool moves = false;  // is drawn in the colour of moving things, even when no mover moves it
  // The frames in which it exists: [first_frame, end_frame). An instance that is hidden, changes or rests for a while
  // stands in the list several times, with one id and other frames each time.
  size_t first_frame = 0, end_frame = std::numeric_limits<size_t>::max();
};

// A moving instance: its pose in each frame of its life.
struct PageMover {
  size_t instance = 0;      // index into SessionPage::instances; moves once only
  std::vector<Pose> poses;  // world_from_instance without its linear part
};

// A target at any time of the session.
struct PageTarget {
  uint64_t id = 0;  // also the id of its instances, if there are any to draw
  std::string name;
  double weight = 1.0;
  bool required = true;
  double radius_m = 0.0;  // of its bounding sphere; 0: not known
};

// One target in one frame.
struct PageSight {
  bool present = true;               // false: it is no target in this frame, and nothing below is shown
  bool steered = true;               // its weight is above 0, so the camera follows it
  glm::dvec3 aim_m{0.0};             // what the camera aims at, world; not finite: not known
  double visible_share = 0.0;        // of the sampled points, in this step, [0, 1]
  double filtered_share = 0.0;       // over the last steps, [0, 1]
  double true_share = kPageUnknown;  // of the target's pixels, by a re-render, [0, 1]; most frames have none
  std::string state;                 // "VISIBLE", "PARTIAL", "OCCLUDED", "OFF_SCREEN": other words are shown grey
  double distance_m = 0.0;           // from the camera to aim_m
  uint64_t occluder_id = 0;          // the instance that hides most of it; 0: none
  double occluder_share = 0.0;       // of the target's points that it hides, [0, 1]
};

// A candidate camera position of the step.
struct PageCell {
  glm::vec3 position_m{0.0f};
  uint32_t visible_targets = 0;  // bit i: SessionPage::targets[i] is seen from there in this step
};

// Numbers of candidates by what is seen from them, with the filter over the last steps.
struct PageCounts {
  uint32_t all_visible = 0, some_visible = 0, none_visible = 0;  // S_V, S_P, S_N
};

// The shot in force in one frame, and what was weighed against it (contract: ShotReport, ComparedCourses).
struct PageShot {
  glm::dvec3 place_m{0.0};               // of the shot
  std::array<double, 3> asked{}, now{};  // side and height in radians, distance in metres
  std::array<double, 4> deviation{};     // of side, height, size and place, [0, 1]
  double sight_loss = 0.0, worth = 0.0;  // [0, 1]
  // an instance that hides a target from the place of the shot, or is expected to; 0: none
  uint64_t hidden_by = 0, hidden_target = 0;
  double hidden_in_s = kPageUnknown;  // when it is expected to; unknown: it hides the target now
  std::string course;                 // one word; empty: not known
  // expected of following, staying and the plan
  std::array<double, 3> losses{kPageUnknown, kPageUnknown, kPageUnknown};
};

struct PageFrame {
  uint64_t sequence = 0;
  double time_s = 0.0;  // time that the pose is meant for; never decreases
  Pose camera;          // world_from_camera
  double vertical_fov_rad = 0.0;
  glm::dvec3 velocity_mps{0.0};
  std::vector<PageSight> sights;  // as long as SessionPage::targets
  PageCounts counts;
  std::string status, reason;  // one word each
  std::string text;            // one sentence
  std::optional<PageShot> shot;
  bool cut = false;    // the pose jumped on purpose
  uint32_t flags = 0;  // bit i: SessionPage::flags[i]
  uint32_t merged_ticks = 0;
  double queue_us = kPageUnknown;     // how long the newest tick waited for the step
  std::vector<float> stage_us;        // as long as SessionPage::stages
  double latency_ms = kPageUnknown;   // from the tick to its reply
  double clearance_m = kPageUnknown;  // from the camera to the nearest collider
  std::vector<PageCell> cells;        // may be empty; the page keeps at most kMaxPageCells in all
  int chosen_cell = -1;               // index into `cells`; -1: none
};

// A picture of what the camera saw at one frame.
struct PagePicture {
  size_t frame = 0;        // index into SessionPage::frames
  std::string media_type;  // "image/jpeg" or "image/png"
  std::vector<uint8_t> bytes;
};

// An event at a frame, shown on the time line and in a list.
struct PageMark {
  size_t frame = 0;  // index into SessionPage::frames
  std::string kind;  // one word: "fault", "rejection" and "gap" are shown as trouble, others as notes
  std::string text;
};

// Settings, shown as JSON.
struct PageSettings {
  std::string title;
  std::string json;  // one JSON value; empty: not known
};

// A row of the table of figures: one text for each of SessionPage::columns.
struct FigureRow {
  std::string label;
  std::vector<std::string> values;
};

struct SessionPage {
  std::string title;
  std::vector<std::string> notices;                        // warnings that stand above the page, one sentence each
  std::vector<std::pair<std::string, std::string>> facts;  // name, value: sampler, seed, scene, rate and so on
  double aspect = 16.0 / 9.0;                              // of the picture, width / height, above 0
  double body_radius_m = 0.0;                              // [0, 10]
  // PageFrame::clearance_m is this much where the nearest collider is farther; 0: it is always exact
  double clearance_reach_m = 0.0;
  std::vector<PageInstance> instances;
  std::vector<PageTarget> targets;  // at most 32
  std::vector<PageMover> movers;
  std::vector<std::string> stages;    // names, in the order in which they run
  std::vector<std::string> flags;     // names; at most 32
  std::vector<PageFrame> frames;      // at least one
  std::vector<PagePicture> pictures;  // by frame, ascending
  std::vector<PageMark> marks;        // by frame, ascending
  std::vector<std::string> columns;   // of the figures
  std::vector<FigureRow> figures;
  std::vector<PageSettings> settings;
};

// The most cells of a page: cells of every n-th frame are kept, with the smallest n that stays within it. The page says
// which frame its cells belong to.
inline constexpr size_t kMaxPageCells = 1'000'000;

// The page as text. Deterministic: equal sessions give equal bytes. A row of the wrong length, an index out of range,
// settings that are no JSON, or no frame at all is kInvalidArgument and the field says which.
Result<std::string> session_page(const SessionPage& session);
// The same into a file; kUnavailable with the path when it cannot be written.
Status write_session_page(const SessionPage& session, const std::string& path);

}  // namespace sightline
