"""Small scene files that do harm, and messages that do."""
import json
import struct

TRIANGLE = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)


def triangle(name):
    return {"asset": {"version": "2.0", "generator": name}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "buffers": [{"byteLength": 36}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}]}


def glb(name):
    """A scene of one triangle. Different names make different files."""
    return container(triangle(name), TRIANGLE)


def many_instances(count):
    """One triangle, drawn this many times. The instances' places are a sparse accessor without values: all zero."""
    document = triangle("many")
    document["accessors"].append({"componentType": 5126, "count": count, "type": "VEC3"})
    document["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1}}}
    document["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    return container(document, TRIANGLE)


def repeated_triangles(count, meshes, start=0):
    """So many triangles, and so many meshes: the first draws them once, the second twice, and so on. No two meshes are equal."""
    corners = []
    for n in range(count):
        x, y, z = n % 97 + start, n // 97, start * 0.5
        corners += [x, y, z, x + 1, y, z, x, y + 1, z]
    data = struct.pack(f"<{len(corners)}f", *corners)
    document = triangle("repeated")
    document["buffers"][0]["byteLength"] = document["bufferViews"][0]["byteLength"] = len(data)
    document["accessors"][0].update(count=3 * count, min=[start, 0, start * 0.5], max=[97 + start, count // 97 + 1, start * 0.5])
    document["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}}] * (n + 1)} for n in range(meshes)]
    document["nodes"] = [{"mesh": n} for n in range(meshes)]
    document["scenes"][0]["nodes"] = list(range(meshes))
    return container(document, data)


def container(document, data):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def scene_of(scene_hash):
    from sightline.v1.session_pb2 import OpenSession
    scene = OpenSession().scene
    scene.hash = scene_hash
    return scene


def varint(number):
    out = b""
    while number > 127:
        out, number = out + bytes([number & 127 | 128]), number >> 7
    return out + bytes([number])


def empty_parts(count):
    """A ControlRequest whose tick adds so many empty instances: two bytes each on the wire, far more when it is parsed."""
    from sightline.v1.camera_control_pb2 import ControlRequest
    from sightline.v1.session_pb2 import Tick

    def field(message, name):
        return message.DESCRIPTOR.fields_by_name[name] if hasattr(message, "DESCRIPTOR") else message.fields_by_name[name]

    def part(descriptor, payload):
        return bytes([descriptor.number << 3 | 2]) + varint(len(payload)) + payload
    delta = field(Tick, "delta")
    added = field(delta.message_type, "added_instances")
    inner = bytes([added.number << 3 | 2, 0]) * count
    return part(field(ControlRequest, "tick"), part(delta, inner))


def dear_tuning():
    """The dearest settings that pass with 32 targets."""
    from google.protobuf import json_format
    from sightline.tuning.v1alpha1.tuning_pb2 import Tuning
    return json_format.ParseDict({"sample": {"points": 8, "resolution": 12}, "aggregate": {"candidates": 700}}, Tuning())


def largest_tuning():
    """The dearest settings that the contract allows."""
    from google.protobuf import json_format
    from sightline.tuning.v1alpha1.tuning_pb2 import Tuning
    return json_format.ParseDict({"sample": {"points": 16, "resolution": 64}, "aggregate": {"candidates": 32768}}, Tuning())
