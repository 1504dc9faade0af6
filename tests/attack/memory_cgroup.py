"""A control group with a limit of memory, as a container has one. Linux offers it in two versions, and often only to root."""
import os
import pathlib

ROOT = pathlib.Path("/sys/fs/cgroup")


class MemoryCgroup:
    """Raises OSError where none can be made. Use it in a `with` statement; it must be empty at the end."""

    def __init__(self, mib):
        second = (ROOT / "cgroup.controllers").exists()
        self.path = (ROOT if second else ROOT / "memory") / f"sightline-attack-{os.getpid()}"
        self.path.mkdir()
        try:
            (self.path / ("memory.max" if second else "memory.limit_in_bytes")).write_text(str(mib << 20))
            swap = self.path / ("memory.swap.max" if second else "memory.swappiness")
            if swap.exists():
                swap.write_text("0")
        except OSError:
            self.path.rmdir()
            raise

    def add(self, pid):
        (self.path / "cgroup.procs").write_text(str(pid))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.path.rmdir()
