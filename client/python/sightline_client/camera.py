"""A camera for programs with threads. AsyncCamera (aio.py) is the same for asyncio."""
from __future__ import annotations

import queue
import threading
import time
from typing import Any, Iterator, Mapping, Optional, Sequence, Union

import grpc

from sightline.v1.camera_control_pb2 import ControlRequest, ControlResponse, UploadSceneResponse
from sightline.v1.scene_pb2 import Shape
from sightline.v1.session_pb2 import CameraReply, OpenSession, SessionOpened, Tick
from sightline_client.connection import (CHANNEL_OPTIONS, CONTROL, UPLOAD, Connection, OwnScene, Scene, Session, answers, chunks, ended, is_lost,
                                         lacks_scene, own_scene, pauses, silent)
from sightline_client.errors import Failed, from_call
from sightline_client.shapes import Place, opening, tick

Message = Union[ControlResponse, Failed, None]  # None: the daemon has ended the call in order


class _Stream:
    """One call of Control, with a thread that reads its responses."""

    def __init__(self, address: str, connection: Connection) -> None:
        self.drained: Optional[str] = None  # the reason why the daemon takes no more ticks
        self._requests: "queue.SimpleQueue[Optional[ControlRequest]]" = queue.SimpleQueue()
        self._responses: "queue.SimpleQueue[Message]" = queue.SimpleQueue()
        credentials = connection.channel_credentials(address)
        self._channel = (grpc.insecure_channel(address, CHANNEL_OPTIONS) if credentials is None
                         else grpc.secure_channel(address, credentials, CHANNEL_OPTIONS))
        self._metadata = connection.metadata()
        method, serialize, parse = CONTROL
        requests: Iterator[Any] = iter(self._requests.get, None)
        self._call: Any = self._channel.stream_stream(method, request_serializer=serialize, response_deserializer=parse)(
            requests, metadata=self._metadata)
        threading.Thread(target=self._read, name="sightline", daemon=True).start()

    def _read(self) -> None:
        try:
            for response in self._call:
                if response.HasField("drain"):
                    self.drained = response.drain.reason
                    self._requests.put(None)  # the daemon need not wait for more ticks; it answers those that it has
                self._responses.put(response)
            self._responses.put(None)
        except grpc.RpcError as error:
            self._responses.put(from_call(error))

    def send(self, request: ControlRequest) -> None:
        self._requests.put(request)

    def receive(self, timeout_s: float) -> ControlResponse:
        """The next response. Raises Failed."""
        message = self._next(timeout_s)
        if message is None:
            raise ended(self.drained or "")
        return message

    def _next(self, timeout_s: float) -> Optional[ControlResponse]:
        try:
            message = self._responses.get(timeout=timeout_s)
        except queue.Empty:
            raise silent(timeout_s) from None
        if isinstance(message, Failed):
            raise message
        return message

    def upload(self, scene: bytes, timeout_s: float) -> UploadSceneResponse:
        method, serialize, parse = UPLOAD
        send: Any = self._channel.stream_unary(method, request_serializer=serialize, response_deserializer=parse)
        try:
            response: UploadSceneResponse = send(chunks(scene), timeout=timeout_s, metadata=self._metadata)
        except grpc.RpcError as error:
            raise from_call(error) from None
        return response

    def finish(self, timeout_s: float) -> None:
        """Ends the session in order. Raises Failed if it was lost."""
        self._requests.put(None)
        try:
            while self._next(timeout_s) is not None:
                pass
        finally:
            self.cut_off()

    def cut_off(self) -> None:
        self._requests.put(None)
        self._call.cancel()
        self._channel.close()


