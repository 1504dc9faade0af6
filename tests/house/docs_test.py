#!/usr/bin/env python3
"""Runs the code in the documents: docs_test.py SOURCE_ROOT BIN_FOLDER PYTHON_FOLDER CPP_PROGRAM.

C++: the program of client/README.md is built by CMake and run here against a daemon; other C++ is compiled by the build. Python blocks are
run against a daemon. Shell commands are run in a scratch folder that looks like the repository. Those that take too long or need
what a test has not are listed in NOT_RUN with the reason; of these, the flags are checked against the program's --help.
"""
import importlib.util
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest

from code_blocks import DOCUMENTS, all_blocks

# Commands that are not run, and why. The flags of our own programs are checked all the same.
NOT_RUN = (
    (r"^tests/run\.sh|^PRESET=", "builds everything and runs this test"),
    (r"^(FORMER=\S+ )?tests/(sanitizers|fuzz|soak|mutation|skew|fault)\.sh", "takes minutes to hours"),
    (r"^tests/check\.sh", "needs the repository itself; .ci/run runs it"),
    (r"^deploy/demo\.sh", "builds, and draws pictures for several seconds; --help is run instead"),
    (r"^docker ", "needs docker"),
    (r"^dotnet ", "needs a .NET SDK; CSharpBuild compiles with Mono"),
    (r"^apt-get |--target packages$", "Packages makes the packages and unpacks them"),
    (r"^deploy/install-packages\.sh", "installs packages on this machine"),
    (r"^tests/deploy/arm64\.sh", "cross-compiles for half an hour"),
    (r"^(go install|grpcurl|ghz) ", "GrpcTools installs these tools and runs the lines"),
    (r"\bgo mod edit", "edits the module of the reader's program"),
    (r"^client/go/generate.sh", "needs Go; GoGenerated runs it"),
    (r"npm run generate", "NodeBuild runs it"),
    (r"^cmake .*build/client", "CppPackage builds and installs the client"),
    (r"pkg-config", "CppPackage finds the installed client by it"),
    (r"^cd client/rust|^cargo build", "RustClient builds the crate and its example"),
    (r"^pip ", "PythonPackage builds and installs the wheel"),
    (r"npm ci", "NodeBuild installs, generates and compiles"),
    (r"make_sessions\.py", "would write into the repository; Conformance compares what it writes"),
    (r"/\w+_bench\b|/step_digest\b", "a benchmark; takes minutes"),
    (r"^kubectl ", "needs a cluster; Manifests checks what it applies"),
    (r"^curl |^sightlined --metrics-listen|^sightlined healthcheck|^sightline (status|top|sessions)", "Metrics runs these on free ports"),
    (r"^sightlined(?!.*(&$| devices| --print-config))", "does not end by itself"),
    (r"^sightline evaluate(?!.*--scene)", "takes minutes"),
    (r"^mcap ", "needs the format's own command, which no registry of packages has"),
    (r"^sightline bench", "measures for a minute, or needs a daemon's process id"),
)
DEFAULT_ADDRESS = "127.0.0.1:50151"
POOL_ADDRESS = "sightline-pool.sightline.svc:50151"  # of KUBERNETES.md


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def commands(block):
    """The commands of a shell block, without comments. A comment "exits with 1" says that the command must."""
    lines = []
    for line in re.sub(r"\\\n\s*", " ", block.text).splitlines():
        command = re.sub(r"(^|\s)#.*$", "", line).strip()
        if command:
            lines.append(f"if {command}; then exit 9; else [ $? = 1 ]; fi" if "# " in line and "exits with 1" in line else command)
    return lines


def plain(command):
    """Without the folder of the build."""
    return command.replace("build/release/bin/", "")


def why_not(command):
    return next((why for pattern, why in NOT_RUN if re.search(pattern, plain(command)) or re.search(pattern, command)), None)


def built_by_demo():
    """Which programs, and whether the folder for Python, exist in a fresh checkout after deploy/demo.sh."""
    targets = re.search(r"cmake --build .* --target (.*)", (ROOT / "deploy/demo.sh").read_text()).group(1).split()
    build = subprocess.run(["ninja", "-C", BIN.parent, "-t", "commands", *targets], capture_output=True, text=True, check=True).stdout
    programs = set(re.findall(r"-o bin/(\S+)", build))
    return lambda path: path.name in programs or f"--python_out={path} " in build


