"""Plays conformance sessions with the Python client: player.py [--asyncio]. README.md describes the protocol."""
import asyncio
import json
import pathlib
import sys

from google.protobuf import json_format

from sightline.v1.session_pb2 import OpenSession, Tick
from sightline_client import AsyncCamera, Camera, Connection, Failed, Refused, Tls


def as_json(message):
    return json_format.MessageToDict(message)


def trust(files):
    """The options that say who the client is."""
    pem = {name: pathlib.Path(files[name]).read_bytes() for name in ("roots", "certificate", "key") if name in files}
    return {"tls": Tls(**pem) if pem else None, "token": files.get("token")}


class Player:
    """Runs commands with a camera of either kind. The cameras of the synchronous client are wrapped, so that both can be awaited."""

    def __init__(self, is_async):
        self.is_async = is_async
        self.camera = None

    async def run(self, command):
        try:
            if "open" in command:
                return {"opened": as_json(await self.open(command))}
            if "tick" in command:
                return {"camera": as_json(await self.wait(self.camera.step(json_format.ParseDict(command["tick"], Tick()))))}
            await self.wait(self.camera.close())
            return {"closed": {"resyncs": self.camera.resyncs, "resumes": self.camera.resumes}}
        except Refused as error:
            return {"refused": as_json(error.error)}
        except ValueError:  # an option of the connection
            return {"failed": {"code": "INVALID_ARGUMENT", "violations": []}}
        except Failed as error:
            return {"failed": {"code": error.code.name, "violations": [as_json(violation) for violation in error.violations]}}

    async def open(self, command):
        request = json_format.ParseDict(command["open"], OpenSession())
        options = Connection(uploads=[pathlib.Path(path).read_bytes() for path in command["uploads"]], **trust(command.get("trust", {})))
        camera = await AsyncCamera.of(command["address"], request, options).open() if self.is_async else Camera.open(command["address"], request, options)
        self.camera = camera
        return camera.opened

    async def wait(self, result):
        return await result if self.is_async else result


async def main():
    player = Player("--asyncio" in sys.argv)
    while line := await asyncio.to_thread(sys.stdin.readline):  # the event loop runs on meanwhile
        print(json.dumps(await player.run(json.loads(line))), flush=True)


asyncio.run(main())
