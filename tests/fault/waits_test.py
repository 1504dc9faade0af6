"""waits_test.py: only the faults that a client cannot notice earlier excuse a long wait."""
import unittest

from waits import NOTICED_BY_TIMEOUT, Wait, too_long


class TooLong(unittest.TestCase):
    def test_a_silent_network_and_a_stopped_daemon_excuse_their_own_waits_only(self):
        excused = [Wait(fault, 2.5) for fault in NOTICED_BY_TIMEOUT]
        late = [Wait("cut", 1.1), Wait("daemon killed", 1.1), Wait("none", 1.1)]
        self.assertEqual(too_long(excused + late, 1.0, 2.0), late)

    def test_what_is_excused_has_a_limit_too(self):
        self.assertEqual(len(too_long([Wait("silent", 3.1), Wait("silent", 2.9)], 1.0, 2.0)), 1)

    def test_without_a_limit_nothing_is_too_long(self):
        self.assertEqual(too_long([Wait("cut", 60.0)], None, 2.0), [])


if __name__ == "__main__":
    unittest.main()
