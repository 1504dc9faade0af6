//! The camera that the player sees: the replies as sampled, a camera that follows the targets while none come, and the way back. No clock and no network: times
//! are the game's, and the caller says whether the daemon is silent.
use crate::following::{Drawn, Follower, RecentMotion, TargetPlaces};
use crate::rotations::{inverse, length, minus, plus, product, read, read_rotation, rotation_of, times, turn_of, Vector, ORIGIN};
use crate::sampler::{PoseSampler, Sample};
use crate::shapes::vector;
use crate::v1::{CameraReply, ObservedCamera, OpenSession, Pose3, Quat, Tick};

/// The origin of a shown pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The daemon's answer to this tick.
    Reply,
    /// An earlier answer, brought up to date.
    Predicted,
    /// No daemon answers: the camera keeps its place relative to the targets.
    Fallback,
    /// The way from the fallback to the daemon's camera.
    Blend,
}

/// The fallback's pose minus the daemon's, where they met.
struct Blend {
    since_s: f64,
    shift: Vector,
    turn: Vector,
    zoom: f64,
}

pub(crate) struct Display {
    pub newest: Option<CameraReply>,
    places: TargetPlaces,
    blend_s: f64,
    sampler: PoseSampler, // of the replies that count: while there is a follower, those that end the fallback
    shown: Sample,
    shown_s: f64,
    centre: Option<Vector>,      // of the targets when that was shown
    offsets: Vec<(f64, Vector)>, // the camera minus the centre at the last two times
    follower: Option<Follower>,
    has_followed: bool, // since the follower began, it was shown
    counts_from: u64, // replies to ticks from this number on end the fallback
    blend: Option<Blend>,
    shifts: Vec<(u64, Vector)>, // of the world, by ticks that no reply covers so far
    motion: RecentMotion,
}

impl Display {
    pub fn new(opening: &OpenSession, blend_s: f64) -> Self {
        let camera = opening.camera.unwrap_or_default();
        let places = TargetPlaces::new(opening);
        let mut display = Display {
            newest: None,
            blend_s,
            sampler: PoseSampler::default(),
            shown: Sample {
                position: read(camera.position.as_ref()),
                rotation: read_rotation(camera.rotation.as_ref()),
                field_of_view: opening.lens.map_or(0.0, |lens| lens.field_of_view),
                cut: false,
            },
            shown_s: 0.0,
            centre: places.centre(&Drawn::new()),
            places,
            offsets: Vec::new(),
            follower: None,
            has_followed: false,
            counts_from: 0,
            blend: None,
            shifts: Vec::new(),
            motion: RecentMotion::default(),
        };
        // There is no reply so far, so the camera follows from the start.
        display.follower = Some(Follower { offset: display.offset(), velocity: ORIGIN, since_s: 0.0 });
        display
    }

    fn offset(&self) -> Vector {
        self.centre.map_or(ORIGIN, |centre| minus(self.shown.position, centre))
    }

    pub fn follows(&self) -> bool {
        self.follower.is_some()
    }

    pub fn take_tick(&mut self, tick: &Tick) {
        if tick.world_shift.is_some() {
            self.shift_world(tick.sequence, read(tick.world_shift.as_ref()));
        }
        let before = self.places.counted();
        self.places.apply(tick);
        if self.places.counted() == before {
            return;
        }
        // The centre may jump, and the camera must not.
        self.centre = self.places.centre(&Drawn::new());
        self.offsets.clear();
        if let (Some(follower), Some(centre)) = (&mut self.follower, self.centre) {
            *follower = Follower { offset: minus(self.shown.position, centre), velocity: ORIGIN, since_s: tick.time_s };
        }
    }

    pub fn take_reply(&mut self, reply: CameraReply) {
        if self.follower.is_none() || reply.sequence >= self.counts_from {
            let moved = self.in_this_world(reply.clone());
            self.sampler.add(&moved);
        }
        self.newest = Some(reply);
    }

    fn shift_world(&mut self, sequence: u64, by: Vector) {
        self.shifts.push((sequence, by));
        self.shown.position = plus(self.shown.position, by);
        self.centre = self.centre.map(|centre| plus(centre, by));
        self.places.shift(by);
        self.sampler.shift(by);
        self.motion.shift(by);
    }

    /// The reply where the world has been shifted since its tick.
    fn in_this_world(&mut self, mut reply: CameraReply) -> CameraReply {
        self.shifts.retain(|(sequence, _)| *sequence > reply.sequence);
        if let Some(pose) = &mut reply.pose {
            let position = self.shifts.iter().fold(read(pose.position.as_ref()), |at, (_, by)| plus(at, *by));
            pose.position = Some(vector(position));
        }
        reply
    }

