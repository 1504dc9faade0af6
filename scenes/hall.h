// Hall (the scene of the paper's Table 2): two targets walk side by side through the nave of a colonnade and turn
// sharply. Meanwhile curtains are drawn across the nave between them and their camera.
//
// In Table 2, a camera that takes the nearest visible candidate loses both targets in one frame of eight. A camera that
// looks 0.3 s ahead and keeps away from occluded candidates never does. The occluder must therefore be sudden and wide.
// A camera that knows it 0.3 s before must still be able to avoid it.
//   Sudden       A curtain comes at 4 m/s and covers both targets within 0.15 s of touching the first. It stops 0.8 m
//   beyond the
//                line to them: a camera at rest that accelerates at 10 m/s^2 sees one of them again after 0.4 s.
//   Predictable  It is drawn straight out of an aisle and moves in sight for over half a second before it hides
//   anything. A curtain
//                that drops from above the ceiling gives no warning, and every row of the table then loses the same.
//   Avoidable    It is drawn 1.1 m in front of the point 5 m behind the targets, so that one metre to the side is
//   enough. The shadow
//                of a curtain near the targets would cover more than a camera can leave in time.
//   Apart        It comes on a straight leg, 1 s after the turn before it and 1.5 s after the last curtain has gone. A
//   camera that is
//                still returning at 3 m/s could not turn back in time.
// A prediction over a long time is wrong at sharp turns and when the curtain stops. At 0.5 s it predicts that the
// curtain goes on by 2 m. The targets stay side by side across the nave when they turn, so that neither hides the other
// from behind. They walk between the rows of columns, so that no column is between them and a camera in the nave.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct HallOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;      // [1, 600]; the hall is as long as the walk needs
  double ceiling_m = 4.5;        // [4, 20]
  double wall_share = 0.5;       // [0, 1]: share of the bays in the aisles that are walled up
  double curtain_pause_s = 1.5;  // [0, 600]: least time between one curtain leaving and the next one coming
  bool from_front = false;       // the camera is 5 m before the targets and sees their faces, instead of 5 m behind
};

// A .glb file. Nothing in it blocks the path of the targets.
std::vector<std::byte> make_hall(const HallOptions& options);

}  // namespace sightline::scenes
