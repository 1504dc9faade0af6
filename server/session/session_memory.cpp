// All that a session carries from step to step, as bytes: the one place that lists the fields. A class that gets
// another field does not compile here until the field is in its list. Fields that have no meaning for the next step are
// named and left out.
//
// Ticks say the rest: a session that goes on from these bytes already has the same scene, settings, limits and lens.
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "server/base/field_archive.h"
#include "server/session/session.h"

namespace sightline {

// A friend of the classes whose fields are private.
struct StateFields {
  // --- camera and motion

  template <typename A, SameAs<Pose> T>
  static void each(A& archive, T& pose) {
    auto& [position_m, rotation] = pose;
    archive(position_m, rotation);
  }
  template <typename A, SameAs<CameraState> T>
  static void each(A& archive, T& camera) {
    auto& [pose, velocity, acceleration, angular_velocity] = camera;
    archive(pose, velocity, acceleration, angular_velocity);
  }
  template <typename A, SameAs<ViewAngles> T>
  static void each(A& archive, T& angles) {
    auto& [yaw, pitch, roll] = angles;
    archive(yaw, pitch, roll);
  }
  template <typename A, SameAs<TurnState> T>
  static void each(A& archive, T& turn) {
    auto& [angles, yaw_rate, pitch_rate, roll_rate] = turn;
    archive(angles, yaw_rate, pitch_rate, roll_rate);
  }
  template <typename A, SameAs<ZoomState> T>
  static void each(A& archive, T& zoom) {
    auto& [fov, lens_fov] = zoom;
    archive(fov, lens_fov);
  }
  template <typename A, SameAs<WantedShot> T>
  static void each(A& archive, T& shot) {
    auto& [is_set, target_set, offset, asked_offset, asked, frame, subjects, weight, tolerance, place, up_yaw, cut_s,
           at_asked, asked_viewpoint, asked_seen_s, viewpoint, in_line, line_end, line_closed_s, all_kept_s] = shot;
    archive(is_set, target_set, offset, asked_offset, asked, frame, subjects, weight, tolerance, place, up_yaw, cut_s,
            at_asked, asked_viewpoint, asked_seen_s, viewpoint, in_line, line_end, line_closed_s, all_kept_s);
  }
  template <typename A, SameAs<ShotFrameState> T>
  static void each(A& archive, T& frame) {
    auto& [number, yaw, age, from, to, now, travels_id, lead] = frame;
    archive(number, yaw, age, from, to, now, travels_id, lead);
  }
  template <typename A, SameAs<PlaceInFrame> T>
  static void each(A& archive, T& place) {
    auto& [side, height, distance] = place;
    archive(side, height, distance);
  }
  template <typename A, SameAs<AskedSight> T>
  static void each(A& archive, T& sight) {
    auto& [target, hidden, by, is_hidden, ahead] = sight;
    archive(target, hidden, by, is_hidden, ahead);
  }
  template <typename A, SameAs<Foreseen> T>
  static void each(A& archive, T& foreseen) {
    auto& [in_s, by] = foreseen;
    archive(in_s, by);
  }
  template <typename A, SameAs<CutState> T>
  static void each(A& archive, T& cut) {
    auto& [since, unseen, target_jumped, next_rank, most_seen, takes_partial] = cut;
    archive(since, unseen, target_jumped, next_rank, most_seen, takes_partial);
  }
  template <typename A, SameAs<Trail> T>
  static void each(A& archive, T& trail) {
    auto& [places] = trail;
    archive(places);
  }
  template <typename A, typename Value>
  static void each(A& archive, RecentTrack<Value>& track) {
    auto& [entries] = track;
    archive(entries);
  }
  template <typename A, typename Value>
  static void each(A& archive, const RecentTrack<Value>& track) {
    auto& [entries] = track;
    archive(entries);
  }
  template <typename A, typename T>
  requires SameAs<T, RecentTrack<glm::dvec3>::Entry> || SameAs<T, RecentTrack<glm::dquat>::Entry>
  static void each(A& archive, T& entry) {
    auto& [value, age] = entry;
    archive(value, age);
  }
  template <typename A, SameAs<SuggestedPath> T>
  static void each(A& archive, T& path) {
    auto& [position, rotation] = path;
    archive(position, rotation);
  }

