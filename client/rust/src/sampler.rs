//! The camera at the time of drawing, from replies that come less often and late.
use crate::rotations::{inverse, minus, plus, product, read, read_rotation, rotation_of, times, turn_of, Quaternion, Vector, ORIGIN};
use crate::v1::CameraReply;

const FULL_S: f64 = 0.15; // a reply's velocities carry the camera on in full for so long
const STOP_S: f64 = 0.35; // until then they ease out
const FADE_S: f64 = 0.02; // what a new reply changes fades in with this time constant

/// A camera that can be drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    pub position: Vector,
    pub rotation: Quaternion,
    pub field_of_view: f64,
    /// It jumped since the former sample; reset what smooths over frames.
    pub cut: bool,
}

/// For how long a reply's velocities have carried the camera at this age: at most 0.25 s.
fn carried_s(age_s: f64) -> f64 {
    if age_s <= FULL_S {
        return age_s.max(-FULL_S);
    }
    let easing_s = age_s.min(STOP_S) - FULL_S;
    FULL_S + easing_s - easing_s * easing_s / (2.0 * (STOP_S - FULL_S))
}

/// The part of a reply that the sampler needs.
#[derive(Debug, Clone, Copy)]
struct Newest {
    time_s: f64,
    pose: Sample,
    velocity: Vector,
    angular_velocity: Vector,
    target_id: u64,
    target: Option<Vector>, // where the target was
}

impl Newest {
    fn new(reply: &CameraReply) -> Self {
        let pose = reply.pose.unwrap_or_default();
        let position = read(pose.position.as_ref());
        let relative = reply.relative_pose.unwrap_or_default();
        let unrotated = relative.unrotated_pose.filter(|_| relative.target_id != 0);
        Newest {
            time_s: reply.pose_time_s,
            pose: Sample { position, rotation: read_rotation(pose.rotation.as_ref()), field_of_view: reply.field_of_view, cut: false },
            velocity: read(reply.velocity.as_ref()),
            angular_velocity: read(reply.angular_velocity.as_ref()),
            target_id: relative.target_id,
            target: unrotated.map(|offset| minus(position, read(offset.position.as_ref()))),
        }
    }

    fn shift(&mut self, by: Vector) {
        self.pose.position = plus(self.pose.position, by);
        self.target = self.target.map(|target| plus(target, by));
    }

    fn at(&self, time_s: f64, target_position: Option<Vector>) -> Sample {
        let age_s = time_s - self.time_s;
        let carried = carried_s(age_s);
        let mut position = plus(self.pose.position, times(carried, self.velocity));
        if let (Some(now), Some(then), true) = (target_position, self.target, age_s > FULL_S) {
            position = plus(position, times(1.0 - carried / age_s, minus(now, then)));
        }
        Sample { position, rotation: product(rotation_of(times(carried, self.angular_velocity)), self.pose.rotation), ..self.pose }
    }
}

/// Gives the camera at any time from the newest reply, for a renderer that is faster than the replies, or ahead of them. It only computes. Call `add`
/// with each reply as it comes, and `sample` for each frame. client/SAMPLING.md states the rules.
#[derive(Debug, Clone)]
pub struct PoseSampler {
    sequence: u64,
    newest: Option<Newest>,
    former: Option<Newest>, // the one of the former sample, while a newer one waits to be shown
    cut: bool,              // a reply since the former sample was a cut
    time_s: f64,            // of the former sample
    // The remainder that fades away: the former sample minus the newest reply, at time_s.
    shift: Vector,
    turn: Vector,
    zoom: f64,
}

impl Default for PoseSampler {
    fn default() -> Self {
        PoseSampler { sequence: 0, newest: None, former: None, cut: false, time_s: f64::NEG_INFINITY, shift: ORIGIN, turn: ORIGIN, zoom: 0.0 }
    }
}

impl PoseSampler {
    /// The target whose position `sample` takes; 0: none.
    pub fn target_id(&self) -> u64 {
        self.newest.map_or(0, |newest| newest.target_id)
    }

    /// Takes a reply. False: it is not newer than the newest one, and is ignored.
    pub fn add(&mut self, reply: &CameraReply) -> bool {
        if self.newest.is_some() && reply.sequence <= self.sequence {
            return false;
        }
        if self.former.is_none() && self.time_s > f64::NEG_INFINITY {
            self.former = self.newest;
        }
        self.sequence = reply.sequence;
        self.newest = Some(Newest::new(reply));
        self.cut |= reply.cut;
        true
    }

    /// The client's world has a new origin: the replies that were added lie elsewhere now (`Tick::world_shift`).
    pub fn shift(&mut self, by: Vector) {
        for reply in [&mut self.newest, &mut self.former].into_iter().flatten() {
            reply.shift(by);
        }
    }

    /// The camera at a game time. `target_position`: where `target_id` is at that time; without it, only velocities carry the camera on. None: there
    /// is no reply so far.
    pub fn sample(&mut self, time_s: f64, target_position: Option<Vector>) -> Option<Sample> {
        let newest = self.newest?;
        self.fade(time_s);
        let plain = newest.at(time_s, target_position);
        let (cut, former) = (std::mem::take(&mut self.cut), self.former.take());
        if cut {
            (self.shift, self.turn, self.zoom) = (ORIGIN, ORIGIN, 0.0);
        } else if let Some(former) = former {
            let before = former.at(time_s, target_position.filter(|_| former.target_id == newest.target_id));
            self.shift = plus(self.shift, minus(before.position, plain.position));
            self.turn = turn_of(product(product(rotation_of(self.turn), before.rotation), inverse(plain.rotation)));
            self.zoom += before.field_of_view - plain.field_of_view;
        }
        Some(Sample {
            position: plus(plain.position, self.shift),
            rotation: product(rotation_of(self.turn), plain.rotation),
            field_of_view: plain.field_of_view + self.zoom,
            cut,
        })
    }

    fn fade(&mut self, time_s: f64) {
        if time_s > self.time_s {
            let left = (-(time_s - self.time_s) / FADE_S).exp();
            (self.shift, self.turn, self.zoom) = (times(left, self.shift), times(left, self.turn), left * self.zoom);
            self.time_s = time_s;
        }
    }
}
