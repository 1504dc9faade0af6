// Bytes that may come from anywhere: whether what was read from them is what a session could carry. A recording may be
// damaged, or made to do harm.
#include <algorithm>
#include <cmath>

#include "server/session/state_fields.h"

namespace sightline {
namespace {

template <typename Enum>
bool up_to(Enum value, Enum last) {
  return static_cast<int>(value) >= 0 && value <= last;
}

}  // namespace

bool StateFields::possible(const MotionPredictor::Track& track) {
  return track.next_ < MotionPredictor::kKept && track.count_ <= MotionPredictor::kKept;
}

// Numbers that no motion has would make the estimate infinite.
bool StateFields::possible(const MotionTrack& track) {
  constexpr double kMost = 1e10;
  const auto small = [&](const glm::dvec3& v) { return glm::length(v) < kMost; };
  const auto share_of = [](double value) { return value >= 0 && value <= 1; };
  const auto belief = [&](const MotionTrack::Belief& of) {
    return small(of.at_m) && small(of.velocity_mps) && of.position >= 0 && of.position < kMost && of.velocity >= 0 &&
           of.velocity < kMost && of.both * of.both <= 1.01 * of.position * of.velocity + 1e-12 && share_of(of.share);
  };
  double shares = 0;
  for (const MotionTrack::Belief& of : track.beliefs_) shares += of.share;
  if (track.filters_ && !(std::abs(shares - 1) < 1e-6)) return false;
  const auto time = [](double value_s) { return value_s >= 0 && value_s < kMost; };
  return small(track.last_m_) && small(track.last_mps_) && small(track.last_miss_m_) && time(track.since_s_) &&
         time(track.believed_s_) && time(track.mean_interval_s_) && time(track.interval_variance_s2_) &&
         std::abs(track.miss_product_m2_) < kMost && share_of(track.held_share_) &&
         std::all_of(track.intervals_s_.begin(), track.intervals_s_.end(), time) &&
         std::all_of(track.beliefs_.begin(), track.beliefs_.end(), belief);
}

bool StateFields::possible(const Session::Track& track) {
  const TurnTrack& turn = track.turn;
  const auto rate = [](const glm::dvec3& radps) { return glm::length(radps) <= kMostTurnRadps; };
  return possible(track.motion) && rate(turn.turning_radps_) && rate(turn.rate_radps_) && turn.since_s_ >= 0 &&
         turn.interval_s_ >= 0;
}

// A plate without an area has no normal.
bool StateFields::possible(const Doors& doors) {
  constexpr double kLeastM = 1e-6, kMostM = 1e10;
  const auto side = [](const glm::dvec3& half_m) {
    return glm::length(half_m) > kLeastM && glm::length(half_m) < kMostM;
  };
  const auto leaf = [&](const Doors::Leaf& of) {
    const glm::dvec3 normal = glm::cross(of.rest.half_u_m, of.rest.half_v_m);
    return glm::length(of.rest.middle_m) < kMostM && side(of.rest.half_u_m) && side(of.rest.half_v_m) &&
           glm::length(normal) > kLeastM * kLeastM && of.rested_s >= 0 && of.away_s >= 0;
  };
  return std::ranges::all_of(doors.leaves_, leaf) &&
         std::ranges::adjacent_find(doors.leaves_, std::greater_equal<>(), &Doors::Leaf::id) == doors.leaves_.end();
}

bool StateFields::possible(const PairHistory::Frame& frame) {
  const size_t targets = frame.target_ids.size();
  const int side = frame.links.empty() ? 0 : frame.links.front().volume.resolution;
  const auto joins = [&](const ChainLink& link) {
    return link.from < targets && link.to < targets && link.volume.resolution == side && link.volume.length_m > 0 &&
           link.volume.far_m > 0 && link.volume.xa_min < link.volume.xa_max &&
           link.volume.xb_min < link.volume.xb_max && link.volume.y_top > 0;
  };
  const bool chained = frame.links.empty() || frame.links.size() == targets - 1;
  return targets <= kMaxTargets && chained && side >= 0 && side <= kMaxMapSize &&
         std::all_of(frame.links.begin(), frame.links.end(), joins) &&
         (frame.links.empty() || (side > 0 && frame.depth_m.size() == targets * static_cast<size_t>(side * side)));
}

bool StateFields::possible(const PairHistory& history) {
  const auto& frames = history.frames_;
  return frames.size() <= kHistorySteps && (frames.empty() || history.newest_ < frames.size()) &&
         std::all_of(frames.begin(), frames.end(), [](const PairHistory::Frame& frame) { return possible(frame); });
}

bool StateFields::possible(const CandidateMemory& memory) {
  const Lattice& lattice = memory.lattice;
  const VisibilityHistory& history = memory.volume.history_;
  const uint64_t side = static_cast<uint64_t>(std::max(lattice.side_, 0));
  const bool cells = lattice.cells_.empty() || (side < 4096 && lattice.cells_.size() == side * side * side);
  const size_t rows = history.slots_.size() * history.targets_;
  return lattice.side_ >= 0 && lattice.spacing_m_ >= 0 && cells && possible(memory.pairs) &&
         history.targets_ <= kMaxTargets && memory.volume.target_ids_.size() == history.targets_ &&
         history.records_.size() == rows && memory.volume.switches_.size() == rows;
}

bool StateFields::possible(const ViewpointMap& map) {
  return map.ids_.size() <= kMaxTargets && map.shares_.size() == map.ids_.size() * ViewpointMap::kViewpoints &&
         map.known_s_.size() == map.ids_.size() && map.distance_m_ > 0;
}

bool StateFields::possible(const ComparedCourses& courses) {
  const auto loss = [](const std::optional<double>& of) {
    return of.value_or(0.0) >= 0 && of.value_or(0.0) <= kMostLoss;
  };
  return up_to(courses.taken.value_or(FlightCourse::kFollow), FlightCourse::kToShot) && loss(courses.follow_loss) &&
         loss(courses.stay_loss) && loss(courses.plan_loss);
}

bool StateFields::possible(const HeldFacts& facts) {
  const auto held = [](double time_s) { return time_s >= 0 && time_s <= kFactHoldsS; };
  return held(facts.goal_sees_all_s) && held(facts.goal_keeps_shot_s) && held(facts.none_sees_all_s);
}

bool StateFields::possible(const DecisionInForce& last) {
  return last.age_s >= 0 && last.clock_s >= 0 && last.clock_s < 1e15 &&
         up_to(last.tracking.by, TrackBy::kAcceleration) && up_to(last.status, MoveStatus::kHolding) &&
         up_to(last.reason, MoveReason::kCut) && possible(last.courses) && possible(last.facts) &&
         last.counts.visible_by_target.size() <= kMaxTargets;
}

bool StateFields::possible(const AskedSight& sight) {
  // The time of the last slice is a sum, which may be rounded up.
  constexpr double kLastS = (kSlices + 0.5) * kSliceS;
  const auto in_time = [](const Foreseen& of) { return of.in_s >= 0 && of.in_s <= kLastS; };
  return sight.hidden >= 0 && sight.hidden <= 1 && std::all_of(sight.ahead.begin(), sight.ahead.end(), in_time);
}

bool StateFields::possible(const CarriedState& state) {
  const auto past = [](const TargetPast& of) { return possible(of.predictor.travel_) && possible(of.predictor.turn_); };
  const auto track = [](const ShareWindow::Track& of) { return of.kept <= kShareSteps; };
  const auto& shares = state.shares.tracks_;
  const auto known = [](size_t viewpoint) { return viewpoint < ViewpointMap::kViewpoints; };
  const auto asked = [](const AskedSight& of) { return possible(of); };
  return std::all_of(state.shot.at_asked.begin(), state.shot.at_asked.end(), asked) && possible(state.candidates) &&
         possible(state.viewpoints) && possible(state.in_force) && state.pasts.size() <= kMaxTargets &&
         std::all_of(state.pasts.begin(), state.pasts.end(), past) && shares.size() <= kMaxTargets &&
         std::all_of(shares.begin(), shares.end(), track) && possible(state.doors) &&
         state.path.position_m.count() > 0 && state.path.rotation.count() > 0 && known(state.shot.asked_viewpoint) &&
         known(state.shot.viewpoint.value_or(0));
}

}  // namespace sightline
