"""Holds one thread of another process, as if it hung, with ptrace."""
import ctypes
import os
import pathlib
import time

SEIZE, INTERRUPT, DETACH = 0x4206, 0x4207, 17
WAIT_FOR_ALL = 0x40000000  # __WALL
libc = ctypes.CDLL(None, use_errno=True)
libc.ptrace.argtypes = (ctypes.c_long, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
libc.ptrace.restype = ctypes.c_long


def threads_named(pid, name):
    return [int(task.name) for task in pathlib.Path(f"/proc/{pid}/task").iterdir() if (task / "comm").read_text().strip() == name]


class HeldThread:
    """Use it in a `with` statement. Raises PermissionError where tracing is not allowed."""

    def __init__(self, pid, name):
        while not threads_named(pid, name):  # a thread names itself when it begins to run
            time.sleep(0.01)
        self.thread = threads_named(pid, name)[0]
        self._ask(SEIZE)
        self._ask(INTERRUPT)
        os.waitpid(self.thread, WAIT_FOR_ALL)

    def _ask(self, request):
        if libc.ptrace(request, self.thread, None, None) != 0:
            error = ctypes.get_errno()
            raise OSError(error, os.strerror(error))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._ask(DETACH)
