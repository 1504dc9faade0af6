#!/usr/bin/env python3
"""The bill of materials of the built programs, as SPDX 2.3 in JSON: sbom.py BUILD_FOLDER SOURCE_ROOT OUT PROGRAM... [--root FOLDER] [--name NAME]
[--optional PACKAGES]

It names what third-parties.txt names, and also the libraries that libraries load, who loads which, and the tools of the build. With --root it describes
an image: it then names every Debian package that is installed below that folder, takes versions and licenses from there, and gives the checksums of the
programs. Without it, the versions are those of the machine that built. A library that belongs to no package is an error.

The output is the same for the same input. Its date is SOURCE_DATE_EPOCH, or else that of the newest program.
"""
import argparse
import base64
import datetime
import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys
import urllib.parse
import uuid

from parties import Build, header_packages, licenses, loaded, needed, owners, packages_of

# Debian's short names of licenses that differ from those of SPDX, in small letters. Versions of the GPL are handled apart.
SPDX_NAMES = {"0bsd": "0BSD", "apache-2": "Apache-2.0", "apache-2.0": "Apache-2.0", "artistic": "Artistic-1.0", "artistic-2.0": "Artistic-2.0",
              "bsd-2-clause": "BSD-2-Clause", "bsd-3-clause": "BSD-3-Clause", "bsd-4-clause": "BSD-4-Clause", "bsl-1": "BSL-1.0",
              "bsl-1.0": "BSL-1.0", "cc0": "CC0-1.0", "cc0-1.0": "CC0-1.0", "cc-by-4": "CC-BY-4.0", "cc-by-4.0": "CC-BY-4.0", "expat": "MIT",
              "isc": "ISC", "mit": "MIT", "mpl-1.1": "MPL-1.1", "mpl-2.0": "MPL-2.0", "unlicense": "Unlicense", "zlib": "Zlib"}
GNU_VERSIONS = {"GPL": ("1.0", "2.0", "3.0"), "LGPL": ("2.0", "2.1", "3.0"), "AGPL": ("1.0", "3.0")}


def spdx_name(name):
    """SPDX's name for a license that Debian calls `name`; empty when there is none."""
    gnu = re.fullmatch(r"(A?GPL|LGPL)-(\d)(\.\d)?(\+?)", name)
    if gnu:
        family, version = gnu[1], gnu[2] + (gnu[3] or ".0")
        return f"{family}-{version}-{'or-later' if gnu[4] else 'only'}" if version in GNU_VERSIONS[family] else ""
    return SPDX_NAMES.get(name.lower(), "")


class Licenses:
    """License expressions of SPDX from Debian's copyright files. Licenses without a name of SPDX are kept with their text."""

    def __init__(self):
        self.texts = {}  # by reference: (name, text)

    def reference(self, name, text):
        reference = f"LicenseRef-{re.sub('[^A-Za-z0-9.]+', '-', name).strip('-')}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"
        self.texts[reference] = (name, text)
        return reference

    def of_copyright(self, package, text):
        """The expression for a machine-readable copyright file, without its part about the packaging. Empty for another file."""
        if not re.match(r"\s*Format(-Specification)?:", text):
            return ""
        bodies, used = {}, set()
        for fields in paragraphs(text):
            synopsis, _, body = fields.get("license", "").partition("\n")
            if body.strip():
                bodies.setdefault(synopsis.strip(), body.strip())
            if synopsis and "files" in fields and not fields["files"].split()[0].startswith("debian"):
                used.add(synopsis.strip())

        def one(name):
            return spdx_name(name) or self.reference(name, bodies.get(name) or f"The copyright file of {package} names this license without its text.")

        def words(text):
            parts = [" AND ".join(one(name.strip()) for name in re.split(r"\s+and\s+", part)) for part in re.split(r"\s+or\s+", text)]
            return " OR ".join(f"({part})" if " AND " in part and len(parts) > 1 else part for part in parts)

        def expression(synopsis):
            """A comma before "and" or "or" binds less than the word alone."""
            parts = re.split(r",\s+(and|or)\s+", synopsis)
            return " ".join(part.upper() if i % 2 else f"({words(part)})" if len(parts) > 1 and " " in words(part) else words(part)
                            for i, part in enumerate(parts))

        all_of = {expression(synopsis) for synopsis in used}
        return " AND ".join(sorted(f"({each})" if " " in each and len(all_of) > 1 else each for each in all_of))


