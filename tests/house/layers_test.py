#!/usr/bin/env python3
"""Checks every #include against the targets that CMake knows: layers_test.py SOURCE_ROOT LINK_GRAPH_JSON.

A file may include a header of this repository only if its target links the target that the header belongs to, and a header of
a library only if its target links that library. What counts as linked is what CMake hands on: all direct links of the target,
and from there on what is PUBLIC or INTERFACE. The check follows includes through headers, so a public header that includes
something its target links only PRIVATE is found at the target that suffers from it.

A header belongs to the target that compiles the .cpp of the same name. A header without one belongs to the target that lists it
(HEADERS of sightline_library), or to the only target of its folder. In tests/ such a header belongs to whoever includes it.
"""
import collections
import json
import pathlib
import re
import shutil
import sys
import tempfile
import unittest

# Folders that are checked.
ROOMS = ("server", "client", "scenes", "tests")
# The rooms of the server that may use gRPC, protobuf and the generated messages. All others must not even link them.
KNOW_THE_NETWORK = ("rpc", "wire", "record", "service", "metrics")
# Rooms of the server that clients must not include.
CLOSED_TO_CLIENTS = ("service", "metrics", "schedule")
# Libraries whose headers only these targets may include, directly or through other headers. (Tests may.)
CONFINED = {
    "OpenGL": ("sightline_gl", "sightline_sample_egl"),
    "Embree": ("sightline_sample_embree",),
}
# Header, usual name of the library, CMake target. An unknown header is an error, so this list is complete.
LIBRARIES = [(re.compile(pattern), name, target) for pattern, name, target in (
    (r"grpc(pp)?/", "gRPC", "gRPC::grpc++"),
    (r"google/protobuf/", "protobuf", "protobuf::libprotobuf"),
    (r"embree[34]/", "Embree", "embree"),
    (r"epoxy/egl|EGL/", "OpenGL", "PkgConfig::EGL"),
    (r"epoxy/|GL/|GLES", "OpenGL", "PkgConfig::EPOXY"),
    (r"glm/", "GLM", "glm::glm"),
    (r"tl/expected\.hpp$", "expected", "expected"),
    (r"xxhash\.h$", "xxHash", "PkgConfig::XXHASH"),
    (r"zstd\.h$", "zstd", "PkgConfig::ZSTD"),
    (r"openssl/ssl", "OpenSSL", "OpenSSL::SSL"),
    (r"openssl/", "OpenSSL", "OpenSSL::Crypto"),
    (r"lz4frame\.h$", "lz4", "PkgConfig::LZ4"),
    (r"zlib\.h$", "zlib", "ZLIB::ZLIB"),
    (r"stb/", "stb", "stb"),
    (r"tiny_gltf\.h$", "tinygltf", "TinyGLTF::TinyGLTF"),
    (r"nlohmann/", "nlohmann-json", "nlohmann_json::nlohmann_json"),
    (r"draco/", "Draco", "draco::draco"),
    (r"meshoptimizer\.h$", "meshoptimizer", "meshoptimizer::meshoptimizer"),
    (r"spdlog/", "spdlog", "spdlog::spdlog"),
    (r"CLI/", "CLI11", "CLI11::CLI11"),
    (r"gtest/", "GoogleTest", "GTest::gtest"),
    (r"gmock/", "GoogleTest", "GTest::gmock"),
    (r"benchmark/", "Google Benchmark", "benchmark::benchmark"),
    (r"btBullet", "Bullet", "PkgConfig::BULLET"),
    (r"prometheus/", "prometheus-cpp", "PkgConfig::PROMETHEUS"),
    (r"systemd/", "systemd", "PkgConfig::SYSTEMD"),
)]
# The C++ library, and what Linux, glibc and the compiler bring.
SYSTEM = re.compile(r"[a-z_0-9]+$|(sys|linux|netinet|arpa)/|"
                    r"(unistd|dlfcn|fcntl|spawn|sched|malloc|time|stdlib|signal|poll|netdb|pwd|strings|errno|immintrin)\.h$")
INCLUDE = re.compile(r'^\s*#\s*include\s*(?:<([^>]+)>|"([^"]+)")', re.M)

