using System;
using Sightline.V1;

namespace Sightline.Client {

/// <summary>A position, or a turn: a vector along its axis, as long as its angle in radians. In the client's frame and in double precision.</summary>
public struct Double3 : IEquatable<Double3> {
    /// <summary>The components.</summary>
    public double X, Y, Z;

    /// <summary>Makes a vector of its components.</summary>
    public Double3(double x, double y, double z) { X = x; Y = y; Z = z; }

    internal static Double3 From(Vec3 v) { return v == null ? new Double3() : new Double3(v.X, v.Y, v.Z); }
    internal Vec3 ToMessage() { return new Vec3 { X = X, Y = Y, Z = Z }; }

    /// <summary>The sum.</summary>
    public static Double3 operator +(Double3 a, Double3 b) { return new Double3(a.X + b.X, a.Y + b.Y, a.Z + b.Z); }
    /// <summary>The difference.</summary>
    public static Double3 operator -(Double3 a, Double3 b) { return new Double3(a.X - b.X, a.Y - b.Y, a.Z - b.Z); }
    /// <summary>The multiple.</summary>
    public static Double3 operator *(double factor, Double3 a) { return new Double3(factor * a.X, factor * a.Y, factor * a.Z); }

    internal double Length => Math.Sqrt(X * X + Y * Y + Z * Z);
    internal bool IsFinite => Finite.Is(X) && Finite.Is(Y) && Finite.Is(Z);

    /// <summary>True if all components are equal.</summary>
    public bool Equals(Double3 other) { return X == other.X && Y == other.Y && Z == other.Z; }
}

/// <summary>A rotation. The same formulae hold in right-handed and in left-handed frames, because the contract states turns by the frame's own rule.</summary>
public struct DoubleQuaternion {
    /// <summary>The components; W is the real part.</summary>
    public double X, Y, Z, W;

    /// <summary>Makes a rotation of its components.</summary>
    public DoubleQuaternion(double x, double y, double z, double w) { X = x; Y = y; Z = z; W = w; }

    internal static DoubleQuaternion From(Quat q) {
        double length = q == null ? 0 : Math.Sqrt(q.X * q.X + q.Y * q.Y + q.Z * q.Z + q.W * q.W);
        return length == 0 ? new DoubleQuaternion(0, 0, 0, 1) : new DoubleQuaternion(q.X / length, q.Y / length, q.Z / length, q.W / length);
    }
    internal static DoubleQuaternion From(Double3 turn) {
        double angle = turn.Length, share = angle > 1e-9 ? Math.Sin(angle / 2) / angle : 0.5;
        return new DoubleQuaternion(share * turn.X, share * turn.Y, share * turn.Z, Math.Cos(angle / 2));
    }
    internal Quat ToMessage() { return new Quat { X = X, Y = Y, Z = Z, W = W }; }

    /// <summary>Turns by q first, then by p.</summary>
    public static DoubleQuaternion operator *(DoubleQuaternion p, DoubleQuaternion q) {
        return new DoubleQuaternion(p.W * q.X + p.X * q.W + p.Y * q.Z - p.Z * q.Y, p.W * q.Y - p.X * q.Z + p.Y * q.W + p.Z * q.X,
                                    p.W * q.Z + p.X * q.Y - p.Y * q.X + p.Z * q.W, p.W * q.W - p.X * q.X - p.Y * q.Y - p.Z * q.Z);
    }

    internal DoubleQuaternion Inverse => new DoubleQuaternion(-X, -Y, -Z, W);

    // The shorter way: at most half a turn.
    internal Double3 Turn {
        get {
            var axis = new Double3(X, Y, Z);
            double sign = W < 0 ? -1 : 1, length = axis.Length;
            return (length > 1e-9 ? sign * 2 * Math.Atan2(length, sign * W) / length : sign * 2) * axis;
        }
    }
}

internal static class Finite {
    public static bool Is(double value) { return !double.IsNaN(value) && !double.IsInfinity(value); }
}

}  // namespace Sightline.Client
