// Subjects: what a director changes while the camera runs. The subject changes from one person to another; a runner
// turns back again and again; two people talk, filmed over a shoulder; people stand too far apart for the first
// picture. It tests whether the shot that was asked for goes along.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sightline::scenes {

// Six people walk about their places, `apart_m` from their neighbours, between columns. One of them is the target, for
// `each_s` at a time; then a neighbour is. The camera starts 5 m from the first.
struct CycleOptions {
  uint64_t seed = 1;
  double duration_s = 32.0;  // [1, 600]
  double apart_m = 5.0;      // [3, 40]
  double each_s = 4.0;       // > 0
};
std::vector<std::byte> make_cycle(const CycleOptions& options);

// One target runs at 5 m/s between columns 8 m apart, and turns at each crossing: to a side, or back. The camera starts
// 5 m behind.
struct RunnerOptions {
  uint64_t seed = 1;
  double duration_s = 30.0;  // [1, 600]
};
std::vector<std::byte> make_runner(const RunnerOptions& options);

// Two people talk in a room under a ceiling at 2.8 m. They stand 1.6 m apart and step about a little, and two others
// walk past. Only the speaker's head is a target ("speaker-head"). The camera starts over the listener's right
// shoulder.
struct ConversationOptions {
  uint64_t seed = 1;
  double duration_s = 20.0;  // [1, 600]
};
std::vector<std::byte> make_conversation(const ConversationOptions& options);

// Open ground with a few columns. `people` stand `apart_m` from one another, and the camera starts in the middle
// between them, so that its first picture shows none.
struct ApartOptions {
  uint64_t seed = 1;
  double duration_s = 12.0;  // [1, 600]
  int people = 2;            // [2, 3]
  double apart_m = 20.0;     // [5, 60]
};
std::vector<std::byte> make_apart(const ApartOptions& options);

}  // namespace sightline::scenes
