"""Clients that send numbers which the contract once allowed, or which an uninitialised double holds. Each case opens a session, sends an ordinary tick,
the extreme one, and some more. A daemon without least and greatest values ended with SIGABRT in Embree, or sent poses that were no numbers."""
import contextlib
import dataclasses
import math
import time
from typing import Callable

import grpc
from attacks import Attack
from sessions import Session, open_request
from sightline.v1 import camera_control_pb2, session_pb2
from sightline.v1.camera_pb2 import Lens, Pose3, Quat, Vec3
from sightline.v1.scene_pb2 import NewInstance, Shape, Target, TargetList
from sightline.v1.settings_pb2 import CameraLimits, Settings

ATTACK_S = 8
HUGE, TINY, DENORMAL = 1e120, 1e-160, 5e-324


@dataclasses.dataclass
class Case:
    name: str
    changes: Callable  # of the OpenSession or the Tick, whichever `opens` says
    field: str         # that a refusal names; empty: it is taken
    opens: bool = False


def taken(name, changes, opens=False):
    return Case(name, changes, "", opens)


def limits(**more):
    return lambda message: message.limits.CopyFrom(CameraLimits(**more))


def settings(**more):
    return lambda message: message.settings.CopyFrom(Settings(**more))


def shape_far_away(size, offset):
    def add(tick):
        box = Shape(box=Shape.Box(half_extent=Vec3(x=size, y=size, z=size)), offset=Vec3(x=offset))
        tick.delta.added_instances.append(NewInstance(id=77, shape=box))
        tick.targets.CopyFrom(TargetList(targets=[Target(id=77)]))
    return add


def weight(value):
    return lambda tick: tick.targets.CopyFrom(TargetList(targets=[Target(id=1, weight=value)]))


def observed(**more):
    return lambda tick: tick.observed_camera.CopyFrom(session_pb2.ObservedCamera(pose=Pose3(), **more))


CASES = [
    Case("a dt of 1e120 s", lambda tick: setattr(tick, "dt_s", HUGE), "tick.dt_s"),
    Case("a time of 1e120 s", lambda tick: setattr(tick, "time_s", HUGE), "tick.time_s"),
    taken("a dt that is not normal", lambda tick: setattr(tick, "dt_s", DENORMAL)),
    taken("a pause of eight hours", lambda tick: setattr(tick, "dt_s", 8 * 3600)),
    taken("a clock in seconds of the epoch", lambda tick: setattr(tick, "time_s", 1.8e9)),
    taken("a clock in nanoseconds of the epoch", lambda tick: setattr(tick, "time_s", 1.8e18)),
    Case("a jerk of 1e-160 m/s3", limits(max_jerk_mps3=TINY), "tick.limits.max_jerk_mps3"),
    Case("a jerk of 1e-160 m/s3 at the opening", limits(max_jerk_mps3=TINY), "open.limits.max_jerk_mps3", opens=True),
    taken("no limit of the jerk", limits(max_jerk_mps3=0)),
    taken("the least limits", limits(max_jerk_mps3=1e-6, max_speed_mps=1e-6, max_acceleration_mps2=1e-6, max_angular_speed_radps=1e-6,
                                     max_angular_acceleration_radps2=1e-6)),
    Case("a speed that is not normal", limits(max_speed_mps=DENORMAL), "tick.limits.max_speed_mps"),
    Case("an acceleration that is not normal", limits(max_acceleration_mps2=DENORMAL), "tick.limits.max_acceleration_mps2"),
    Case("an angular speed that is not normal", limits(max_angular_speed_radps=DENORMAL), "tick.limits.max_angular_speed_radps"),
    Case("a weight of 1e-200", weight(1e-200), "tick.targets.targets[0].weight"),
    taken("a weight of 0", weight(0)),
    taken("the least weight", weight(1e-6)),
    Case("a shape of 1 mm at 100 km", shape_far_away(1e-3, 1e5), "tick.delta.added_instances[0].shape.offset"),
    taken("a shape of 1 mm at 1 km", shape_far_away(1e-3, 1e3)),
    taken("a shape of 100 km at 100 km", shape_far_away(1e5, 1e5)),
    Case("a distance that is not normal", settings(max_distance_m=DENORMAL, min_distance_m=0), "tick.settings.max_distance_m"),
    Case("a response that is not normal", settings(aim_response_s=DENORMAL), "tick.settings.aim_response_s"),
    Case("a near plane that is not normal", lambda tick: tick.lens.CopyFrom(Lens(near_m=DENORMAL)), "tick.lens.near_m"),
    Case("an origin at 1e300", lambda opening: opening.world_origin.CopyFrom(Vec3(x=1e300)), "open.world_origin", opens=True),
    Case("an observed camera at 1e120 m/s", observed(velocity=Vec3(x=HUGE)), "tick.observed_camera.velocity"),
    taken("an observed camera with tiny velocities", observed(velocity=Vec3(x=DENORMAL), angular_velocity=Vec3(y=TINY))),
    Case("a rotation that is hardly there", lambda tick: tick.observed_camera.CopyFrom(
        session_pb2.ObservedCamera(pose=Pose3(rotation=Quat(w=TINY)))), "tick.observed_camera.pose.rotation"),
]


