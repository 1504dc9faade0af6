//! The state of a session as the client knows it, so that the session can go on in another daemon.
use std::collections::HashMap;

use prost::Message;

use crate::v1::{
    scene_ref::Source, settings::Preset, shot::{Far, Place}, tick_error, AttributeChange, Attributes, CameraReply, NewInstance, ObservedCamera, OpenSession,
    Pose3, SceneDelta, SceneRef, Shot, ShotReport, StepControl, Tick, TickError, Transforms, Vec3,
};

fn shifted(place: Option<Vec3>, shift: &Vec3, sign: f64) -> Vec3 {
    let place = place.unwrap_or_default();
    Vec3 { x: place.x + sign * shift.x, y: place.y + sign * shift.y, z: place.z + sign * shift.z }
}

/// The changes that ticks made to one instance.
#[derive(Default)]
struct Change {
    removed: bool,              // an instance of the opening, or a node of its scene file
    added: Option<NewInstance>, // by a tick, perhaps after `removed`
    attributes: Option<Option<Attributes>>,
    position: Option<Vec<f64>>,
    rotation: Option<Vec<f32>>,
}

/// Follows the ticks that a daemon has applied. A session that is opened with `opening` and gets `ticks` has the same scene, targets,
/// settings, limits, lens and clock as one that got every tick, and its camera is where the newest reply had it.
///
/// The shot goes on. The camera's memory of the things that it had seen before is lost.
pub(crate) struct Snapshot {
    first: OpenSession,
    changes: HashMap<u64, Change>,
    order: Vec<u64>, // the keys of `changes`, in the order of the first change
    terms: Tick,     // the newest targets, lens, settings, limits and tuning, and how far the world has been shifted since the opening
    time_s: f64,
    camera: Option<ObservedCamera>,
    kept: Option<ShotReport>, // of the newest reply
}

impl Snapshot {
    pub fn new(first: OpenSession) -> Self {
        Snapshot { first, changes: HashMap::new(), order: Vec::new(), terms: Tick::default(), time_s: 0.0, camera: None, kept: None }
    }

    pub fn names_scene_by_hash(&self) -> bool {
        matches!(self.first.scene, Some(SceneRef { source: Some(Source::Hash(_)), .. }))
    }

    /// The opening names this scene.
    pub fn use_scene(&mut self, hash: String) {
        self.first.scene.get_or_insert_default().source = Some(Source::Hash(hash));
    }

    /// Takes a tick that the daemon has applied.
    pub fn apply(&mut self, tick: &Tick) {
        if let Some(shift) = &tick.world_shift {
            self.shift_world(shift);
        }
        if let Some(delta) = &tick.delta {
            self.apply_delta(delta);
        }
        if let Some(transforms) = &tick.transforms {
            self.move_instances(transforms);
        }
        self.take_terms(tick);
        self.time_s = tick.time_s;
    }

    pub fn take_reply(&mut self, reply: &CameraReply) {
        self.camera = Some(ObservedCamera {
            pose: reply.pose,
            velocity: reply.velocity,
            angular_velocity: reply.angular_velocity,
            cut: false,
        });
        self.kept = reply.shot.clone();
    }

    fn shift_world(&mut self, shift: &Vec3) {
        self.terms.world_shift = Some(shifted(self.terms.world_shift, shift, 1.0));
        for change in self.changes.values_mut() {
            if let Some(added) = &mut change.added {
                let pose = added.pose.unwrap_or_default();
                added.pose = Some(Pose3 { position: Some(shifted(pose.position, shift, 1.0)), ..pose });
            }
            if let Some(position) = &mut change.position {
                for (axis, by) in [shift.x, shift.y, shift.z].into_iter().enumerate() {
                    position[axis] += by;
                }
            }
        }
        if let Some(pose) = self.camera.as_mut().and_then(|camera| camera.pose.as_mut()) {
            pose.position = Some(shifted(pose.position, shift, 1.0));
        }
    }

    /// The first message of the session that goes on: as at first, and before the world was shifted, but with the camera where it is now.
    pub fn opening(&self) -> OpenSession {
        let mut request = self.first.clone();
        if let Some(camera) = &self.camera {
            request.camera = camera.pose;
            if let (Some(pose), Some(shift)) = (&mut request.camera, &self.terms.world_shift) {
                pose.position = Some(shifted(pose.position, shift, -1.0));
            }
            self.go_on_with_shot(&mut request);
        }
        request
    }

    /// The shot as it was asked for last, from where it is now.
    fn go_on_with_shot(&self, request: &mut OpenSession) {
        if let Some(shot) = &mut request.shot {
            (shot.cut, shot.blend_s) = (false, 0.0);
        }
        let Some(ShotReport { side: Some(side), height: Some(height), distance: Some(distance), place_x, place_y, .. }) = &self.kept else {
            return;
        };
        if distance.asked <= 0.0 {
            return;
        }
        let shot = request.shot.get_or_insert_with(Shot::default);
        if shot.side_rad.is_none() || shot.orbit_radps != 0.0 || shot.either_side {
            shot.side_rad = Some(side.asked);
        }
        shot.either_side = false;
        shot.height_rad.get_or_insert(height.asked);
        shot.far.get_or_insert(Far::Distance(distance.asked));
        if shot.places.is_empty() && (*place_x != 0.0 || *place_y != 0.0) {
            shot.places.push(Place { id: 0, x: *place_x, y: *place_y });
        }
    }