class Camera:
    """A session that keeps targets in view, tick by tick. Use it in a `with` statement, from one thread at a time.

        Camera(address, position=..., targets=..., occluders=..., at=...)    as `opening` of this package describes
        Camera.open(address, OpenSession(...))                               with all that the contract has

    When the stream breaks, the next tick goes on with the session in a new stream: the daemon keeps it for a while (its flag
    --resume-grace-s), and the replies are those of an unbroken stream. When the daemon does not keep it, goes away, or says Drain, the next
    tick opens the session again, in the daemon that answers then, and returns its reply: at the camera's last pose, with the scene, targets,
    settings, limits and lens as they were. Several addresses are tried in turn. Raises Failed if no daemon can be reached at first.

    scene: a scene file of your own (.glb, or .gltf without other files) as bytes or by its path; each daemon that does not have it gets it,
    and its hash goes into OpenSession.scene. Or a SceneRef, which names a scene that the daemon has.
    """

    def __init__(self, addresses: Union[str, Sequence[str]], *, position: Place, targets: Mapping[int, Shape],
                 occluders: Mapping[int, Shape], at: Mapping[int, Place], scene: Optional[Scene] = None,
                 connection: Connection = Connection(), **more: Any) -> None:
        self._start(addresses, opening(position=position, targets=targets, occluders=occluders, at=at, **more), connection, scene)

    @classmethod
    def open(cls, addresses: Union[str, Sequence[str]], request: OpenSession, connection: Connection = Connection(),
             scene: Optional[OwnScene] = None) -> Camera:
        camera = cls.__new__(cls)
        camera._start(addresses, request, connection, scene)
        return camera

    def _start(self, addresses: Union[str, Sequence[str]], request: OpenSession, connection: Connection, scene: Optional[Scene]) -> None:
        self._session = Session(addresses, request, connection, own_scene(scene, request))
        self._stream: Optional[_Stream] = None
        for attempt in range(len(self._session.addresses)):
            try:
                self._open_stream()
                return
            except Failed as error:
                self._session.next_address()
                if not is_lost(error, opening=True) or attempt + 1 == len(self._session.addresses):
                    raise

    @property
    def opened(self) -> SessionOpened:
        """What the daemon said when it opened the session, the last time that one did."""
        return self._session.opened

    @property
    def resyncs(self) -> int:
        """How many times the session was opened again, in another daemon or in the same one."""
        return self._session.resyncs

    @property
    def resumes(self) -> int:
        """How many times it went on in another stream without that."""
        return self._session.resumes

    def tick(self, time_s: float, places: Mapping[int, Place], **more: Any) -> CameraReply:
        """Tells the daemon what has moved, and returns where the camera goes; the arguments are those of `tick` of this package.
        Raises Refused or Failed."""
        return self.step(tick(time_s, places, **more))

    def step(self, message: Tick) -> CameraReply:
        """The same for a whole Tick. The camera numbers ticks whose sequence is 0. No step_control that merges a tick into the next one:
        it would get no reply."""
        session = self._session
        numbered = session.number(message)
        give_up = time.monotonic() + session.connection.give_up_after_s
        reason = ""
        session.reopened = False
        for pause_s in pauses():
            time.sleep(pause_s)
            try:
                if self._stream is not None and self._stream.drained is not None:
                    reason = self._stream.drained
                    self._leave()
                taken = self._stream is None and self._go_on(numbered)
                response = self._ask(numbered, taken)
                break
            except Failed as error:
                was_open = self._stream is not None
                self._leave()
                if not is_lost(error, opening=not was_open) or time.monotonic() >= give_up:
                    raise
                reason = reason or str(error)
        if session.reopened:
            session.resyncs += 1
            if session.connection.on_resync is not None:
                session.connection.on_resync(reason or "the former tick lost the session")
        return session.take(numbered, response)

    def _go_on(self, next_tick: Tick) -> bool:
        """Resumes the lost session, or opens a new one. True: the daemon has taken the tick already, and its answer follows."""
        session = self._session
        request = session.resumption()
        if request is not None:
            stream = _Stream(session.address, session.connection)
            try:
                taken = session.is_resumed(self._first_answer(stream, request, session.resume_timeout_s), next_tick)
                if taken is not None:
                    self._stream = stream
                    return taken
                stream.finish(session.connection.reply_timeout_s)
            except Failed as error:
                stream.cut_off()
                session.is_not_resumed(error)
        self._open_stream()
        assert self._stream is not None
        for past in session.first_requests(next_tick):
            self._stream.send(past)
        return False

    def _open_stream(self) -> None:
        session = self._session
        try:
            self._open_session(session.first_uploads())
        except Failed as error:
            if not lacks_scene(error) or not session.uploads():
                raise
            self._open_session(session.uploads())

    def _open_session(self, uploads: Sequence[bytes]) -> None:
        session, timeout_s = self._session, self._session.connection.open_timeout_s
        if uploads:
            self._upload(uploads, timeout_s)
        stream = _Stream(session.address, session.connection)
        try:
            session.is_open(self._first_answer(stream, session.first_message(), timeout_s))
        except Failed:
            stream.cut_off()
            raise
        self._stream = stream

    def _upload(self, scenes: Sequence[bytes], timeout_s: float) -> None:
        """In a stream that opens no session, since the daemon does not wait long for an opening."""
        stream = _Stream(self._session.address, self._session.connection)
        try:
            for scene in scenes:
                self._session.is_uploaded(scene, stream.upload(scene, timeout_s))
        finally:
            stream.cut_off()

    @staticmethod
    def _first_answer(stream: _Stream, request: ControlRequest, timeout_s: float) -> SessionOpened:
        stream.send(request)
        while True:
            response = stream.receive(timeout_s)
            if response.HasField("opened"):
                return response.opened

    def _ask(self, message: Tick, taken: bool) -> ControlResponse:
        assert self._stream is not None
        if not taken:
            self._stream.send(ControlRequest(tick=message))
        while True:
            response = self._stream.receive(self._session.connection.reply_timeout_s)
            if answers(response, message):
                return response

    def _leave(self) -> None:
        drained = self._stream is not None and self._stream.drained is not None
        if self._stream is not None:
            self._stream.cut_off()
            self._stream = None
        self._session.leave(drained)

    def close(self) -> None:
        """Ends the session. Raises Failed if it was lost meanwhile."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.finish(self._session.connection.reply_timeout_s)

    def __enter__(self) -> Camera:
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        if kind is None:
            self.close()
        elif self._stream is not None:  # do not hide the error that is on its way
            self._stream.cut_off()
