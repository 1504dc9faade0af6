// Hall (the scene of the paper's Table 2): a colonnade in whose nave two targets walk side by side and turn sharply, while
// curtains are drawn across the nave between them and their camera.
//
// Table 2 says what such a hall is: the nearest visible place loses both targets in one frame of eight, and a camera that
// shelters and looks 0.3 s ahead never does. So what hides must be sudden, wide and avoidable, by who knows it 0.3 s before:
//   sudden     a curtain comes at 4 m/s and covers both targets within 0.15 s of its touching the first. It
//              stops 0.8 m beyond the line to them: from rest, 0.4 s of 10 m/s^2 to see one again.
//   foreseen   it is drawn out of an aisle straight across, so that it has moved in sight for over half a second before it
//              hides anything. (Curtains that drop from above the ceiling tell nobody: every row loses the same.)
//   avoidable  it is drawn 1.1 m before the place 5 m behind the targets, so that a metre to the side is enough. A curtain
//              near the targets has a shadow of their whole way, which no camera leaves in time.
//   apart      it comes on a straight leg, 1 s after the turn before it and 1.5 s after the last one has gone: a camera that
//              is still on its way back at 3 m/s cannot turn in time, whatever it knows.
// Sharp turns are what a long look ahead gets wrong, as does the curtain's stop: at 0.5 s it is foretold to go on by 2 m.
// The targets keep side by side across the nave when they turn, so that seen from behind neither hides the other. They walk
// between the rows of columns, so that none stands between them and a camera in the nave.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

struct HallOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;  // [1, 600]; the hall is as long as the walk needs
  double ceiling_m = 4.5;    // [4, 20]
  double wall_share = 0.5;   // [0, 1]: of the places in the aisles beside a column, how many are walled up
  double curtain_pause_s = 1.5;  // [0, 600]: the least time from one curtain's going to the next one's coming
};

// A .glb file. Nothing in it ever blocks the way that the targets take.
std::vector<std::byte> make_hall(const HallOptions& options);

}  // namespace sightline::scenes
