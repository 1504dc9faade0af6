"""Pages that `sightline report` writes of recordings, in a real browser, held against the files as the format's own reader has
them. page_test.py runs these tests with its own."""
import json
import math
import pathlib
import subprocess

from browsing import Browsing, By, Keys, MAKE_RECORDING, OUT, READER, SIGHTLINE


def words(value, prefix):
    """An enum value of the contract as the page shows it: TRACKING_STATUS_PARTIAL_VIEW -> "partial view"."""
    assert value.startswith(prefix), value
    return value.removeprefix(prefix).lower().replace("_", " ")


class Reader:
    """Replies of a recording as the format's own reader has them, and as a person would put them into the canonical frame."""

    def __init__(self, path):
        script = pathlib.Path(__file__).with_name("recorded_replies.py")
        done = subprocess.run([READER, script, path], check=True, capture_output=True, text=True, timeout=120)
        self.replies = json.loads(done.stdout)

    def position(self, i):
        """Of a session in Unreal's convention: centimetres, (x, z, y); the world's origin is at (1000, 20, -500) m."""
        p = self.replies[i]["pose"]["position"]
        return [p["x"] / 100 - 1000, p["z"] / 100 - 20, p["y"] / 100 + 500]

    def fov_degrees(self, i):
        half = math.radians(self.replies[i]["field_of_view"]) / 2
        return math.degrees(2 * math.atan(math.tan(half) / (16 / 9)))


