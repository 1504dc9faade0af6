"""A daemon that answers when the test says so, with what the test says. It computes nothing."""
import queue
import threading
import time
from concurrent import futures

import grpc
from sightline.v1.camera_control_pb2 import ControlRequest, ControlResponse
from sightline.v1.camera_pb2 import Pose3, Quat, Vec3
from sightline.v1.errors_pb2 import TickError
from sightline.v1.session_pb2 import CameraReply, SessionOpened


class HeldDaemon:
    """ticks: those that came, in order. A tick is answered at once, until hold(); answer_one() and let_go() answer those that came meanwhile."""

    def __init__(self):
        self.ticks, self.openings = [], 0
        self.refused = set()  # numbers of ticks to refuse
        self.camera = (0.0, 2.5, 9.0)  # of the replies
        self.cut = False  # of the next reply
        self._open = threading.Event()
        self._open.set()
        self._permits = threading.Semaphore(0)
        self._moved = (0.0, 0.0, 0.0)  # by the shifts of the world so far
        self._server = grpc.server(futures.ThreadPoolExecutor(4))
        handler = grpc.stream_stream_rpc_method_handler(self._control, ControlRequest.FromString, ControlResponse.SerializeToString)
        self._server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("sightline.v1.CameraControlService", {"Control": handler}),))
        self.address = "127.0.0.1:%d" % self._server.add_insecure_port("127.0.0.1:0")
        self._server.start()

    def _control(self, requests, context):
        came = queue.Queue()
        threading.Thread(target=self._read, args=(requests, came), daemon=True).start()
        while (request := came.get()) is not None:
            if request.HasField("open"):
                self.openings += 1
                yield ControlResponse(opened=SessionOpened(session_id="held", resume_token=b""))
                continue
            self.ticks.append(request.tick)
            while not self._open.is_set() and not self._permits.acquire(timeout=0.05):
                if not context.is_active():
                    return
            yield self._answer(request.tick)

    @staticmethod
    def _read(requests, came):
        try:
            for request in requests:
                came.put(request)
        except grpc.RpcError:
            pass
        came.put(None)

    def _answer(self, tick):
        if tick.sequence in self.refused:
            return ControlResponse(tick_error=TickError(sequence=tick.sequence, code=TickError.CODE_INVALID_ARGUMENT, message="as the test says"))
        cut, self.cut = self.cut, False
        by = tick.world_shift
        self._moved = tuple(a + b for a, b in zip(self._moved, (by.x, by.y, by.z)))
        x, y, z = (a + b for a, b in zip(self.camera, self._moved))
        return ControlResponse(camera=CameraReply(sequence=tick.sequence, time_s=tick.time_s, pose_time_s=tick.time_s, cut=cut, field_of_view=0.7,
                                                  pose=Pose3(position=Vec3(x=x, y=y, z=z), rotation=Quat(w=1))))

    def hold(self):
        self._open.clear()

    def answer_one(self):
        """Of those that are held back."""
        self._permits.release()

    def let_go(self):
        self._open.set()

    def wait_for(self, sequence, patience_s=10.0):
        """Until the tick with this number came."""
        late = time.monotonic() + patience_s
        while not any(tick.sequence >= sequence for tick in list(self.ticks)):
            assert time.monotonic() < late, f"tick {sequence} has not come"
            time.sleep(0.005)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._open.set()
        self._server.stop(0).wait()
