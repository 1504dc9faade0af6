"""A camera for a game loop: no call waits for long, with or without a daemon."""
from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass, replace
from typing import Any, List, Mapping, Optional, Sequence, Tuple, Union

from sightline.v1.errors_pb2 import TickError
from sightline.v1.scene_pb2 import Shape
from sightline.v1.session_pb2 import CameraReply, OpenSession, SessionOpened, Tick
from sightline_client.camera import Camera
from sightline_client.connection import Connection, OwnScene, Scene, is_lost, own_scene, pauses
from sightline_client.display import Display, Source
from sightline_client.errors import Failed, Refused, as_refusal
from sightline_client.shapes import Place, Quaternion, Vector, opening, tick
from sightline_client.waiting import MOST_WAITING, WaitingTicks

LONGEST_PAUSE_S = 0.25  # between attempts, so that a daemon that is back is found soon


@dataclass(frozen=True)
class Patience:
    """How long a LiveCamera waits.

    wait_s: a tick waits at most so long for its answer; 0: not at all. fallback_after_s: without an answer for so long, the camera follows the
    targets by itself; it must be longer than the way to the daemon and back. blend_s: so long the way back takes, in game time.
    reply_timeout_s: without an answer for so long, the stream is given up for a new one. close_s: so long the last ticks may take.
    """
    wait_s: float = 0.1
    fallback_after_s: float = 0.3
    blend_s: float = 0.5
    reply_timeout_s: float = 2.0
    close_s: float = 1.0


@dataclass(frozen=True)
class LiveView:
    """The camera to draw now.

    cut: it jumped; reset what smooths over frames. age_s: game time since the tick that the newest reply covers; 0: this one. sequence: number
    of the newest tick. reply: the newest one; None: there is none so far. refusals: of ticks, since the former view; TickError.sequence says which.
    trouble: why no daemon answers; None: one does.
    """
    position: Vector
    rotation: Quaternion
    field_of_view: float
    cut: bool
    age_s: float
    source: Source
    sequence: int
    reply: Optional[CameraReply]
    refusals: Tuple[TickError, ...]
    trouble: Optional[Failed]


