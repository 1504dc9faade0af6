// As much of Godot as the code of client/engines/godot.md uses.
using System;

namespace Godot {

[AttributeUsage(AttributeTargets.Field)]
public sealed class ExportAttribute : Attribute { }
public struct Vector3 {
    public float X, Y, Z;
    public Vector3(float x, float y, float z) { X = x; Y = y; Z = z; }
    public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.X + b.X, a.Y + b.Y, a.Z + b.Z); }
    public static Vector3 operator /(Vector3 a, float d) { return new Vector3(a.X / d, a.Y / d, a.Z / d); }
    public static Vector3 Up => new Vector3(0, 1, 0);
    public Vector3 Lerp(Vector3 to, float weight) { return to; }
    public Vector3 DirectionTo(Vector3 to) { return to; }
    public float DistanceTo(Vector3 to) { return 0; }
}
public struct Quaternion {
    public float X, Y, Z, W;
    public Quaternion(float x, float y, float z, float w) { X = x; Y = y; Z = z; W = w; }
    public Quaternion(Vector3 arcFrom, Vector3 arcTo) { X = 0; Y = 0; Z = 0; W = 1; }
}
public struct Basis {
    public Basis(Quaternion quaternion) { }
    public Quaternion GetRotationQuaternion() { return new Quaternion(); }
}
public struct Transform3D {
    public Transform3D(Basis basis, Vector3 origin) { Basis = basis; Origin = origin; }
    public Basis Basis;
    public Vector3 Origin;
    public Transform3D AffineInverse() { return this; }
    public static Transform3D operator *(Transform3D a, Transform3D b) { return a; }
    public static Vector3 operator *(Transform3D transform, Vector3 vector) { return vector; }
}
public class Node {
    public int ProcessPhysicsPriority { get; set; }
    public ulong GetInstanceId() { return 1; }
    public Godot.Collections.Array<Node> FindChildren(string pattern, string type) { return null; }
    public virtual void _EnterTree() { }
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
public class Skeleton3D : Node3D {
    public int FindBone(string name) { return 0; }
    public Transform3D GetBoneGlobalPose(int boneIdx) { return new Transform3D(); }
}
public class Shape3D { }
public class BoxShape3D : Shape3D {
    public Vector3 Size { get; set; }
}
public class CollisionShape3D : Node3D {
    public Shape3D Shape { get; set; }
}
public class Shape { }  // a name that Sightline has too
public static class GD {
    public static void PushWarning(params object[] what) { }
}

}  // namespace Godot

namespace Godot.Collections {

public sealed class Array<T> : System.Collections.Generic.List<T> { }

}  // namespace Godot.Collections
