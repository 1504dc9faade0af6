"""A client of Sightline: one camera that keeps its targets in view, tick by tick.

Lengths are in metres, times in seconds. The frame is glTF's unless the opening declares another convention: right-handed, +Y up, a camera
looks along its own -Z. README.md shows complete programs; proto/sightline/v1 describes every field.
"""
from pkgutil import extend_path

# A program beside this folder, as example.py, finds the generated messages of the package in a build's folder.
__path__ = extend_path(__path__, __name__)

from sightline_client.aio import AsyncCamera  # noqa: E402
from sightline_client.camera import Camera  # noqa: E402
from sightline_client.connection import Connection, Tls  # noqa: E402
from sightline_client.display import Source  # noqa: E402
from sightline_client.errors import Failed, QueueFull, Refused  # noqa: E402
from sightline_client.live import LiveCamera, LiveView, Patience  # noqa: E402
from sightline_client.sampler import PoseSampler, Sample  # noqa: E402
from sightline_client.shapes import Place, along, box, capsule, opening, pose, sphere, tick  # noqa: E402

__all__ = ["AsyncCamera", "Camera", "Connection", "Failed", "LiveCamera", "LiveView", "Patience", "Place", "PoseSampler", "QueueFull", "Refused",
           "Sample", "Source", "Tls", "along", "box", "capsule", "opening", "pose", "sphere", "tick"]
