"""What the two cameras share: options, the calls, and the rules by which a session goes on in another daemon."""
from __future__ import annotations

import os
import pathlib
import random
from dataclasses import dataclass
from typing import Callable, Iterator, List, Optional, Sequence, Tuple, Union

import grpc

from sightline.v1.camera_control_pb2 import ControlRequest, ControlResponse, UploadSceneRequest, UploadSceneResponse
from sightline.v1.scene_pb2 import SceneRef
from sightline.v1.session_pb2 import CameraReply, OpenSession, ResumeSession, SessionOpened, Tick
from sightline_client.errors import Failed, Refused, unavailable
from sightline_client.snapshot import Snapshot, was_applied

SERVICE = "/sightline.v1.CameraControlService/"
CONTROL = (SERVICE + "Control", ControlRequest.SerializeToString, ControlResponse.FromString)
UPLOAD = (SERVICE + "UploadScene", UploadSceneRequest.SerializeToString, UploadSceneResponse.FromString)
CHUNK_BYTES = 512 << 10
LONGEST_PAUSE_S = 1.0
LONGEST_RESUME_S = 2.0  # a daemon resumes a session at once, or not at all

# A channel of its own for each connection: gRPC would otherwise share one, and its own pauses between attempts with it. Replies with
# depth maps exceed gRPC's default limit of 4 MiB.
CHANNEL_OPTIONS: List[Tuple[str, int]] = [("grpc.use_local_subchannel_pool", 1), ("grpc.max_receive_message_length", 64 << 20)]

OwnScene = Union[bytes, str, "os.PathLike[str]"]  # a scene file of the client's own, or its path
Scene = Union[SceneRef, OwnScene]

_LOST = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED, grpc.StatusCode.UNKNOWN, grpc.StatusCode.INTERNAL,
         grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.ABORTED)


@dataclass(frozen=True)
class Tls:
    """How a connection is encrypted. All are PEM files as bytes.

    roots: those whose signature makes the daemon's certificate valid; None: gRPC's own. certificate, key: what the client shows of itself,
    for daemons that ask for it.
    """
    roots: Optional[bytes] = None
    certificate: Optional[bytes] = None
    key: Optional[bytes] = None


@dataclass(frozen=True)
class Connection:
    """How a camera reaches its daemons and what it does when one is lost.

    give_up_after_s: how long a tick waits for a daemon that takes the session over; 0: a lost session is an error at once.
    reply_timeout_s: a daemon that answers nothing for so long is taken for lost. open_timeout_s: the same for an upload, and for the opening, for which the
    daemon loads the scene. uploads: files that the opening or a tick names by their hashes; a daemon that does not have one gets it.
    on_resync: called with the reason after the session was opened again, on the thread that waits for the tick.
    tls: encrypts TCP; None: it is not encrypted. token: shows the daemon who calls; needs tls or a unix socket.
    """
    give_up_after_s: float = 30.0
    reply_timeout_s: float = 5.0
    open_timeout_s: float = 30.0
    uploads: Sequence[bytes] = ()
    on_resync: Optional[Callable[[str], None]] = None
    tls: Optional[Tls] = None
    token: Optional[str] = None

    def channel_credentials(self, address: str) -> Optional[grpc.ChannelCredentials]:
        """None: the connection is not encrypted. Raises ValueError rather than send the token to everyone."""
        local = address.startswith("unix:")
        if self.tls is None or local:
            if self.token is not None and not local:
                raise ValueError("Connection.token: is sent only over TLS (Connection.tls) or a unix socket")
            return None
        return grpc.ssl_channel_credentials(self.tls.roots, self.tls.key, self.tls.certificate)

    def metadata(self) -> Tuple[Tuple[str, str], ...]:
        return () if self.token is None else (("authorization", "Bearer " + self.token),)


def is_lost(error: Failed, opening: bool) -> bool:
    """True if another attempt, or another daemon, may help. A scene file that is too large stays so."""
    return error.code in _LOST or (opening and error.code == grpc.StatusCode.RESOURCE_EXHAUSTED and not _names(error, "chunk"))


def lacks_scene(error: Failed) -> bool:
    return error.code == grpc.StatusCode.NOT_FOUND and _names(error, "scene")


def _names(error: Failed, part: str) -> bool:
    return any(part in violation.field for violation in error.violations)


def pauses() -> Iterator[float]:
    """The times to wait between attempts, in seconds: none, then longer and longer. They are random, so that the cameras of a lost
    daemon do not all come at once."""
    yield 0.0
    pause_s = 0.05
    while True:
        yield pause_s * random.uniform(0.5, 1.0)
        pause_s = min(2 * pause_s, LONGEST_PAUSE_S)


def own_scene(scene: Optional[Scene], request: OpenSession) -> Optional[bytes]:
    """The client's own scene file. None: the scene is one that the daemon has, and the request now names it. Raises OSError."""
    if isinstance(scene, SceneRef):
        request.scene.CopyFrom(scene)
        return None
    return scene if scene is None or isinstance(scene, bytes) else pathlib.Path(scene).read_bytes()


