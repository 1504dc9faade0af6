#!/usr/bin/env python3
"""Writes the conformance sessions: make_sessions.py FOLDER. README.md describes the format.

What is expected is computed here from the contract's comments, by frames.py and by hand; no reply of a daemon goes into it.
"""
import json
import math
import pathlib
import sys

import court
from frames import FRAMES, looking, minus, multiply, product, quaternion, transpose, turn

VERTICAL, ASPECT = math.radians(40), 16 / 9  # the default lens
UP = ("x", "y", "z", "w")
IDENTITY = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
TWO_63 = 2 ** 63
ABOVE_DOUBLES = {"above": str(2 ** 53)}  # a number that a double cannot hold in general


def named(values):
    return dict(zip(UP, values))


def pose(position, rotation=None):
    message = {"position": named(position)}
    if rotation is not None:
        message["rotation"] = named(quaternion(rotation))
    return message


def capsule(id_, position, frame=FRAMES[0], rotation=None):
    shape = {"capsule": {"radius": frame.length(0.3), "halfHeight": frame.length(0.6)}}
    return {"id": str(id_), "shape": shape, "pose": pose(frame.point(position), rotation and frame.object_rotation(rotation))}


def box(id_, position, whole_size, frame=FRAMES[0]):
    half = frame.size([size / 2 for size in whole_size])
    return {"id": str(id_), "shape": {"box": {"halfExtent": named(half)}}, "pose": pose(frame.point(position))}


def targets(*ids):
    return [{"id": str(id_)} for id_ in ids]


def transforms(frame, places):
    """places: by id, a position and perhaps a rotation, all or none."""
    message = {"ids": [str(id_) for id_ in places], "positions": [v for position, *_ in places.values() for v in frame.point(position)]}
    rotations = [v for _, *rotation in places.values() for r in rotation for v in quaternion(frame.object_rotation(r))]
    return {**message, "rotations": rotations} if rotations else message


def camera_pose(frame, eye, at):
    return pose(frame.point(eye), frame.camera_rotation(*looking(eye, at)))


def relative_pose(frame, id_, target, target_rotation, eye, at):
    """The camera as seen from a target, with and without the target's rotation."""
    turned, camera = frame.object_rotation(target_rotation), frame.camera_rotation(*looking(eye, at))
    offset = minus(frame.point(eye), frame.point(target))
    return {"targetId": str(id_), "pose": pose(product(transpose(turned), offset), multiply(transpose(turned), camera)),
            "unrotatedPose": pose(offset, camera)}


