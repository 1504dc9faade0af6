"""What the built programs are made of: the libraries that they load, the archives and headers that are inside them, the tools that made them, and what
dpkg and npm know of each. third_parties.py and sbom.py write it down."""
import json
import pathlib
import re
import subprocess

# The C and C++ libraries and the compiler's runtime come with the system; their headers are no further parties.
TOOLCHAIN = re.compile(r"^(libc6-dev|linux-libc-dev|libstdc\+\+-\d+-dev|libgcc-\d+-dev)$")


def run(*command):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True).stdout


def loaded(program):
    """By name: the path of every library that the loader finds for a program, also those that libraries load."""
    found = {}
    for name, path in re.findall(r"^\s*(\S+)(?: => (.+?))?(?: \(0x[0-9a-f]+\))?$", run("ldd", program), re.M):
        if path == "not found":
            raise SystemExit(f"{program} needs {name}, which is not installed")
        if path or name.startswith("/"):  # not the kernel's own, which is no file
            found[pathlib.Path(name).name] = path or name
    return found


def needed(path):
    """The names of the libraries that a program or library asks for itself."""
    return re.findall(r"\(NEEDED\).*\[(.+)\]", run("readelf", "-d", path))


class Build:
    """A build by Ninja. `folder` holds build.ninja, `root` the sources."""

    def __init__(self, folder, root):
        self.folder, self.root = pathlib.Path(folder), pathlib.Path(root)
        self.rules = (self.folder / "build.ninja").read_text()
        self.edges = {}  # by output: inputs that are no order-only ones
        for outputs, inputs in re.findall(r"^build ([^:]+): \S+(.*)$", self.rules, re.M):
            for output in outputs.replace("|", " ").split():
                self.edges[output] = inputs.split("||")[0].replace("|", " ").split()

    def setting(self, name):
        """A value of CMake's cache."""
        return re.search(rf"^{name}:\w+=(.*)$", (self.folder / "CMakeCache.txt").read_text(), re.M).group(1)

    def archives(self, program):
        """The archives of other projects on a program's link line."""
        found = re.search(rf"^build bin/{re.escape(pathlib.Path(program).name)}: .*?(?=^build |\Z)", self.rules, re.M | re.S)
        line = re.search(r"LINK_LIBRARIES = (.*)", found.group(0)).group(1)
        return [word for word in line.split() if word.startswith("/usr/") and word.endswith(".a")]

    def sources(self, program):
        """The files that a program is compiled from."""
        found, seen, waiting = set(), set(), [f"bin/{pathlib.Path(program).name}"]
        while waiting:
            output = waiting.pop()
            if output in seen:
                continue
            seen.add(output)
            inputs = self.edges.get(output, [])
            waiting += [name for name in inputs if name.endswith((".o", ".a"))]
            if output.endswith(".o"):
                found.add(self.folder / inputs[0])  # an absolute path stays as it is
        return found

    def headers(self, program):
        """The headers of other projects that a program's sources include, themselves or by our own headers."""
        named, seen, waiting = set(), set(), list(self.sources(program))
        while waiting:
            path = waiting.pop()
            if path in seen or not path.is_file():
                continue
            seen.add(path)
            text = path.read_text(encoding="utf-8")
            named |= set(re.findall(r"^#\s*include <([^>]+)>", text, re.M))
            waiting += [place / name for name in re.findall(r'^#\s*include "([^"]+)"', text, re.M)
                        for place in (self.root, path.parent, self.folder / "proto")]
        system = pathlib.Path("/usr/include")
        places = (system, system / "x86_64-linux-gnu", system / "aarch64-linux-gnu")
        return [str(path) for name in sorted(named) for place in places if (path := place / name).is_file()]

    def tools(self):
        """The programs that the build calls: compiler, CMake, Ninja, protoc and its plugin."""
        settings = ("CMAKE_CXX_COMPILER", "CMAKE_COMMAND", "CMAKE_MAKE_PROGRAM", "Protobuf_PROTOC_EXECUTABLE")
        return sorted({self.setting(name) for name in settings} | set(re.findall(r"protoc-gen-grpc=(/\S+)", self.rules)))

    def start_up_files(self):
        """What the compiler links into every program by itself, and the static C++ library, whose package has the templates."""
        names = ("crt1.o", "crtbeginS.o", "libgcc.a", "libstdc++.a")
        return [str(pathlib.Path(run(self.setting("CMAKE_CXX_COMPILER"), f"-print-file-name={name}").strip()).resolve()) for name in names]

    def npm(self):
        """What the page of a session holds ("dependencies"), and what packs it ("devDependencies"): (kind, name, entry of the lock file)."""
        web = self.root / "client/page/web"
        wanted = json.loads((web / "package.json").read_text())
        lock = json.loads((web / "package-lock.json").read_text())["packages"]
        return [(kind, name, lock[f"node_modules/{name}"]) for kind in ("dependencies", "devDependencies") for name in wanted[kind]]

    def npm_license(self, name):
        found = sorted(self.folder.glob(f"**/node_modules/{name}/LICENSE*"))
        return found[0].read_text(encoding="utf-8") if found else ""


def owners(paths):
    """By path: the Debian package that owns a file. A path below /lib may be known below /usr/lib, and a link by what it leads to."""
    known_as = {path: (path, "/usr" + path if path.startswith("/lib") else path.removeprefix("/usr"), str(pathlib.Path(path).resolve()))
                for path in paths}
    if not known_as:
        return {}
    asked = sorted({name for names in known_as.values() for name in names})
    told = subprocess.run(["dpkg", "-S", *asked], capture_output=True, text=True).stdout
    owner = {}
    for packages, path in re.findall(r"^(?!diversion by )(.+?): (/.*)$", told, re.M):
        owner[path] = packages.split(",")[0].split(":")[0].strip()
    return {path: next(owner[name] for name in names if name in owner) for path, names in known_as.items() if any(name in owner for name in names)}


def packages_of(paths):
    return set(owners(paths).values())


def version_and_source(package):
    return run("dpkg-query", "-W", "-f", "${Version}\t${source:Package}\n", package).splitlines()[0].split("\t")


def header_packages(build, program, sources):
    """The packages of headers alone that are compiled into a program: those that come from none of `sources`."""
    return {package for package in packages_of(build.headers(program))
            if not TOOLCHAIN.match(package) and version_and_source(package)[1] not in sources}


def licenses(text):
    """The names that a machine-readable copyright file gives, without those of the packaging; else those that the text mentions."""
    sections = re.findall(r"^Files: *(.+?)\n.*?^License: *(\S.*?)$", text, re.M | re.S)
    names = {name.strip() for files, name in sections if "debian" not in files.split()[0]}
    if not names:
        names = {name for name in ("Apache", "MIT", "BSD", "Zlib", "GPL", "LGPL") if re.search(rf"\b{name}\b", text)}
    return ", ".join(sorted(names)) or "see its copyright file"