Include = collections.namedtuple("Include", "path line header")


class House:
    """The files of the repository and the targets that they belong to."""

    def __init__(self, root, graph):
        self.root = pathlib.Path(root)
        self.targets = graph["targets"]
        self.includes = {}  # file -> [Include]
        for room in ROOMS:
            for path in sorted((self.root / room).rglob("*")):
                if path.suffix in (".h", ".cpp"):
                    self.read(path)
        self.compiled = collections.defaultdict(set)  # file -> targets that list it
        self.generated = {}  # "sightline/v1/camera.pb.h" -> target, by any end of its path
        for name, target in self.targets.items():
            for source in target.get("sources", ()):
                self.compiled[source].add(name)
                if source.startswith("/") and source.endswith(".h"):
                    self.add_generated(name, source)
        self.folders = collections.defaultdict(set)  # folder -> targets with files in it
        for source, names in self.compiled.items():
            self.folders[source.rpartition("/")[0]] |= names
        self.visible_, self.reached_ = {}, {}

    def read(self, path):
        text = path.read_text(encoding="utf-8")
        name = path.relative_to(self.root).as_posix()
        self.includes[name] = [Include(name, text.count("\n", 0, found.start(found.lastindex)) + 1, found.group(found.lastindex))
                               for found in INCLUDE.finditer(text)]

    def add_generated(self, target, path):
        parts = path.split("/")
        for first in range(1, len(parts) - 1):
            self.generated["/".join(parts[first:])] = target

    def handed_on(self, target):
        """What linking `target` makes available, itself included."""
        found, waiting = set(), [target]
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.add(name)
                links = self.targets.get(name, {}).get("interface", ())
                waiting += [link for link in links if not link.startswith("$<LINK_ONLY:")]
        return found

    def visible(self, target):
        """What a file of `target` may include from."""
        if target not in self.visible_:
            found = {target}
            for link in self.targets[target].get("links", ()):
                found |= self.handed_on(link)
            self.visible_[target] = found
        return self.visible_[target]

    def all_links(self, target):
        """Everything that ends up behind `target`, PRIVATE or not."""
        found, waiting = set(), [target]
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.add(name)
                row = self.targets.get(name, {})
                links = list(row.get("links", ())) + list(row.get("interface", ()))
                waiting += [re.sub(r"^\$<LINK_ONLY:(.*)>$", r"\1", link) for link in links]
        return found

    def owners(self, path):
        """Targets that a file belongs to; None: a header of tests/ that goes with whoever includes it."""
        if path in self.compiled:
            return self.compiled[path]
        folder = path.rpartition("/")[0]
        source = path.rpartition(".")[0] + ".cpp"
        if source in self.includes:
            return self.compiled.get(source, set())
        if folder.startswith("tests"):
            return None
        return self.folders[folder] if len(self.folders[folder]) == 1 else set()

    def reached(self, start):
        """{header: the first include of it} of all that a file includes, directly or through headers of the repository."""
        if start not in self.reached_:
            found, waiting = {}, [start]
            while waiting:
                for include in self.includes[waiting.pop()]:
                    if include.header not in found:
                        found[include.header] = include
                        if include.header in self.includes:
                            waiting.append(include.header)
            self.reached_[start] = found
        return self.reached_[start]

    def library(self, header):
        """(name, target) of the library or generated code that a header is from; None: not one of these."""
        if header in self.generated:
            return "generated code", self.generated[header]
        for pattern, name, target in LIBRARIES:
            if pattern.match(header):
                return name, target
        return None


def folder_of(path):
    return "/".join(path.split("/")[:2])


def units(house):
    """(file, target) of everything to check: each source in each target that compiles it, each header in each that it belongs to."""
    for path in house.includes:
        owners = house.owners(path)
        if owners is None:
            continue
        for target in sorted(owners):
            yield path, target


def check_ownership(house):
    for path in house.includes:  # tests/record/mcap_fuzz.cpp is built by its own script
        if house.owners(path) == set() and not path.startswith("tests/"):
            yield f"{path}: belongs to no target. List it in SOURCES, or in HEADERS where its folder has several targets."