def convention(frame):
    """One scene, told in the frame of an engine: what is seen, from where, how far it is and how wide the picture is."""
    a, b, c, post = (0.5, 0.9, 0.3), (-4, 1, 0), (6, 1, 6), court.POST[0]
    tilt = turn((1, 2, 0.5), 0.7)
    eye, at = (-1, 1.7, 7), (-0.5, 0.9, 0)
    eye2, at2 = (-4, 1.4, -6), b
    plate_beside, edge_on = (-3.2, 1.2, -3), turn((1, 1, 1), 2 * math.pi / 3)
    post2 = (3, 0.9, 1)

    def distances(eye, post):
        return [{"id": id_, "distance": frame.length(math.dist(eye, place))} for id_, place in zip("1237", (a, b, c, post))]

    def seen(listed, index, **more):
        return [{**target, **more} if i == index else target for i, target in enumerate(listed)]

    def still(sequence, **more):
        return {"sequence": str(sequence), "timeS": 0, "dtS": 0, **more}

    first = distances(eye, post)
    first = seen(first, 0, state="TARGET_STATE_VISIBLE", visibleShare=1, inPicture=True, pictureShare=1)
    first = seen(first, 1, state="TARGET_STATE_OCCLUDED", visibleShare=0, inPicture=True,
                 occluders=[{"id": {"atLeast": str(TWO_63)}, "share": 1}])
    first = seen(first, 2, state="TARGET_STATE_OFF_SCREEN", inPicture=False, pictureShare=0)
    first = seen(first, 3, state="TARGET_STATE_VISIBLE", visibleShare=1, inPicture=True)
    there = camera_pose(frame, eye2, at2)
    held = {"pose": there, "velocity": named((0, 0, 0))}
    steps = [
        {"open": {
            "convention": frame.message(),
            "seed": "7",
            "scene": {"hash": court.HASH, "bindings": [{"node": "post", "id": "7"}]},
            "instances": [capsule(1, a, frame, tilt), box(2, b, (0.6, 1.8, 0.4), frame), capsule(3, c, frame), box(4, (10, 1, 10), (2, 2, 0.04), frame)],
            "targets": targets(1, 2, 3, 7),
            "camera": camera_pose(frame, eye, at),
            "degradationPolicy": "DEGRADATION_POLICY_NEVER"},
         "expect": {"opened": {"instanceCount": "6", "mirrorHash": ABOVE_DOUBLES}}},
        {"tick": still(1), "expect": {"camera": {
            "sequence": "1", "pose": camera_pose(frame, eye, at), "velocity": named((0, 0, 0)), "reason": "MOVE_REASON_PAUSED", "cut": False,
            "fieldOfView": frame.field_of_view(VERTICAL, ASPECT), "targets": first,
            "relativePose": relative_pose(frame, 1, a, tilt, eye, at)}}},
        {"tick": still(2, observedCamera={"pose": there, "cut": True}), "expect": {"camera": {
            **held, "cut": True, "reason": "MOVE_REASON_OBSERVED_CUT",
            "targets": seen(distances(eye2, post), 1, state="TARGET_STATE_VISIBLE", visibleShare=1, inPicture=True),
            "relativePose": relative_pose(frame, 1, a, tilt, eye2, at2)}}},
        {"tick": still(3, transforms=transforms(frame, {4: (plate_beside, edge_on), 7: (post2, tilt)})), "expect": {"camera": {
            **held, "cut": False, "targets": seen(distances(eye2, post2), 1, visibleShare=1)}}},
        {"tick": still(4, transforms=transforms(frame, {4: (plate_beside, IDENTITY)})), "expect": {"camera": {
            **held, "targets": seen(distances(eye2, post2), 1, visibleShare=0, occluders=[{"id": "4", "share": 1}])}}},
    ]
    for n in range(1, 41):
        x = 0.5 + 2 * math.sin(n / 30)
        steps.append({"tick": {"sequence": str(4 + n), "timeS": n / 60, "transforms": transforms(frame, {1: ((x, 0.9, 0.3),)})},
                      "expect": {"camera": {"sequence": str(4 + n)}}})
    steps.append({"tick": still(45, timeS=40 / 60, lens={"fieldOfView": frame.field_of_view(math.radians(50), 1.5), "aspect": 1.5}),
                  "expect": {"camera": {"fieldOfView": frame.field_of_view(math.radians(50), 1.5)}}})
    return session(f"The scene in the convention of {frame.name}.", steps)


def session(about, steps):
    return {"about": about, "steps": [*steps, {"close": {}, "expect": {"closed": {"resyncs": sum("daemon" in step for step in steps), "resumes": sum("stream" in step for step in steps)}}}]}


def opening(**more):
    return {"seed": "7", "instances": [capsule(1, (0, 0.9, 0)), capsule(2, (1.2, 0.9, 0))], "targets": targets(1, 2),
            "camera": pose((0, 1.6, 6)), "degradationPolicy": "DEGRADATION_POLICY_NEVER", **more}


