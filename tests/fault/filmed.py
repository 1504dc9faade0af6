"""A game that films two walkers at 60 Hz, and watches over what its camera does."""
import math
import random
import threading
import time

from sightline_client import Camera, Connection, Failed, box, capsule
from waits import ORDINARY_S, Wait

RATE_HZ = 60.0
SPEED_LIMIT_MPS = 6.0
ANNA, BEN, PILLAR = 1, 2, 3
# Positions may be off by this.
ROUNDING_M = 1e-6


def places(time_s, phase):
    angle = time_s + phase
    return {ANNA: (3 * math.sin(angle) - 0.6, 0.9, 0), BEN: (3 * math.sin(angle) + 0.6, 0.9, math.cos(angle))}


class Filmed(threading.Thread):
    """One session. It runs until `stop`; the figures may be read at any time."""

    def __init__(self, addresses, number, reply_timeout_s=2.0):
        super().__init__(name=f"session {number}", daemon=True)
        self.addresses, self.number = addresses, number
        self.connection = Connection(reply_timeout_s=reply_timeout_s, give_up_after_s=60.0)
        self.ticks = self.resumes = self.resyncs = 0
        self.fault = "none"  # what befell this session last; those who do it say so before
        self.waits = []  # of the ticks that met trouble, or took long without
        self.troubles = []
        self.jumps = []
        self.stopping = threading.Event()
        self.opened = threading.Event()

    def run(self):
        try:
            with self._camera() as camera:
                self.opened.set()
                while not self.stopping.is_set():
                    self._tick(camera)
        except Failed as error:
            self.troubles.append(str(error))
        finally:
            self.opened.set()

    def _camera(self):
        phase = random.Random(self.number).uniform(0, 6)
        self.phase, self.last = phase, None
        person = capsule(radius=0.3, height=1.8)
        camera = Camera(self.addresses, position=(0, 1.6, 6), targets={ANNA: person, BEN: person}, occluders={PILLAR: box(1, 4, 1)},
                        at={PILLAR: (0, 2, 2), **places(0, phase)}, connection=self.connection)
        return camera

    def _tick(self, camera):
        self.ticks += 1
        time_s = self.ticks / RATE_HZ
        before = time.monotonic()
        lost = camera.resumes + camera.resyncs
        limits = {"limits": {"max_speed_mps": SPEED_LIMIT_MPS}} if self.ticks == 1 else {}
        reply = camera.tick(time_s, places(time_s, self.phase), **limits)
        fault = self.fault  # before the others see that the session has gone on
        self.resumes, self.resyncs = camera.resumes, camera.resyncs
        waited = time.monotonic() - before
        if camera.resumes + camera.resyncs > lost or waited > ORDINARY_S:
            self.waits.append(Wait(fault, waited))
        self._look_for_jump(reply)
        time.sleep(max(0.0, 1 / RATE_HZ - waited))

    def _look_for_jump(self, reply):
        p = reply.pose.position
        if reply.sequence != self.ticks:
            self.troubles.append(f"tick {self.ticks} was answered by the reply to {reply.sequence}")
        if self.last is not None:
            former, former_s = self.last
            moved, allowed = math.dist(former, (p.x, p.y, p.z)), SPEED_LIMIT_MPS * (reply.time_s - former_s) + ROUNDING_M
            if moved > allowed:
                self.jumps.append(f"session {self.number}, tick {self.ticks}: {moved:.4f} m, {allowed:.4f} m are allowed")
        self.last = (p.x, p.y, p.z), reply.time_s

    def stop(self):
        self.stopping.set()
        self.join(90)
        if self.is_alive():
            self.troubles.append("the session did not end")