  // --- prediction

  template <typename A, SameAs<PredictionSettings> T>
  static void each(A& archive, T& settings) {
    auto& [ahead, smoothing, lasts, memory, tolerance_m, tolerance_rad, max_speed, max_turn] = settings;
    archive(ahead, smoothing, lasts, memory, tolerance_m, tolerance_rad, max_speed, max_turn);
  }
  template <typename A, SameAs<MotionPredictor::Track::Step> T>
  static void each(A& archive, T& step) {
    auto& [dt, moved] = step;
    archive(dt, moved);
  }
  template <typename A, SameAs<MotionPredictor::Track::Extremes> T>
  static void each(A& archive, T& top) {
    auto& [rate, acceleration, dt] = top;
    archive(rate, acceleration, dt);
  }
  template <typename A, SameAs<MotionPredictor::Track> T>
  static void each(A& archive, T& track) {
    auto& [rate, acceleration, steps, next, count, top, drift, mismatch, judged] = track;
    archive(rate, acceleration, steps, next, count, top, drift, mismatch, judged);
  }
  template <typename A, SameAs<MotionPredictor> T>
  static void each(A& archive, T& predictor) {
    auto& [settings, last, seen, travel, turn] = predictor;
    archive(settings, last, seen, travel, turn);
  }
  template <typename A, SameAs<TargetPast> T>
  static void each(A& archive, T& past) {
    auto& [id, predictor] = past;
    archive(id, predictor);
  }

  // --- visibility

  template <typename A, SameAs<ViewpointMap> T>
  static void each(A& archive, T& map) {
    auto& [directions, distance, ids, shares, known, places, look_up] = map;
    (void)directions, (void)places, (void)look_up;  // constant; working memory
    archive(distance, ids, shares, known);
  }
  template <typename A, SameAs<Lattice::Cell> T>
  static void each(A& archive, T& cell) {
    auto& [index, owner] = cell;
    archive(index, owner);
  }
  template <typename A, SameAs<Lattice> T>
  static void each(A& archive, T& lattice) {
    auto& [spacing, side, runs, size, positions, listed, covers, owners, cells, addresses] = lattice;
    (void)runs, (void)size, (void)positions, (void)listed, (void)addresses;  // made again in every step
    archive(spacing, side, covers, owners, cells);
  }
  template <typename A, SameAs<TargetSwitch> T>
  static void each(A& archive, T& state) {
    auto& [held_until, visible] = state;
    archive(held_until, visible);
  }
  template <typename A, SameAs<VisibilityRecord> T>
  static void each(A& archive, T& record) {
    auto& [visible, known] = record;
    archive(visible, known);
  }
  template <typename A, SameAs<VisibilityHistory::Slot> T>
  static void each(A& archive, T& slot) {
    auto& [owner, step] = slot;
    archive(owner, step);
  }
  template <typename A, SameAs<VisibilityHistory> T>
  static void each(A& archive, T& history) {
    auto& [step, targets, slots, records, scratch] = history;
    (void)scratch;
    archive(step, targets, slots, records);
  }
  template <typename A, SameAs<TemporalVolume> T>
  static void each(A& archive, T& volume) {
    auto& [settings, steps, lattice_slots, target_ids, history, switches, scratch, old_of_new] = volume;
    (void)settings, (void)steps, (void)lattice_slots, (void)scratch, (void)old_of_new;  // of the present step
    archive(target_ids, history, switches);
  }
  template <typename A, SameAs<PairVolume> T>
  static void each(A& archive, T& volume) {
    auto& [a, world_from_volume, length, far, y_top, xa_min, xa_max, xb_min, xb_max, resolution] = volume;
    archive(a, world_from_volume[0], world_from_volume[1], world_from_volume[2], length, far, y_top, xa_min, xa_max,
            xb_min, xb_max, resolution);
  }
  template <typename A, SameAs<ChainLink> T>
  static void each(A& archive, T& link) {
    auto& [from, to, volume] = link;
    archive(from, to, volume);
  }
  template <typename A, SameAs<PairHistory::Frame> T>
  static void each(A& archive, T& frame) {
    auto& [target_ids, links, jitter, slack, depth] = frame;
    archive(target_ids, links, jitter, slack, depth);
  }
  template <typename A, SameAs<PairHistory> T>
  static void each(A& archive, T& history) {
    auto& [frames, newest, records, index_in_frame] = history;
    (void)records, (void)index_in_frame;  // of the present step
    archive(frames, newest);
  }
  template <typename A, SameAs<OcclusionSmoother::Past> T>
  static void each(A& archive, T& past) {
    auto& [owner, step, smoothed] = past;
    archive(owner, step, smoothed);
  }
  template <typename A, SameAs<OcclusionSmoother> T>
  static void each(A& archive, T& smoother) {
    auto& [step, cells, travellers] = smoother;
    archive(step, cells, travellers);
  }
  template <typename A, SameAs<HiddenAhead::Slice> T>
  static void each(A& archive, T& slice) {
    auto& [renewed, shares] = slice;
    archive(renewed, shares);
  }
  template <typename A, SameAs<HiddenAhead> T>
  static void each(A& archive, T& ahead) {
    auto& [slices, first, next, steps, newest_owner] = ahead;
    archive(slices, first, next, steps, newest_owner);
  }
  template <typename A, SameAs<CandidateMemory> T>
  static void each(A& archive, T& memory) {
    auto& [lattice, volume, pairs, smoother, ahead, ahead_targets] = memory;
    archive(lattice, volume, pairs, smoother, ahead, ahead_targets);
  }
  template <typename A, SameAs<ShareWindow::Step> T>
  static void each(A& archive, T& step) {
    auto& [time, seen, points] = step;
    archive(time, seen, points);
  }
  template <typename A, SameAs<ShareWindow::Track> T>
  static void each(A& archive, T& track) {
    auto& [id, added, kept, ring] = track;
    archive(id, added, kept, ring);
  }
  template <typename A, SameAs<ShareWindow> T>
  static void each(A& archive, T& window) {
    auto& [time, tracks] = window;
    archive(time, tracks);
  }