def paragraphs(text):
    """The paragraphs of a file in Debian's control format: field in small letters -> value."""
    for block in re.split(r"\n[ \t]*\n", text):
        fields, last = {}, ""
        for line in block.splitlines():
            if line[:1] in (" ", "\t") and last:
                fields[last] += "\n" + ("" if line.strip() == "." else line[1:])
            elif field := re.match(r"([A-Za-z-]+):[ \t]*(.*)", line):
                last = field[1].lower()
                fields[last] = field[2]
        yield fields


class Debian:
    """The packages that dpkg knows below a folder."""

    def __init__(self, root):
        self.root = pathlib.Path(root)
        form = "${db:Status-Status}\t${Package}\t${Version}\t${Architecture}\t${source:Package}\t${source:Version}\n"
        shown = subprocess.run(["dpkg-query", f"--admindir={self.root / 'var/lib/dpkg'}", "-W", "-f", form], capture_output=True, text=True, check=True)
        self.installed = {fields[1]: fields[2:] for line in shown.stdout.splitlines() if (fields := line.split("\t"))[0] == "installed"}
        release = dict(re.findall(r'^(\w+)="?(.*?)"?$', (self.root / "usr/lib/os-release").read_text(), re.M))
        self.vendor, self.release, self.supplier = release["ID"], release.get("VERSION_CODENAME", ""), release["NAME"]

    def copyright(self, package):
        path = self.root / "usr/share/doc" / package / "copyright"
        return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""


def element(name):
    """An identifier of SPDX, which may hold letters, digits, dots and dashes."""
    return "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", lambda sign: f".{ord(sign[0]):02X}", name)