def not_finite_in(message):
    """The names of the numbers below a message that are not finite."""
    out = []
    for field, value in message.ListFields():
        repeated = field.label == field.LABEL_REPEATED
        for one in value if repeated else [value]:
            if field.message_type:
                out += [f"{field.name}.{inner}" for inner in not_finite_in(one)]
            elif isinstance(one, float) and not math.isfinite(one):
                out.append(field.name)
    return out


def plays(address, case):
    """What became of the case, with either preset: "" when it is as it must be, else what is wrong."""
    return "; ".join(filter(None, (plays_with(preset, address, case) for preset in (Settings.PRESET_SIGHTLINE, Settings.PRESET_PAPER))))


def plays_with(preset, address, case):
    request = open_request(targets=2, settings=Settings(preset=preset))
    if case.opens:
        case.changes(request)
        try:
            Session(address, request).close()
        except grpc.RpcError as error:
            return "" if case.field and case.field in error.details() else f"refused with {error.details()!r}"
        return f"opened although {case.field} is wrong" if case.field else ""
    with Session(address, request) as session:
        time_s, wrong = 0.0, []
        for number in range(1, 41):
            tick = session_pb2.Tick(sequence=number, time_s=time_s + 1 / 60)
            tick.transforms.ids.append(1)
            tick.transforms.positions.extend((3 * math.sin(number / 5), 0.9, 0.1 * number))
            if number % 4 == 2 and (number == 2 or case.field):
                case.changes(tick)
            session.requests.put(camera_control_pb2.ControlRequest(tick=tick))
            reply = session.reads()
            is_extreme = number % 4 == 2 and (number == 2 or case.field)
            if reply.HasField("tick_error"):
                named = [violation.field for violation in reply.tick_error.field_violations]
                if not (is_extreme and case.field and any(field.startswith(case.field) for field in named)):
                    wrong.append(f"tick {number} was refused: {reply.tick_error.message}")
                continue
            time_s = tick.time_s
            if is_extreme and case.field:
                wrong.append(f"tick {number} was taken although {case.field} is wrong")
            wrong += [f"tick {number}: {name} is not finite" for name in not_finite_in(reply)]
        return "; ".join(wrong)


def legal_numbers(daemon):
    """All cases again and again. A daemon that ends shows in the healthy session."""
    end, played, wrong = time.monotonic() + ATTACK_S, 0, []
    while time.monotonic() < end and daemon.process.poll() is None:
        for case in CASES:
            with contextlib.suppress(grpc.RpcError):
                if told := plays(daemon.address, case):
                    wrong.append(f"{case.name}: {told}")
                played += 1
            if daemon.process.poll() is not None:
                return f"the daemon ended with {daemon.process.returncode} at {case.name!r}"
    return f"{played} sessions with extreme numbers; {len(wrong)} answered wrongly{': ' + wrong[0] if wrong else ''}"


ATTACKS = [Attack(20, "legal numbers that no step can compute with", "SIGABRT in Embree: all sessions of all clients lost", legal_numbers)]
