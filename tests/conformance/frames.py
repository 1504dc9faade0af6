"""The conventions of proto/sightline/v1/camera.proto as plain arithmetic, written from the comments there. It shares no code with the
daemon or with any client.

A vector is a list of three numbers, a rotation a matrix of three rows. "Canonical" is glTF's frame in metres.
"""
import math

AXES = {"PLUS_X": (1, 0, 0), "MINUS_X": (-1, 0, 0), "PLUS_Y": (0, 1, 0), "MINUS_Y": (0, -1, 0), "PLUS_Z": (0, 0, 1), "MINUS_Z": (0, 0, -1)}


class Frame:
    """x, y, z: where the client's axes point, as canonical axes. forward, up: of a camera with the identity rotation, as client axes."""

    def __init__(self, name, x, y, z, metres, forward, up, horizontal, degrees):
        self.name, self.axes, self.metres = name, (x, y, z), metres
        self.to_client = [AXES[axis] for axis in (x, y, z)]  # rows: a client coordinate is the product with that client axis
        self.forward, self.up = AXES[forward], AXES[up]
        self.forward_name, self.up_name = forward, up
        self.horizontal, self.degrees = horizontal, degrees

    def message(self):
        """The Convention of the opening."""
        if self.name != "custom":
            return {"preset": f"PRESET_{self.name.upper()}"}
        x, y, z = (f"AXIS_{axis}" for axis in self.axes)
        return {"preset": "PRESET_CUSTOM", "custom": {
            "x": x, "y": y, "z": z, "metresPerUnit": self.metres, "cameraForward": f"AXIS_{self.forward_name}", "cameraUp": f"AXIS_{self.up_name}",
            "horizontalFieldOfView": self.horizontal, "degrees": self.degrees}}

    def direction(self, canonical):
        return product(self.to_client, canonical)

    def point(self, canonical):
        return [value / self.metres for value in self.direction(canonical)]

    def size(self, canonical):
        """Of a box, along the client's axes."""
        return [abs(value) for value in self.point(canonical)]

    def length(self, metres):
        return metres / self.metres

    def object_rotation(self, canonical):
        """The matrix of an object's rotation."""
        columns = transpose(self.to_client)
        return multiply(multiply(self.to_client, canonical), columns)

    def camera_rotation(self, ahead, above):
        """The matrix that turns `forward` to where the camera looks and `up` to where its picture's top is."""
        f, u = self.direction(ahead), self.direction(above)
        seen = transpose([f, u, cross(f, u)])
        own = [self.forward, self.up, cross(self.forward, self.up)]
        return multiply(seen, own)

    def field_of_view(self, vertical_rad, aspect):
        angle = 2 * math.atan(aspect * math.tan(vertical_rad / 2)) if self.horizontal else vertical_rad
        return math.degrees(angle) if self.degrees else angle

    def canonical_point(self, client):
        return product(transpose(self.to_client), [value * self.metres for value in client])


FRAMES = [
    Frame("gltf", "PLUS_X", "PLUS_Y", "PLUS_Z", 1, "MINUS_Z", "PLUS_Y", False, False),
    Frame("godot", "PLUS_X", "PLUS_Y", "PLUS_Z", 1, "MINUS_Z", "PLUS_Y", False, True),
    Frame("unity", "MINUS_X", "PLUS_Y", "PLUS_Z", 1, "PLUS_Z", "PLUS_Y", False, True),
    # Unreal's (x, y, z) is glTF's (x, z, y); ROS's (x, y, z) is glTF's (z, x, y).
    Frame("unreal", "PLUS_X", "PLUS_Z", "PLUS_Y", 0.01, "PLUS_X", "PLUS_Z", True, True),
    Frame("ros", "PLUS_Z", "PLUS_X", "PLUS_Y", 1, "PLUS_X", "PLUS_Z", False, False),
    # Left-handed, in inches, +X down; a camera looks along its +Y with -X upwards.
    Frame("custom", "MINUS_Y", "PLUS_X", "PLUS_Z", 0.0254, "PLUS_Y", "MINUS_X", True, True),
]


def product(matrix, vector):
    return [sum(a * b for a, b in zip(row, vector)) for row in matrix]


def transpose(matrix):
    return [list(column) for column in zip(*matrix)]


def multiply(a, b):
    return [[sum(x * y for x, y in zip(row, column)) for column in zip(*b)] for row in a]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def minus(a, b):
    return [x - y for x, y in zip(a, b)]


def unit(a):
    length = math.hypot(*a)
    return [x / length for x in a]


def turn(axis, angle):
    """The matrix of a turn about an axis, by Rodrigues' formula."""
    x, y, z = unit(axis)
    c, s, t = math.cos(angle), math.sin(angle), 1 - math.cos(angle)
    return [[t * x * x + c, t * x * y - s * z, t * x * z + s * y],
            [t * x * y + s * z, t * y * y + c, t * y * z - s * x],
            [t * x * z - s * y, t * y * z + s * x, t * z * z + c]]


def looking(eye, at):
    """Where a level camera looks and where its picture's top is: two canonical directions."""
    ahead = unit(minus(at, eye))
    right = unit(cross(ahead, [0, 1, 0]))
    return ahead, cross(right, ahead)


def quaternion(m):
    """x, y, z, w of a rotation's matrix, with w >= 0."""
    traces = [m[0][0] - m[1][1] - m[2][2], m[1][1] - m[0][0] - m[2][2], m[2][2] - m[0][0] - m[1][1], m[0][0] + m[1][1] + m[2][2]]
    largest = traces.index(max(traces))
    four = 2 * math.sqrt(1 + traces[largest])
    table = [[four / 4, (m[0][1] + m[1][0]) / four, (m[0][2] + m[2][0]) / four, (m[2][1] - m[1][2]) / four],
             [(m[0][1] + m[1][0]) / four, four / 4, (m[1][2] + m[2][1]) / four, (m[0][2] - m[2][0]) / four],
             [(m[0][2] + m[2][0]) / four, (m[1][2] + m[2][1]) / four, four / 4, (m[1][0] - m[0][1]) / four],
             [(m[2][1] - m[1][2]) / four, (m[0][2] - m[2][0]) / four, (m[1][0] - m[0][1]) / four, four / 4]]
    q = table[largest]
    return [-value for value in q] if q[3] < 0 else q
