//! Where the targets are, as the game said, and a camera that follows them without a daemon.
use std::collections::{HashMap, VecDeque};

use crate::rotations::{length, minus, plus, read, times, Vector, ORIGIN};
use crate::v1::{NewInstance, OpenSession, Target, Tick};

const CARRY_S: f64 = 0.1; // time constant with which the motion relative to the targets dies away
const STEPS: usize = 5;

/// Positions by id that are newer than the newest tick.
pub type Drawn = HashMap<u64, Vector>;

/// Follows the positions of the instances and the list of targets.
pub(crate) struct TargetPlaces {
    positions: HashMap<u64, Vector>,
    weights: Vec<(u64, f64)>,
}

impl TargetPlaces {
    pub fn new(opening: &OpenSession) -> Self {
        let mut places = TargetPlaces { positions: HashMap::new(), weights: Vec::new() };
        places.add(&opening.instances);
        places.choose(&opening.targets);
        places
    }

    pub fn shift(&mut self, by: Vector) {
        for position in self.positions.values_mut() {
            *position = plus(*position, by);
        }
    }

    pub fn apply(&mut self, tick: &Tick) {
        if let Some(delta) = &tick.delta {
            for id in &delta.removed_ids {
                self.positions.remove(id);
            }
            self.add(&delta.added_instances);
        }
        if let Some(moved) = &tick.transforms {
            for (id, place) in moved.ids.iter().zip(moved.positions.chunks_exact(3)) {
                if place.iter().all(|value| value.is_finite()) {
                    self.positions.insert(*id, [place[0], place[1], place[2]]);
                }
            }
        }
        if let Some(list) = &tick.targets {
            self.choose(&list.targets);
        }
    }

    fn add(&mut self, instances: &[NewInstance]) {
        for added in instances {
            self.positions.insert(added.id, read(added.pose.as_ref().and_then(|pose| pose.position.as_ref())));
        }
    }

    fn choose(&mut self, targets: &[Target]) {
        self.weights = targets.iter().map(|target| (target.id, target.weight.unwrap_or(1.0))).collect();
    }

    /// The targets that make up the centre, and their weights.
    pub fn counted(&self) -> Vec<(u64, f64)> {
        self.weights.iter().copied().filter(|(id, weight)| *weight > 0.0 && self.positions.contains_key(id)).collect()
    }

    pub fn position(&self, id: u64, drawn: &Drawn) -> Option<Vector> {
        drawn.get(&id).or_else(|| self.positions.get(&id)).copied()
    }

    /// The weighted mean of the targets; none: there is none whose position is known.
    pub fn centre(&self, drawn: &Drawn) -> Option<Vector> {
        let (mut total, mut sum) = (0.0, ORIGIN);
        for (id, weight) in self.counted() {
            total += weight;
            sum = plus(sum, times(weight, self.position(id, drawn)?));
        }
        (total > 0.0).then(|| times(1.0 / total, sum))
    }
}

/// Keeps the camera's place relative to the targets' centre. Its motion relative to them dies away. It turns no more.
pub(crate) struct Follower {
    pub offset: Vector,
    pub velocity: Vector,
    pub since_s: f64,
}

impl Follower {
    pub fn at(&self, time_s: f64, centre: Vector) -> Vector {
        let carried_s = CARRY_S * (1.0 - (-(time_s - self.since_s).max(0.0) / CARRY_S).exp());
        plus(plus(centre, self.offset), times(carried_s, self.velocity))
    }
}

/// The velocity of a point from its last positions. A single jump does not count.
#[derive(Default)]
pub(crate) struct RecentMotion {
    last: Option<(f64, Vector)>,
    velocities: VecDeque<Vector>,
}

impl RecentMotion {
    pub fn add(&mut self, time_s: f64, position: Vector) {
        if let Some((former_s, former)) = self.last {
            if time_s <= former_s {
                return;
            }
            self.velocities.push_back(times(1.0 / (time_s - former_s), minus(position, former)));
            if self.velocities.len() > STEPS {
                self.velocities.pop_front();
            }
        }
        self.last = Some((time_s, position));
    }

    pub fn shift(&mut self, by: Vector) {
        self.last = self.last.map(|(time_s, position)| (time_s, plus(position, by)));
    }

    /// The mean of the last steps without the fastest.
    pub fn velocity(&self) -> Vector {
        let mut slower: Vec<_> = self.velocities.iter().copied().collect();
        slower.sort_by(|a, b| length(*a).total_cmp(&length(*b)));
        slower.pop();
        slower.iter().fold(ORIGIN, |mean, step| plus(mean, times(1.0 / slower.len() as f64, *step)))
    }
}