    /// The ticks that follow the opening; they get no replies of their own. `next_sequence` is that of the tick after them. There are none
    /// before the first reply.
    pub fn ticks(&self, next_sequence: u64) -> Vec<Tick> {
        if self.camera.is_none() {
            return Vec::new();
        }
        let turned = self.transforms(|change| change.rotation.is_some());
        let moved = self.transforms(|change| change.rotation.is_none() && change.position.is_some());
        // Rotations are sent for all instances of a tick or for none.
        let mut lists = match (turned, moved) {
            (Some(turned), Some(moved)) => vec![Some(turned), Some(moved)],
            (turned, moved) => vec![turned.or(moved)],
        };
        let count = lists.len();
        let summary = |(i, transforms): (usize, Option<Transforms>)| {
            let mut tick = Tick::default();
            if i == 0 {
                tick = Tick { observed_camera: self.camera, delta: self.delta(), ..self.terms.clone() };
            }
            tick.transforms = transforms;
            tick.sequence = next_sequence - (count - i) as u64;
            tick.time_s = self.time_s;
            tick.step_control = Some(StepControl { merge_into_next: true, ..Default::default() });
            tick
        };
        lists.drain(..).enumerate().map(summary).collect()
    }

    fn change(&mut self, id: u64) -> &mut Change {
        if !self.changes.contains_key(&id) {
            self.order.push(id);
        }
        self.changes.entry(id).or_default()
    }

    fn apply_delta(&mut self, delta: &SceneDelta) {
        for &id in &delta.removed_ids {
            let known = self.changes.remove(&id);
            self.order.retain(|&other| other != id);
            if known.is_none_or(|change| change.removed || change.added.is_none()) {
                self.change(id).removed = true;
            }
            self.forget_in_targets(id);
        }
        for added in &delta.added_instances {
            self.change(added.id).added = Some(added.clone());
        }
        for changed in &delta.changed_instances {
            self.change(changed.id).attributes = Some(changed.attributes);
        }
    }

    /// A list of targets may name existing instances only.
    fn forget_in_targets(&mut self, id: u64) {
        for target in self.terms.targets.iter_mut().flat_map(|list| &mut list.targets) {
            target.attached_ids.retain(|&other| other != id);
            target.ignored_ids.retain(|&other| other != id);
            target.part_ids.retain(|&other| other != id);
        }
    }

    fn move_instances(&mut self, moved: &Transforms) {
        for (i, &id) in moved.ids.iter().enumerate() {
            let change = self.change(id);
            change.position = Some(moved.positions[3 * i..3 * i + 3].to_vec());
            if !moved.rotations.is_empty() {
                change.rotation = Some(moved.rotations[4 * i..4 * i + 4].to_vec());
            }
        }
    }

    fn take_terms(&mut self, tick: &Tick) {
        let terms = &mut self.terms;
        if tick.targets.is_some() {
            terms.targets = tick.targets.clone();
        }
        if tick.lens.is_some() {
            terms.lens = tick.lens;
        }
        if tick.shot.is_some() {
            self.first.shot = tick.shot.clone();
        }
        // A preset resets the settings and the tuning.
        if tick.settings.as_ref().is_some_and(|settings| settings.preset != Preset::Unspecified as i32) {
            (terms.settings, terms.tuning) = (None, None);
        }
        merge(&mut terms.settings, &tick.settings);
        merge(&mut terms.limits, &tick.limits);
        merge(&mut terms.tuning, &tick.tuning);
    }

    fn delta(&self) -> Option<SceneDelta> {
        let mut delta = SceneDelta::default();
        for &id in &self.order {
            let change = &self.changes[&id];
            if change.removed {
                delta.removed_ids.push(id);
            }
            delta.added_instances.extend(change.added.clone());
            if let Some(attributes) = change.attributes {
                delta.changed_instances.push(AttributeChange { id, attributes });
            }
        }
        (delta.encoded_len() > 0).then_some(delta)
    }

    fn transforms(&self, takes: impl Fn(&Change) -> bool) -> Option<Transforms> {
        let mut moved = Transforms::default();
        for &id in self.order.iter().filter(|id| takes(&self.changes[id])) {
            let change = &self.changes[&id];
            moved.ids.push(id);
            moved.positions.extend(change.position.iter().flatten());
            moved.rotations.extend(change.rotation.iter().flatten());
        }
        (!moved.ids.is_empty()).then_some(moved)
    }
}

/// The fields of `change` win.
fn merge<M: Message + Default>(base: &mut Option<M>, change: &Option<M>) {
    if let Some(change) = change {
        let bytes = change.encode_to_vec();
        base.get_or_insert_default().merge(&*bytes).expect("what was encoded can be decoded");
    }
}

/// True if the tick was applied and only its step failed (see TickError).
pub(crate) fn was_applied(error: &TickError) -> bool {
    use tick_error::Code;
    matches!(error.code(), Code::Internal | Code::Unavailable) && error.field_violations.is_empty()
}