  template <typename A, SameAs<Plate> T>
  static void each(A& archive, T& plate) {
    auto& [middle, half_u, half_v] = plate;
    archive(middle, half_u, half_v);
  }
  template <typename A, SameAs<Doors::Leaf> T>
  static void each(A& archive, T& leaf) {
    auto& [id, rest, rested_s, away_s, there] = leaf;
    archive(id, rest, rested_s, away_s, there);
  }
  template <typename A, SameAs<Doors> T>
  static void each(A& archive, T& doors) {
    auto& [leaves] = doors;
    archive(leaves);
  }

  // --- the whole

  template <typename A, SameAs<BlindState> T>
  static void each(A& archive, T& blind) {
    auto& [blind_s, shot_gains_s, searched_s, way] = blind;
    archive(blind_s, shot_gains_s, searched_s, way);
  }
  template <typename A, SameAs<SummedGain> T>
  static void each(A& archive, T& gain) {
    auto& [sum_metre_s] = gain;
    archive(sum_metre_s);
  }
  template <typename A, SameAs<Pace> T>
  static void each(A& archive, T& pace) {
    auto& [response, closing, braking] = pace;
    archive(response, closing, braking);
  }
  template <typename A, SameAs<Tracking> T>
  static void each(A& archive, T& tracking) {
    auto& [by, pace, vector, beyond] = tracking;
    archive(by, pace, vector, beyond);
  }
  template <typename A, SameAs<HeldFacts> T>
  static void each(A& archive, T& facts) {
    auto& [goal_sees_all_s, goal_keeps_shot_s, none_sees_all_s] = facts;
    archive(goal_sees_all_s, goal_keeps_shot_s, none_sees_all_s);
  }
  template <typename A, SameAs<ComparedCourses> T>
  static void each(A& archive, T& courses) {
    auto& [taken, follow_loss, stay_loss, plan_loss] = courses;
    archive(taken, follow_loss, stay_loss, plan_loss);
  }
  template <typename A, SameAs<SightCounts> T>
  static void each(A& archive, T& counts) {
    auto& [total, all, some, none, by_target] = counts;
    archive(total, all, some, none, by_target);
  }
  template <typename A, SameAs<DecisionInForce> T>
  static void each(A& archive, T& last) {
    auto& [age_s, clock_s, made, is_due, tracking, status, reason, courses, facts, view_way, sees_none, nearest_view,
           counts, target_ids, seen] = last;
    archive(age_s, clock_s, made, is_due, tracking, status, reason, courses, facts, view_way, sees_none, nearest_view,
            counts, target_ids, seen);
  }
  template <typename A, SameAs<CarriedState> T>
  static void each(A& archive, T& state) {
    auto& [camera, turn, zoom, horizon, shot, viewpoints, pasts, trail, candidates, doors, goal, follows, change, blind,
           in_force, shares, given_up, not_aimed_at, path, cut, pull] = state;
    archive(camera, turn, zoom, horizon, shot, viewpoints, pasts, trail, candidates, doors, goal, follows, change,
            blind, in_force, shares, given_up, not_aimed_at, path, cut, pull);
  }
  template <typename A, SameAs<Target> T>
  static void each(A& archive, T& target) {
    auto& [id, weight, required, aim_offset, layers, attached, ignored, parts] = target;
    archive(id, weight, required, aim_offset, layers, attached, ignored, parts);
  }