class ReportTest(Browsing):
    """The report of an eventful session in Unreal's convention."""

    @classmethod
    def setUpClass(cls):
        subprocess.run([MAKE_RECORDING, OUT], check=True, capture_output=True, timeout=300)
        for name in ("yard", "hall", "lost"):
            subprocess.run([SIGHTLINE, "report", OUT / f"{name}.mcap", "--out", OUT / f"{name}.html", "--pictures", "12"],
                           check=True, capture_output=True, timeout=300)
        cls.page = OUT / "yard.html"
        cls.file = Reader(OUT / "yard.mcap")
        super().setUpClass()

    def number(self, field):
        return float(self.text(field).split()[0].rstrip("°%"))

    def frame_of(self, tick):
        """The first frame that answers for a tick, counted from 0."""
        return next(i for i, reply in enumerate(self.file.replies) if int(reply["sequence"]) > tick)

    def assert_lens(self, frame):
        for value, wanted in zip(self.view()["lens"]["position"], self.file.position(frame)):
            self.assertAlmostEqual(value, wanted, places=6)

    def test_it_opens_with_the_facts_of_the_file(self):
        self.assertEqual(self.find("#title").text, "yard")
        facts = self.find("#facts").get_attribute("textContent")
        for fact in ("samplerembree", "server1.2.3", "start2023-11-14 22:13:20 UTC", "seed5", "conventionUNREAL",
                     f"replies{len(self.file.replies)}", "refused1", "faults1", "missing2"):
            self.assertIn(fact, facts)
        self.assertEqual(self.text("frame"), f"0 of {len(self.file.replies)}")
        self.assert_lens(0)

    def test_the_numbers_are_those_of_the_file(self):
        for frame in (0, 5, 40, self.frame_of(60), 100, len(self.file.replies) - 1):
            with self.subTest(frame=frame):
                self.go(frame)
                self.check_numbers(frame)

    def check_numbers(self, frame):
        reply = self.file.replies[frame]
        self.assertEqual(self.text("sequence"), reply["sequence"])
        self.assertEqual(self.text("time"), f"{reply['pose_time_s']:.4f} s")
        for value, wanted in zip(self.text("position").split(), self.file.position(frame)):
            self.assertAlmostEqual(float(value), wanted, delta=0.00051)
        self.assertAlmostEqual(self.number("fov"), self.file.fov_degrees(frame), delta=0.0051)
        speed = math.hypot(*(reply["velocity"][axis] for axis in "xyz")) / 100
        self.assertAlmostEqual(self.number("speed"), speed, delta=0.0051)
        # The nearest collider is the floor, which lies at height 0, or something nearer.
        self.assertGreater(self.number("clearance"), 0)
        self.assertLess(self.number("clearance"), self.file.position(frame)[1] + 0.0051)
        for field, prefix in (("status", "TRACKING_STATUS_"), ("reason", "MOVE_REASON_")):
            self.assertEqual(self.text(field), words(reply[field], prefix))
        for field in ("all_visible", "some_visible", "none_visible"):
            self.assertEqual(self.text(field), str(reply["candidate_counts"][field]))
        self.assertEqual(self.text("merged"), str(reply["merged_ticks"]))
        self.assertEqual("degraded" in self.text("flags"), reply["flags"]["degraded"])
        for i, stage in enumerate(("scene", "bound", "sample", "aggregate", "move")):
            self.assertAlmostEqual(self.number(f"stage-{i}"), reply["stage_times"][f"{stage}_us"], delta=0.06)
        self.assertAlmostEqual(self.number("queue"), reply["stage_times"]["queue_us"], delta=0.06)
        self.assertAlmostEqual(self.number("latency"), 1.5, delta=0.0051)
        seen = {target["id"]: target for target in reply["targets"]}
        for k, target in enumerate(("10", "11", "12")):
            self.check_target(k, seen.get(target))

    def check_target(self, k, seen):
        if seen is None:
            self.assertEqual(self.text(f"visible-{k}"), "–")
            self.assertEqual(self.text(f"state-{k}"), "no target now")
            return
        self.assertAlmostEqual(self.number(f"visible-{k}"), 100 * seen["visible_share"], delta=0.051)
        self.assertAlmostEqual(self.number(f"filtered-{k}"), 100 * seen["filtered_share"], delta=0.051)
        self.assertAlmostEqual(self.number(f"distance-{k}"), seen["distance"] / 100, delta=0.0051)
        self.assertEqual(self.text(f"state-{k}"), words(seen["state"], "TARGET_STATE_"))

    def test_scrubbing_moves_the_camera_of_the_3d_view(self):
        line = self.find("#timeline")
        seen = set()
        for part in (0.2, 0.5, 0.8):
            self.click_at(line, 124 + part * (line.rect["width"] - 132), 60)
            self.assert_lens(self.frame())
            seen.add(self.picture())
        self.assertEqual(len(seen), 3)

    def test_the_keyboard_steps_and_jumps_to_what_happened(self):
        self.press(Keys.ARROW_RIGHT)
        self.assertEqual(self.frame(), 1)
        self.press_with_shift(Keys.ARROW_RIGHT)
        time_s = self.file.replies[1]["pose_time_s"] + 1
        self.assertAlmostEqual(self.file.replies[self.frame()]["pose_time_s"], time_s, delta=1 / 60 + 1e-6)
        self.press(Keys.END)
        self.assertEqual(self.frame(), len(self.file.replies) - 1)
        self.press(Keys.HOME)
        fault = self.frame_of(40)
        reached = [self.frame()]
        while reached[-1] < fault:
            self.press("]")
            self.assertGreater(self.frame(), reached[-1])
            reached.append(self.frame())
        self.assertEqual(reached[-1], fault)
        self.assertIn("the device was away <for a moment>", self.find("#frame-events").text)

    def test_the_list_of_events_leads_to_them(self):
        self.find("#tab-run").click()
        events = self.find("#events").find_elements(By.CSS_SELECTOR, "li")
        self.assertEqual([event.find_element(By.CSS_SELECTOR, "b").text for event in events],
                         ["rejection", "fault", "change", "gap", "change", "change"])
        events[2].find_element(By.CSS_SELECTOR, "button").click()
        self.rest()
        self.assertEqual(self.frame(), self.frame_of(60))

    def test_the_figures_are_those_of_the_file(self):
        self.find("#tab-run").click()
        lines = self.find("#panel-run").text.splitlines()
        shares = [t["visible_share"] for reply in self.file.replies for t in reply["targets"] if t["id"] == "10"]
        self.assertIn(f"visible share: target 10 {100 * sum(shares) / len(shares):.2f} %", lines)
        places = [self.file.position(i) for i in range(len(self.file.replies))]
        travel = sum(math.dist(a, b) for a, b in zip(places, places[1:]))
        self.assertIn(f"camera travel {travel:.2f} m", lines)
        self.assertIn(f"ticks merged into a later reply {sum(reply['merged_ticks'] for reply in self.file.replies)}", lines)

    def test_instances_are_drawn_in_their_frames_alone(self):
        crate, pillar = "20", "3"
        for tick, shown in ((29, {pillar}), (31, {pillar, crate}), (82, {crate}), (92, set()), (111, {pillar})):
            with self.subTest(tick=tick):
                self.go(self.frame_of(tick))
                self.assertEqual(set(self.view()["drawn"]) & {crate, pillar}, shown)

    def test_what_comes_and_goes_changes_the_picture(self):
        self.go(self.frame_of(79))
        self.press("1")
        with_pillar = self.picture()
        self.go(self.frame_of(81))
        self.assertNotEqual(self.picture(), with_pillar)

    def test_the_cells_of_steps_taken_again_are_as_many_as_the_reply_counts(self):
        for frame in (10, 77, 130):
            self.go(frame)
            self.assertIn(int(self.text("cells_of")), (frame - 1, frame))  # of the last decision
            self.assertEqual(self.view()["cells"], self.file.replies[frame]["candidate_counts"]["total"])

    def test_notices_stand_above_and_can_be_closed(self):
        self.assertIn("2 messages were not recorded", self.find("#notices").text)
        self.find("#notices-close").click()
        self.assertFalse(self.find("#notices").is_displayed())
        self.assert_lens(0)

    def test_the_settings_are_whole(self):
        self.find("#tab-settings").click()
        text = self.find("#panel-settings").text
        for part in ("Settings in effect at the start", "Settings in effect at the end", "Tuning in effect at the start", '"max_speed_mps": 4', '"points": 8'):
            self.assertIn(part, text)


class HallReportTest(Browsing):
    """The report of the hall, its scene taken from the recording."""

    @classmethod
    def setUpClass(cls):
        cls.page = OUT / "hall.html"
        super().setUpClass()

    def test_the_scene_and_its_names_are_there(self):
        self.assertFalse(self.find("#notices").is_displayed())
        self.assertGreater(len(self.view()["drawn"]), 20)
        self.assertIn("target-1", self.find("#panel-frame").text)
        self.go(299)
        self.assertGreater(self.view()["cells"], 0)
        self.press("c")
        self.assertTrue(self.view()["through"])


class LostReportTest(Browsing):
    """The same where nobody has the scene any more."""

    @classmethod
    def setUpClass(cls):
        cls.page = OUT / "lost.html"
        super().setUpClass()

    def test_what_is_known_is_shown_and_what_is_missing_said(self):
        self.assertIn("A scene file is missing", self.find("#notices").text)
        self.assertEqual(self.view()["cells"], 0)
        self.press(Keys.END)
        self.assertEqual(self.frame(), 59)
        self.assertEqual(self.text("true-0"), "–")
