//! Ticks that wait for a daemon that is late or away.
use std::collections::{HashMap, HashSet, VecDeque};

use crate::v1::{ObservedCamera, Tick, Transforms};

pub(crate) const MOST_WAITING: usize = 4096;
const MOST_PARTS: usize = 8; // of what is folded: with and without rotation, velocity and angular velocity

/// The tick was not taken, because too many wait.
pub(crate) struct Full;

#[derive(Default)]
struct Place {
    position: Vec<f64>,
    rotation: Vec<f32>,         // empty: it stays as it is
    velocity: Vec<f32>,         // empty: the daemon derives it
    angular_velocity: Vec<f32>, // empty: the daemon derives it
}

/// A tick that is kept whole, or several in one that only say where things are.
#[derive(Default)]
struct Entry {
    kept: Option<Tick>,
    sequence: u64,
    time_s: f64,
    dt_s: f64,
    has_dt: bool,      // some tick said its dt_s
    folded: Vec<Tick>, // the first MOST_PARTS
    places: HashMap<u64, Place>,
    ids: Vec<u64>,                     // the keys of `places`, in the order of their first tick
    observed: Option<ObservedCamera>,  // of the newest tick
    suggested: Option<ObservedCamera>, // what the player sees instead of the daemon's camera
}

/// Elements size * i to size * (i + 1), or none of an empty list.
fn part<T: Clone>(values: &[T], size: usize, i: usize) -> Vec<T> {
    values.get(size * i..size * (i + 1)).map_or(Vec::new(), <[T]>::to_vec)
}

/// All numbers are there and finite, and no id comes twice.
fn is_whole(moved: &Transforms) -> bool {
    let n = moved.ids.len();
    let sizes_fit = moved.positions.len() == 3 * n
        && [0, 4 * n].contains(&moved.rotations.len())
        && [&moved.velocities, &moved.angular_velocities].iter().all(|values| [0, 3 * n].contains(&values.len()));
    let mut optional = moved.rotations.iter().chain(&moved.velocities).chain(&moved.angular_velocities);
    let finite = moved.positions.iter().all(|value| value.is_finite()) && optional.all(|value| value.is_finite());
    sizes_fit && finite && moved.ids.iter().collect::<HashSet<_>>().len() == n
}

impl Entry {
    fn fold(&mut self, tick: Tick, dt_s: f64) {
        (self.sequence, self.time_s, self.observed) = (tick.sequence, tick.time_s, tick.observed_camera);
        self.dt_s += dt_s;
        self.has_dt |= tick.dt_s.is_some();
        if self.folded.len() < MOST_PARTS {
            self.folded.push(tick.clone());
        }
        let moved = tick.transforms.unwrap_or_default();
        for (i, id) in moved.ids.iter().enumerate() {
            let place = self.places.entry(*id).or_insert_with(|| {
                self.ids.push(*id);
                Place::default()
            });
            place.position = part(&moved.positions, 3, i);
            place.velocity = part(&moved.velocities, 3, i);
            place.angular_velocity = part(&moved.angular_velocities, 3, i);
            if !moved.rotations.is_empty() {
                place.rotation = part(&moved.rotations, 4, i);
            }
        }
    }

    fn ticks(mut self) -> Vec<Tick> {
        let mut ticks = match self.kept.take() {
            Some(kept) => vec![kept],
            None => self.parts(),
        };
        if let Some(last) = ticks.last_mut() {
            last.observed_camera = last.observed_camera.take().or(self.observed).or(self.suggested);
        }
        ticks
    }

    /// Several ticks where need be: a message has rotations for all of its instances or for none, and so with
    /// velocities and angular velocities. Each part takes the number of a tick. Where there are fewer ticks than parts, the ticks go as they came.
    fn parts(&mut self) -> Vec<Tick> {
        let mut kinds: Vec<([bool; 3], Transforms)> = Vec::new();
        for id in &self.ids {
            let place = &self.places[id];
            let kind = [place.rotation.is_empty(), place.velocity.is_empty(), place.angular_velocity.is_empty()];
            let at = kinds.iter().position(|(known, _)| *known == kind).unwrap_or_else(|| {
                kinds.push((kind, Transforms::default()));
                kinds.len() - 1
            });
            let moved = &mut kinds[at].1;
            moved.ids.push(*id);
            moved.positions.extend(&place.position);
            moved.rotations.extend(&place.rotation);
            moved.velocities.extend(&place.velocity);
            moved.angular_velocities.extend(&place.angular_velocity);
        }
        if kinds.len() > self.folded.len() {
            return std::mem::take(&mut self.folded);
        }
        let mut all: Vec<_> = kinds.into_iter().map(|(_, moved)| Some(moved)).collect();
        if all.is_empty() {
            all.push(None);
        }
        let n = all.len();
        let tick = |(i, transforms)| Tick {
            sequence: self.sequence - (n - 1 - i) as u64,
            time_s: self.time_s,
            dt_s: self.has_dt.then_some(if i == 0 { self.dt_s } else { 0.0 }),
            transforms,
            ..Default::default()
        };
        all.into_iter().enumerate().map(tick).collect()
    }
}

/// Ticks in their order. Those that carry only time and places, and perhaps an observed camera that is no cut, fold into one: the newest place
/// counts for each id. Every other tick is kept whole, so that a refusal hits it alone; MOST_WAITING of them may wait.
#[derive(Default)]
pub(crate) struct WaitingTicks {
    entries: VecDeque<Entry>,
    time_s: Option<f64>, // of the newest tick
}

impl WaitingTicks {
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Takes a tick with its number.
    pub fn add(&mut self, tick: Tick) -> Result<(), Full> {
        let time_s = tick.time_s;
        let dt_s = tick.dt_s.unwrap_or_else(|| self.time_s.map_or(0.0, |former| time_s - former));
        let plain = self.is_plain(&tick);
        if !plain || self.entries.back().is_none_or(|last| last.kept.is_some()) {
            if self.entries.len() >= MOST_WAITING {
                return Err(Full);
            }
            self.entries.push_back(Entry::default());
        }
        if let Some(last) = self.entries.back_mut() {
            last.suggested = None;
            if plain {
                last.fold(tick, dt_s);
            } else {
                last.kept = Some(tick);
            }
        }
        self.time_s = Some(time_s);
        Ok(())
    }

    /// Goes with the newest tick as its observed camera, if that tick waits and has none.
    pub fn suggest(&mut self, observed: ObservedCamera) {
        if let Some(last) = self.entries.back_mut() {
            last.suggested = Some(observed);
        }
    }

    /// The ticks to send next, each of which gets an answer.
    pub fn take(&mut self) -> Option<Vec<Tick>> {
        self.entries.pop_front().map(Entry::ticks)
    }

    /// Only a tick that a daemon is likely to take is folded.
    fn is_plain(&self, tick: &Tick) -> bool {
        let dt_s = tick.dt_s.unwrap_or_default();
        if tick.observed_camera.is_some_and(|observed| observed.cut) || !tick.time_s.is_finite() || !dt_s.is_finite() || dt_s < 0.0 {
            return false;
        }
        if self.time_s.is_some_and(|former| tick.time_s < former) {
            return false;
        }
        if !tick.transforms.as_ref().is_none_or(is_whole) {
            return false;
        }
        let rest = Tick { sequence: 0, time_s: 0.0, dt_s: None, transforms: None, observed_camera: None, ..tick.clone() };
        rest == Tick::default()
    }
}