  // An instance that has moved: where it is, to the bit.
  struct Moved {
    uint64_t id = 0;
    Pose pose;
    glm::dvec3 velocity_mps{0.0}, angular_velocity_radps{0.0}, correction_m{0.0};
  };
  template <typename A, SameAs<Moved> T>
  static void each(A& archive, T& instance) {
    auto& [id, pose, velocity, angular_velocity, correction] = instance;
    archive(id, pose, velocity, angular_velocity, correction);
  }
  // Slots decide the order of what is equal otherwise.
  struct Slot {
    uint32_t slot = 0;
    uint64_t id = 0;  // 0: free
  };
  template <typename A, SameAs<Slot> T>
  static void each(A& archive, T& place) {
    auto& [slot, id] = place;
    archive(slot, id);
  }
  struct Scene {
    uint64_t revision = 0, hash = 0, slot_count = 0;
    std::vector<Moved> moved;
    std::vector<Slot> rearranged;
    std::vector<uint32_t> free_slots;
  };
  template <typename A, SameAs<Scene> T>
  static void each(A& archive, T& scene) {
    auto& [revision, hash, slot_count, moved, rearranged, free_slots] = scene;
    archive(revision, hash, slot_count, moved, rearranged, free_slots);
  }
  template <typename A, SameAs<MotionTrack::Belief> T>
  static void each(A& archive, T& belief) {
    auto& [at, velocity, position, both, of_velocity, share] = belief;
    archive(at, velocity, position, both, of_velocity, share);
  }
  template <typename A, SameAs<MotionTrack> T>
  static void each(A& archive, T& track) {
    auto& [known, stands, held, filters, noisy, sent, last, since, ticks_since, intervals_s, intervals, held_share,
           mean_interval, interval_variance, last_mps, last_miss, misses, miss_product, beliefs, believed] = track;
    archive(known, stands, held, filters, noisy, sent, last, since, ticks_since, intervals_s, intervals, held_share,
            mean_interval, interval_variance, last_mps, last_miss, misses, miss_product, beliefs, believed);
  }
  template <typename A, SameAs<TurnTrack> T>
  static void each(A& archive, T& track) {
    auto& [sent, turned, since, interval, rate, turning] = track;
    archive(sent, turned, since, interval, rate, turning);
  }
  template <typename A, SameAs<Session::Track> T>
  static void each(A& archive, T& track) {
    auto& [motion, turn] = track;
    archive(motion, turn);
  }
  struct TrackOf {
    uint64_t id = 0;
    Session::Track track;
  };
  template <typename A, SameAs<TrackOf> T>
  static void each(A& archive, T& of) {
    auto& [id, track] = of;
    archive(id, track);
  }
  struct Memory {
    Scene scene;
    std::vector<Target> targets;
    uint64_t shot_number = 0;
    bool ticked = false;
    uint64_t sequence = 0, steps = 0;
    double time_s = 0.0;
    std::vector<TrackOf> tracks;
    std::vector<uint64_t> derived_moving, former_ids;
    CarriedState carried;
  };
  template <typename A, SameAs<Memory> T>
  static void each(A& archive, T& memory) {
    auto& [scene, targets, shot_number, ticked, sequence, steps, time, tracks, derived_moving, former_ids,
           carried] = memory;
    archive(scene, targets, shot_number, ticked, sequence, steps, time, tracks, derived_moving, former_ids, carried);
  }

