using System;
using System.Collections.Generic;
using System.Linq;
using Sightline.V1;

namespace Sightline.Client {

// Ticks that wait for a daemon that is late or away, in their order. Those that carry only time and places, and perhaps an observed camera that is no
// cut, fold into one: the newest place counts for each id. Every other tick is kept whole, so that a refusal hits it alone; MostWaiting of them may
// wait.
internal sealed class WaitingTicks {
    public const int MostWaiting = 4096;
    const int MostParts = 8;  // of what is folded: with and without rotation, velocity and angular velocity

    readonly LinkedList<Entry> entries = new LinkedList<Entry>();
    double? timeS;  // of the newest tick

    public int Count => entries.Count;

    // Takes a tick with its number. Throws QueueFullException.
    public void Add(Tick tick) {
        double dtS = tick.HasDtS ? tick.DtS : timeS == null ? 0 : tick.TimeS - timeS.Value;
        bool isPlain = IsPlain(tick);
        if (!isPlain || entries.Count == 0 || entries.Last.Value.Kept != null) {
            if (entries.Count >= MostWaiting) throw new QueueFullException(MostWaiting + " ticks wait for a daemon");
            entries.AddLast(new Entry { Kept = isPlain ? null : tick });
        }
        if (isPlain) entries.Last.Value.Fold(tick, dtS);
        entries.Last.Value.Suggested = null;
        timeS = tick.TimeS;
    }

    // Goes with the newest tick as its observed camera, if that tick waits and has none.
    public void Suggest(ObservedCamera observed) {
        if (entries.Count > 0) entries.Last.Value.Suggested = observed;
    }

    // The ticks to send next, each of which gets an answer.
    public List<Tick> Take() {
        var first = entries.First.Value;
        entries.RemoveFirst();
        return first.Ticks();
    }

    // Only a tick that a daemon is likely to take is folded.
    bool IsPlain(Tick tick) {
        if (tick.ObservedCamera != null && tick.ObservedCamera.Cut) return false;
        if (!Finite.Is(tick.TimeS) || (tick.HasDtS && !(Finite.Is(tick.DtS) && tick.DtS >= 0)) || tick.TimeS < timeS) return false;
        if (tick.Transforms != null && !IsWhole(tick.Transforms)) return false;
        var rest = tick.Clone();
        rest.Sequence = 0;
        rest.TimeS = 0;
        rest.ClearDtS();
        rest.Transforms = null;
        rest.ObservedCamera = null;
        return rest.Equals(new Tick());
    }

    // All numbers are there and finite, and no id comes twice.
    static bool IsWhole(Transforms moved) {
        int n = moved.Ids.Count;
        if (moved.Positions.Count != 3 * n || !IsNoneOr(4 * n, moved.Rotations) || new HashSet<ulong>(moved.Ids).Count != n) return false;
        if (!IsNoneOr(3 * n, moved.Velocities) || !IsNoneOr(3 * n, moved.AngularVelocities)) return false;
        var optional = moved.Rotations.Concat(moved.Velocities).Concat(moved.AngularVelocities);
        return moved.Positions.All(Finite.Is) && optional.All(value => Finite.Is(value));
    }

    static bool IsNoneOr(int count, ICollection<float> values) {
        return values.Count == 0 || values.Count == count;
    }

    sealed class Place {
        public double[] Position;
        public float[] Rotation;                   // empty: it stays as it is
        public float[] Velocity, AngularVelocity;  // empty: the daemon derives it

        public (bool, bool, bool) Kind => (Rotation.Length > 0, Velocity.Length > 0, AngularVelocity.Length > 0);
    }

    // A tick that is kept whole, or several in one that only say where things are.
    sealed class Entry {
        public Tick Kept;
        public ObservedCamera Suggested;  // what the player sees instead of the daemon's camera
        readonly List<Tick> folded = new List<Tick>();  // the first MostParts
        readonly Dictionary<ulong, Place> places = new Dictionary<ulong, Place>();
        readonly List<ulong> ids = new List<ulong>();  // the keys of places, in the order of their first tick
        ulong sequence;
        double timeS, dtS;
        bool hasDt;               // some tick said its DtS
        ObservedCamera observed;  // of the newest tick

        public void Fold(Tick tick, double passedS) {
            sequence = tick.Sequence;
            timeS = tick.TimeS;
            dtS += passedS;
            hasDt |= tick.HasDtS;
            observed = tick.ObservedCamera;
            if (folded.Count < MostParts) folded.Add(tick);
            var moved = tick.Transforms ?? new Transforms();
            for (int i = 0; i < moved.Ids.Count; ++i) {
                Place before;
                if (!places.TryGetValue(moved.Ids[i], out before)) ids.Add(moved.Ids[i]);
                var rotation = Part(moved.Rotations, 4, i);
                places[moved.Ids[i]] = new Place {
                    Position = Part(moved.Positions, 3, i), Rotation = rotation.Length == 0 && before != null ? before.Rotation : rotation,
                    Velocity = Part(moved.Velocities, 3, i), AngularVelocity = Part(moved.AngularVelocities, 3, i)
                };
            }
        }

        static T[] Part<T>(IList<T> values, int size, int i) {
            var part = new T[values.Count == 0 ? 0 : size];
            for (int k = 0; k < part.Length; ++k) part[k] = values[size * i + k];
            return part;
        }

        public List<Tick> Ticks() {
            var ticks = Kept != null ? new List<Tick> { Kept } : Parts();
            var last = ticks[ticks.Count - 1];
            last.ObservedCamera = last.ObservedCamera ?? observed ?? Suggested;
            return ticks;
        }

        // Several ticks where need be: a message has rotations for all of its instances or for none, and so with velocities and angular
        // velocities. Each part takes the number of a tick. Where there are fewer ticks than parts, the ticks go as they came.
        List<Tick> Parts() {
            var kinds = ids.GroupBy(id => places[id].Kind).ToList();
            if (kinds.Count > folded.Count) return folded;
            var parts = new List<Tick>();
            for (int i = 0; i < Math.Max(kinds.Count, 1); ++i) {
                var tick = new Tick { Sequence = sequence - (ulong)(Math.Max(kinds.Count, 1) - 1 - i), TimeS = timeS };
                if (hasDt) tick.DtS = i == 0 ? dtS : 0;
                if (kinds.Count > 0) tick.Transforms = new Transforms();
                foreach (ulong id in kinds.Count > 0 ? kinds[i] : Enumerable.Empty<ulong>()) {
                    tick.Transforms.Ids.Add(id);
                    tick.Transforms.Positions.AddRange(places[id].Position);
                    tick.Transforms.Rotations.AddRange(places[id].Rotation);
                    tick.Transforms.Velocities.AddRange(places[id].Velocity);
                    tick.Transforms.AngularVelocities.AddRange(places[id].AngularVelocity);
                }
                parts.Add(tick);
            }
            return parts;
        }
    }
}

}  // namespace Sightline.Client
