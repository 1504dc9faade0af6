using System.Collections.Generic;
using Google.Protobuf;
using Google.Protobuf.Collections;
using Sightline.V1;

namespace Sightline.Client {

/// <summary>Follows the ticks that a daemon has applied. A session that is opened with <see cref="Opening"/> and gets <see cref="Ticks"/> has the same
/// scene, targets, settings, limits, lens and clock as one that got every tick, and its camera is where the newest reply had it. The shot goes
/// on. The camera's memory of what it had seen before is lost. For one thread at a time.</summary>
internal sealed class Snapshot {
    // The changes that ticks made to one instance.
    sealed class Change {
        public bool Removed;           // an instance of the opening, or a node of its scene file
        public NewInstance Added;      // by a tick, perhaps after Removed
        public Attributes Attributes;
        public double[] Position;
        public float[] Rotation;
    }

    readonly OpenSession opening;
    readonly List<ulong> order = new List<ulong>();  // of the first change
    readonly Dictionary<ulong, Change> changes = new Dictionary<ulong, Change>();
    readonly Tick terms = new Tick();  // the newest targets, lens, settings, limits and tuning, and how far the world has been shifted since the opening
    double timeS;
    ObservedCamera camera;
    ShotReport kept;  // of the newest reply

    public Snapshot(OpenSession opening) { this.opening = opening.Clone(); }

    /// <summary>Hash of the scene that the opening names; empty: it names none by its hash.</summary>
    public string SceneHash {
        get { return opening.Scene?.Hash ?? ""; }
        set {
            opening.Scene = opening.Scene ?? new SceneRef();
            opening.Scene.Hash = value;
        }
    }

    /// <summary>Takes a tick that the daemon has applied.</summary>
    public void Apply(Tick tick) {
        if (tick.WorldShift != null) ShiftWorld(tick.WorldShift);
        if (tick.Delta != null) Apply(tick.Delta);
        if (tick.Transforms != null) Move(tick.Transforms);
        TakeTerms(tick);
        timeS = tick.TimeS;
    }

    public void TakeReply(CameraReply reply) {
        camera = new ObservedCamera { Pose = reply.Pose.Clone(), Velocity = reply.Velocity?.Clone(), AngularVelocity = reply.AngularVelocity?.Clone() };
        kept = reply.Shot?.Clone();
    }

    void ShiftWorld(Vec3 shift) {
        if (terms.WorldShift == null) terms.WorldShift = new Vec3();
        Add(shift, 1, terms.WorldShift);
        foreach (var change in changes.Values) {
            if (change.Added != null) change.Added = Shifted(change.Added, shift);
            if (change.Position != null) change.Position = new[] { change.Position[0] + shift.X, change.Position[1] + shift.Y, change.Position[2] + shift.Z };
        }
        if (camera != null) Add(shift, 1, camera.Pose.Position ?? (camera.Pose.Position = new Vec3()));
    }

    static NewInstance Shifted(NewInstance added, Vec3 shift) {
        var there = added.Clone();
        if (there.Pose == null) there.Pose = new Pose3();
        Add(shift, 1, there.Pose.Position ?? (there.Pose.Position = new Vec3()));
        return there;
    }

    static void Add(Vec3 shift, double sign, Vec3 place) {
        place.X += sign * shift.X;
        place.Y += sign * shift.Y;
        place.Z += sign * shift.Z;
    }

    /// <summary>The first message of the session that goes on: as at first, and before the world was shifted, but with the camera where it is now.</summary>
    public OpenSession Opening() {
        var request = opening.Clone();
        if (camera != null) {
            request.Camera = camera.Pose.Clone();
            if (terms.WorldShift != null) Add(terms.WorldShift, -1, request.Camera.Position ?? (request.Camera.Position = new Vec3()));
            GoOnWithShot(request);
        }
        return request;
    }

    /// <summary>The shot as it was asked for last, from where it is now.</summary>
    void GoOnWithShot(OpenSession request) {
        if (request.Shot != null) {
            request.Shot.Cut = false;
            request.Shot.BlendS = 0;
        }
        if (kept == null || !(kept.Distance.Asked > 0)) return;
        if (request.Shot == null) request.Shot = new Shot();
        var shot = request.Shot;
        if (!shot.HasSideRad || shot.OrbitRadps != 0 || shot.EitherSide) shot.SideRad = kept.Side.Asked;
        shot.EitherSide = false;
        if (!shot.HasHeightRad) shot.HeightRad = kept.Height.Asked;
        if (shot.FarCase == Shot.FarOneofCase.None) shot.Distance = kept.Distance.Asked;
        if (shot.Places.Count == 0 && (kept.PlaceX != 0 || kept.PlaceY != 0)) shot.Places.Add(new Shot.Types.Place { X = kept.PlaceX, Y = kept.PlaceY });
    }

