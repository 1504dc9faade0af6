"""The page of a session in a real browser: page_test.py SIGHTLINED SIGHTLINE MAKE_SCENES MAKE_RECORDING READER OUT.

Plays a scene against a daemon, opens the page that `sightline drive --page` writes in headless Chromium, uses it as a
person would and compares what it shows with the trace of the same drive. Then the pages of recordings (report_page_test.py):
MAKE_RECORDING makes those, READER is a Python with tests/record/requirements.txt. OUT keeps pages and screenshots. Leaves
with 77 where there is no Chromium."""
import base64
import csv
import json
import math
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

from browsing import ActionChains, Browsing, By, Keys, MAKE_SCENES, OUT, SIGHTLINE, SIGHTLINED, browser, prefer, wait_for
from report_page_test import HallReportTest, LostReportTest, ReportTest


class Session:
    """A drive of four targets among obstacles: its page and its trace."""

    def __init__(self):
        OUT.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            subprocess.run([MAKE_SCENES, "--out", folder, "arena"], check=True, capture_output=True, timeout=60)
            address = f"unix:{folder}/sock"
            daemon = subprocess.Popen([SIGHTLINED, "--listen", "none", "--listen-unix", f"{folder}/sock",
                                       "--sampler", "embree", "--ready-file", folder / "ready",
                                       "--record-dir", folder / "recordings", "--record-scenes"],
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            try:
                wait_for((folder / "ready").exists)
                self.page = OUT / "arena.html"
                drive = [SIGHTLINE, "drive", folder / "arena.glb", "--server", address, "--fast"]
                self.said = self.run(*drive, "--duration", "5", "--truth-every", "10", "--out", folder / "out",
                                     "--page", self.page)
                self.run(*drive, "--duration", "1", "--no-truth", "--out", folder / "plain")
                self.refused = subprocess.run(
                    [*drive, "--out", folder / "none", "--page", folder / "none" / "no" / "page.html"],
                    capture_output=True, text=True, timeout=60)
            finally:
                daemon.terminate()
                daemon.wait(timeout=30)
            first = min((folder / "recordings").glob("*.mcap"))
            self.report = OUT / "arena-report.html"
            self.run(SIGHTLINE, "report", first, "--out", self.report, "--pictures", "4")
            self.rows, self.plain_rows = self.trace(folder / "out"), self.trace(folder / "plain")
            self.metrics = json.loads((folder / "out" / "metrics.json").read_text())

    @staticmethod
    def run(*command):
        return subprocess.run(command, check=True, capture_output=True, text=True, timeout=300).stdout

    @staticmethod
    def trace(folder):
        with open(folder / "trace.csv", newline="") as file:
            return list(csv.DictReader(file))


class PageTest(Browsing):
    @classmethod
    def setUpClass(cls):
        cls.session = Session()
        cls.page, cls.rows = cls.session.page, cls.session.rows
        super().setUpClass()

    def assert_frame(self, frame):
        self.assertEqual(self.frame(), frame)
        self.assert_lens(frame)

    def assert_lens(self, frame):
        """The 3D camera is where the trace has it."""
        row, lens = self.rows[frame], self.view()["lens"]
        for value, column in zip(lens["position"] + lens["rotation"], ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")):
            self.assertAlmostEqual(value, float(row[column]), places=9)

    # ---- tests ----

    def test_the_drive_says_where_the_page_is(self):
        self.assertIn(f"page    {self.session.page}", self.session.said)
        self.assertLess(self.session.page.stat().st_size, 20e6)

    def test_the_report_of_the_daemons_recording_is_the_same_session(self):
        ours, drives = PageArrays(self.session.report), PageArrays(self.page)
        for name in ("sequence", "time_s", "camera", "fov_rad", "velocity_mps", "counts", "cut", "flags", "present", "steered",
                     "visible_share", "filtered_share", "distance_m", "stage_us", "cell_frame", "cell_mask", "cell_chosen",
                     "worth", "sight_loss", "shot_asked", "shot_now", "shot_deviation", "course"):
            with self.subTest(name=name):
                self.assertGreater(len(drives.array(name)), 0)
                self.assertEqual(ours.array(name), drives.array(name))
        self.assertEqual([t["name"] for t in ours.page["targets"]], [t["name"] for t in drives.page["targets"]])
        # Rotations cross the wire in single precision.
        self.assertLess(max(abs(a - b) for a, b in zip(ours.array("aim_m"), drives.array("aim_m"))), 1e-5)
        self.assertEqual({i["name"] for i in ours.page["instances"]}, {i["name"] for i in drives.page["instances"]})
        # The drive was faster than real time.
        facts = dict(ours.page["facts"])
        self.assertEqual(facts["game time"], "5.000 s, from 0.000 s to 5.000 s")
        self.assertRegex(facts["wall clock"], r"^[0-9.]+ s$")
        self.assertNotEqual(facts["wall clock"], "5.00 s")

    def test_a_page_changes_nothing_of_the_drive(self):
        decided = [column for column in self.rows[0] if not column.endswith(("_us", "_ms")) and "true_" not in column
                   and column not in ("r_n", "r_p", "r_p_tolerant")]
        self.assertGreater(len(decided), 40)
        self.assertEqual(len(self.session.plain_rows), 61)
        for with_page, without in zip(self.rows, self.session.plain_rows):
            self.assertEqual([with_page[column] for column in decided], [without[column] for column in decided])

    def test_a_page_that_cannot_be_written_is_refused_before_the_drive(self):
        self.assertEqual(self.session.refused.returncode, 1)
        self.assertIn("page.html", self.session.refused.stderr)
        self.assertNotIn("session", self.session.refused.stdout)

    def test_it_opens_at_the_first_frame_with_the_names_of_the_session(self):
        self.assert_frame(0)
        self.assertEqual(self.find("#title").text, "arena")
        self.assertIn("embree", self.find("#facts").text)
        self.assertEqual(self.find("#timeline").get_attribute("aria-valuemax"), str(len(self.rows) - 1))
        self.assertGreater(self.view()["cells"], 0)

    def test_an_address_opens_it_at_a_frame_and_follows_what_is_shown(self):
        self.open("#frame=42")
        self.assert_frame(42)
        self.press(Keys.ARROW_RIGHT)
        wait_for(lambda: self.driver.current_url.endswith("#frame=43"))

    def test_the_numbers_are_those_of_the_trace(self):
        hidden = [i for i, row in enumerate(self.rows) if row["target-4.occluder"]]
        self.assertTrue(hidden, "the drive should lose sight once")
        for frame in sorted({0, 1, 10, hidden[0], len(self.rows) // 2, len(self.rows) - 1}):
            with self.subTest(frame=frame):
                self.go(frame)
                self.assert_frame(frame)
                self.check_numbers(self.rows[frame])

    def check_numbers(self, row):
        number = lambda field: float(self.text(field).split()[0].rstrip("°"))  # noqa: E731
        self.assertEqual(self.text("sequence"), row["sequence"])
        self.assertEqual(self.text("time"), f"{float(row['pose_time_s']):.4f} s")
        for value, column in zip(self.text("position").split(), ("x_m", "y_m", "z_m")):
            self.assertAlmostEqual(float(value), float(row[column]), delta=0.00051)
        self.assertAlmostEqual(number("fov"), math.degrees(float(row["vertical_fov_rad"])), delta=0.0051)
        speed = math.hypot(*(float(row[column]) for column in ("vx_mps", "vy_mps", "vz_mps")))
        self.assertAlmostEqual(number("speed"), speed, delta=0.0051)
        self.assertAlmostEqual(number("clearance"), float(row["clearance_m"]), delta=0.0051)
        self.assertEqual(self.text("status"), row["status"].lower().replace("_", " "))
        self.assertEqual(self.text("reason"), row["reason"].lower().replace("_", " "))
        for field, column in (("all_visible", "s_v"), ("some_visible", "s_p"), ("none_visible", "s_n"),
                              ("merged", "merged_ticks")):
            self.assertEqual(self.text(field), row[column])
        for i, stage in enumerate(("scene", "bound", "sample", "aggregate", "move")):
            self.assertAlmostEqual(number(f"stage-{i}"), float(row[f"{stage}_us"]), delta=0.06)
        self.assertAlmostEqual(number("total"), float(row["total_us"]), delta=0.2)
        self.assertAlmostEqual(number("queue"), float(row["queue_us"]), delta=0.06)
        self.assertAlmostEqual(number("latency"), float(row["latency_ms"]), delta=0.0051)
        for k in range(4):
            self.check_target(k, {column.split(".", 1)[1]: value for column, value in row.items()
                                  if column.startswith(f"target-{k + 1}.")})

    def check_target(self, k, row):
        percent = lambda field: float(self.text(f"{field}-{k}").rstrip(" %"))  # noqa: E731
        self.assertAlmostEqual(percent("visible"), 100 * float(row["visible_share"]), delta=0.051)
        self.assertEqual(self.text(f"state-{k}"), row["state"].lower().replace("_", " "))
        self.assertAlmostEqual(float(self.text(f"distance-{k}").rstrip(" m")), float(row["distance_m"]), delta=0.0051)
        if row["true_visible_share"]:
            self.assertAlmostEqual(percent("true"), 100 * float(row["true_visible_share"]), delta=0.051)
        else:
            self.assertEqual(self.text(f"true-{k}"), "–")
        said = self.text(f"blocker-{k}")
        if row["occluder"]:
            share = re.fullmatch(r"behind .+ \((\d+) % hidden\)", said).group(1)
            self.assertAlmostEqual(float(share), 100 * float(row["occluder_share"]), delta=0.51)
        else:
            self.assertEqual(said, "")

    def test_the_shot_is_the_one_of_the_replies(self):
        arrays = PageArrays(self.page)
        number = lambda field: float(self.text(field).split()[-1 if field == "worth" else 0].rstrip("°%"))  # noqa: E731
        courses = set()
        for frame in (0, 60, len(self.rows) // 2, len(self.rows) - 1):
            with self.subTest(frame=frame):
                self.go(frame)
                self.assertAlmostEqual(number("worth"), arrays.array("worth")[frame], delta=0.0051)
                self.assertAlmostEqual(number("sight_loss"), 100 * arrays.array("sight_loss")[frame], delta=0.51)
                for i, (term, scale, delta) in enumerate((("side", 180 / math.pi, 0.51), ("height", 180 / math.pi, 0.51), ("distance", 1, 0.051))):
                    for field, name in (("asked", "shot_asked"), ("now", "shot_now")):
                        self.assertAlmostEqual(number(f"{term}-{field}"), scale * arrays.array(name)[3 * frame + i], delta=delta)
                    self.assertAlmostEqual(number(f"{term}-off"), 100 * arrays.array("shot_deviation")[4 * frame + i], delta=0.51)
                courses.add(self.text("course"))
                by, target, in_s = (arrays.array(name)[frame] for name in ("shot_hidden_by", "shot_hidden_target", "shot_hidden_in_s"))
                names = {str(i["id"]): i["name"] for i in arrays.page["instances"]}
                name = lambda index: names[arrays.page["occluders"][index]]  # noqa: E731
                self.assertEqual(self.text("in_the_way"), "nothing" if by < 0 else f"{name(by)} hides {name(target)}" if math.isnan(in_s)
                                 else f"{name(by)} will hide {name(target)} in {in_s:.1f} s")
                losses = [f"{word} {100 * loss:.0f} %" for word, loss in zip(("follow", "stay", "plan"), arrays.array("course_losses")[3 * frame:3 * frame + 3])
                          if math.isfinite(loss)]
                self.assertEqual(self.text("losses"), ", ".join(losses) or "–")
                self.assertNotRegex(self.text("text"), r"(instance|target) \d")
                self.assert_shot_is_drawn(arrays, frame)
        self.assertTrue(courses - {"–"} <= {"follow", "stay", "plan", "to view", "approach", "far way", "to shot"}, courses)

    def assert_shot_is_drawn(self, arrays, frame):
        """Where the page's numbers have it, until it is switched off."""
        place = arrays.array("shot_place_m")[3 * frame:3 * frame + 3]
        drawn = self.driver.execute_script(
            "const { asked, shot } = window.sightline.view.marks; return [shot.visible, ...asked.position.toArray()]")
        self.assertTrue(drawn[0])
        for a, b in zip(drawn[1:], place):
            self.assertAlmostEqual(a, b, places=6)
        self.find('[data-toggle="shot"]').click()
        self.rest()
        self.assertFalse(self.driver.execute_script("return window.sightline.view.marks.shot.visible"))
        self.find('[data-toggle="shot"]').click()
        self.rest()

    def test_the_lanes_of_motion_are_those_of_the_trace(self):
        columns = {name: [float(row[name]) for row in self.rows] for name in ("pose_time_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "clearance_m")}
        self.assertFalse(any(row["reason"] == "CUT" for row in self.rows))
        time_s = columns["pose_time_s"]

        def rates(values):
            """Differences over time; the first is left out."""
            return [None] + [None if a is None else [(q - p) / (time_s[k + 1] - time_s[k]) for p, q in zip(a, b)]
                             for k, (a, b) in enumerate(zip(values, values[1:]))]

        velocity = rates(list(zip(columns["x_m"], columns["y_m"], columns["z_m"])))
        jerk = rates(rates(velocity))
        rotations = list(zip(*(columns[c] for c in ("qx", "qy", "qz", "qw"))))
        radius_m = self.driver.execute_script("return window.sightline.session.targets.map((target) => target.radius_m)")
        for frame in (3, 10, len(self.rows) // 2, len(self.rows) - 1):
            dot = abs(sum(a * b for a, b in zip(rotations[frame - 1], rotations[frame])))
            row = self.rows[frame]
            half = math.tan(float(row["vertical_fov_rad"]) / 2)
            wanted = {
                "Speed": math.hypot(*velocity[frame]),
                "Turn": 2 * math.acos(min(1, dot)) / (time_s[frame] - time_s[frame - 1]),
                "Jerk": math.hypot(*jerk[frame]),
                "Clearance": columns["clearance_m"][frame],
                "Shot size": max(radius_m[k] / half / float(row[f"target-{k + 1}.distance_m"]) for k in range(4)),
            }
            shown = dict(self.driver.execute_script(
                "return window.sightline.timeline.lanes.filter((lane) => lane.value).map((lane) => [lane.label, lane.value(arguments[0])])", frame))
            for lane, value in wanted.items():
                with self.subTest(frame=frame, lane=lane):
                    digits = len(shown[lane].split()[0].partition(".")[2])
                    self.assertAlmostEqual(float(shown[lane].split()[0]), value, delta=0.51 * 10 ** -digits + 1e-6 * value)

    def test_the_camera_is_in_the_picture_when_the_page_opens(self):
        position, rotation, fov_degrees, aspect = self.driver.execute_script(
            """const { outside } = window.sightline.view;
               return [outside.position.toArray(), outside.quaternion.toArray(), outside.fov, outside.aspect]""")
        x, y, depth = self.seen_from(position, rotation, self.view()["lens"]["position"])
        high = math.tan(math.radians(fov_degrees) / 2)
        self.assertGreater(depth, 0)
        self.assertLess(abs(y / depth) / high, 0.95)
        self.assertLess(abs(x / depth) / (high * aspect), 0.95)

    @staticmethod
    def seen_from(position, rotation, point):
        """A point to the right of a camera, above it and before it, in metres."""
        x, y, z, w = rotation
        d = [p - q for p, q in zip(point, position)]
        axes = [(1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)),
                (2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)),
                (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y))]
        right, up, back = (sum(a * b for a, b in zip(axis, d)) for axis in axes)
        return right, up, -back

    def test_the_figures_are_those_of_the_drive(self):
        self.find("#tab-run").click()
        run = self.find("#panel-run").text
        for name, key, digits in (("path length d_c", "d_c_m", 1), ("least clearance", "least_clearance_m", 2)):
            line = next(line for line in run.splitlines() if line.startswith(name))
            wanted = [f"{self.session.metrics[column][key]:.{digits}f} m" for column in ("sightline", "follow")]
            self.assertEqual(line, " ".join([name, *wanted]))

    def test_scrubbing_moves_the_camera_of_the_3d_view(self):
        line = self.find("#timeline")
        seen = []
        for part in (0.2, 0.5, 0.8):
            self.click_at(line, 124 + part * (line.rect["width"] - 132), 60)
            frame = self.frame()
            self.assertAlmostEqual(frame / (len(self.rows) - 1), part, delta=0.01)
            self.assert_lens(frame)
            seen.append(self.picture())
        self.assertEqual(len(set(seen)), 3)

    def test_dragging_scrubs(self):
        line = self.find("#timeline")
        middle = -line.rect["width"] / 2 + 124
        ActionChains(self.driver).move_to_element_with_offset(line, round(middle + 100), 0).click_and_hold() \
            .move_by_offset(300, 0).move_by_offset(200, 0).release().perform()
        self.rest()
        frame = self.frame()
        self.assertAlmostEqual(frame / (len(self.rows) - 1), 600 / (line.rect["width"] - 132), delta=0.01)
        self.assert_lens(frame)

    def test_a_click_on_the_cameras_path_jumps_there(self):
        wanted = len(self.rows) // 2
        place = self.driver.execute_script("""
            const { view, session } = window.sightline, box = document.querySelector('#scene').getBoundingClientRect();
            const point = view.outside.position.clone().fromArray(session.camera, 7 * arguments[0]).project(view.outside);
            return [(point.x + 1) / 2 * box.width, (1 - point.y) / 2 * box.height];""", wanted)
        self.click_at(self.find("#scene"), *place)
        frame = self.frame()
        distance = math.dist(*([float(self.rows[i][c]) for c in ("x_m", "y_m", "z_m")] for i in (frame, wanted)))
        self.assertLess(distance, 0.3)
        self.assertNotEqual(frame, 0)
        self.assert_lens(frame)

    def test_the_keyboard_steps_and_jumps(self):
        last = len(self.rows) - 1
        self.press(Keys.ARROW_RIGHT)
        self.assert_frame(1)
        self.press_with_shift(Keys.ARROW_RIGHT)
        self.assert_frame(61)
        self.press_with_shift(Keys.ARROW_LEFT)
        self.press(Keys.ARROW_LEFT)
        self.assert_frame(0)
        self.press(Keys.ARROW_LEFT)
        self.assert_frame(0)
        self.press(Keys.END)
        self.assert_frame(last)
        self.press(Keys.ARROW_RIGHT)
        self.assert_frame(last)
        self.press(Keys.HOME)
        self.assert_frame(0)

    def test_brackets_go_to_the_next_change(self):
        events = [i for i in range(1, len(self.rows))
                  if self.rows[i]["cut"] == "1" or any(self.rows[i][c] != self.rows[i - 1][c] for c in ("status", "reason"))]
        self.press("]")
        self.assert_frame(events[0])
        self.press("]")
        self.assert_frame(events[1])
        self.press("[")
        self.assert_frame(events[0])

    def test_space_plays_and_pauses(self):
        self.press(",")
        self.assertEqual(self.find("#speed").get_attribute("value"), "0.5")
        self.press(".")
        self.press(" ")
        self.assertEqual(self.find("#play").get_attribute("aria-label"), "Pause")
        wait_for(lambda: self.frame() > 5)
        self.press(" ")
        self.assertEqual(self.find("#play").get_attribute("aria-label"), "Play")
        frame = self.frame()
        time.sleep(0.5)
        self.assert_frame(frame)

    def test_playing_ends_at_the_last_frame(self):
        self.press(Keys.END)
        self.press_with_shift(Keys.ARROW_LEFT)
        for _ in range(3):
            self.press(".")
        self.find("#play").click()
        wait_for(lambda: self.find("#play").get_attribute("aria-label") == "Play")
        self.assert_frame(len(self.rows) - 1)

    def test_the_focus_can_be_seen_and_the_slider_says_what_it_shows(self):
        for _ in range(60):
            self.press(Keys.TAB)
            focus = self.driver.switch_to.active_element
            self.assertNotEqual(focus.value_of_css_property("outline-style"), "none", focus.get_attribute("outerHTML")[:200])
            if focus.get_attribute("id") == "timeline":
                break
        self.assertEqual(focus.get_attribute("id"), "timeline")
        self.press(Keys.ARROW_RIGHT)
        self.assertEqual(focus.get_attribute("aria-valuenow"), "1")
        status = self.rows[1]["status"].lower().replace("_", " ")
        self.assertEqual(focus.get_attribute("aria-valuetext"), f"{float(self.rows[1]['pose_time_s']):.3f} seconds, {status}")

    def test_every_control_has_a_name(self):
        nameless = self.driver.execute_script("""
            return [...document.querySelectorAll('button, select, [role="slider"], img, dialog, [role="tab"], canvas#scene')]
              .filter((node) => !(node.getAttribute('aria-label') || node.getAttribute('alt') || node.textContent.trim()))
              .map((node) => node.outerHTML.slice(0, 100))""")
        self.assertEqual(nameless, [])

    def test_help_opens_and_closes(self):
        self.press("?")
        self.assertTrue(self.find("#help").is_displayed())
        self.assertIn("Play or pause", self.find("#help").text)
        self.press(Keys.ARROW_RIGHT)
        self.assertEqual(self.frame(), 0)  # the keys rest meanwhile
        self.press(Keys.ESCAPE)
        self.assertFalse(self.find("#help").is_displayed())
        self.press(Keys.ARROW_RIGHT)
        self.assert_frame(1)

    def test_through_the_camera_targets_are_where_the_pose_puts_them(self):
        frame = next(i for i, row in enumerate(self.rows)
                     if all(row[f"target-{k}.{column}"] == "1" for k in (1, 2) for column in ("true_visible_share", "in_picture")))
        self.go(frame)
        self.press("c")
        self.assertTrue(self.view()["through"])
        box = self.find("#scene").rect
        points = [self.project(frame, k, box) for k in (0, 1)]
        orange, blue = self.colours_at(self.picture(), points)
        self.assertGreater(orange[0], 2 * orange[2] + 20, (orange, points))  # target-1 is orange
        self.assertGreater(blue[2], blue[0] + 40, (blue, points))            # target-2 is blue

    def project(self, frame, k, box):
        """Where target `k` is in the largest picture of the session's shape within `box`, by the trace's pose and plain arithmetic."""
        row = self.rows[frame]
        aim, aspect = self.driver.execute_script(
            """const { aim_m, aspect } = window.sightline.session, at = 3 * (arguments[0] * 4 + arguments[1]);
               return [[...aim_m.subarray(at, at + 3)], aspect]""", frame, k)
        right, up, depth = self.seen_from([float(row[c]) for c in ("x_m", "y_m", "z_m")], [float(row[c]) for c in ("qx", "qy", "qz", "qw")], aim)
        high = min(box["width"] / aspect, box["height"])
        scale = high / (2 * math.tan(float(row["vertical_fov_rad"]) / 2))
        return [box["width"] / 2 + scale * right / depth, box["height"] / 2 - scale * up / depth]

    def test_what_blocks_a_target_is_highlighted(self):
        blocked = next(i for i, row in enumerate(self.rows) if row["target-4.occluder"])
        count = sum(bool(self.rows[blocked][f"target-{k}.occluder"]) for k in (1, 2, 3, 4))
        self.go(blocked)
        self.assertEqual(self.view()["blockers"], count)
        before = self.picture()
        self.press("2")
        self.assertEqual(self.view()["blockers"], 0)
        self.assertNotEqual(self.picture(), before)

    def test_each_switch_changes_the_3d_view(self):
        for key in ("x", "1", "2", "3", "c"):
            with self.subTest(key=key):
                before = self.picture()
                self.press(key)
                self.assertNotEqual(self.picture(), before)

    def test_the_cells_drawn_are_those_that_the_step_looked_at(self):
        for frame in (5, 100):
            self.go(frame)
            self.assertIn(int(self.text("cells_of")), (frame - 1, frame))  # of the last decision
            self.assertEqual(self.view()["cells"], int(self.rows[frame]["candidates"]))

    def test_the_picture_is_the_last_one_taken(self):
        self.go(150)
        of = int(self.text("picture_of").split(",")[0].removeprefix("frame "))
        taken = self.driver.execute_script("return window.sightline.session.pictures.map((picture) => picture.frame)")
        self.assertEqual(of, max(frame for frame in taken if frame <= 150))
        wait_for(lambda: self.driver.execute_script("return document.querySelector('#picture').naturalWidth") == 480)

    def test_the_time_line_zooms_about_what_is_shown(self):
        self.go(150)
        whole = self.picture("#timeline")
        for _ in range(3):
            self.press("+")
        self.assertNotEqual(self.picture("#timeline"), whole)
        line = self.find("#timeline")
        self.click_at(line, 124 + (line.rect["width"] - 132) / 2, 60)
        self.assertAlmostEqual(self.frame(), 150, delta=2)
        self.press("0")
        self.click_at(line, 124 + (line.rect["width"] - 132), 60)
        self.assertEqual(self.frame(), len(self.rows) - 1)

    def test_light_and_dark_follow_the_system_until_chosen(self):
        theme = lambda: self.driver.execute_script("return document.documentElement.dataset.theme")  # noqa: E731
        try:
            self.assertEqual(theme(), "dark")
            prefer(self.driver, light=True)
            wait_for(lambda: theme() == "light")
            self.press("l")
            self.assertEqual(theme(), "dark")
            self.find("#theme").click()
            self.assertEqual(theme(), "light")
        finally:
            prefer(self.driver, light=False)


class PageArrays:
    """What a page carries, read by itself."""

    def __init__(self, path):
        text = path.read_text()
        self.page = json.loads(re.search(r'id="session">(.*?)</script>', text, re.S).group(1))
        self.data = zlib.decompress(base64.b64decode(re.search(r'id="data">(.*?)</script>', text, re.S).group(1)))

    def array(self, name):
        kind, offset, count = self.page["arrays"][name]
        code = {"f64": "d", "f32": "f", "u32": "I", "i32": "i", "u16": "H", "u8": "B"}[kind]
        return struct.unpack_from(f"<{count}{code}", self.data, offset)


class LayoutTest(unittest.TestCase):
    """Everything within the window, nothing over anything else; a screenshot of each is kept."""

    def test_layouts(self):
        for width, height in ((1280, 800), (1920, 1080)):
            for light in (False, True):
                with self.subTest(width=width, light=light):
                    driver = browser(width, height, light)
                    try:
                        for prefix, page in (("", PageTest.page), ("report-", ReportTest.page), ("hall-", HallReportTest.page)):
                            self.check(driver, page, width, height, f"{prefix}{width}-{'light' if light else 'dark'}")
                    finally:
                        driver.quit()

    def check(self, driver, page, width, height, name):
        driver.get(f"file://{page}#frame=75")
        wait_for(lambda: driver.execute_script("return document.body.dataset.ready"))
        time.sleep(1)
        (OUT / f"{name}.png").write_bytes(base64.b64decode(driver.get_screenshot_as_base64()))
        boxes = driver.execute_script("""
            return Object.fromEntries(['header', '#view', 'aside', 'footer', '#timeline'].map((name) => {
              const { left, top, right, bottom } = document.querySelector(name).getBoundingClientRect();
              return [name, { left, top, right, bottom }];
            }));""")
        size = driver.execute_script("const { scrollWidth, scrollHeight } = document.documentElement; return [scrollWidth, scrollHeight]")
        self.assertEqual(size, [width, height])
        self.assertLessEqual(boxes["header"]["bottom"], boxes["#view"]["top"])
        self.assertLessEqual(boxes["#view"]["right"], boxes["aside"]["left"])
        self.assertLessEqual(boxes["#view"]["bottom"], boxes["footer"]["top"])
        self.assertLessEqual(boxes["#timeline"]["bottom"], height)
        self.assertGreater(boxes["#view"]["bottom"] - boxes["#view"]["top"], 0.4 * height)
        cut = driver.execute_script("""
            return [...document.querySelectorAll('aside [data-field]')]
              .filter((node) => node.offsetParent && getComputedStyle(node).display !== 'inline')
              .filter((node) => node.scrollWidth > node.clientWidth + 1).map((node) => node.dataset.field)""")
        self.assertEqual(cut, [])


    def test_two_recordings_side_by_side_fit_a_small_window(self):
        page = OUT / "beside.html"
        Session.run(SIGHTLINE, "report", OUT / "yard.mcap", OUT / "hall.mcap", "--out", page, "--pictures", "4")
        driver = browser(1280, 800)
        try:
            driver.get(f"file://{page}")
            wait_for(lambda: driver.execute_script("return document.body.dataset.ready"))
            time.sleep(1)
            (OUT / "beside-1280.png").write_bytes(base64.b64decode(driver.get_screenshot_as_base64()))
            for frame in driver.find_elements(By.CSS_SELECTOR, "iframe"):
                driver.switch_to.frame(frame)
                self.check_half(driver)
                driver.switch_to.default_content()
        finally:
            driver.quit()

    def check_half(self, driver):
        """In half the width: the view, the numbers and the whole time line, one above the other, without scrolling."""
        height, width, scroll_height, scroll_width, view, aside, line = driver.execute_script("""
            const { clientHeight, clientWidth, scrollHeight, scrollWidth } = document.documentElement;
            const boxes = ['#view', 'aside', '#timeline'].map((name) => document.querySelector(name).getBoundingClientRect());
            return [clientHeight, clientWidth, scrollHeight, scrollWidth, ...boxes.map(({ top, bottom }) => [top, bottom])];""")
        self.assertEqual((scroll_height, scroll_width), (height, width))
        self.assertGreater(view[1] - view[0], 0.2 * height)
        self.assertLessEqual(view[1], aside[0])
        self.assertGreater(aside[1] - aside[0], 0.1 * height)
        self.assertLessEqual(line[1], height)


class NoWebglTest(unittest.TestCase):
    def test_numbers_and_time_line_work_without_webgl(self):
        driver = browser(1280, 800, flags=("--disable-3d-apis",))
        try:
            driver.get(f"file://{PageTest.session.page}")
            wait_for(lambda: driver.execute_script("return document.body.dataset.ready"))
            self.assertTrue(driver.find_element(By.CSS_SELECTOR, "#no-webgl").is_displayed())
            ActionChains(driver).send_keys(Keys.END).perform()
            shown = driver.find_element(By.CSS_SELECTOR, '[data-field="sequence"]').text
            self.assertEqual(shown, PageTest.session.rows[-1]["sequence"])
        finally:
            driver.quit()


if __name__ == "__main__":
    os.environ["SE_OFFLINE"] = "true"
    suite = unittest.TestSuite()
    for case in (PageTest, ReportTest, HallReportTest, LostReportTest, LayoutTest, NoWebglTest):
        suite.addTests(unittest.defaultTestLoader.loadTestsFromTestCase(case))
    sys.exit(not unittest.TextTestRunner(verbosity=2).run(suite).wasSuccessful())
