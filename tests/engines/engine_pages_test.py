#!/usr/bin/env python3
"""The pages of client/engines: engine_pages_test.py SIGHTLINED STUBS ENGINES. The numbers are checked against a daemon and against plain
arithmetic (tests/conformance/frames.py)."""
import json
import math
import pathlib
import re
import sys
import unittest

SIGHTLINED, STUBS, ENGINES = sys.argv[1:4]
sys.path[:0] = [STUBS, str(pathlib.Path(__file__).parent.parent / "conformance")]

from google.protobuf import json_format  # noqa: E402
from sightline.v1.session_pb2 import OpenSession, Tick  # noqa: E402
from sightline_client import Camera, Failed  # noqa: E402

import expectations  # noqa: E402
import frames  # noqa: E402
from daemon import Daemon  # noqa: E402

PAGES = {"unity": "unity.md", "unreal": "unreal.md", "godot": "godot.md"}
FRAMES = {frame.name: frame for frame in frames.FRAMES}


def text_of(page):
    return pathlib.Path(ENGINES, page).read_text(encoding="utf-8")


def block_of(page, language):
    (block,) = re.findall(rf"^```{language}\n(.*?)^```$", text_of(page), re.M | re.S)
    return block


def numbers(vector):
    return [vector.get(axis, 0.0) for axis in ("x", "y", "z", "w")[:len(vector)]]


def matrix(quaternion):
    x, y, z, w = numbers(quaternion)
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]


