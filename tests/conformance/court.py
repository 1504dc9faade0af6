"""The scene file of the conformance sessions: boxes in glTF, written by hand. court.glb holds a wall, which no session binds to an id, and a
post, which sessions bind."""
import json
import struct

# The centre and the whole size of each box, in metres.
WALL = ((-3, 1.5, 2), (4, 3, 0.2))
POST = ((2.5, 0.9, -1), (0.6, 1.8, 0.4))
HASH = "86a6a9ef3a3ad562a84b113254bb6ecc"  # of the file as written below: XXH3 with 128 bits (xxhsum -H2)


def write(path):
    corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [corner for a, b, c, d in sides for corner in (a, b, c, a, c, d)]
    vertices = b"".join(struct.pack("<3f", *corner) for corner in corners)
    data = vertices + struct.pack(f"<{len(triangles)}H", *triangles)
    gltf = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"name": name, "mesh": 0, "translation": centre, "scale": size} for name, (centre, size) in (("wall", WALL), ("post", POST))],
        "meshes": [{"name": "box", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [-0.5] * 3, "max": [0.5] * 3},
            {"bufferView": 1, "componentType": 5123, "count": len(triangles), "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(vertices)},
                        {"buffer": 0, "byteOffset": len(vertices), "byteLength": len(data) - len(vertices)}],
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(gltf, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    whole = 12 + 8 + len(text) + 8 + len(data)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, whole) + struct.pack("<I4s", len(text), b"JSON") + text
                     + struct.pack("<I4s", len(data), b"BIN\0") + data)
