"""A client of Sightline: one camera that keeps its targets in view, tick by tick.

Lengths are in metres, times in seconds. The frame is glTF's unless the opening declares another convention: right-handed, +Y up, a camera
looks along its own -Z. README.md shows complete programs; proto/sightline/v1 describes every field.
"""
from sightline_client.aio import AsyncCamera
from sightline_client.camera import Camera
from sightline_client.connection import Connection, Tls
from sightline_client.errors import Failed, Refused
from sightline_client.shapes import Place, box, capsule, opening, pose, sphere, tick

__all__ = ["AsyncCamera", "Camera", "Connection", "Failed", "Place", "Refused", "Tls", "box", "capsule", "opening", "pose", "sphere", "tick"]
