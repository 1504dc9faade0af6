#!/usr/bin/env python3
"""The third parties of the built programs: third_parties.py BUILD_FOLDER SOURCE_ROOT OUT PROGRAM...

Writes a list, one line for each Debian or npm package with its version, its licenses and how it takes part, and the licenses of those whose code is
inside the programs. It is made from what is linked: the libraries that a program loads (readelf), the static ones on its link line (build.ninja), the
headers that its sources include, and the packages that the page of a session is built from.
"""
import pathlib
import sys

from parties import Build, header_packages, licenses, loaded, needed, packages_of, version_and_source

BUILD = Build(*sys.argv[1:3])
OUT, PROGRAMS = pathlib.Path(sys.argv[3]), sys.argv[4:]


def copyright_of(package):
    return pathlib.Path("/usr/share/doc", package, "copyright").read_text(encoding="utf-8", errors="replace")


def debian():
    """By package: how it takes part."""
    roles = {}
    asked_for, linked = set(), set()
    for program in PROGRAMS:
        at = loaded(program)
        asked_for |= packages_of([at[name] for name in needed(program)])
        linked |= packages_of(BUILD.archives(program))
    sources = {version_and_source(package)[1] for package in asked_for}
    for package in asked_for:
        roles[package] = "loaded"
    for program in PROGRAMS:
        for package in header_packages(BUILD, program, sources):
            roles[package] = "headers"
    for package in linked:
        roles[package] = "inside"
    return roles


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
    for kind, name, entry in BUILD.npm():
        if kind == "dependencies":
            rows.append((f"npm {name}", entry["version"], entry["license"], "page"))
            texts[f"npm {name}"] = BUILD.npm_license(name)
    lines = ["Third parties of Sightline", "", *(f"  {role:8} {meaning}" for role, meaning in ROLES.items()), ""]
    lines += [f"{package:28} {version:30} {role:8} {license_}" for package, version, license_, role in rows]
    for package, text in texts.items():
        lines += ["", "=" * 100, package, "=" * 100, "", text.strip()]
    OUT.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
