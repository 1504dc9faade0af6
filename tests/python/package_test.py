"""The Python package as users install it: package_test.py SIGHTLINED SOURCE_ROOT WORK_FOLDER.

Builds the wheel from a copy of what it needs, without the build of the server. Checks its types, and runs the example from it with the
oldest and the newest Python from 3.10 to 3.13 that this machine has.
"""
import pathlib
import shutil
import subprocess
import sys
import unittest

SIGHTLINED, ROOT, WORK = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
sys.path.insert(0, str(ROOT / "tests/conformance"))

from daemon import Daemon  # noqa: E402


def run(*command, **more):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, **more)
    if done.returncode != 0:
        raise AssertionError(f"{command}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}")
    return done.stdout


def pythons():
    """The interpreters by version: those on the PATH, and those of pyenv."""
    found = {}
    folders = []
    if shutil.which("pyenv"):
        folders = sorted(pathlib.Path(run("pyenv", "root").strip(), "versions").glob("3.*/bin"))
    for version in ("3.10", "3.11", "3.12", "3.13"):
        for candidate in (f"/usr/bin/python{version}", *(folder / f"python{version}" for folder in folders)):
            if pathlib.Path(candidate).exists():
                found.setdefault(version, candidate)
    return {version: found[version] for version in (min(found), max(found))}


def environment(python, *packages):
    """An environment with these packages, kept between runs as long as they are the same."""
    folder = WORK / f"venv-{pathlib.Path(python).name}"
    if not (folder / "bin/python").exists():
        run(python, "-m", "venv", folder)
    run(folder / "bin/python", "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--only-binary", ":all:", *packages)
    return folder / "bin"


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        checkout = WORK / "checkout"
        shutil.rmtree(checkout, ignore_errors=True)
        for folder in ("proto/sightline", "client/python"):
            shutil.copytree(ROOT / folder, checkout / folder, ignore=shutil.ignore_patterns("build", "*.egg-info", "__pycache__"))
        cls.package = checkout / "client/python"
        run(sys.executable, "-m", "venv", WORK / "builder")
        run(WORK / "builder/bin/pip", "--disable-pip-version-check", "wheel", "--quiet", "--no-deps", "--wheel-dir", checkout, cls.package)
        cls.wheel, = checkout.glob("*.whl")

    def test_types_are_right(self):
        tools = environment(sys.executable, f"{self.wheel}[check]")
        run(tools / "pip", "--disable-pip-version-check", "install", "--quiet", "--no-deps", "--force-reinstall", self.wheel)
        run(tools / "mypy", "--config-file", self.package / "pyproject.toml", "-p", "sightline_client")
        run(tools / "mypy", "--check-untyped-defs", self.package / "example.py", cwd=WORK)
        wrong = self.package / "wrong.py"
        wrong.write_text("from sightline_client import box\nbox('wide', 1, 1)\n")
        with self.assertRaisesRegex(AssertionError, "incompatible type"):
            run(tools / "mypy", wrong, cwd=WORK)

    def test_the_example_runs_with_old_and_new_pythons(self):
        with Daemon(SIGHTLINED) as daemon:
            example = WORK / "example.py"
            example.write_text((self.package / "example.py").read_text().replace("127.0.0.1:50151", daemon.address))
            for version, python in pythons().items():
                with self.subTest(python=version):
                    tools = environment(python, self.wheel)
                    run(tools / "pip", "--disable-pip-version-check", "install", "--quiet", "--no-deps", "--force-reinstall", self.wheel)
                    lines = run(tools / "python", "-W", "error", example, cwd=WORK).splitlines()
                    self.assertEqual(len(lines), 300)
                    self.assertGreater(len(set(lines)), 100)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:])