def numbers():
    """Numbers of 64 bits arrive as they are."""
    greatest, odd = TWO_63 - 1, 2 ** 53 + 1
    last = 2 ** 64 - 1
    near, far = capsule(odd, (0, 1, 2)), capsule(greatest, (0, 1, 0))
    return session("Ids, seeds, hashes and sequence numbers that a double cannot hold.", [
        {"open": opening(seed=str(last), instances=[near, far], targets=targets(greatest), camera=pose((0, 1, 6))),
         "expect": {"opened": {"mirrorHash": ABOVE_DOUBLES, "instanceCount": "2"}}},
        {"tick": {"sequence": str(last - 2), "timeS": 0}, "expect": {"camera": {
            "sequence": str(last - 2), "mirrorHash": ABOVE_DOUBLES, "relativePose": {"targetId": str(greatest)},
            "targets": [{"id": str(greatest), "visibleShare": 0, "occluders": [{"id": str(odd), "share": 1}]}]}}},
        {"tick": {"sequence": str(last - 1), "timeS": 0.1, "transforms": {"ids": [str(last)], "positions": [0, 0, 0]}},
         "expect": {"refused": {"sequence": str(last - 1), "code": "CODE_NOT_FOUND", "fieldViolations": [{"field": "tick.transforms.ids[0]"}],
                                "resync": {"mirrorHash": ABOVE_DOUBLES}}}},
        {"tick": {"sequence": str(last - 1), "timeS": 0.1, "delta": {"addedInstances": [capsule(TWO_63, (0, 0, 0))]}},
         "expect": {"refused": {"code": "CODE_INVALID_ARGUMENT", "fieldViolations": [
             {"field": "tick.delta.added_instances[0].id", "description": {"contains": "9223372036854775808"}}]}}},
        {"tick": {"sequence": str(last), "timeS": 0.1, "transforms": {"ids": [str(odd)], "positions": [5, 1, 0]}},
         "expect": {"camera": {"sequence": str(last), "targets": [{"id": str(greatest), "visibleShare": 1}]}}},
    ])


def errors():
    """Every error names its field."""
    def failing(code, field, **more):
        return {"open": opening(**more), "expect": {"failed": {"code": code, "violations": [{"field": field}] if field else []}}}

    def refused(code, field, resync=None, **tick):
        tick = {"timeS": 0, **tick}
        return {"tick": tick, "expect": {"refused": {"code": f"CODE_{code}", "fieldViolations": [{"field": field}], "resync": resync}}}

    known = {"mirrorRevision": "1", "mirrorHash": ABOVE_DOUBLES}
    return session("Openings that fail and ticks that are refused.", [
        failing("INVALID_ARGUMENT", "open.instances[1].shape.capsule.radius",
                instances=[capsule(1, (0, 0, 0)), {"id": "2", "shape": {"capsule": {"radius": -1, "halfHeight": 1}}}]),
        failing("INVALID_ARGUMENT", "open.convention.custom", convention={"preset": "PRESET_CUSTOM"}),
        failing("INVALID_ARGUMENT", "open.settings.max_distance_m", settings={"maxDistanceM": -5}),
        failing("INVALID_ARGUMENT", "open.instances[1].id", instances=[capsule(1, (0, 0, 0)), capsule(1, (1, 0, 0))], targets=[]),
        failing("NOT_FOUND", "open.targets[0].id", targets=targets(99)),
        failing("NOT_FOUND", "open.scene.hash", scene={"hash": "0" * 32}),
        {"open": opening(), "expect": {"opened": {"instanceCount": "2", "mirrorRevision": "1"}}},
        {"tick": {"timeS": 0}, "expect": {"camera": {"sequence": "1"}}},
        refused("NOT_FOUND", "tick.transforms.ids[0]", known, transforms={"ids": ["99"], "positions": [0, 0, 0]}),
        refused("INVALID_ARGUMENT", "tick.transforms.positions", transforms={"ids": ["1"], "positions": [0, 0]}),
        refused("INVALID_ARGUMENT", "tick.transforms.rotations[0]", transforms={"ids": ["1"], "positions": [0, 0, 0], "rotations": [0, 0, 0, 2]}),
        refused("INVALID_ARGUMENT", "tick.settings.dead_zone", settings={"deadZone": 2}),
        refused("INVALID_ARGUMENT", "tick.time_s", timeS=-1),
        refused("INVALID_ARGUMENT", "tick.sequence", sequence="1"),
        refused("ALREADY_EXISTS", "tick.delta.added_instances[0].id", known, delta={"addedInstances": [capsule(2, (0, 0, 0))]}),
        refused("FAILED_PRECONDITION", "tick.delta.base_revision", known, delta={"baseRevision": "12345678901234567890"}),
        {"tick": {"timeS": 0.1, "delta": {"baseRevision": "1", "removedIds": ["2"]}, "targets": {"targets": targets(1)}},
         "expect": {"camera": {"mirrorRevision": "2", "targets": [{"id": "1"}]}}},
    ])


