using System;
using System.Collections.Generic;
using System.Linq;
using Sightline.V1;

namespace Sightline.Client {

// Follows the positions of the instances and the list of targets, as the game said.
internal sealed class TargetPlaces {
    Dictionary<ulong, Double3> positions = new Dictionary<ulong, Double3>();
    List<KeyValuePair<ulong, double>> weights;

    public TargetPlaces(OpenSession opening) {
        AddAll(opening.Instances);
        Choose(opening.Targets);
    }

    public void Shift(Double3 by) { positions = positions.ToDictionary(place => place.Key, place => place.Value + by); }

    public void Apply(Tick tick) {
        if (tick.Delta != null) {
            foreach (ulong id in tick.Delta.RemovedIds) positions.Remove(id);
            AddAll(tick.Delta.AddedInstances);
        }
        if (tick.Transforms != null) {
            var places = tick.Transforms.Positions;
            for (int i = 0; i < tick.Transforms.Ids.Count && 3 * i + 2 < places.Count; ++i) {
                var place = new Double3(places[3 * i], places[3 * i + 1], places[3 * i + 2]);
                if (place.IsFinite) positions[tick.Transforms.Ids[i]] = place;
            }
        }
        if (tick.Targets != null) Choose(tick.Targets.Targets);
    }

    // The targets that make up the centre, and their weights.
    public List<KeyValuePair<ulong, double>> Counted() {
        return weights.Where(target => target.Value > 0 && positions.ContainsKey(target.Key)).ToList();
    }

    // drawn: positions that are newer; null: there are none.
    public Double3? Position(ulong id, IReadOnlyDictionary<ulong, Double3> drawn) {
        Double3 place;
        if (drawn != null && drawn.TryGetValue(id, out place)) return place;
        return positions.TryGetValue(id, out place) ? place : (Double3?)null;
    }

    // The weighted mean of the targets; null: there is none whose position is known.
    public Double3? Centre(IReadOnlyDictionary<ulong, Double3> drawn) {
        double total = 0;
        var sum = new Double3();
        foreach (var target in Counted()) {
            total += target.Value;
            sum += target.Value * Position(target.Key, drawn).Value;
        }
        return total > 0 ? 1 / total * sum : (Double3?)null;
    }

    void AddAll(IEnumerable<NewInstance> instances) {
        foreach (var added in instances) positions[added.Id] = Double3.From(added.Pose?.Position);
    }

    void Choose(IEnumerable<Target> targets) {
        weights = targets.Select(target => new KeyValuePair<ulong, double>(target.Id, target.HasWeight ? target.Weight : 1)).ToList();
    }
}

// Keeps the camera's place relative to the targets' centre. Its motion relative to them dies away. It turns no more.
internal sealed class Follower {
    const double CarryS = 0.1;  // time constant
    readonly Double3 offset, velocity;
    readonly double sinceS;

    public Follower(Double3 offset, Double3 relativeVelocity, double sinceS) {
        this.offset = offset;
        velocity = relativeVelocity;
        this.sinceS = sinceS;
    }

    public Double3 At(double timeS, Double3 centre) {
        return centre + offset + CarryS * (1 - Math.Exp(-Math.Max(timeS - sinceS, 0) / CarryS)) * velocity;
    }
}

// The velocity of a point from its last positions. A single jump does not count.
internal sealed class RecentMotion {
    const int Steps = 5;
    double timeS;
    Double3? last;
    readonly List<Double3> velocities = new List<Double3>();

    public void Add(double time, Double3 position) {
        if (last != null && time <= timeS) return;
        if (last != null) velocities.Add(1 / (time - timeS) * (position - last.Value));
        if (velocities.Count > Steps) velocities.RemoveAt(0);
        last = position;
        timeS = time;
    }

    public void Shift(Double3 by) { last += by; }

    // The mean of the last steps without the fastest.
    public Double3 Velocity() {
        var slower = velocities.OrderBy(step => step.Length).Take(velocities.Count - 1).ToList();
        return slower.Aggregate(new Double3(), (mean, step) => mean + 1.0 / slower.Count * step);
    }
}

}  // namespace Sightline.Client
