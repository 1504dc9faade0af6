"""A wall clock that a test moves while a daemon runs; the machine's own is left alone (shifted_clock.c)."""
import os
import pathlib
import struct
import tempfile

from sightline.v1 import camera_control_pb2

# The stubs and the library are parts of the same build.
LIBRARY = pathlib.Path(camera_control_pb2.__file__).parents[3] / "tests/attack/libshifted_clock.so"


class ShiftedClock:
    """Programs started with `environment` show it. Use it in a `with` statement."""

    def __init__(self):
        self.file = tempfile.NamedTemporaryFile()
        self.environment = {"LD_PRELOAD": str(LIBRARY), "SIGHTLINE_CLOCK_SHIFT": self.file.name}
        self.shift(0)

    def shift(self, seconds):
        """From now on it differs by so much from the machine's."""
        os.pwrite(self.file.fileno(), struct.pack("=q", int(seconds * 1e9)), 0)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()
