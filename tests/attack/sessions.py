"""Sessions and other calls of a well-behaved client, for tests. The stubs must be on sys.path."""
import contextlib
import queue
import threading

import grpc
from service_stub import CameraControlServiceStub
from sightline.v1 import camera_control_pb2, server_pb2, session_pb2
from sightline.v1.camera_pb2 import Pose3, Vec3
from sightline.v1.scene_pb2 import NewInstance, Shape, Target


def boxes(count):
    return [NewInstance(id=n + 1, shape=Shape(box=Shape.Box(half_extent=Vec3(x=0.2, y=0.9, z=0.2))), pose=Pose3(position=Vec3(x=2.0 * n, y=0.9)))
            for n in range(count)]


class Session:
    """`request` opens a session, or resumes one."""

    def __init__(self, address, request, channel=None):
        self.owned = channel is None
        self.channel = channel or grpc.insecure_channel(address, options=[("grpc.use_local_subchannel_pool", 1)])
        self.requests, self.sequence = queue.SimpleQueue(), 0
        self.call = CameraControlServiceStub(self.channel).Control(iter(self.requests.get, None))
        self.requests.put(camera_control_pb2.ControlRequest(**{"resume" if isinstance(request, session_pb2.ResumeSession) else "open": request}))
        try:
            self.opened = next(self.call).opened
        except BaseException:
            self.close()
            raise

    def sends(self, **more):
        self.sequence += 1
        self.requests.put(camera_control_pb2.ControlRequest(
            tick=session_pb2.Tick(sequence=self.sequence, time_s=self.sequence / 60, **more)))

    def breaks(self):
        """Ends the call as a broken connection does, not in order."""
        self.call.cancel()

    def reads(self):
        return next(self.call)

    def tick(self, **more):
        self.sends(**more)
        return self.reads().camera

    def waits_for_drain(self):
        return next(self.call).HasField("drain")

    def status(self):
        """The status with which the daemon ends the session."""
        try:
            for _ in self.call:
                pass
        except grpc.RpcError as error:
            return error
        return self.call

    def close(self):
        self.requests.put(None)
        with contextlib.suppress(grpc.RpcError, AttributeError):
            for _ in self.call:
                pass
        if self.owned:
            self.channel.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def open_request(targets=1, **more):
    request = session_pb2.OpenSession(camera=Pose3(position=Vec3(x=0, y=1.6, z=6)), targets=[Target(id=n + 1) for n in range(targets)],
                                      **more)
    request.instances.extend(boxes(targets))
    return request


def open_session(address, targets=1, channel=None, **more):
    return Session(address, open_request(targets, **more), channel)


class Crowd:
    """As many sessions of one client as the daemon opens, at most `most`. Each ticks again as soon as it is answered, and refuses reduced quality.
    Use it in a `with` statement."""

    def __init__(self, address, most, **more):
        self.answers, self.playing, self.told = 0, True, ""
        self.channels = [grpc.insecure_channel(address, options=[("grpc.use_local_subchannel_pool", 1)]) for _ in range(8)]
        self.sessions = []
        for n in range(most):
            try:
                self.sessions.append(open_session(address, channel=self.channels[n % len(self.channels)],
                                                  degradation_policy=session_pb2.DEGRADATION_POLICY_NEVER, **more))
            except grpc.RpcError as error:
                self.told = f"{error.code().name}: {error.details()}"
                break
        self.players = [threading.Thread(target=self._play, args=(session,)) for session in self.sessions]
        for player in self.players:
            player.start()

    def _play(self, session):
        with contextlib.suppress(grpc.RpcError, StopIteration):
            while self.playing:
                session.tick()
                self.answers += 1

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.playing = False
        for channel in self.channels:
            channel.close()
        for player in self.players:
            player.join()


@contextlib.contextmanager
def stub(address):
    with grpc.insecure_channel(address, options=[("grpc.use_local_subchannel_pool", 1)]) as channel:
        yield CameraControlServiceStub(channel)


def info(address, timeout=5):
    with stub(address) as service:
        return service.GetServerInfo(server_pb2.GetServerInfoRequest(), timeout=timeout)


def upload(address, data, chunk=1 << 20, timeout=60):
    with stub(address) as service:
        return service.UploadScene((camera_control_pb2.UploadSceneRequest(chunk=data[at:at + chunk]) for at in range(0, len(data), chunk)),
                                   timeout=timeout)


def status_of(address, upload):
    """The error of an upload of so many bytes."""
    import sys
    try:
        sys.modules[__name__].upload(address, bytes(upload))
    except grpc.RpcError as error:
        return error
    raise AssertionError("the upload succeeded")
