"""A daemon of the tests' own, which keeps its address when it is replaced by a new one."""
import pathlib
import subprocess
import tempfile
import time


class Daemon:
    def __init__(self, program, *flags):
        self.command = [program, "--sampler", "embree", "--log-level", "error", *flags]
        self.folder = tempfile.TemporaryDirectory()
        self.process = None
        self.address = "127.0.0.1:0"

    def start(self):
        ready = pathlib.Path(self.folder.name, "ready")
        ready.unlink(missing_ok=True)
        self.process = subprocess.Popen([*self.command, "--listen", self.address, "--ready-file", ready])
        deadline = time.monotonic() + 60
        while not ready.exists():
            if self.process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError("the daemon did not start")
            time.sleep(0.01)
        self.address = ready.read_text().split()[0]

    def stop(self, how="drain"):
        """drain: it says goodbye to its sessions. kill: it does not."""
        {"drain": self.process.terminate, "kill": self.process.kill}[how]()
        self.process.wait(20)

    def replace(self, how):
        """Another daemon takes its place, which knows nothing of its sessions and scenes."""
        self.stop(how)
        self.start()

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.stop()
        self.folder.cleanup()
