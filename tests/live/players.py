"""The players of the clients, as programs that run one command a line (tests/conformance/README.md)."""
import base64
import json
import shlex
import subprocess
import threading

from google.protobuf import json_format
from sightline.v1 import session_pb2

MESSAGES = {"sampler_add": session_pb2.CameraReply, "live_open": session_pb2.OpenSession, "live_tick": session_pb2.Tick}


def commands_of(arguments):
    """Players by name, from NAME=COMMAND and NAME:base64=COMMAND."""
    return dict(argument.split("=", 1) for argument in arguments)


class Player:
    def __init__(self, name, command):
        self.in_base64 = name.endswith(":base64")
        self.process = subprocess.Popen(shlex.split(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, command, patience_s=30):
        if self.in_base64:
            command = {key: self._encoded(key, value) for key, value in command.items()}
        self.process.stdin.write(json.dumps(command) + "\n")
        self.process.stdin.flush()
        too_late = threading.Timer(patience_s, self.process.kill)
        too_late.start()
        line = self.process.stdout.readline()
        too_late.cancel()
        assert line, f"the player has ended with {self.process.wait()}"
        return json.loads(line)

    @staticmethod
    def _encoded(key, value):
        if key not in MESSAGES:
            return value
        return base64.b64encode(json_format.ParseDict(value, MESSAGES[key]()).SerializeToString()).decode()

    def close(self):
        self.process.stdin.close()
        assert self.process.wait(20) == 0, "the player did not end in order"
        self.process.stdout.close()

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        """Does not hide the error that is on its way."""
        if kind is None:
            self.close()
        else:
            self.process.kill()
            self.process.wait()