  // --- the scene

  static Scene scene_of(const SceneMirror& mirror) {
    Scene scene{.revision = mirror.revision_,
                .hash = mirror.hash_,
                .slot_count = mirror.slots_.size(),
                .moved = {},
                .rearranged = {},
                .free_slots = mirror.free_slots_};
    for (const uint32_t slot : mirror.moving_slots_) {
      const Instance& instance = mirror.slots_[slot];
      scene.moved.push_back(
          {instance.id, instance.pose, instance.velocity_mps, instance.angular_velocity_radps, instance.correction_m});
    }
    for (const uint32_t slot : mirror.rearranged_slots_) scene.rearranged.push_back({slot, mirror.slots_[slot].id});
    return scene;
  }

  // The slot of every instance, by `scene`; empty when the mirror holds other instances.
  static std::vector<uint64_t> ids_by_slot(const SceneMirror& mirror, const Scene& scene) {
    std::vector<uint64_t> ids(std::min<uint64_t>(scene.slot_count, kMaxInstances), 0);
    size_t placed = 0;
    std::set<uint64_t> rearranged;
    for (const auto& [slot, id] : scene.rearranged) {
      if (slot >= ids.size() || (id != 0 && (!mirror.slot_of(id) || !rearranged.insert(id).second))) return {};
      ids[slot] = id;
      placed += id != 0;
    }
    for (const auto& [id, slot] : mirror.slot_by_id_) {
      if (rearranged.contains(id)) continue;
      if (slot >= ids.size() || ids[slot] != 0) return {};
      ids[slot] = id;
      ++placed;
    }
    std::vector<bool> is_free(ids.size(), false);
    for (const uint32_t slot : scene.free_slots) {
      if (slot >= ids.size() || ids[slot] != 0 || is_free[slot]) return {};
      is_free[slot] = true;
    }
    return placed == mirror.size() && placed + scene.free_slots.size() == ids.size() ? ids : std::vector<uint64_t>{};
  }

  static bool resume(SceneMirror& mirror, const Scene& scene) {
    constexpr double kMostCorrectionM = 1e3;  // a tenth of a second at the fastest motion is far less
    const std::vector<uint64_t> ids = ids_by_slot(mirror, scene);
    if (ids.empty() && scene.slot_count > 0) return false;
    for (const Moved& moved : scene.moved)
      if (!(glm::length(moved.correction_m) < kMostCorrectionM) || !mirror.find(moved.id) ||
          !(std::abs(glm::length(moved.pose.rotation) - 1.0) < 1e-3))
        return false;
    std::vector<Instance> slots(ids.size());
    for (size_t slot = 0; slot < ids.size(); ++slot)
      if (ids[slot] != 0) slots[slot] = std::move(mirror.slots_[mirror.slot_by_id_.at(ids[slot])]);
    mirror.slots_ = std::move(slots);
    mirror.slot_by_id_.clear();
    mirror.record_hashes_.assign(ids.size(), 0);
    mirror.named_in_.assign(ids.size(), 0);
    mirror.free_slots_ = scene.free_slots;
    mirror.rearranged_slots_.clear();
    for (const auto& place : scene.rearranged) mirror.rearranged_slots_.insert(place.slot);
    mirror.hash_ = 0;
    for (uint32_t slot = 0; slot < ids.size(); ++slot)
      if (ids[slot] != 0)
        mirror.slot_by_id_.emplace(ids[slot], slot), mirror.slots_[slot].moving = false, mirror.place(slot);
    mirror.moving_slots_.clear();
    for (const Moved& moved : scene.moved) move(mirror, mirror.slot_by_id_.at(moved.id), moved);
    mirror.tidy_moving_slots();
    mirror.revision_ = scene.revision;
    ++mirror.version_, ++mirror.static_version_, ++mirror.moving_version_;
    return mirror.hash_ == scene.hash;
  }