class LiveCamera:
    """A session that keeps targets in view, for a game loop that must not wait. Use it in a `with` statement, from one thread at a time.

        LiveCamera(address, position=..., targets=..., occluders=..., at=...)    as `opening` of this package describes
        LiveCamera.open(address, OpenSession(...))                               with all that the contract has

    It opens at once; a thread of its own reaches the daemon, for ever if need be. Of Connection, give_up_after_s and reply_timeout_s do not
    count. A daemon that can never accept the opening is an error: tick raises Failed. One that is away is not. scene: as Camera's.
    """

    def __init__(self, addresses: Union[str, Sequence[str]], *, position: Place, targets: Mapping[int, Shape], occluders: Mapping[int, Shape],
                 at: Mapping[int, Place], scene: Optional[Scene] = None, connection: Connection = Connection(), patience: Patience = Patience(),
                 **more: Any) -> None:
        self._start(addresses, opening(position=position, targets=targets, occluders=occluders, at=at, **more), connection, patience, scene)

    @classmethod
    def open(cls, addresses: Union[str, Sequence[str]], request: OpenSession, connection: Connection = Connection(),
             patience: Patience = Patience(), scene: Optional[OwnScene] = None) -> LiveCamera:
        camera = cls.__new__(cls)
        camera._start(addresses, request, connection, patience, scene)
        return camera

    def _start(self, addresses: Union[str, Sequence[str]], request: OpenSession, connection: Connection, patience: Patience,
               scene: Optional[Scene]) -> None:
        for address in [addresses] if isinstance(addresses, str) else addresses:
            connection.channel_credentials(address)  # raises ValueError
        self._addresses, self._request, self._patience = addresses, request, patience
        self._scene = own_scene(scene, request)
        self._connection = replace(connection, give_up_after_s=0.0, reply_timeout_s=patience.reply_timeout_s)
        self._stopping = threading.Event()
        self._camera: Optional[Camera] = None  # of the worker
        self._changed = threading.Condition()
        # Guarded by _changed:
        self._display = Display(request, patience.blend_s)
        self._waiting = WaitingTicks()
        self._sequence = self._answered = 0  # the newest tick, and the newest that was answered
        self._first_s: Optional[float] = None
        self._silent_since = 0.0  # by the wall clock; counts while ticks are unanswered
        self._refusals: List[TickError] = []
        self._fatal: Optional[Exception] = None
        self._trouble: Optional[Failed] = None
        self._closed = False
        self._worker = threading.Thread(target=self._work, name="sightline-live", daemon=True)
        self._worker.start()

    @property
    def opened(self) -> Optional[SessionOpened]:
        """The answer of the daemon that opened the session last; None before the first."""
        return self._camera.opened if self._camera else None

    @property
    def resyncs(self) -> int:
        """As Camera.resyncs."""
        return self._camera.resyncs if self._camera else 0

    @property
    def resumes(self) -> int:
        """As Camera.resumes."""
        return self._camera.resumes if self._camera else 0

    def tick(self, time_s: float, places: Mapping[int, Place], **more: Any) -> LiveView:
        """Tells the daemon what has moved, and returns the camera to draw; the arguments are those of `tick` of this package. It waits for the
        answer at most Patience.wait_s, and not at all while an earlier tick is unanswered. Raises QueueFull, and Failed for an opening that
        no daemon accepts."""
        return self.step(tick(time_s, places, **more))

    def step(self, message: Tick) -> LiveView:
        """The same for a whole Tick without a sequence. The camera numbers them: the first is 1."""
        if message.step_control.merge_into_next:
            raise ValueError("tick.step_control.merge_into_next: a camera waits for a reply to each tick")
        if message.sequence:
            raise ValueError("tick.sequence: a LiveCamera numbers its ticks")
        if not math.isfinite(message.time_s):
            raise ValueError("tick.time_s: must be finite")
        numbered = Tick()
        numbered.CopyFrom(message)
        with self._changed:
            self._check()
            idle = self._answered == self._sequence
            self._take(numbered, idle)
            if idle and self._patience.wait_s > 0:
                self._changed.wait_for(lambda: self._answered == self._sequence or self._fatal is not None, self._patience.wait_s)
                self._check()
            view = self._view(message.time_s, {}, counts_from=self._sequence + idle)
            if self._display.follows:
                self._waiting.suggest(self._display.observed())
            return view

    def sample(self, time_s: float, drawn: Mapping[int, Vector] = {}) -> LiveView:
        """The camera to draw between ticks, at a game time near the newest tick's. drawn: positions of targets at that time, by id. Never waits."""
        with self._changed:
            self._check()
            return self._view(time_s, drawn, counts_from=self._sequence + 1)

    def _check(self) -> None:
        if self._closed:
            raise ValueError("the camera is closed")
        if self._fatal is not None:
            raise self._fatal

    def _take(self, message: Tick, idle: bool) -> None:
        message.sequence = self._sequence + 1
        self._waiting.add(message)
        self._display.take_tick(message)
        if idle:
            self._silent_since = time.monotonic()
        self._sequence = message.sequence
        self._first_s = message.time_s if self._first_s is None else self._first_s
        self._changed.notify_all()

    def _is_silent(self) -> bool:
        return time.monotonic() - self._silent_since >= self._patience.fallback_after_s

    def _view(self, time_s: float, drawn: Mapping[int, Vector], counts_from: int) -> LiveView:
        if self._answered != self._sequence and self._is_silent():
            self._display.follow(counts_from)
        shown, source = self._display.show(time_s, drawn)
        newest = self._display.newest
        if source == Source.PREDICTED and newest is not None and newest.sequence == self._sequence:
            source = Source.REPLY
        covered_s = newest.time_s if newest is not None else self._first_s if self._first_s is not None else time_s
        refusals, self._refusals = tuple(self._refusals), []
        return LiveView(shown.position, shown.rotation, shown.field_of_view, shown.cut, max(time_s - covered_s, 0.0), source, self._sequence, newest,
                        refusals, self._trouble)

    # On the worker's thread.

    def _work(self) -> None:
        try:
            if not self._try_for_ever(None):
                return
            while (ticks := self._next()) is not None:
                for message in ticks:
                    if not self._try_for_ever(message):
                        return
            assert self._camera is not None
            self._camera.close()
        except Failed:
            pass  # the session is over in any case
        except Exception as error:  # an option of the connection that cannot be right
            with self._changed:
                self._fatal = error
                self._changed.notify_all()

    def _next(self) -> Optional[List[Tick]]:
        with self._changed:
            self._changed.wait_for(lambda: len(self._waiting) > 0 or self._stopping.is_set())
            return self._waiting.take() if len(self._waiting) > 0 else None

    def _try_for_ever(self, message: Optional[Tick]) -> bool:
        """Opens the session if need be, and gets the answer to the tick. False: the camera was closed, or no daemon takes the opening."""
        for pause_s in pauses():
            if self._stopping.wait(min(pause_s, LONGEST_PAUSE_S)) and pause_s > 0:
                return False
            stream = self._stream_name()
            try:
                if self._camera is None:
                    self._camera = Camera.open(self._addresses, self._request, self._connection, self._scene)
                if message is not None:
                    self._answer(message, self._camera.step(message), None)
                return True
            except Refused as refused:
                assert message is not None
                self._answer(message, None, refused.error)
                return True
            except Failed as failed:
                if self._camera is None and not is_lost(failed, opening=True):
                    raise self._give_up(failed)
                if message is not None and self._stream_name() != stream and not is_lost(failed, opening=False):
                    self._answer(message, None, as_refusal(failed, message.sequence))  # it would end the call of the next stream too
                    return True
                with self._changed:
                    self._trouble = failed
        return False

    def _stream_name(self) -> Tuple[str, int]:
        """Another one after each opening and each resumption. A session that cannot be resumed goes on under another id."""
        return (self._camera.opened.session_id, self._camera.resumes) if self._camera is not None else ("", 0)

    def _give_up(self, failed: Failed) -> Failed:
        with self._changed:
            self._fatal = failed
            self._changed.notify_all()
        return failed

    def _answer(self, message: Tick, reply: Optional[CameraReply], refusal: Optional[TickError]) -> None:
        with self._changed:
            self._answered, self._trouble = message.sequence, None
            self._silent_since = time.monotonic()
            if reply is not None:
                self._display.take_reply(reply)
            if refusal is not None and len(self._refusals) < MOST_WAITING:
                self._refusals.append(refusal)
            self._changed.notify_all()

    def close(self) -> None:
        """Ends the session. Ticks that wait are sent before, if a daemon takes them within Patience.close_s. Never raises."""
        self._stopping.set()
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._worker.join(self._patience.close_s)
        stream = self._camera._stream if self._camera is not None else None
        if self._worker.is_alive() and stream is not None:
            stream.cut_off()

    def __enter__(self) -> LiveCamera:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