class Workshop:
    """A folder that looks like the repository with its build, whose programs talk to the daemon of the test. exists: which programs and
    folders of the build it has."""

    def __init__(self, folder, exists=lambda path: True):
        self.folder = pathlib.Path(folder)
        self.exists = exists
        self.bin = self.folder / "build/release/bin"
        self.bin.mkdir(parents=True)
        for program in BIN.iterdir():
            if program.name not in ("sightline", "sightlined") and exists(program):
                (self.bin / program.name).symlink_to(program)
        if exists(STUBS):
            (self.folder / "build/release/python").symlink_to(STUBS)
        for name in ("deploy", "proto", "scenes", "server", "tests"):
            (self.folder / name).symlink_to(ROOT / name)
        (self.folder / "out").mkdir()
        (self.folder / "client/python").mkdir(parents=True)
        self.port = free_port()
        # Scenes are played for a second only.
        self.wrapper("sightline", 'case "$1" in drive|evaluate|demo) set -- "$@" --duration 1 ;; esac\n'
                     f'case "$*" in *--server*) ;; drive*) set -- "$@" --server 127.0.0.1:{self.port} ;; esac\n'
                     f'exec {BIN}/sightline "$@"')

    def wrapper(self, name, script):
        if not self.exists(BIN / name):
            return
        path = self.bin / name
        path.write_text(f"#!/bin/bash\n{script}\n")
        path.chmod(0o755)

    def listen_on(self, port):
        """Where a daemon of the documents listens, and where the example looks for it."""
        for example in (ROOT / "client/python").glob("*.py"):
            (self.folder / "client/python" / example.name).write_text(example.read_text().replace(DEFAULT_ADDRESS, f"127.0.0.1:{port}"))
        self.wrapper("sightlined", f'case "$1" in devices|--print-config) ;; *) set -- "$@" --listen 127.0.0.1:{port} --log-level warning ;; esac\n'
                     f'exec {BIN}/sightlined "$@"')

    def environment(self):
        inherited = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        return dict(inherited, PATH=f"{self.bin}:/usr/bin:{os.environ['PATH']}")

    def bash(self, script, timeout=120):
        return subprocess.run(["bash", "-euo", "pipefail", "-c", script], cwd=self.folder, env=self.environment(), capture_output=True,
                              text=True, timeout=timeout)