class EnginePages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemon = cls.enterClassContext(Daemon(SIGHTLINED))

    def reply_to(self, opening, tick):
        with Camera.open(self.daemon.address, json_format.ParseDict(opening, OpenSession())) as camera:
            return json_format.MessageToDict(camera.step(json_format.ParseDict(tick, Tick())))

    def test_the_daemon_gives_the_replies_of_the_pages(self):
        for name, page in PAGES.items():
            with self.subTest(page=page):
                said = json.loads(block_of(page, "json"))
                self.assertEqual(said["open"]["convention"]["preset"], f"PRESET_{name.upper()}")
                self.assertEqual([], expectations.unmet(said["reply"], self.reply_to(said["open"], said["tick"])))

    def test_the_replies_of_the_pages_follow_from_the_conventions(self):
        for name, page in PAGES.items():
            with self.subTest(page=page):
                said = json.loads(block_of(page, "json"))
                camera, body = said["open"]["camera"], said["open"]["instances"][0]["pose"]
                offset = frames.minus(numbers(camera["position"]), numbers(body["position"]))
                back = frames.transpose(matrix(body["rotation"]))
                relative = said["reply"]["relativePose"]
                self.assert_close(numbers(relative["unrotatedPose"]["position"]), offset)
                self.assert_close(numbers(relative["pose"]["position"]), frames.product(back, offset))
                turned = frames.multiply(back, matrix(camera["rotation"]))
                for got, expected in zip(matrix(relative["pose"]["rotation"]), turned):
                    self.assert_close(got, expected)
                self.assert_close([said["reply"]["fieldOfView"]], [FRAMES[name].field_of_view(0.6981317007977318, 16 / 9)])

    def assert_close(self, got, expected):
        self.assertEqual(len(got), len(expected))
        for a, b in zip(got, expected):
            self.assertAlmostEqual(a, b, places=6)

    def test_the_camera_of_the_pages_looks_at_the_target(self):
        """The identity rotation looks along the axis that the convention names, and every page's target is ahead along it."""
        for name, page in PAGES.items():
            with self.subTest(page=page):
                said = json.loads(block_of(page, "json"))["open"]
                to_target = frames.minus(numbers(said["instances"][0]["pose"]["position"]), numbers(said["camera"]["position"]))
                ahead = sum(a * b for a, b in zip(to_target, FRAMES[name].forward))
                self.assertGreater(ahead, 0.9 * sum(a * a for a in to_target) ** 0.5)

    def test_the_table_of_exporters_follows_from_the_conventions(self):
        for engine, formula in re.findall(r"^\| (Unity|Unreal|Godot) \| \(([^)]*)\), \w+ \|", text_of("README.md"), re.M):
            with self.subTest(engine=engine):
                values = {"x": 2.0, "y": 3.0, "z": 5.0}
                said = []
                for term in formula.split(", "):
                    sign, factor, axis = re.fullmatch(r"(-?)(?:(\d+) )?([xyz])", term).groups()
                    said.append((-1 if sign else 1) * float(factor or 1) * values[axis])
                self.assert_close(said, FRAMES[engine.lower()].point(list(values.values())))

    def test_a_negative_id_is_refused_with_the_id_that_it_should_be(self):
        said = json.loads(block_of("unity.md", "json"))["open"]
        wrong = json.loads(json.dumps(said).replace('"4294967286"', str(json.dumps(str(2 ** 64 - 10)))))
        with self.assertRaisesRegex(Failed, r"open\.instances\[0\]\.id.*-10 as a signed number.*4294967286"):
            self.reply_to(wrong, {"timeS": 0})
        self.assertIn("-10 becomes 4294967286", text_of("README.md"))

    def test_without_targets_the_camera_holds(self):
        reply = self.reply_to({"camera": {"position": {"z": 6}}}, {"timeS": 0, "dtS": 0.1})
        self.assertEqual((reply["status"], reply["reason"]), ("TRACKING_STATUS_HOLDING", "MOVE_REASON_NO_TARGETS"))
        self.assertNotIn("relativePose", reply)

    def test_a_compound_is_one_target(self):
        """A wall hides the left one of two spheres: half of the target is seen."""
        def sphere(x):
            return {"shape": {"sphere": {"radius": 0.4}, "offset": {"x": x}}}

        body = {"id": "1", "shape": {"compound": {"parts": [sphere(-1), sphere(1)]}}}
        wall = {"id": "2", "shape": {"box": {"halfExtent": {"x": 2, "y": 4, "z": 0.05}}}, "pose": {"position": {"x": -2, "y": 0, "z": 1.5}}}
        opening = {"camera": {"position": {"z": 8}}, "instances": [body, wall], "targets": [{"id": "1"}], "tuning": {"sample": {"points": 16}}}
        with Camera.open(self.daemon.address, json_format.ParseDict(opening, OpenSession())) as camera:
            shares = [camera.step(Tick(time_s=0.0)).targets[0].visible_share for _ in range(8)]
        self.assertAlmostEqual(sum(shares) / len(shares), 0.5, delta=0.1)

    def test_the_bones_of_a_skinned_body_lie_where_they_should_in_every_engine(self):
        """A wall hides the hips, and an arm points out beside it. Its capsule is turned as on the pages: by the shortest turn from the engine's
        up axis to the bone, in the engine's own coordinates."""
        def capsule(frame, id_, start, end, radius):
            bone, up = frames.minus(frame.point(end), frame.point(start)), frames.unit(frame.point([0, 1, 0]))
            along = frames.unit(bone)
            turn = frames.unit([*frames.cross(up, along), 1 + sum(a * b for a, b in zip(up, along))])
            middle = frame.point([(a + b) / 2 for a, b in zip(start, end)])
            return {"id": id_, "shape": {"capsule": {"radius": frame.length(radius), "halfHeight": math.hypot(*bone) / 2}},
                    "pose": {"position": dict(zip("xyz", middle)), "rotation": dict(zip("xyzw", turn))}}

        def share(frame, hand):
            wall = {"id": "9", "shape": {"box": {"halfExtent": dict(zip("xyz", frame.size([1, 3, 0.05])))}}, "pose": {"position": dict(zip("xyz", frame.point([0, 1, 2])))}}
            body = [capsule(frame, "1", [0, 0.9, 0], [0, 1.1, 0], 0.15), capsule(frame, "2", [0.2, 1.4, 0], hand, 0.08)]
            opening = {"convention": frame.message(), "seed": "3", "camera": {"position": dict(zip("xyz", frame.point([0, 1.5, 6])))},
                       "instances": [*body, wall], "targets": [{"id": "1", "partIds": ["2"]}]}
            with Camera.open(self.daemon.address, json_format.ParseDict(opening, OpenSession())) as camera:
                return sum(camera.step(Tick(time_s=0.0)).targets[0].visible_share for _ in range(8)) / 8

        for name in PAGES:
            with self.subTest(engine=name):
                self.assertAlmostEqual(share(FRAMES[name], [3, 1.4, 0]), share(FRAMES["gltf"], [3, 1.4, 0]), delta=0.02)
                self.assertGreater(share(FRAMES[name], [3, 1.4, 0]), 0.2)
                self.assertEqual(share(FRAMES[name], [0.2, 1.4, -2.8]), 0, "an arm that points away from the camera is hidden")

    def test_an_offset_moves_the_aim(self):
        """A capsule with its pivot at the feet is as far away as one that is centred on its middle."""
        def distance(instance):
            return self.reply_to({"camera": {"position": {"y": 3, "z": 6}}, "instances": [instance], "targets": [{"id": "1"}]},
                                 {"timeS": 0})["targets"][0]["distance"]

        shape = {"capsule": {"radius": 0.3, "halfHeight": 0.6}}
        centred = distance({"id": "1", "shape": shape, "pose": {"position": {"y": 0.9}}})
        at_feet = distance({"id": "1", "shape": {**shape, "offset": {"y": 0.9}}})
        self.assertAlmostEqual(centred, at_feet, places=5)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
