"""A camera for asyncio. It does what Camera (camera.py) does, without threads."""
from __future__ import annotations

import asyncio
import time
from typing import Any, Mapping, Optional, Sequence, Union

import grpc
import grpc.aio

from sightline.v1.camera_control_pb2 import ControlRequest, ControlResponse, UploadSceneResponse
from sightline.v1.scene_pb2 import Shape
from sightline.v1.session_pb2 import CameraReply, OpenSession, SessionOpened, Tick
from sightline_client.connection import (CHANNEL_OPTIONS, CONTROL, UPLOAD, Connection, OwnScene, Scene, Session, answers, chunks, ended, is_lost,
                                         lacks_scene, own_scene, pauses, silent)
from sightline_client.errors import Failed, from_call
from sightline_client.shapes import Place, opening, tick

Message = Union[ControlResponse, Failed, None]  # None: the daemon has ended the call in order


class _Stream:
    """One call of Control, with a task that reads its responses."""

    def __init__(self, address: str, connection: Connection) -> None:
        self.drained: Optional[str] = None  # the reason why the daemon takes no more ticks
        self._responses: "asyncio.Queue[Message]" = asyncio.Queue()
        credentials = connection.channel_credentials(address)
        self._channel = (grpc.aio.insecure_channel(address, options=CHANNEL_OPTIONS) if credentials is None
                         else grpc.aio.secure_channel(address, credentials, options=CHANNEL_OPTIONS))
        self._metadata = connection.metadata()
        method, serialize, parse = CONTROL
        self._call: Any = self._channel.stream_stream(method, request_serializer=serialize, response_deserializer=parse)(
            metadata=self._metadata)
        self._reader = asyncio.create_task(self._read())

    async def _read(self) -> None:
        try:
            while (response := await self._call.read()) is not grpc.aio.EOF:
                if response.HasField("drain"):
                    self.drained = response.drain.reason
                    await self._end_requests()  # the daemon need not wait for more ticks; it answers those that it has
                self._responses.put_nowait(response)
            self._responses.put_nowait(None)
        except grpc.aio.AioRpcError as error:
            self._responses.put_nowait(from_call(error))

    async def _end_requests(self) -> None:
        try:
            await self._call.done_writing()
        except (grpc.aio.AioRpcError, asyncio.InvalidStateError):
            pass  # the call has ended, and the reader knows why

    async def send(self, request: ControlRequest) -> None:
        try:
            await self._call.write(request)
        except (grpc.aio.AioRpcError, asyncio.InvalidStateError):
            pass  # as above

    async def receive(self, timeout_s: float) -> ControlResponse:
        """The next response. Raises Failed."""
        response = await self._next(timeout_s)
        if response is None:
            raise ended(self.drained or "")
        return response

    async def _next(self, timeout_s: float) -> Optional[ControlResponse]:
        try:
            message = await asyncio.wait_for(self._responses.get(), timeout_s)
        except asyncio.TimeoutError:
            raise silent(timeout_s) from None
        if isinstance(message, Failed):
            raise message
        return message

    async def upload(self, scene: bytes, timeout_s: float) -> UploadSceneResponse:
        method, serialize, parse = UPLOAD
        send: Any = self._channel.stream_unary(method, request_serializer=serialize, response_deserializer=parse)
        try:
            response: UploadSceneResponse = await send(chunks(scene), timeout=timeout_s, metadata=self._metadata)
        except grpc.aio.AioRpcError as error:
            raise from_call(error) from None
        return response

    async def finish(self, timeout_s: float) -> None:
        """Ends the session in order. Raises Failed if it was lost."""
        try:
            await self._end_requests()
            while await self._next(timeout_s) is not None:
                pass
        finally:
            await self.cut_off()

    async def cut_off(self) -> None:
        self._reader.cancel()
        self._call.cancel()
        await self._channel.close()