def chunks(scene: bytes) -> Iterator[UploadSceneRequest]:
    for at in range(0, len(scene), CHUNK_BYTES):
        yield UploadSceneRequest(chunk=scene[at:at + CHUNK_BYTES])


class Session:
    """The state of a camera's session over all of its streams: numbers, snapshot, addresses."""

    def __init__(self, addresses: Union[str, Sequence[str]], opening: OpenSession, connection: Connection, scene: Optional[bytes]) -> None:
        self.addresses = [addresses] if isinstance(addresses, str) else list(addresses)
        self.connection = connection
        self.snapshot = Snapshot(opening)
        self._scene = scene
        self.opened = SessionOpened()
        self.resyncs = 0
        self.resumes = 0
        self.reopened = False  # while the present tick waited for its answer
        self._sequence = 0
        self._address = 0
        self._token = b""  # of the session in the daemon at `address`, also while it is lost; empty: it cannot be resumed
        self._answered = 0  # the newest tick of this session that was answered

    @property
    def address(self) -> str:
        return self.addresses[self._address]

    def next_address(self) -> None:
        self._address = (self._address + 1) % len(self.addresses)

    def first_uploads(self) -> Sequence[bytes]:
        """What the daemon must get before the opening, since the hash that the opening needs is not known so far."""
        return [] if self._scene is None or self.snapshot.scene.hash else [self._scene]

    def uploads(self) -> Sequence[bytes]:
        """What a daemon gets that does not have a scene."""
        return [*([] if self._scene is None else [self._scene]), *self.connection.uploads]

    def is_uploaded(self, scene: bytes, response: UploadSceneResponse) -> None:
        if scene is self._scene:
            self.snapshot.scene.hash = response.hash

    def first_message(self) -> ControlRequest:
        request = ControlRequest(open=self.snapshot.opening())
        request.open.resumable = True
        return request

    def is_open(self, opened: SessionOpened) -> None:
        self.opened, self.reopened = opened, True
        self._token, self._answered = opened.resume_token, 0

    def resumption(self) -> Optional[ControlRequest]:
        """The first message of a stream that goes on with the lost session. None: a new session must be opened."""
        if not self._token:
            return None
        return ControlRequest(resume=ResumeSession(token=self._token, answered_sequence=self._answered))

    @property
    def resume_timeout_s(self) -> float:
        return min(self.connection.reply_timeout_s, LONGEST_RESUME_S)

    def is_resumed(self, opened: SessionOpened, tick: Tick) -> Optional[bool]:
        """True: the daemon has taken the tick already, and its answer follows. False: it has not. None: it lacks earlier ticks, so the session
        is lost."""
        if opened.newest_sequence not in (tick.sequence, self._answered):
            self._token = b""
            return None
        self.resumes += 1
        return bool(opened.newest_sequence == tick.sequence)

    def is_not_resumed(self, error: Failed) -> None:
        """Raises the error if the same is to be tried again. Otherwise a new session must be opened."""
        if is_lost(error, opening=True):
            if len(self.addresses) == 1:
                raise error
            self.next_address()
        self._token = b""

    def leave(self, drained: bool) -> None:
        """A stream was given up. The next one goes to the next address, unless the session can be resumed."""
        if drained:
            self._token = b""
        if not self._token:
            self.next_address()

    def number(self, tick: Tick) -> Tick:
        """A copy of the tick with its number: one more than the last, unless the tick has one."""
        if tick.step_control.merge_into_next:
            raise ValueError("tick.step_control.merge_into_next: a camera waits for a reply to each tick")
        numbered = Tick()
        numbered.CopyFrom(tick)
        if not numbered.sequence:
            numbered.sequence = self._sequence + 1
        self._sequence = max(self._sequence, numbered.sequence)
        return numbered

    def first_requests(self, tick: Tick) -> List[ControlRequest]:
        """What a new session begins with after its opening, so that `tick` can follow."""
        ticks = self.snapshot.ticks(tick.sequence)
        if tick.delta.HasField("base_revision"):
            tick.delta.base_revision = self.opened.mirror_revision + sum(summary.HasField("delta") for summary in ticks)
        return [ControlRequest(tick=summary) for summary in ticks]

    def take(self, tick: Tick, response: ControlResponse) -> CameraReply:
        """The answer to a tick. Raises Refused."""
        self._answered = tick.sequence
        if response.HasField("tick_error"):
            if was_applied(response.tick_error):
                self.snapshot.apply(tick)
            raise Refused(response.tick_error)
        self.snapshot.apply(tick)
        self.snapshot.take_reply(response.camera)
        return response.camera


def answers(response: ControlResponse, tick: Tick) -> bool:
    """False for what a daemon says beside its answers, and for messages of a newer one."""
    if response.HasField("camera"):
        return response.camera.sequence == tick.sequence
    return response.HasField("tick_error")


def ended(reason: str) -> Failed:
    return unavailable(reason or "the daemon has ended the session")


def silent(timeout_s: float) -> Failed:
    return unavailable(f"the daemon has answered nothing for {timeout_s:g} s")
