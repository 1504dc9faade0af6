"""Plays conformance sessions with the Python client: player.py [--asyncio]. README.md describes the protocol."""
import asyncio
import json
import pathlib
import sys
import time

from google.protobuf import json_format

from sightline.v1.session_pb2 import CameraReply, OpenSession, Tick
from sightline_client import AsyncCamera, Camera, Connection, Failed, LiveCamera, Patience, PoseSampler, QueueFull, Refused, Tls


def as_json(message):
    return json_format.MessageToDict(message)


def trust(files):
    """The options that say who the client is."""
    pem = {name: pathlib.Path(files[name]).read_bytes() for name in ("roots", "certificate", "key") if name in files}
    return {"tls": Tls(**pem) if pem else None, "token": files.get("token")}


class Sampler:
    """The commands of tests/live for a PoseSampler."""

    def __init__(self):
        self.sampler = None

    def sampler_new(self, _):
        self.sampler = PoseSampler()
        return {"sampler": {}}

    def sampler_add(self, command):
        return {"taken": self.sampler.add(json_format.ParseDict(command["sampler_add"], CameraReply()))}

    def sampler_shift(self, command):
        self.sampler.shift(tuple(command["sampler_shift"]))
        return {"sampler": {}}

    def sampler_at(self, command):
        at = command["sampler_at"]
        shown = self.sampler.sample(at["time_s"], tuple(at["target"]) or None)
        return {"sample": shown and [*shown.position, *shown.rotation, shown.field_of_view, int(shown.cut)]}


class Live:
    """The same for a LiveCamera."""

    def __init__(self):
        self.camera = None

    def live_open(self, command):
        self.camera = LiveCamera.open(command["address"], json_format.ParseDict(command["live_open"], OpenSession()),
                                      patience=Patience(wait_s=command["wait_s"]), scene=command.get("scene_file"))
        return {"live": {}}

    def live_tick(self, command):
        tick = json_format.ParseDict(command["live_tick"], Tick())
        began = time.monotonic()
        try:
            view = self.camera.step(tick)
        except (Failed, QueueFull) as error:
            return {"error": getattr(error, "code").name if isinstance(error, Failed) else "QUEUE_FULL"}
        took_s = time.monotonic() - began
        reply = view.reply
        return {"view": {
            "position": view.position, "rotation": view.rotation, "field_of_view": view.field_of_view, "cut": view.cut, "age_s": view.age_s,
            "source": view.source.value, "sequence": view.sequence, "reply": reply.sequence if reply else 0,
            "hash": str(reply.mirror_hash) if reply else "0", "refusals": [refusal.sequence for refusal in view.refusals],
            "refusal_codes": [refusal.code for refusal in view.refusals], "trouble": view.trouble is not None, "took_s": took_s}}

    def live_close(self, _):
        began = time.monotonic()
        self.camera.close()
        return {"live_closed": {"took_s": time.monotonic() - began, "resyncs": self.camera.resyncs, "resumes": self.camera.resumes}}


class Player:
    """Runs commands with a camera of either kind. The cameras of the synchronous client are wrapped, so that both can be awaited."""

    def __init__(self, is_async):
        self.is_async = is_async
        self.camera = None
        self.others = (Sampler(), Live())

    async def run(self, command):
        name = next(iter(command))
        for other in self.others:
            if hasattr(other, name):
                return getattr(other, name)(command)
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
        scene = command.get("scene_file") or ("scene" in command and pathlib.Path(command["scene"]).read_bytes()) or None
        if self.is_async:
            camera = await AsyncCamera.of(command["address"], request, options, scene).open()
        else:
            camera = Camera.open(command["address"], request, options, scene)
        self.camera = camera
        return camera.opened

    async def wait(self, result):
        return await result if self.is_async else result


async def main():
    player = Player("--asyncio" in sys.argv)
    while line := await asyncio.to_thread(sys.stdin.readline):  # the event loop runs on meanwhile
        print(json.dumps(await player.run(json.loads(line))), flush=True)


asyncio.run(main())