class Document:
    def __init__(self, build, image):
        self.build, self.image, self.here = build, image, Debian("/")
        self.version = build.setting("CMAKE_PROJECT_VERSION")
        self.licenses = Licenses()
        self.own = self.licenses.reference("Sightline", (build.root / "deploy/packages/copyright").read_text(encoding="utf-8").strip())
        self.packages, self.relations = {}, {}

    def package(self, key, declared, **more):
        self.packages[element(key)] = {"SPDXID": element(key), "downloadLocation": "NOASSERTION", "filesAnalyzed": False,
                                        "licenseConcluded": "NOASSERTION", "licenseDeclared": declared, "copyrightText": "NOASSERTION", **more}
        return element(key)

    def relate(self, one, kind, other, comment=""):
        self.relations[one, kind, other] = comment

    def ours(self, key, name, purpose, **more):
        return self.package(key, self.own, name=name, versionInfo=self.version, supplier="Organization: Sightline developers",
                            primaryPackagePurpose=purpose, **more)

    def debian(self, name):
        """The element of a Debian package, as it is in the image, or else here."""
        known = self.image if self.image and name in self.image.installed else self.here
        version, architecture, source, source_version = known.installed[name]
        if element(f"deb-{name}") in self.packages:
            return element(f"deb-{name}")
        text = known.copyright(name)
        declared = self.licenses.of_copyright(name, text)
        quoted = urllib.parse.quote(version, safe="~")
        address = f"pkg:deb/{known.vendor}/{urllib.parse.quote(name, safe='')}@{quoted}?arch={architecture}"
        if known.release:
            address += f"&distro={known.release}"
        more = {} if declared else {"licenseComments": f"The copyright file is not machine-readable. It mentions: {licenses(text)}."}
        return self.package(f"deb-{name}", declared or "NOASSERTION", name=name, versionInfo=version, supplier=f"Organization: {known.supplier}",
                            sourceInfo=f"built package from: {source} {source_version}", **more,
                            externalRefs=[{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": address}])

    def npm(self, name, entry):
        digest = base64.b64decode(entry["integrity"].removeprefix("sha512-")).hex()
        address = f"pkg:npm/{urllib.parse.quote(name, safe='/')}@{entry['version']}"
        return self.package(f"npm-{name}", entry["license"], name=name, versionInfo=entry["version"], supplier="NOASSERTION",
                            checksums=[{"algorithm": "SHA512", "checksumValue": digest}],
                            externalRefs=[{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": address}])

    def loads(self, path, at, owner, known_as):
        """`path` loads what it asks for itself, and so on. `at` and `owner`: by name, the path; by path, the package."""
        for name in needed(path):
            other = self.debian(owner[at[name]])
            if other != known_as:
                self.relate(known_as, "DYNAMIC_LINK", other)

    def program(self, path, optional):
        """A program with all that it loads and holds, and what built it."""
        checksum = {"checksums": [{"algorithm": "SHA256", "checksumValue": hashlib.sha256(path.read_bytes()).hexdigest()}]} if self.image else {}
        program = self.ours(f"program-{path.name}", path.name, "APPLICATION", packageFileName=path.name, **checksum)
        at = loaded(path)
        owner = owners(at.values())
        strangers = sorted(set(at.values()) - set(owner))
        if strangers:
            raise SystemExit(f"{path} loads {', '.join(strangers)}, which belong to no Debian package")
        missing = sorted(set(owner.values()) - set(self.image.installed)) if self.image else []
        if missing:
            raise SystemExit(f"{path} loads libraries of {', '.join(missing)}, which the image does not hold")
        self.loads(path, at, owner, program)
        for library in sorted(set(at.values())):
            self.loads(library, at, owner, self.debian(owner[library]))

        for package in packages_of(self.build.archives(path)):
            self.relate(program, "STATIC_LINK", self.debian(package), "A static library is linked in.")
        sources = {self.here.installed[owner[at[name]]][2] for name in needed(path)}
        alone = header_packages(self.build, path, sources)
        for package in alone:
            self.relate(program, "STATIC_LINK", self.debian(package), "Headers are compiled in.")
        start = packages_of(self.build.start_up_files())
        for package in start:
            self.relate(program, "STATIC_LINK", self.debian(package), "Start-up code, or templates of the C++ library, are linked in.")
        compiled_from = self.build.sources(path)
        if any("foxglove" in source.parts for source in compiled_from):
            schemas = self.package("source-foxglove-schemas", "MIT", name="foxglove-schemas", supplier="NOASSERTION",
                                   comment="The messages of proto/foxglove have the names and numbers of these schemas. Their version was not kept.")
            self.relate(program, "STATIC_LINK", schemas, "Message definitions are compiled in.")
        if any("page" in source.parts for source in compiled_from):
            for kind, name, entry in self.build.npm():
                if kind == "dependencies":
                    self.relate(program, "CONTAINS", self.npm(name, entry), "It is inside each page of a session.")
                else:
                    self.relate(self.npm(name, entry), "BUILD_DEPENDENCY_OF", program, "It packs the page of a session.")

        for package in packages_of(self.build.headers(path)) - alone - start | packages_of(self.build.tools()):
            self.relate(self.debian(package), "BUILD_DEPENDENCY_OF", program)
        for package in optional:
            if package in (self.image or self.here).installed:
                self.relate(self.debian(package), "OPTIONAL_DEPENDENCY_OF", program, "The program loads it by name when it is asked to use OpenGL.")
        return program

    def as_json(self, name, programs, optional):
        root = self.ours(name, name, "CONTAINER" if self.image else "APPLICATION")
        for program in programs:
            self.relate(root, "CONTAINS", self.program(program, optional))
        for package in self.image.installed if self.image else ():
            self.relate(root, "CONTAINS", self.debian(package))
        self.relate("SPDXRef-DOCUMENT", "DESCRIBES", root)
        seconds = int(os.environ.get("SOURCE_DATE_EPOCH") or max(program.stat().st_mtime for program in programs))
        document = {
            "spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT", "name": f"{name}-{self.version}",
            "creationInfo": {"created": datetime.datetime.fromtimestamp(seconds, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
                             "creators": ["Organization: Sightline developers", f"Tool: sightline-sbom-{self.version}"]},
            "comment": "Declared licenses are those of all files of a package's source, from Debian's copyright files. Versions are those "
                       + ("of the image." if self.image else "on the machine that built; other versions may be installed where the programs run."),
            "packages": [self.packages[key] for key in sorted(self.packages)],
            "relationships": [{"spdxElementId": one, "relationshipType": kind, "relatedSpdxElement": other, **({"comment": comment} if comment else {})}
                              for (one, kind, other), comment in sorted(self.relations.items())],
            "hasExtractedLicensingInfos": [{"licenseId": reference, "name": of, "extractedText": text}
                                           for reference, (of, text) in sorted(self.licenses.texts.items())]}
        # The namespace is an identifier of this content. Nothing is served at it.
        content = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(document, sort_keys=True))
        document["documentNamespace"] = f"https://sightline.invalid/spdx/{document['name']}-{content}"
        return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("programs", type=pathlib.Path, nargs="+")
    parser.add_argument("--root", type=pathlib.Path, help="folder with the image's var/lib/dpkg, usr/share/doc and usr/lib/os-release")
    parser.add_argument("--name", default="sightline", help="name of what is described; sightline when not given")
    parser.add_argument("--optional", default="", help="packages that the programs load by name, separated by commas")
    given = parser.parse_args()
    document = Document(Build(given.build, given.source), Debian(given.root) if given.root else None)
    text = document.as_json(given.name, given.programs, [name for name in re.split(r"[,\s]+", given.optional) if name])
    given.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
