#!/usr/bin/env python3
"""generated_test.py SOURCE_ROOT CARGO TARGET_FOLDER WORK_FOLDER: the Rust of client/README.md, its build.rs and its modules, is a crate that compiles. TARGET_FOLDER
is that of the client, which has compiled the dependencies already."""
import pathlib
import re
import shutil
import subprocess
import sys

ROOT, CARGO, TARGET, WORK = sys.argv[1:5]
sys.path.insert(0, str(pathlib.Path(ROOT, "tests/house")))

from code_blocks import blocks_of  # noqa: E402


def manifest():
    """The client's, with the same dependencies, as another crate."""
    text = pathlib.Path(ROOT, "client/rust/Cargo.toml").read_text()
    return text.replace('name = "sightline-client"', 'name = "generated"')


def write_crate(folder):
    build, modules = (block.text for block in blocks_of(ROOT, "client/README.md") if block.language == "rust")
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "src").mkdir(parents=True)
    (folder / "proto").symlink_to(pathlib.Path(ROOT, "proto"))
    (folder / "Cargo.toml").write_text(manifest())
    lock = pathlib.Path(ROOT, "client/rust/Cargo.lock").read_text()
    (folder / "Cargo.lock").write_text(re.sub(r'name = "sightline-client"', 'name = "generated"', lock))
    (folder / "build.rs").write_text(build)
    (folder / "src/lib.rs").write_text(modules + "pub type Client = CameraControlServiceClient<tonic::transport::Channel>;\n")


if __name__ == "__main__":
    write_crate(pathlib.Path(WORK))
    sys.exit(subprocess.run([CARGO, "build", "--release", "--offline", "--target-dir", TARGET], cwd=WORK).returncode)
