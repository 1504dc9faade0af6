"""Generates the messages into the package. Everything else is in pyproject.toml."""
import importlib.resources
import pathlib

from grpc_tools import protoc
from setuptools import setup
from setuptools.command.build_py import build_py

HERE = pathlib.Path(__file__).parent.absolute()
PROTO = HERE.parent.parent / "proto"


class GenerateMessages(build_py):
    def run(self):
        super().run()
        out = pathlib.Path(self.build_lib)
        details = HERE / "sightline_client/call_details.proto"
        protos = [*sorted((PROTO / "sightline").rglob("*.proto")), details]
        builtin = importlib.resources.files("grpc_tools") / "_proto"
        command = ["protoc", f"-I{PROTO}", f"-I{HERE}", f"-I{builtin}", f"--python_out={out}", f"--pyi_out={out}", *map(str, protos)]
        if protoc.main(command) != 0:
            raise SystemExit("protoc failed")
        (out / "sightline/py.typed").touch()


setup(cmdclass={"build_py": GenerateMessages})
