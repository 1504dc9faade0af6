using System;
using System.Collections.Generic;
using System.Linq;
using Sightline.V1;

namespace Sightline.Client {

/// <summary>The origin of a shown pose.</summary>
public enum LiveSource {
    /// <summary>The daemon's answer to this tick.</summary>
    Reply,
    /// <summary>An earlier answer, brought up to date.</summary>
    Predicted,
    /// <summary>No daemon answers: the camera keeps its place relative to the targets.</summary>
    Fallback,
    /// <summary>The way from the fallback to the daemon's camera.</summary>
    Blend
}

// The camera that the player sees: the replies as sampled, a camera that follows the targets while none come, and the way back. No clock and no network: times are
// the game's, and the caller says whether the daemon is silent.
internal sealed class Display {
    // The fallback's pose minus the daemon's, where they met.
    sealed class BlendState {
        public double SinceS, Zoom;
        public Double3 Shift, Turn;
    }

    readonly double blendS;
    readonly TargetPlaces places;
    readonly RecentMotion motion = new RecentMotion();
    PoseSampler sampler = new PoseSampler();  // of the replies that count: while there is a follower, those that end the fallback
    Sample shown;
    double shownS;
    Double3? centre;  // of the targets when that was shown
    List<KeyValuePair<double, Double3>> offsets = new List<KeyValuePair<double, Double3>>();  // the camera minus the centre at the last two times
    Follower follower;
    bool hasFollowed;  // since the follower began, it was shown
    ulong countsFrom;  // replies to ticks from this number on end the fallback
    BlendState blend;
    readonly List<KeyValuePair<ulong, Double3>> shifts = new List<KeyValuePair<ulong, Double3>>();  // of the world, by ticks that no reply covers so far

    public CameraReply Newest { get; private set; }
    public bool Follows => follower != null;

    public Display(OpenSession opening, double blendS) {
        this.blendS = blendS;
        places = new TargetPlaces(opening);
        shown = new Sample {
            Position = Double3.From(opening.Camera?.Position), Rotation = DoubleQuaternion.From(opening.Camera?.Rotation),
            FieldOfView = opening.Lens == null ? 0 : opening.Lens.FieldOfView
        };
        centre = places.Centre(null);
        follower = new Follower(Offset(), new Double3(), 0);  // there is no reply so far, so the camera follows from the start
    }

    public void TakeTick(Tick tick) {
        if (tick.WorldShift != null) ShiftWorld(tick.Sequence, Double3.From(tick.WorldShift));
        var before = places.Counted();
        places.Apply(tick);
        if (before.SequenceEqual(places.Counted())) return;
        // The centre may jump, and the camera must not.
        centre = places.Centre(null);
        offsets.Clear();
        if (follower != null && centre != null) follower = new Follower(shown.Position - centre.Value, new Double3(), tick.TimeS);
    }

    public void TakeReply(CameraReply reply) {
        Newest = reply;
        if (follower == null || reply.Sequence >= countsFrom) sampler.Add(InThisWorld(reply));
    }

    void ShiftWorld(ulong sequence, Double3 by) {
        shifts.Add(new KeyValuePair<ulong, Double3>(sequence, by));
        shown.Position += by;
        centre += by;
        places.Shift(by);
        sampler.Shift(by);
        motion.Shift(by);
    }

    // The reply where the world has been shifted since its tick.
    CameraReply InThisWorld(CameraReply reply) {
        shifts.RemoveAll(shift => shift.Key <= reply.Sequence);
        if (shifts.Count == 0) return reply;
        var moved = reply.Clone();
        var position = shifts.Aggregate(Double3.From(reply.Pose?.Position), (at, shift) => at + shift.Value);
        moved.Pose = new Pose3 { Position = position.ToMessage(), Rotation = reply.Pose?.Rotation };
        return moved;
    }

    // The daemon is silent. from: the first tick whose reply ends the fallback.
    public void Follow(ulong from) {
        if (follower == null) {
            follower = new Follower(Offset(), RelativeVelocity(), shownS);
            hasFollowed = false;
        } else if (countsFrom > 0) {
            return;
        }
        countsFrom = from;
        sampler = new PoseSampler();
        blend = null;
    }

    // The camera at a game time. drawn: positions of targets at that time, if they are newer than the newest tick.
    public Sample Show(double timeS, IReadOnlyDictionary<ulong, Double3> drawn, out LiveSource source) {
        var now = places.Centre(drawn);
        Sample sample;
        var daemon = sampler.Sample(timeS, places.Position(sampler.TargetId, drawn));
        if (daemon != null) {
            if (follower != null) GoBack(Followed(timeS, now), daemon.Value, timeS);
            sample = Blended(daemon.Value, timeS, out source);
        } else {  // there is a follower until there is a reply
            sample = Followed(timeS, now);
            source = LiveSource.Fallback;
            hasFollowed = true;
        }
        Remember(sample, timeS, now);
        return sample;
    }

    // The camera that the player sees, so that the daemon goes on from it.
    public ObservedCamera Observed() {
        var pose = new Pose3 { Position = shown.Position.ToMessage(), Rotation = shown.Rotation.ToMessage() };
        return new ObservedCamera { Pose = pose, Velocity = motion.Velocity().ToMessage() };
    }

    Double3 Offset() { return centre == null ? new Double3() : shown.Position - centre.Value; }

    // No faster than the camera of the newest reply: targets that are put elsewhere do not throw it.
    Double3 RelativeVelocity() {
        if (offsets.Count < 2 || Newest == null) return new Double3();
        var velocity = 1 / (offsets[1].Key - offsets[0].Key) * (offsets[1].Value - offsets[0].Value);
        double most = Double3.From(Newest.Velocity).Length, speed = velocity.Length;
        return speed <= most ? velocity : most / speed * velocity;
    }

    Sample Followed(double timeS, Double3? now) {
        var sample = shown;
        sample.Cut = false;
        if (now != null) sample.Position = follower.At(timeS, now.Value);
        return sample;
    }

    void GoBack(Sample followed, Sample daemon, double timeS) {
        follower = null;
        if (!hasFollowed) return;
        blend = new BlendState {
            SinceS = timeS, Shift = followed.Position - daemon.Position, Turn = (followed.Rotation * daemon.Rotation.Inverse).Turn,
            Zoom = followed.FieldOfView - daemon.FieldOfView
        };
    }

    Sample Blended(Sample sample, double timeS, out LiveSource source) {
        source = LiveSource.Predicted;
        double left = blend != null && !sample.Cut ? ShareLeft(timeS - blend.SinceS) : 0;
        if (left == 0) {
            blend = null;
            return sample;
        }
        source = LiveSource.Blend;
        sample.Position += left * blend.Shift;
        sample.Rotation = DoubleQuaternion.From(left * blend.Turn) * sample.Rotation;
        sample.FieldOfView += left * blend.Zoom;
        return sample;
    }

    double ShareLeft(double passedS) {
        double x = blendS > 0 ? Math.Min(Math.Max(passedS / blendS, 0), 1) : 1;
        return 1 - x * x * (3 - 2 * x);
    }

    void Remember(Sample sample, double timeS, Double3? now) {
        shown = sample;
        shownS = timeS;
        centre = now;
        motion.Add(timeS, sample.Position);
        if (now == null || sample.Cut) offsets.Clear();
        if (now == null || (offsets.Count > 0 && timeS <= offsets[offsets.Count - 1].Key)) return;
        offsets.Add(new KeyValuePair<double, Double3>(timeS, sample.Position - now.Value));
        if (offsets.Count > 2) offsets.RemoveAt(0);
    }
}

}  // namespace Sightline.Client
