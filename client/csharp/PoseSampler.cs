using System;
using Sightline.V1;

namespace Sightline.Client {

/// <summary>A camera that can be drawn.</summary>
public struct Sample {
    /// <summary>Where it is, in the client's frame.</summary>
    public Double3 Position;
    /// <summary>How it is turned.</summary>
    public DoubleQuaternion Rotation;
    /// <summary>As CameraReply.FieldOfView.</summary>
    public double FieldOfView;
    /// <summary>It jumped since the former sample; reset what smooths over frames.</summary>
    public bool Cut;
}

/// <summary>Gives the camera at any time from the newest reply, for a renderer that is faster than the replies, or ahead of them. It only computes.
/// Call Add with each reply as it comes, and Sample for each frame. client/SAMPLING.md states the rules.</summary>
public sealed class PoseSampler {
    const double FullS = 0.15;  // a reply's velocities carry the camera on in full for so long
    const double StopS = 0.35;  // until then they ease out
    const double FadeS = 0.02;  // what a new reply changes fades in with this time constant

    ulong sequence;
    Newest newest;
    Newest former;  // the one of the former sample, while a newer one waits to be shown
    bool cut;       // a reply since the former sample was a cut
    double timeS = double.NegativeInfinity;  // of the former sample
    // The remainder that fades away: the former sample minus the newest reply, at timeS.
    Double3 shift, turn;
    double zoom;

    /// <summary>The target whose position Sample takes; 0: none.</summary>
    public ulong TargetId => newest == null ? 0 : newest.TargetId;

    /// <summary>Takes a reply. False: it is not newer than the newest one, and is ignored.</summary>
    public bool Add(CameraReply reply) {
        if (newest != null && reply.Sequence <= sequence) return false;
        if (former == null && !double.IsNegativeInfinity(timeS)) former = newest;
        sequence = reply.Sequence;
        newest = new Newest(reply);
        cut |= reply.Cut;
        return true;
    }

    /// <summary>The client's world has a new origin: the replies that were added lie elsewhere now (Tick.WorldShift).</summary>
    public void Shift(Double3 by) {
        newest?.Shift(by);
        former?.Shift(by);
    }

    /// <summary>The camera at a game time; null: there is no reply so far.</summary>
    /// <param name="targetPosition">Where TargetId is at that time; without it, only velocities carry the camera on.</param>
    public Sample? Sample(double time, Double3? targetPosition = null) {
        if (newest == null) return null;
        Fade(time);
        var shown = newest.At(time, targetPosition);
        shown.Cut = cut;
        if (cut) {
            shift = turn = new Double3();
            zoom = 0;
        } else if (former != null) {
            var before = former.At(time, former.TargetId == newest.TargetId ? targetPosition : null);
            shift += before.Position - shown.Position;
            turn = (DoubleQuaternion.From(turn) * before.Rotation * shown.Rotation.Inverse).Turn;
            zoom += before.FieldOfView - shown.FieldOfView;
        }
        cut = false;
        former = null;
        shown.Position += shift;
        shown.Rotation = DoubleQuaternion.From(turn) * shown.Rotation;
        shown.FieldOfView += zoom;
        return shown;
    }

    void Fade(double time) {
        if (time <= timeS) return;
        double left = Math.Exp(-(time - timeS) / FadeS);
        shift = left * shift;
        turn = left * turn;
        zoom *= left;
        timeS = time;
    }

    // For how long a reply's velocities have carried the camera at this age: at most 0.25 s.
    static double CarriedS(double ageS) {
        if (ageS <= FullS) return Math.Max(ageS, -FullS);
        double easingS = Math.Min(ageS, StopS) - FullS;
        return FullS + easingS - easingS * easingS / (2 * (StopS - FullS));
    }

    // The part of a reply that the sampler needs.
    sealed class Newest {
        public readonly ulong TargetId;
        readonly double timeS;
        Sample pose;
        readonly Double3 velocity, angularVelocity;
        Double3? target;  // where the target was

        public Newest(CameraReply reply) {
            timeS = reply.PoseTimeS;
            pose = new Sample {
                Position = Double3.From(reply.Pose?.Position), Rotation = DoubleQuaternion.From(reply.Pose?.Rotation), FieldOfView = reply.FieldOfView
            };
            velocity = Double3.From(reply.Velocity);
            angularVelocity = Double3.From(reply.AngularVelocity);
            if (reply.RelativePose == null) return;
            TargetId = reply.RelativePose.TargetId;
            if (TargetId != 0 && reply.RelativePose.UnrotatedPose != null) target = pose.Position - Double3.From(reply.RelativePose.UnrotatedPose.Position);
        }

        public void Shift(Double3 by) {
            pose.Position += by;
            target += by;
        }

        public Sample At(double time, Double3? targetPosition) {
            double ageS = time - timeS, carried = CarriedS(ageS);
            var shown = pose;
            shown.Position += carried * velocity;
            if (ageS > FullS && targetPosition != null && target != null)
                shown.Position += (1 - carried / ageS) * (targetPosition.Value - target.Value);
            shown.Rotation = DoubleQuaternion.From(carried * angularVelocity) * shown.Rotation;
            return shown;
        }
    }
}

}  // namespace Sightline.Client