def settings():
    """Settings, limits, lens and targets change with a tick."""
    def ticks(first, n, expect, **with_first):
        return [{"tick": {"timeS": (first + i) / 60, "transforms": {"ids": ["1"], "positions": [math.sin((first + i) / 10), 0.9, 0]},
                          **(with_first if i == 0 else {})}, "expect": {"camera": expect}} for i in range(n)]

    slow = {"velocity": {"lengthAtMost": 0.2001}}
    return session("Settings, limits and targets that change on the way.", [
        {"open": opening(instances=[*opening()["instances"], box(3, (0, 2, 2), (1, 4, 1))], settings={"preset": "PRESET_PAPER", "predictionS": 0.2},
                         limits={"maxSpeedMps": 0.2}, tuning={"aggregate": {"visibilityThreshold": 0.5}}), "expect": {"opened": {"instanceCount": "3"}}},
        *ticks(0, 20, slow),
        *ticks(20, 20, slow, settings={"preset": "PRESET_SIGHTLINE", "searchViewpoints": False}),
        *ticks(40, 20, {"targets": [{"id": "2"}]}, targets={"targets": targets(2)}, limits={"maxSpeedMps": 4, "bodyRadiusM": 0.2}),
        *ticks(60, 2, {"targets": [], "status": "TRACKING_STATUS_HOLDING", "reason": "MOVE_REASON_NO_TARGETS", "relativePose": None},
               targets={"targets": []}),
    ])


def body():
    """A character of three capsules that move by themselves: a wall hides the hips, and the arm comes out beside it."""
    def tick(share, reach, arm=True, **more):
        places = {"1": [0, 0.9, 0], **({"11": [reach, 1.3, 0]} if arm else {}), "12": [0, 1.6, 0]}
        return {"tick": {"timeS": 0, "transforms": {"ids": [*places], "positions": sum(places.values(), [])}, **more},
                "expect": {"camera": {"targets": [{"id": "1", "visibleShare": share}]}}}

    def with_parts(*ids):
        return {"targets": {"targets": [{"id": "1", "partIds": list(ids)}]}}

    def refused(code, field, *ids):
        return {"tick": {"timeS": 0, **with_parts(*ids)}, "expect": {"refused": {"code": f"CODE_{code}", "fieldViolations": [{"field": field}]}}}

    wall, part_of_it = box(3, (0, 2, 2), (3, 4, 0.2)), {"between": [0.2, 0.8]}
    return session("A target with parts that move by themselves: what counts, what is refused, and parts that are removed.", [
        {"open": opening(instances=[capsule(1, (0, 0.9, 0)), capsule(11, (0, 1.3, 0)), capsule(12, (0, 1.6, 0)), wall],
                         targets=[{"id": "1", "partIds": ["11", "12"]}], settings={"searchViewpoints": False}),
         "expect": {"opened": {"instanceCount": "4"}}},
        *[tick(0, 0)] * 3,
        # The capsules are equally large: the one that comes out is between a third and a half of what the target shows.
        *[tick(part_of_it, 4)] * 5,
        refused("INVALID_ARGUMENT", "tick.targets.targets[0].part_ids[1]", "11", "11"),
        refused("INVALID_ARGUMENT", "tick.targets.targets[0].part_ids[0]", "1"),
        refused("NOT_FOUND", "tick.targets.targets[0].part_ids[0]", "99"),
        tick(0, 4, arm=False, delta={"removedIds": ["11"]}),
        tick(part_of_it, 4, delta={"addedInstances": [capsule(11, (4, 1.3, 0))]}),
        tick(part_of_it, 4, **with_parts("11")),
        tick(0, 4, **with_parts()),
    ])


