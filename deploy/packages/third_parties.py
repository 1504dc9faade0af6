#!/usr/bin/env python3
"""The third parties of the built programs: third_parties.py BUILD_FOLDER SOURCE_ROOT OUT PROGRAM...

Writes a list, one line for each Debian or npm package with its version, its licenses and how it takes part, and the licenses of those whose code is
inside the programs. It is made from what is linked: the libraries that a program loads (readelf), the static ones on its link line (build.ninja), the
headers that the sources include, and the packages that the page of a session is built from.
"""
import json
import pathlib
import re
import subprocess
import sys

BUILD, ROOT, OUT = (pathlib.Path(argument) for argument in sys.argv[1:4])
PROGRAMS = sys.argv[4:]
SYSTEM = pathlib.Path("/usr/include")
OURS = ("server", "client", "scenes")


def needed(program):
    """The libraries that the loader finds for a program, by path."""
    entries = subprocess.run(["readelf", "-d", program], capture_output=True, text=True, check=True).stdout
    names = set(re.findall(r"\(NEEDED\).*\[(.+)\]", entries))
    loaded = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    return [path for name, path in re.findall(r"^\s*(\S+) => (\S+)", loaded, re.M) if name in names]


def static_libraries(program):
    """The archives of other projects on the link line."""
    rules = (BUILD / "build.ninja").read_text()
    found = re.search(rf"^build bin/{re.escape(pathlib.Path(program).name)}: .*?(?=^build |\Z)", rules, re.M | re.S)
    line = re.search(r"LINK_LIBRARIES = (.*)", found.group(0)).group(1)
    return [word for word in line.split() if word.startswith("/usr/") and word.endswith(".a")]


def headers():
    """The headers of other projects that our sources include."""
    named = set()
    for folder in OURS:
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".cpp", ".h"):
                named |= set(re.findall(r"^#include <([^>]+)>", path.read_text(encoding="utf-8"), re.M))
    places = (SYSTEM, SYSTEM / "x86_64-linux-gnu", SYSTEM / "aarch64-linux-gnu")
    return [str(path) for name in sorted(named) for place in places if (path := place / name).is_file()]


def packages_of(paths):
    """By package: the Debian packages that own files. A path below /lib may be known below /usr/lib."""
    if not paths:
        return set()
    also = [("/usr" + path if path.startswith("/lib") else path.removeprefix("/usr")) for path in paths]
    real = [str(pathlib.Path(path).resolve()) for path in paths]
    told = subprocess.run(["dpkg", "-S", *paths, *also, *real], capture_output=True, text=True).stdout
    return {name.split(":")[0].strip() for line in told.splitlines() if ": /" in line for name in line.rsplit(": /", 1)[0].split(",")}


def version_and_source(package):
    shown = subprocess.run(["dpkg-query", "-W", "-f", "${Version}\t${source:Package}\n", package], capture_output=True, text=True, check=True).stdout
    return shown.splitlines()[0].split("\t")


def copyright_of(package):
    return pathlib.Path("/usr/share/doc", package, "copyright").read_text(encoding="utf-8", errors="replace")


def licenses(text):
    """The names that a machine-readable copyright file gives, without those of the packaging; else those that the text mentions."""
    sections = re.findall(r"^Files: *(.+?)\n.*?^License: *(\S.*?)$", text, re.M | re.S)
    names = {name.strip() for files, name in sections if "debian" not in files.split()[0]}
    if not names:
        names = {name for name in ("Apache", "MIT", "BSD", "Zlib", "GPL", "LGPL") if re.search(rf"\b{name}\b", text)}
    return ", ".join(sorted(names)) or "see its copyright file"


# The C and C++ libraries and the compiler's runtime come with the system; their headers are no further parties.
TOOLCHAIN = re.compile(r"^(libc6-dev|linux-libc-dev|libstdc\+\+-\d+-dev|libgcc-\d+-dev)$")


def debian():
    """By package: how it takes part."""
    roles = {}
    loaded, linked = set(), set()
    for program in PROGRAMS:
        loaded |= packages_of(needed(program))
        linked |= packages_of(static_libraries(program))
    sources = {version_and_source(package)[1] for package in loaded}
    for package in loaded:
        roles[package] = "loaded"
    for package in packages_of(headers()):
        if not TOOLCHAIN.match(package) and version_and_source(package)[1] not in sources:
            roles[package] = "headers"
    for package in linked:
        roles[package] = "inside"
    return roles


def npm():
    """What the page of a session holds, and what packed it: (name, version, license, folder)."""
    page = json.loads((ROOT / "client/page/web/package.json").read_text())
    lock = json.loads((ROOT / "client/page/web/package-lock.json").read_text())["packages"]
    for name in page["dependencies"]:
        entry = lock[f"node_modules/{name}"]
        found = sorted(BUILD.glob(f"**/node_modules/{name}/LICENSE*"))
        yield name, entry["version"], entry["license"], found[0].read_text(encoding="utf-8") if found else ""


ROLES = {"loaded": "loaded when a program starts; not part of these files", "headers": "headers compiled in",
         "inside": "a static library, linked in", "page": "inside each page of a session"}


def main():
    rows, texts = [], {}
    for package, role in sorted(debian().items()):
        version, _ = version_and_source(package)
        text = copyright_of(package)
        rows.append((package, version, licenses(text), role))
        if role != "loaded":
            texts[package] = text
    for name, version, license_, text in npm():
        rows.append((f"npm {name}", version, license_, "page"))
        texts[f"npm {name}"] = text
    lines = ["Third parties of Sightline", "", *(f"  {role:8} {meaning}" for role, meaning in ROLES.items()), ""]
    lines += [f"{package:28} {version:30} {role:8} {license_}" for package, version, license_, role in rows]
    for package, text in texts.items():
        lines += ["", "=" * 100, package, "=" * 100, "", text.strip()]
    OUT.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
