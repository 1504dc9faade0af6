// As much of Unity as the code of client/engines/unity.md uses.
using System;

namespace UnityEngine {

public sealed class RequireComponent : Attribute {
    public RequireComponent(Type type) { }
}
public struct Vector3 {
    public float x, y, z;
    public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
    public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.x + b.x, a.y + b.y, a.z + b.z); }
    public static Vector3 operator -(Vector3 a, Vector3 b) { return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z); }
    public static Vector3 operator /(Vector3 a, float d) { return new Vector3(a.x / d, a.y / d, a.z / d); }
    public static Vector3 up => new Vector3(0, 1, 0);
    public static Vector3 Lerp(Vector3 a, Vector3 b, float t) { return a; }
    public static Vector3 Scale(Vector3 a, Vector3 b) { return a; }
    public static float Distance(Vector3 a, Vector3 b) { return 0; }
}
public struct Quaternion {
    public float x, y, z, w;
    public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
    public static Quaternion operator *(Quaternion a, Quaternion b) { return a; }
    public static Vector3 operator *(Quaternion rotation, Vector3 point) { return point; }
    public static Quaternion Inverse(Quaternion rotation) { return rotation; }
    public static Quaternion FromToRotation(Vector3 fromDirection, Vector3 toDirection) { return new Quaternion(); }
}
public class Object {
    public int GetInstanceID() { return 0; }
}
public sealed class GameObject : Object { }
public class Component : Object {
    public GameObject gameObject => null;
    public Transform transform => null;
    public T GetComponent<T>() { return default(T); }
    public T[] GetComponentsInChildren<T>() { return new T[0]; }
}
public sealed class Transform : Component {
    public Vector3 position { get; set; }
    public Quaternion rotation { get; set; }
    public Vector3 lossyScale => new Vector3();
    public Vector3 TransformPoint(Vector3 position) { return position; }
    public void SetPositionAndRotation(Vector3 position, Quaternion rotation) { }
}
public class MonoBehaviour : Component { }
public sealed class BoxCollider : Component {
    public Vector3 center { get; set; }
    public Vector3 size { get; set; }
}
public sealed class Camera : Component {
    public float fieldOfView { get; set; }
}
public static class Time {
    public static double timeAsDouble => 0;
}
public static class Debug {
    public static void LogWarning(object message) { }
    public static void LogException(Exception exception) { }
}

}  // namespace UnityEngine

namespace Cysharp.Net.Http {

public sealed class YetAnotherHttpHandler : System.Net.Http.HttpMessageHandler {
    public bool? Http2Only { get; set; }
}

}  // namespace Cysharp.Net.Http
