"""A control group with a limit of memory, as a container has one. Linux offers it in two versions, and often only to root."""
import itertools
import os
import pathlib
import time

ROOT = pathlib.Path("/sys/fs/cgroup")
NUMBERS = itertools.count()


class MemoryCgroup:
    """Raises OSError where none can be made. Use it in a `with` statement; it must be empty at the end."""

    def __init__(self, mib):
        second = (ROOT / "cgroup.controllers").exists()
        self.path = (ROOT if second else ROOT / "memory") / f"sightline-attack-{os.getpid()}-{next(NUMBERS)}"
        self.path.mkdir()
        try:
            (self.path / ("memory.max" if second else "memory.limit_in_bytes")).write_text(str(mib << 20))
            swap = self.path / ("memory.swap.max" if second else "memory.swappiness")
            if swap.exists():
                swap.write_text("0")
        except OSError:
            self.close()
            raise

    def inside(self, command):
        """The command line that runs this command inside the group, under the same process id."""
        return ["sh", "-c", 'echo 0 > "$0" && exec "$@"', str(self.path / "cgroup.procs"), *command]

    def close(self):
        # The kernel may need a moment to see that the last process has ended.
        for _ in range(100):
            try:
                return self.path.rmdir()
            except OSError:
                time.sleep(0.02)
        self.path.rmdir()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
