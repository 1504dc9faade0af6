"""Runs a program within limits of time and memory."""
import enum
import os
import subprocess
import tempfile

# Of one process, in bytes. The tests themselves stay far below; a mutant that allocates without end is killed by this, and not the machine.
MEMORY = 4 << 30


class End(enum.Enum):
    WELL = 0
    BADLY = 1
    LATE = 2  # it was stopped at the limit


def run(command, environment, limit_s):
    """How it ended. It runs in a folder of its own, which is removed."""
    limited = ["prlimit", f"--data={MEMORY}", "--core=0", *command]
    with tempfile.TemporaryDirectory(prefix="mutant-") as folder:
        process = subprocess.Popen(limited, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, **environment}, cwd=folder,
                                   start_new_session=True)
        try:
            return End.WELL if process.wait(limit_s) == 0 else End.BADLY
        except subprocess.TimeoutExpired:
            return End.LATE
        finally:
            # Daemons that the test started belong to its group. Nothing is left over.
            try:
                os.killpg(process.pid, 9)
            except ProcessLookupError:
                pass
            process.wait()
