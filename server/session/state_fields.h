// All that a session carries from step to step: the one place that lists the fields. A class that gets another field
// does not compile here until the field is in its list. Fields that have no meaning for the next step are named and
// left out. session_memory.cpp writes and reads them as bytes.
//
// Ticks say the rest: a session that goes on from these bytes already has the same scene, settings, limits and lens.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

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
    auto& [id, rest, rested_s, away_s] = leaf;
    archive(id, rest, rested_s, away_s);
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
    auto& [camera, turn, zoom, horizon, shot, viewpoints, pasts, candidates, doors, goal, follows, change, blind,
           in_force, shares, given_up, not_aimed_at, path, cut, pull] = state;
    archive(camera, turn, zoom, horizon, shot, viewpoints, pasts, candidates, doors, goal, follows, change, blind,
            in_force, shares, given_up, not_aimed_at, path, cut, pull);
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

  // --- the scene (session_memory.cpp)

  static Scene scene_of(const SceneMirror& mirror);
  // Gives the instances the slots and the motion of `scene`. False: the mirror holds other instances, or what `scene`
  // says is impossible. The mirror may then be changed in part.
  static bool resume(SceneMirror& mirror, const Scene& scene);
  // The slot of every instance, by `scene`; empty when the mirror holds other instances.
  static std::vector<uint64_t> ids_by_slot(const SceneMirror& mirror, const Scene& scene);
  // As SceneMirror::move, but to the bit: the rotation is not normalised again.
  static void move(SceneMirror& mirror, uint32_t slot, const Moved& moved);

  // --- bytes that may come from anywhere (possible_state.cpp)

  // False: no session carries these values, and a step from them could read outside its memory or make numbers that are
  // not finite.
  static bool possible(const MotionPredictor::Track& track);
  static bool possible(const MotionTrack& track);
  static bool possible(const Session::Track& track);
  static bool possible(const PairHistory::Frame& frame);
  static bool possible(const PairHistory& history);
  static bool possible(const CandidateMemory& memory);
  static bool possible(const ViewpointMap& map);
  static bool possible(const Doors& doors);
  static bool possible(const ComparedCourses& courses);
  static bool possible(const HeldFacts& facts);
  static bool possible(const DecisionInForce& last);
  static bool possible(const AskedSight& sight);
  static bool possible(const CarriedState& state);
};

}  // namespace sightline
