// As much of Godot as the code of client/engines/godot.md uses.
using System;

namespace Godot {

[AttributeUsage(AttributeTargets.Field)]
public sealed class ExportAttribute : Attribute { }
public struct Vector3 {
    public float X, Y, Z;
    public Vector3(float x, float y, float z) { X = x; Y = y; Z = z; }
    public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.X + b.X, a.Y + b.Y, a.Z + b.Z); }
}
public struct Quaternion {
    public float X, Y, Z, W;
    public Quaternion(float x, float y, float z, float w) { X = x; Y = y; Z = z; W = w; }
}
public struct Basis {
    public Basis(Quaternion quaternion) { }
    public Quaternion GetRotationQuaternion() { return new Quaternion(); }
}
public struct Transform3D {
    public Transform3D(Basis basis, Vector3 origin) { }
}
public class Node {
    public int ProcessPhysicsPriority { get; set; }
    public ulong GetInstanceId() { return 1; }
    public virtual void _Ready() { }
    public virtual void _PhysicsProcess(double delta) { }
    public virtual void _ExitTree() { }
}
public class Node3D : Node {
    public bool TopLevel { get; set; }
    public Vector3 GlobalPosition { get; set; }
    public Basis GlobalBasis { get; set; }
    public Transform3D GlobalTransform { get; set; }
}
public class Camera3D : Node3D {
    public float Fov { get; set; }
}
public class Shape { }  // a name that Sightline has too
public static class GD {
    public static void PushWarning(params object[] what) { }
}

}  // namespace Godot

namespace Godot.Collections {

public sealed class Array<T> : System.Collections.Generic.List<T> { }

}  // namespace Godot.Collections