def resync():
    """A session goes on in a daemon that knows nothing of it. Every kind of change happens before the daemon goes away."""
    def around(n):
        return {"1": [2 * math.sin(n / 20), 0.9, 0], "2": [2 * math.sin(n / 20) + 1.2, 0.9, 0]}

    def tick(n, **more):
        places = around(n)
        return {"tick": {"timeS": n / 60, "transforms": {"ids": [*places], "positions": sum(places.values(), [])}, **more},
                "expect": {"camera": {"timeS": n / 60}}}

    def ticks(first, n):
        return [tick(i) for i in range(first, first + n)]

    half = math.sqrt(0.5)
    turned = {"ids": ["7", "3"], "positions": [3, 0.9, -2, -2, 1, 3], "rotations": [0, half, 0, half, half, 0, 0, half]}
    still = {"ids": ["4"], "positions": [4, 1, 4]}
    return {**session("Daemons that drain and daemons that are killed.", [
        {"open": opening(scene={"hash": court.HASH, "bindings": [{"node": "post", "id": "7"}, {"node": "wall", "id": "8"}]},
                         instances=[*opening()["instances"], box(3, (-2, 1, 3), (1, 2, 0.3)), box(4, (3, 1, 3), (1, 2, 1)), box(5, (5, 1, 5), (1, 1, 1))],
                         limits={"maxSpeedMps": 3}), "expect": {"opened": {"instanceCount": "7"}}},
        *ticks(0, 20),
        tick(20, transforms=turned),
        tick(21, transforms=still),
        tick(22, delta={"removedIds": ["5", "8"], "addedInstances": [box(6, (0, 2, 2.5), (0.6, 4, 0.6)), box(8, (-6, 1, 0), (1, 1, 1)), box(13, (2, 1.8, 0), (0.3, 0.3, 0.3))],
                        "changedInstances": [{"id": "4", "attributes": {"occludes": False}}]}),
        tick(23, settings={"minDistanceM": 2, "maxDistanceM": 12}, limits={"maxSpeedMps": 2}, lens={"fieldOfView": 0.8},
             targets={"targets": [{"id": "2", "weight": 2, "partIds": ["3", "13"]}, {"id": "1", "attachedIds": ["4", "6"]}]}),
        tick(24, delta={"removedIds": ["6", "13"], "addedInstances": [box(9, (0.5, 2, 3), (0.6, 4, 0.6))]}),
        *ticks(25, 20),
        {"daemon": "drain"},
        tick(45, delta={"baseRevision": "3", "removedIds": ["4"]}),
        *ticks(46, 20),
        {"daemon": "kill"},
        *ticks(66, 20),
        {"daemon": "kill"},
        tick(86, transforms={"ids": ["99"], "positions": [0, 0, 0]}) | {"expect": {"refused": {"code": "CODE_NOT_FOUND"}}},
        *ticks(87, 5),
    ]), "likeWithoutInterruption": True, "fastest": 3.0}