  // As SceneMirror::move, but to the bit: the rotation is not normalised again.
  static void move(SceneMirror& mirror, uint32_t slot, const Moved& moved) {
    Instance& instance = mirror.slots_[slot];
    instance.pose = moved.pose;
    instance.velocity_mps = moved.velocity_mps, instance.angular_velocity_radps = moved.angular_velocity_radps,
    instance.correction_m = moved.correction_m;
    instance.moving = true;
    mirror.moving_slots_.push_back(slot);
    mirror.place(slot);
  }

  // --- bytes that may come from anywhere

  static bool possible(const MotionPredictor::Track& track) {
    return track.next_ < MotionPredictor::kKept && track.count_ <= MotionPredictor::kKept;
  }
  // Numbers that no motion has would make the estimate infinite.
  static bool possible(const MotionTrack& track) {
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
  static bool possible(const Session::Track& track) {
    const TurnTrack& turn = track.turn;
    const auto rate = [](const glm::dvec3& radps) { return glm::length(radps) <= kMostTurnRadps; };
    return possible(track.motion) && rate(turn.turning_radps_) && rate(turn.rate_radps_) && turn.since_s_ >= 0 &&
           turn.interval_s_ >= 0;
  }
  static bool possible(const PairHistory::Frame& frame) {
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
  static bool possible(const PairHistory& history) {
    const auto& frames = history.frames_;
    return frames.size() <= kHistorySteps && (frames.empty() || history.newest_ < frames.size()) &&
           std::all_of(frames.begin(), frames.end(), [](const PairHistory::Frame& frame) { return possible(frame); });
  }
  static bool possible(const CandidateMemory& memory) {
    const Lattice& lattice = memory.lattice;
    const VisibilityHistory& history = memory.volume.history_;
    const uint64_t side = static_cast<uint64_t>(std::max(lattice.side_, 0));
    const bool cells = lattice.cells_.empty() || (side < 4096 && lattice.cells_.size() == side * side * side);
    const size_t rows = history.slots_.size() * history.targets_;
    return lattice.side_ >= 0 && lattice.spacing_m_ >= 0 && cells && possible(memory.pairs) &&
           history.targets_ <= kMaxTargets && memory.volume.target_ids_.size() == history.targets_ &&
           history.records_.size() == rows && memory.volume.switches_.size() == rows;
  }
  static bool possible(const ViewpointMap& map) {
    return map.ids_.size() <= kMaxTargets && map.shares_.size() == map.ids_.size() * ViewpointMap::kViewpoints &&
           map.known_s_.size() == map.ids_.size() && map.distance_m_ > 0;
  }
  template <typename Enum>
  static bool up_to(Enum value, Enum last) {
    return static_cast<int>(value) >= 0 && value <= last;
  }
  static bool possible(const ComparedCourses& courses) {
    const auto loss = [](const std::optional<double>& of) {
      return of.value_or(0.0) >= 0 && of.value_or(0.0) <= kMostLoss;
    };
    return up_to(courses.taken.value_or(FlightCourse::kFollow), FlightCourse::kToShot) && loss(courses.follow_loss) &&
           loss(courses.stay_loss) && loss(courses.plan_loss);
  }
  static bool possible(const HeldFacts& facts) {
    const auto held = [](double time_s) { return time_s >= 0 && time_s <= kFactHoldsS; };
    return held(facts.goal_sees_all_s) && held(facts.goal_keeps_shot_s) && held(facts.none_sees_all_s);
  }
  static bool possible(const DecisionInForce& last) {
    return last.age_s >= 0 && last.clock_s >= 0 && last.clock_s < 1e15 &&
           up_to(last.tracking.by, TrackBy::kAcceleration) && up_to(last.status, MoveStatus::kHolding) &&
           up_to(last.reason, MoveReason::kCut) && possible(last.courses) && possible(last.facts) &&
           last.counts.visible_by_target.size() <= kMaxTargets;
  }
  static bool possible(const AskedSight& sight) {
    // The time of the last slice is a sum, which may be rounded up.
    constexpr double kLastS = (kSlices + 0.5) * kSliceS;
    const auto in_time = [](const Foreseen& of) { return of.in_s >= 0 && of.in_s <= kLastS; };
    return sight.hidden >= 0 && sight.hidden <= 1 && std::all_of(sight.ahead.begin(), sight.ahead.end(), in_time);
  }
  static bool possible(const CarriedState& state) {
    const auto past = [](const TargetPast& of) {
      return possible(of.predictor.travel_) && possible(of.predictor.turn_);
    };
    const auto track = [](const ShareWindow::Track& of) { return of.kept <= kShareSteps; };
    const auto& shares = state.shares.tracks_;
    const auto known = [](size_t viewpoint) { return viewpoint < ViewpointMap::kViewpoints; };
    const auto asked = [](const AskedSight& of) { return possible(of); };
    return std::all_of(state.shot.at_asked.begin(), state.shot.at_asked.end(), asked) && possible(state.candidates) &&
           possible(state.viewpoints) && possible(state.in_force) && state.pasts.size() <= kMaxTargets &&
           std::all_of(state.pasts.begin(), state.pasts.end(), past) && shares.size() <= kMaxTargets &&
           std::all_of(shares.begin(), shares.end(), track) && state.trail.places_m().size() <= Trail::kPlaces &&
           state.path.position_m.count() > 0 && state.path.rotation.count() > 0 && known(state.shot.asked_viewpoint) &&
           known(state.shot.viewpoint.value_or(0));
  }
};

namespace {

Status unfit(const char* why) {
  return invalid("memory", why);
}

}  // namespace

uint64_t Session::memory_layout() {
  static const uint64_t number = [] {
    FieldLayout<StateFields> layout;
    layout(StateFields::Memory{});
    layout(std::array<uint8_t, ViewpointMap::kViewpoints>{});  // shares of viewpoints have a meaning only among as many
    return layout.number();
  }();
  return number;
}

void Session::write_memory(std::string& out) const {
  std::vector<StateFields::TrackOf> tracks;
  for (const auto& [id, track] : tracks_) tracks.push_back({id, track});
  std::ranges::sort(tracks, {}, &StateFields::TrackOf::id);
  FieldWriter<StateFields> write(out);
  write(StateFields::scene_of(mirror_), options_.targets, options_.shot.number, ticked_, sequence_, steps_, time_s_,
        tracks, derived_moving_, former_ids_, stepper_.carried());
}

Status Session::resume(uint64_t layout, std::string_view memory) {
  if (layout != memory_layout()) return unfit("was written by a version of the program that carries other data");
  FieldReader<StateFields> read(memory);
  StateFields::Memory found;
  read(found);
  if (read.failed() || !read.at_end() || !StateFields::possible(found.carried)) return unfit("is damaged");
  for (const StateFields::TrackOf& of : found.tracks)
    if (!StateFields::possible(of.track)) return unfit("is damaged");
  for (const Target& target : found.targets)
    if (!mirror_.find(target.instance_id)) return unfit("is of a session with other targets");
  if (found.targets.size() > kMaxTargets) return unfit("is damaged");
  if (!StateFields::resume(mirror_, found.scene)) return unfit("is of another scene");
  options_.targets = std::move(found.targets);
  options_.shot.number = found.shot_number;
  take_extents();
  ticked_ = found.ticked;
  sequence_ = found.sequence;
  steps_ = found.steps;
  time_s_ = found.time_s;
  tracks_.clear();
  for (const StateFields::TrackOf& of : found.tracks)
    if (mirror_.find(of.id)) tracks_.emplace(of.id, of.track);
  derived_moving_ = std::move(found.derived_moving);
  former_ids_ = std::move(found.former_ids);
  pending_dt_s_ = 0.0;
  pending_ticks_ = 0;
  pending_cut_ = false;
  stepper_.resume(std::move(found.carried));
  return {};
}

}  // namespace sightline
