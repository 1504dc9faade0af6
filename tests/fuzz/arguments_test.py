"""Wrong arguments of the command that fuzzes: arguments_test.py FUZZ_SH. Right ones would install packages and fuzz, so they are not tried."""
import subprocess
import sys
import unittest

FUZZ = sys.argv[1]


class Arguments(unittest.TestCase):
    def refused(self, *arguments):
        result = subprocess.run([FUZZ, *arguments], capture_output=True, text=True, timeout=20)
        self.assertEqual((result.returncode, result.stdout), (2, ""), arguments)
        return result.stderr

    def test_minutes_that_are_not_positive_are_refused(self):
        for minutes in ("0", "0.0", "00", "-1", "", ".", "five", "1e3", "5m", "5 ", "1.2.3", "nan", "inf"):
            with self.subTest(minutes=minutes):
                self.assertIn(f"got '{minutes}'", self.refused(minutes, "access"))

    def test_an_unknown_target_is_refused_before_the_others_run(self):
        self.assertIn("nosuch", self.refused("0.01", "access", "nosuch"))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