    /// The daemon is silent. `counts_from`: the first tick whose reply ends the fallback.
    pub fn follow(&mut self, counts_from: u64) {
        if self.follower.is_none() {
            self.follower = Some(Follower { offset: self.offset(), velocity: self.relative_velocity(), since_s: self.shown_s });
            self.has_followed = false;
        } else if self.counts_from > 0 {
            return;
        }
        self.counts_from = counts_from;
        self.sampler = PoseSampler::default();
        self.blend = None;
    }

    /// No faster than the camera of the newest reply: targets that are put elsewhere do not throw it.
    fn relative_velocity(&self) -> Vector {
        let ([(start_s, start), (end_s, end)], Some(newest)) = (self.offsets.as_slice(), &self.newest) else {
            return ORIGIN;
        };
        let velocity = times(1.0 / (end_s - start_s), minus(*end, *start));
        let (most, speed) = (length(read(newest.velocity.as_ref())), length(velocity));
        if speed <= most {
            velocity
        } else {
            times(most / speed, velocity)
        }
    }

    /// The camera at a game time. `drawn`: positions of targets at that time, if they are newer than the newest tick.
    pub fn show(&mut self, time_s: f64, drawn: &Drawn) -> (Sample, Source) {
        let centre = self.places.centre(drawn);
        let followed = self.followed(time_s, centre);
        let target = self.places.position(self.sampler.target_id(), drawn);
        let shown = match (self.sampler.sample(time_s, target), followed) {
            (Some(daemon), followed) => {
                if let Some(followed) = followed {
                    self.go_back(followed, daemon, time_s);
                }
                self.blended(daemon, time_s)
            }
            (None, followed) => {
                self.has_followed = true;
                (followed.expect("there is a follower until there is a reply"), Source::Fallback)
            }
        };
        self.remember(shown.0, time_s, centre);
        shown
    }

    /// The camera that the player sees, so that the daemon goes on from it.
    pub fn observed(&self) -> ObservedCamera {
        let [x, y, z, w] = self.shown.rotation;
        let pose = Pose3 { position: Some(vector(self.shown.position)), rotation: Some(Quat { x, y, z, w }) };
        ObservedCamera { pose: Some(pose), velocity: Some(vector(self.motion.velocity())), ..Default::default() }
    }

    fn followed(&self, time_s: f64, centre: Option<Vector>) -> Option<Sample> {
        let follower = self.follower.as_ref()?;
        let position = centre.map_or(self.shown.position, |centre| follower.at(time_s, centre));
        Some(Sample { position, cut: false, ..self.shown })
    }

    fn go_back(&mut self, followed: Sample, daemon: Sample, time_s: f64) {
        self.follower = None;
        if !self.has_followed {
            return;
        }
        self.blend = Some(Blend {
            since_s: time_s,
            shift: minus(followed.position, daemon.position),
            turn: turn_of(product(followed.rotation, inverse(daemon.rotation))),
            zoom: followed.field_of_view - daemon.field_of_view,
        });
    }

    fn blended(&mut self, daemon: Sample, time_s: f64) -> (Sample, Source) {
        let left = self.blend.as_ref().map_or(0.0, |blend| share_left(time_s - blend.since_s, self.blend_s));
        match &self.blend {
            Some(blend) if left > 0.0 && !daemon.cut => {
                let shown = Sample {
                    position: plus(daemon.position, times(left, blend.shift)),
                    rotation: product(rotation_of(times(left, blend.turn)), daemon.rotation),
                    field_of_view: daemon.field_of_view + left * blend.zoom,
                    cut: false,
                };
                (shown, Source::Blend)
            }
            _ => {
                self.blend = None;
                (daemon, Source::Predicted)
            }
        }
    }

    fn remember(&mut self, sample: Sample, time_s: f64, centre: Option<Vector>) {
        (self.shown, self.shown_s, self.centre) = (sample, time_s, centre);
        self.motion.add(time_s, sample.position);
        if centre.is_none() || sample.cut {
            self.offsets.clear();
        }
        if let Some(centre) = centre.filter(|_| self.offsets.last().is_none_or(|(last_s, _)| time_s > *last_s)) {
            self.offsets.push((time_s, minus(sample.position, centre)));
            if self.offsets.len() > 2 {
                self.offsets.remove(0);
            }
        }
    }
}

fn share_left(passed_s: f64, blend_s: f64) -> f64 {
    let x = if blend_s > 0.0 { (passed_s / blend_s).clamp(0.0, 1.0) } else { 1.0 };
    1.0 - x * x * (3.0 - 2.0 * x)
}