def problem(house, header, target):
    """Why files of `target` may not include this, or None."""
    visible = house.visible(target)
    if header in house.includes:
        owners = house.owners(header)
        if owners and not owners & visible:
            return f"{header} belongs to {' or '.join(sorted(owners))}, which {target} does not link"
    elif found := house.library(header):
        if found[1] not in visible:
            return f"{header} is of {found[0]} ({found[1]}), which {target} does not link"
    elif not SYSTEM.match(header):
        return f"{header} is neither a file of the repository nor of a library that is known here"
    return None


def check_links(house):
    """Every include that a file reaches, against what its target links. One line for each header and target."""
    seen = set()
    for start, target in units(house):
        for header, include in house.reached(start).items():
            if (header, target) not in seen:
                seen.add((header, target))
                if why := problem(house, header, target):
                    yield f"{include.path}:{include.line}: {why} (seen from {start})"


def check_confined(house):
    """Libraries that only some targets may see, whatever they link."""
    for start, target in units(house):
        if start.startswith("tests/"):
            continue
        for header, where in house.reached(start).items():
            found = house.library(header)
            allowed = CONFINED.get(found[0]) if found else None
            if allowed and target not in allowed:
                yield f"{where.path}:{where.line}: only {' and '.join(allowed)} may see {found[0]}, not {target} (seen from {start})"


def check_below_the_wire(house):
    """Neither includes nor links of the method know that there is a network."""
    for name, target in house.targets.items():
        room = target.get("folder", "").split("/")
        if room[0] == "server" and len(room) > 1 and room[1] not in KNOW_THE_NETWORK:
            for link in sorted(house.all_links(name) & {"gRPC::grpc++", "gRPC::grpc", "protobuf::libprotobuf"}):
                yield f"{target['folder']}/CMakeLists.txt: {name} links {link}, directly or not; only {', '.join(KNOW_THE_NETWORK)} may"


def check_clients(house):
    for path, includes in house.includes.items():
        for include in includes if path.startswith("client/") else ():
            room = include.header.split("/")
            if room[0] == "server" and room[1] in CLOSED_TO_CLIENTS:
                yield f"{path}:{include.line}: {include.header}: clients do not include server/{room[1]}"


def find_cycle(edges):
    """One cycle as a list of nodes, or []."""
    done, path = set(), []

    def visit(node):
        if node in path:
            return path[path.index(node):] + [node]
        if node in done:
            return []
        path.append(node)
        for after in sorted(edges.get(node, ())):
            if cycle := visit(after):
                return cycle
        path.pop()
        done.add(node)
        return []

    for node in sorted(edges):
        if cycle := visit(node):
            return cycle
    return []


def check_cycles(house):
    """No two folders of server/, nor of client/, include each other, directly or through others."""
    for room in ("server", "client"):
        edges, example = collections.defaultdict(set), {}
        for path, includes in house.includes.items():
            for include in includes:
                a, b = folder_of(path), folder_of(include.header)
                if a != b and path.count("/") > 1 and include.header.count("/") > 1 and a.startswith(room) and b.startswith(room):
                    edges[a].add(b)
                    example.setdefault((a, b), f"{path}:{include.line}")
        cycle = find_cycle(edges)
        if cycle:
            steps = ", ".join(f"{a} -> {b} ({example[a, b]})" for a, b in zip(cycle, cycle[1:]))
            yield f"folders include each other in a circle: {steps}"


CHECKS = (check_ownership, check_links, check_confined, check_below_the_wire, check_clients, check_cycles)


def violations(root, graph):
    house = House(root, graph)
    return sorted({line for check in CHECKS for line in check(house)})


class Layers(unittest.TestCase):
    def test_files_include_only_what_their_targets_link(self):
        self.assertEqual("", "\n".join(violations(ROOT, GRAPH)))

    def test_all_files_were_seen(self):
        house = House(ROOT, GRAPH)
        self.assertGreater(len(house.includes), 300)
        self.assertGreater(sum(1 for _ in units(house)), 300)
        self.assertIn("sightline/v1/camera_control.pb.h", house.generated)


