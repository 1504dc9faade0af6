"""The page on trust: it agrees with the files beside it, and names tests that exist."""
import pathlib
import re
import unittest

import make_page

TESTS = pathlib.Path(__file__).parents[2]


def names_of_tests():
    found = set()
    for path in TESTS.rglob("*.cpp"):
        found |= {f"{suite}.{name}" for suite, name in re.findall(r"^TEST(?:_F|_P)?\((\w+),\s*(\w+)\)", path.read_text(), re.M)}
    for path in TESTS.rglob("CMakeLists.txt"):
        text = path.read_text()
        for name in re.findall(r"add_test\(NAME\s+(\S+)", text):
            for part in re.findall(r"foreach\(\w+ ([\w ]+)\)", text)[:1] or [""]:
                found |= {re.sub(r"\$\{\w+\}", value, name) for value in part.split() or [""]}
    return found


class Page(unittest.TestCase):
    def test_it_agrees_with_its_files(self):
        self.assertEqual((make_page.HERE / "README.md").read_text(), make_page.page())

    def test_every_test_that_it_names_exists(self):
        names = names_of_tests()
        for command in make_page.commands():
            for part in command.split("|"):
                with self.subTest(part):
                    self.assertTrue(any(re.search(part, name) for name in names), part)


if __name__ == "__main__":
    unittest.main()
