"""How long the camera waited, by the fault that it met, and which of these waits are too long."""
import dataclasses

# A game that films at 60 Hz waits for less than this when nothing befalls it.
ORDINARY_S = 0.5
# The client notices these faults only when its reply timeout is over.
NOTICED_BY_TIMEOUT = ("silent", "daemon stopped")


@dataclasses.dataclass(frozen=True)
class Wait:
    fault: str  # that befell the session last
    seconds: float


def too_long(waits, most_wait_s, reply_timeout_s):
    """The waits that are longer than allowed; most_wait_s None: all are allowed."""
    if most_wait_s is None:
        return []
    return [wait for wait in waits if wait.seconds > most_wait_s + (reply_timeout_s if wait.fault in NOTICED_BY_TIMEOUT else 0.0)]