class PlantedViolations(unittest.TestCase):
    """Each plants one line in a copy of the sources, or one link in the table, and must be found there."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        for room in ROOMS:
            shutil.copytree(ROOT / room, pathlib.Path(cls.folder.name, room),
                            ignore=lambda folder, names: [n for n in names if "." in n and not n.endswith((".h", ".cpp"))])
        cls.before = set(violations(cls.folder.name, GRAPH))

    def plant(self, path, line):
        file = pathlib.Path(self.folder.name, path)
        text = file.read_text() if file.exists() else None
        self.addCleanup(lambda: file.write_text(text) if text is not None else file.unlink())
        file.write_text(f"{line}\n{text or ''}")

    def expect_found(self, *parts, graph=None):
        found = [line for line in violations(self.folder.name, graph or GRAPH) if line not in self.before]
        self.assertTrue(any(all(part in line for part in parts) for line in found), f"{parts} not in {found}")

    def test_a_header_of_a_target_that_is_not_linked(self):
        self.plant("server/bound/bound.cpp", '#include "server/move/motion.h"')
        self.expect_found("server/bound/bound.cpp:1:", "sightline_move", "sightline_bound does not link")

    def test_the_service_in_the_step(self):
        self.plant("server/step/step.cpp", '#include "server/service/log.h"')
        self.expect_found("server/step/step.cpp:1:", "sightline_service")

    def test_grpc_in_the_method(self):
        self.plant("server/session/session.h", "#include <grpcpp/grpcpp.h>")
        self.expect_found("server/session/session.h:1:", "gRPC", "sightline_session does not link")

    def test_messages_in_the_method(self):
        self.plant("server/session/session.cpp", '#include "sightline/v1/camera_control.pb.h"')
        self.expect_found("server/session/session.cpp:1:", "sightline_proto")

    def test_grpc_linked_by_the_method(self):
        graph = json.loads(json.dumps(GRAPH))
        graph["targets"]["sightline_scene"]["links"].append("gRPC::grpc++")
        self.expect_found("sightline_scene links gRPC::grpc++", "only rpc, wire", graph=graph)
        self.expect_found("sightline_step links gRPC::grpc++", graph=graph)

    def test_a_private_link_in_a_public_header(self):
        self.plant("server/scene/gltf.h", "#include <nlohmann/json.hpp>")
        self.expect_found("server/scene/gltf.h:1:", "sightline_wire does not link")

    def test_opengl_outside_gl_and_the_egl_sampler(self):
        self.plant("client/command/main.cpp", "#include <epoxy/gl.h>")
        self.expect_found("client/command/main.cpp:1:", "may see OpenGL, not sightline")

    def test_opengl_through_a_header(self):
        self.plant("server/gl/software_renderer.h", '#include "server/gl/gl_object.h"')
        self.expect_found("server/gl/gl_object.h:", "may see OpenGL", "seen from client/command/main.cpp")

    def test_embree_beside_its_sampler(self):
        self.plant("client/truth/truth.h", "#include <embree3/rtcore.h>")
        self.expect_found("client/truth/truth.h:1:", "may see Embree")

    def test_the_service_in_a_client(self):
        self.plant("client/bench/stream.h", '#include "server/service/listener.h"')
        self.expect_found("client/bench/stream.h:1:", "clients do not include server/service")

    def test_a_circle_of_folders(self):
        self.plant("server/wire/to_proto.h", '#include "server/record/recorder.h"')
        self.expect_found("in a circle", "server/record -> server/", "server/wire -> server/record")

    def test_a_header_of_nowhere(self):
        self.plant("server/move/shot.cpp", "#include <boost/any.hpp>")
        self.expect_found("server/move/shot.cpp:1:", "boost/any.hpp", "neither")

    def test_a_file_that_no_target_compiles(self):
        self.plant("server/move/forgotten.cpp", "// nobody compiles this")
        self.expect_found("server/move/forgotten.cpp", "belongs to no target")


if __name__ == "__main__":
    ROOT, GRAPH = pathlib.Path(sys.argv[1]), json.loads(pathlib.Path(sys.argv[2]).read_text())
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