def resume():
    """A session goes on in a new stream when its stream breaks, wherever that happens."""
    def tick(n, **more):
        places = {"1": [2 * math.sin(n / 20), 0.9, 0], "2": [2 * math.sin(n / 20) + 1.2, 0.9, 0]}
        return {"tick": {"timeS": n / 60, "transforms": {"ids": [*places], "positions": sum(places.values(), [])}, **more},
                "expect": {"camera": {"sequence": str(n + 1), "timeS": n / 60, "mergedTicks": None}}}

    def ticks(first, n):
        return [tick(i) for i in range(first, first + n)]

    refused = {"expect": {"refused": {"sequence": "62", "code": "CODE_NOT_FOUND"}}}
    return {**session("Streams that break: between two ticks, before a tick arrives, and before its answer does.", [
        {"open": opening(instances=[*opening()["instances"], box(3, (0, 2, 2), (1, 4, 1))]), "expect": {"opened": {"instanceCount": "3"}}},
        *ticks(0, 15),
        {"stream": "cut"},
        *ticks(15, 15),
        {"stream": "lose request"},
        tick(30, delta={"addedInstances": [box(4, (1, 2, 3), (0.6, 4, 0.6))]}),
        *ticks(31, 14),
        {"stream": "lose reply"},
        tick(45, delta={"removedIds": ["4"]}, targets={"targets": [{"id": "2", "weight": 2}, {"id": "1"}]}),
        *ticks(46, 15),
        {"stream": "lose reply"},
        tick(61, transforms={"ids": ["99"], "positions": [0, 0, 0]}) | refused,
        *ticks(62, 10),
    ]), "equalWithoutInterruption": True}


def shift():
    """The client's world gets a new origin twice, and the session goes on in other daemons."""
    shifts = {15: [1000, 0, -500], 40: [-3000, 20, 0]}

    def world(n):
        return [sum(by[axis] for at, by in shifts.items() if at <= n) for axis in range(3)]

    def moved(place, n):
        return [a + b for a, b in zip(place, world(n))]

    def tick(n, **more):
        by = {"worldShift": named(shifts[n])} if n in shifts else {}
        positions = moved([2 * math.sin(n / 20), 0.9, 0], n) + moved([2 * math.sin(n / 20) + 1.2, 0.9, 0], n)
        x, y, z = moved([0, 1.6, 6], n)
        near = {"position": {name: {"between": [value - 8, value + 8]} for name, value in zip("xyz", (x, y, z))}}
        return {"tick": {"timeS": n / 60, "transforms": {"ids": ["1", "2"], "positions": positions}, **by, **more},
                "expect": {"camera": {"timeS": n / 60, "pose": near}}}

    def ticks(first, n):
        return [tick(i) for i in range(first, first + n)]

    added = box(5, moved((5, 1, 5), 20), (1, 1, 1))
    return {**session("Worlds that get a new origin, before daemons are killed and after.", [
        {"open": opening(scene={"hash": court.HASH, "bindings": [{"node": "post", "id": "7"}]},
                         instances=[*opening()["instances"], box(3, (-2, 1, 3), (1, 2, 0.3)), box(4, (3, 1, 3), (1, 2, 1))]),
         "expect": {"opened": {"instanceCount": "6"}}},
        tick(0), tick(1, delta={"addedInstances": [box(6, (2, 1, -3), (1, 1, 1))]}), *ticks(2, 18),
        tick(20, delta={"addedInstances": [added]}), *ticks(21, 9),
        {"daemon": "kill"},
        *ticks(30, 20),
        {"daemon": "kill"},
        *ticks(50, 10),
    ]), "likeWithoutInterruption": True, "fastest": 10.0}


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    court.write(folder / "court.glb")
    made = {f"convention_{frame.name}": convention(frame) for frame in FRAMES}
    made |= {make.__name__: make() for make in (numbers, errors, settings, body, resync, resume, shift)}
    for name, content in made.items():
        lines = ",\n".join("    " + json.dumps(step) for step in content.pop("steps"))
        head = "".join(f"  {json.dumps(key)}: {json.dumps(value)},\n" for key, value in content.items())
        (folder / f"{name}.json").write_text(f'{{\n{head}  "steps": [\n{lines}\n  ]\n}}\n')


if __name__ == "__main__":
    main()