class Documents(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.shop = Workshop(cls.temporary.name)
        cls.start_daemon()
        cls.make_files()
        cls.blocks = all_blocks(ROOT)

    @classmethod
    def start_daemon(cls):
        ready = cls.shop.folder / "ready"
        cls.daemon = subprocess.Popen([BIN / "sightlined", "--listen", f"127.0.0.1:{cls.shop.port}", "--ready-file", ready, "--sampler", "embree",
                                       "--log-level", "warning", "--record-dir", cls.shop.folder / "recorded", "--record-scenes"])
        cls.addClassCleanup(cls.daemon.wait, 20)
        cls.addClassCleanup(cls.daemon.terminate)
        deadline = time.monotonic() + 60
        while not ready.exists():
            if cls.daemon.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError("the daemon did not start")
            time.sleep(0.02)

    @classmethod
    def make_files(cls):
        """The files that the documents speak of: a scene, a recording of three seconds, and the same, cut off."""
        made = cls.shop.bash(f"make-scenes --out . hall && cp hall.glb my_level.glb && {BIN}/sightline drive hall.glb --duration 3"
                             f" --no-truth --server 127.0.0.1:{cls.shop.port} --out made && sleep 1.2 && cp recorded/*.mcap hall.mcap")
        assert made.returncode == 0, made.stderr + made.stdout
        whole = (cls.shop.folder / "hall.mcap").read_bytes()
        (cls.shop.folder / "broken.mcap").write_bytes(whole[:len(whole) * 2 // 3])

    def of_language(self, language):
        return [block for block in self.blocks if block.language == language]

    def test_every_block_says_its_language(self):
        known = {"cpp", "python", "js", "sh", "json", "text", "cmake", "yaml", "rust", "go"}
        self.assertEqual([], [f"{b.path}:{b.line}: {b.language or 'none'}" for b in self.blocks if b.language not in known])

    def test_no_code_is_indented_instead(self):
        for path in (path for path in DOCUMENTS if path.endswith(".md")):
            text = re.sub(r"^```.*?^```", "", (ROOT / path).read_text(encoding="utf-8"), flags=re.S | re.M)
            self.assertNotRegex(text, r"\n\n    \S", f"{path}: a fence with its language makes code testable")

    def test_the_cpp_program_moves_a_camera(self):
        done = subprocess.run([PROGRAM, f"127.0.0.1:{self.shop.port}"], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.expect_a_moving_camera(done.stdout)

    def test_a_game_adds_the_client_to_its_build(self):
        (block,) = (block for block in self.of_language("cmake") if block.path == "client/README.md")
        with tempfile.TemporaryDirectory() as folder:
            game = pathlib.Path(folder)
            (game / "sightline").symlink_to(ROOT)
            (game / "game.cpp").touch()
            (game / "CMakeLists.txt").write_text("cmake_minimum_required(VERSION 3.25)\nproject(game LANGUAGES C CXX)\n"
                                                 f"add_executable(game game.cpp)\n{block.text}")
            done = subprocess.run(["cmake", "-S", game, "-B", game / "build", "-G", "Ninja"], capture_output=True, text=True, timeout=120)
            self.assertEqual(done.returncode, 0, done.stderr)
            build = subprocess.run(["ninja", "-C", game / "build", "-t", "commands", "game"], capture_output=True, text=True, check=True).stdout
            compile_game = next(line for line in build.splitlines() if line.endswith("game.cpp"))
            self.assertRegex(compile_game, f"-I{game / 'sightline'} .*-std=[a-z+]*20")
            self.assertNotIn("-W", compile_game, "a game keeps its own warnings")
            self.assertNotIn("sightlined", build)

    def test_python_moves_a_camera(self):
        cameras = [block for block in self.of_language("python") if "sightline_client" in block.text]
        self.assertTrue(cameras)
        for block in cameras:
            with self.subTest(block=f"{block.path}:{block.line}"):
                text = block.text.replace(DEFAULT_ADDRESS, f"127.0.0.1:{self.shop.port}").replace(POOL_ADDRESS, f"localhost:{self.shop.port}")
                done = subprocess.run([sys.executable, "-c", text], env=dict(self.shop.environment(), PYTHONPATH=str(STUBS)),
                                      capture_output=True, text=True, timeout=60)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.expect_a_moving_camera(done.stdout)

    def test_other_python_compiles(self):
        """It needs packages that this test has not; OfficialRecordings reads recordings with them."""
        for block in self.of_language("python"):
            compile(block.text, f"{block.path}:{block.line}", "exec")

    @unittest.skipUnless(shutil.which("node"), "node is not installed")
    def test_javascript_has_no_syntax_errors(self):
        self.assertTrue(self.of_language("js"))
        for block in self.of_language("js"):
            with self.subTest(block=f"{block.path}:{block.line}"):
                path = self.shop.folder / "block.mjs"
                path.write_text(block.text)
                done = subprocess.run(["node", "--check", path], capture_output=True, text=True, timeout=60)
                self.assertEqual(done.returncode, 0, done.stderr)

    @unittest.skipUnless(importlib.util.find_spec("yaml"), "python3-yaml is not installed")
    def test_yaml_and_json_parse(self):
        import yaml
        self.assertTrue(self.of_language("yaml"))
        for language, load in (("yaml", yaml.safe_load), ("json", json.loads)):
            for block in self.of_language(language):
                with self.subTest(block=f"{block.path}:{block.line}"):
                    member = language == "json" and not block.text.lstrip().startswith("{")  # of an object that the page does not show
                    self.assertIsInstance(load(f"{{{block.text}}}" if member else block.text), dict)

    def test_the_readme_shows_the_example(self):
        example = (ROOT / "client/python/example.py").read_text()
        self.assertIn(example, [block.text for block in self.of_language("python") if block.path == "README.md"])

    def expect_a_moving_camera(self, output):
        places = re.findall(r"camera \(([^)]*)\)", output)
        self.assertGreater(len(places), 100)
        self.assertGreater(len(set(places)), 30, "the camera hardly moved")

    def test_shell_commands_work(self):
        blocks = self.of_language("sh")
        self.assertGreater(len(blocks), 10)
        for block in blocks:
            with self.subTest(block=f"{block.path}:{block.line}"):
                self.run_block(self.shop, block)

    def test_the_readme_needs_nothing_that_its_first_command_does_not_build(self):
        exists = built_by_demo()
        self.assertTrue(exists(BIN / "sightlined"))
        self.assertFalse(exists(BIN / "scenes_test"))
        with tempfile.TemporaryDirectory() as folder:
            fresh = Workshop(folder, exists)
            for block in self.of_language("sh"):
                if block.path == "README.md":
                    with self.subTest(line=block.line):
                        self.run_block(fresh, block)

    def run_block(self, shop, block):
        lines = [command for command in commands(block) if not why_not(command)]
        if not lines:
            return
        own_daemon = any(line.endswith("&") for line in lines)
        port = free_port() if own_daemon else shop.port
        shop.listen_on(port)
        waiting = f"for _ in $(seq 200); do (exec 3<>/dev/tcp/127.0.0.1/{port}) 2>/dev/null && break; sleep 0.1; done"
        script = ["trap 'kill $(jobs -p) 2>/dev/null || true' EXIT"]
        for line in lines:
            script.append(line.replace(DEFAULT_ADDRESS, f"127.0.0.1:{port}"))
            if line.endswith("&"):
                script.append(waiting)
        done = shop.bash("\n".join(script))
        self.assertEqual(done.returncode, 0, "\n".join(script) + "\n" + done.stdout[-2000:] + done.stderr[-2000:])

    def test_flags_of_commands_that_are_not_run_exist(self):
        for block in self.of_language("sh"):
            for command in commands(block):
                words = plain(command).split()
                if why_not(command) and words[0] in ("sightline", "sightlined", "deploy/demo.sh"):
                    with self.subTest(command=command):
                        self.check_flags(words)

    def check_flags(self, words):
        verb = words[1:2] if words[0] == "sightline" or words[1:2] == ["healthcheck"] else []
        program = words[0] if "/" in words[0] else BIN / words[0]
        done = subprocess.run([program, *verb, "--help"], cwd=ROOT, capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        if words[0] == "sightlined" and verb:  # it takes the daemon's flags too
            done.stdout += subprocess.run([program, "--help"], capture_output=True, text=True, timeout=60).stdout
        for flag in (word.split("=")[0] for word in words if word.startswith("--")):
            self.assertRegex(done.stdout, rf"(^|[\s,\[(]){re.escape(flag)}\b", f"{flag} in {' '.join(words)}")

    def test_programs_that_are_not_run_exist(self):
        for block in self.of_language("sh"):
            for command in commands(block):
                for program in re.findall(r"build/release/bin/(\S+)", command):
                    self.assertTrue((BIN / program).exists() or program.endswith("_bench") or program == "step_digest", f"{block.path}: {program}")
                    self.assertTrue((BIN / program).exists() or (ROOT / "tests/bench").exists(), program)

    def test_what_is_not_run_is_in_some_document(self):
        lines = [line for block in self.of_language("sh") for line in commands(block)]
        for pattern, why in NOT_RUN:
            self.assertTrue(any(re.search(pattern, plain(line)) or re.search(pattern, line) for line in lines), f"nothing matches {pattern} ({why})")

    def test_settings_that_the_page_about_tuning_names_exist(self):
        settings = set(re.findall(r"^\| `((?:settings|limits|tuning)\.[\w.]+)`", (ROOT / "proto/SETTINGS.md").read_text(), re.M))
        named = re.findall(r"^\| .* \| .* \| (.*) \|$", (ROOT / "client/TUNING.md").read_text(), re.M)
        words = {word for cell in named for word in re.findall(r"`([a-z][\w.]*_[\w.]+|tuning\.[\w.]+|limits\.[\w.]+)`", cell)}
        fields = {"attached_ids", "part_ids", "filtered_share", "visible_share"}  # of messages, not of settings
        self.assertGreater(len(words), 20)
        for word in words - fields:
            full = word if "." in word else f"settings.{word}"
            self.assertTrue(full in settings or any(name.startswith(full + ".") for name in settings), word)

    def test_links_lead_to_files(self):
        tracked = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
        self.assertIn("README.md", tracked)
        for path in tracked:
            text = re.sub(r"```.*?```", "", (ROOT / path).read_text(encoding="utf-8"), flags=re.S)
            for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
                if not re.match(r"[a-z]+:", target):
                    self.assertTrue((ROOT / path).parent.joinpath(target).exists(), f"{path}: {target}")


if __name__ == "__main__":
    ROOT, BIN, STUBS, PROGRAM = (pathlib.Path(argument).absolute() for argument in sys.argv[1:5])
    unittest.main(argv=sys.argv[:1] + sys.argv[5:])