    /// <summary>The ticks that follow the opening; they get no replies of their own. Empty before the first reply.</summary>
    /// <param name="nextSequence">Number of the tick after them.</param>
    public List<Tick> Ticks(ulong nextSequence) {
        var ticks = new List<Tick>();
        if (camera == null) return ticks;
        Transforms turned = new Transforms(), moved = new Transforms();
        foreach (var id in order) Place(id, changes[id], turned, moved);
        var first = new Tick { ObservedCamera = camera.Clone(), Delta = Delta() };
        first.MergeFrom(terms);
        ticks.Add(first);
        // Rotations are sent for all instances of a tick or for none.
        if (turned.Ids.Count > 0) first.Transforms = turned;
        if (moved.Ids.Count > 0) {
            if (turned.Ids.Count > 0) ticks.Add(new Tick());
            ticks[ticks.Count - 1].Transforms = moved;
        }
        for (int i = 0; i < ticks.Count; ++i) {
            ticks[i].Sequence = nextSequence - (ulong)(ticks.Count - i);
            ticks[i].TimeS = timeS;
            ticks[i].StepControl = new StepControl { MergeIntoNext = true };
        }
        return ticks;
    }

    static void Place(ulong id, Change change, Transforms turned, Transforms moved) {
        if (change.Position == null) return;
        var list = change.Rotation != null ? turned : moved;
        list.Ids.Add(id);
        list.Positions.Add(change.Position);
        if (change.Rotation != null) list.Rotations.Add(change.Rotation);
    }

    void Apply(SceneDelta delta) {
        foreach (var id in delta.RemovedIds) {
            Change known;
            changes.TryGetValue(id, out known);
            changes.Remove(id);
            order.Remove(id);
            if (known == null || known.Removed || known.Added == null) ChangeOf(id).Removed = true;
            ForgetInTargets(id);
        }
        foreach (var added in delta.AddedInstances) ChangeOf(added.Id).Added = added.Clone();
        foreach (var change in delta.ChangedInstances) ChangeOf(change.Id).Attributes = change.Attributes?.Clone() ?? new Attributes();
    }

    // A list of targets may name existing instances only.
    void ForgetInTargets(ulong id) {
        if (terms.Targets == null) return;
        foreach (var target in terms.Targets.Targets) {
            while (target.AttachedIds.Remove(id)) { }
            while (target.IgnoredIds.Remove(id)) { }
            while (target.PartIds.Remove(id)) { }
        }
    }

    Change ChangeOf(ulong id) {
        Change change;
        if (changes.TryGetValue(id, out change)) return change;
        order.Add(id);
        return changes[id] = new Change();
    }

    void Move(Transforms moved) {
        for (int i = 0; i < moved.Ids.Count; ++i) {
            var change = ChangeOf(moved.Ids[i]);
            change.Position = Part(moved.Positions, 3 * i, 3);
            if (moved.Rotations.Count > 0) change.Rotation = Part(moved.Rotations, 4 * i, 4);
        }
    }

    static T[] Part<T>(RepeatedField<T> values, int first, int count) {
        var part = new T[count];
        for (int i = 0; i < count; ++i) part[i] = values[first + i];
        return part;
    }

    void TakeTerms(Tick tick) {
        if (tick.Targets != null) terms.Targets = tick.Targets.Clone();
        if (tick.Lens != null) terms.Lens = tick.Lens.Clone();
        if (tick.Shot != null) opening.Shot = tick.Shot.Clone();
        if (tick.Settings != null && tick.Settings.Preset != Settings.Types.Preset.Unspecified) {
            // A preset resets the settings and the tuning.
            terms.Settings = null;
            terms.Tuning = null;
        }
        terms.MergeFrom(new Tick { Limits = tick.Limits, Settings = tick.Settings, Tuning = tick.Tuning });
    }

    SceneDelta Delta() {
        var delta = new SceneDelta();
        foreach (var id in order) {
            var change = changes[id];
            if (change.Removed) delta.RemovedIds.Add(id);
            if (change.Added != null) delta.AddedInstances.Add(change.Added.Clone());
            if (change.Attributes != null) delta.ChangedInstances.Add(new AttributeChange { Id = id, Attributes = change.Attributes.Clone() });
        }
        bool isEmpty = delta.RemovedIds.Count + delta.AddedInstances.Count + delta.ChangedInstances.Count == 0;
        return isEmpty ? null : delta;
    }
}

}  // namespace Sightline.Client