class AsyncCamera:
    """A session that keeps targets in view, tick by tick, for one task at a time. Use it in an `async with` statement:

        async with AsyncCamera(address, position=..., targets=..., occluders=..., at=...) as camera:
            reply = await camera.tick(time_s, places)

    AsyncCamera.of(address, OpenSession(...)) takes all that the contract has. What Camera says about lost sessions and scenes holds here too.
    """

    def __init__(self, addresses: Union[str, Sequence[str]], *, position: Place, targets: Mapping[int, Shape],
                 occluders: Mapping[int, Shape], at: Mapping[int, Place], scene: Optional[Scene] = None,
                 connection: Connection = Connection(), **more: Any) -> None:
        self._prepare(addresses, opening(position=position, targets=targets, occluders=occluders, at=at, **more), connection, scene)

    @classmethod
    def of(cls, addresses: Union[str, Sequence[str]], request: OpenSession, connection: Connection = Connection(),
           scene: Optional[OwnScene] = None) -> AsyncCamera:
        camera = cls.__new__(cls)
        camera._prepare(addresses, request, connection, scene)
        return camera

    def _prepare(self, addresses: Union[str, Sequence[str]], request: OpenSession, connection: Connection, scene: Optional[Scene]) -> None:
        self._session = Session(addresses, request, connection, own_scene(scene, request))
        self._stream: Optional[_Stream] = None

    async def open(self) -> AsyncCamera:
        """Opens the session, as `async with` does. Raises Failed."""
        for attempt in range(len(self._session.addresses)):
            try:
                await self._open_stream()
                break
            except Failed as error:
                self._session.next_address()
                if not is_lost(error, opening=True) or attempt + 1 == len(self._session.addresses):
                    raise
        return self

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

    async def tick(self, time_s: float, places: Mapping[int, Place], **more: Any) -> CameraReply:
        """As Camera.tick."""
        return await self.step(tick(time_s, places, **more))

    async def step(self, message: Tick) -> CameraReply:
        """As Camera.step."""
        session = self._session
        numbered = session.number(message)
        give_up = time.monotonic() + session.connection.give_up_after_s
        reason = ""
        session.reopened = False
        for pause_s in pauses():
            await asyncio.sleep(pause_s)
            try:
                if self._stream is not None and self._stream.drained is not None:
                    reason = self._stream.drained
                    await self._leave()
                taken = self._stream is None and await self._go_on(numbered)
                response = await self._ask(numbered, taken)
                break
            except Failed as error:
                was_open = self._stream is not None
                await self._leave()
                if not is_lost(error, opening=not was_open) or time.monotonic() >= give_up:
                    raise
                reason = reason or str(error)
        if session.reopened:
            session.resyncs += 1
            if session.connection.on_resync is not None:
                session.connection.on_resync(reason or "the former tick lost the session")
        return session.take(numbered, response)

    async def _go_on(self, next_tick: Tick) -> bool:
        """Resumes the lost session, or opens a new one. True: the daemon has taken the tick already, and its answer follows."""
        session = self._session
        request = session.resumption()
        if request is not None:
            stream = _Stream(session.address, session.connection)
            try:
                taken = session.is_resumed(await self._first_answer(stream, request, session.resume_timeout_s), next_tick)
                if taken is not None:
                    self._stream = stream
                    return taken
                await stream.finish(session.connection.reply_timeout_s)
            except Failed as error:
                await stream.cut_off()
                session.is_not_resumed(error)
        await self._open_stream()
        assert self._stream is not None
        for past in session.first_requests(next_tick):
            await self._stream.send(past)
        return False

    async def _open_stream(self) -> None:
        session = self._session
        try:
            await self._open_session(session.first_uploads())
        except Failed as error:
            if not lacks_scene(error) or not session.uploads():
                raise
            await self._open_session(session.uploads())

    async def _open_session(self, uploads: Sequence[bytes]) -> None:
        session, timeout_s = self._session, self._session.connection.open_timeout_s
        if uploads:
            await self._upload(uploads, timeout_s)
        stream = _Stream(session.address, session.connection)
        try:
            session.is_open(await self._first_answer(stream, session.first_message(), timeout_s))
        except Failed:
            await stream.cut_off()
            raise
        self._stream = stream

    async def _upload(self, scenes: Sequence[bytes], timeout_s: float) -> None:
        """In a stream that opens no session, since the daemon does not wait long for an opening."""
        stream = _Stream(self._session.address, self._session.connection)
        try:
            for scene in scenes:
                self._session.is_uploaded(scene, await stream.upload(scene, timeout_s))
        finally:
            await stream.cut_off()

    @staticmethod
    async def _first_answer(stream: _Stream, request: ControlRequest, timeout_s: float) -> SessionOpened:
        await stream.send(request)
        while True:
            response = await stream.receive(timeout_s)
            if response.HasField("opened"):
                return response.opened

    async def _ask(self, message: Tick, taken: bool) -> ControlResponse:
        assert self._stream is not None
        if not taken:
            await self._stream.send(ControlRequest(tick=message))
        while True:
            response = await self._stream.receive(self._session.connection.reply_timeout_s)
            if answers(response, message):
                return response

    async def _leave(self) -> None:
        drained = self._stream is not None and self._stream.drained is not None
        if self._stream is not None:
            await self._stream.cut_off()
            self._stream = None
        self._session.leave(drained)

    async def close(self) -> None:
        """Ends the session. Raises Failed if it was lost meanwhile."""
        stream, self._stream = self._stream, None
        if stream is not None:
            await stream.finish(self._session.connection.reply_timeout_s)

    async def __aenter__(self) -> AsyncCamera:
        return await self.open()

    async def __aexit__(self, kind: Any, *_: Any) -> None:
        if kind is None:
            await self.close()
        elif self._stream is not None:  # do not hide the error that is on its way
            await self._stream.cut_off()
