#!/usr/bin/env python3
"""sbom_test.py BUILD_FOLDER SOURCE_ROOT SIGHTLINED SIGHTLINE: the bill of materials, read by code of its own and compared with what ldd, dpkg and the
sources say. Damaged documents are found out, which shows that the checks see something."""
import copy
import functools
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import urllib.parse

BUILD, ROOT, SIGHTLINED, SIGHTLINE = (pathlib.Path(argument) for argument in sys.argv[1:5])
SCRIPT = ROOT / "deploy/packages/sbom.py"
RELATIONS = {"BUILD_DEPENDENCY_OF", "CONTAINS", "DESCRIBES", "DYNAMIC_LINK", "OPTIONAL_DEPENDENCY_OF", "STATIC_LINK"}


def sbom(*arguments, programs=(SIGHTLINED, SIGHTLINE), **environment):
    """(exit code, what it said, the document's text)."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder, "sbom.json")
        done = subprocess.run(["/usr/bin/python3", "-B", SCRIPT, BUILD, ROOT, out, *programs, *arguments], capture_output=True, text=True, timeout=120,
                              env={**os.environ, "SOURCE_DATE_EPOCH": "1700000000", **environment})
        return done.returncode, done.stderr, out.read_text(encoding="utf-8") if out.exists() else ""


@functools.cache
def libraries(program):
    """The files that ldd names for a program."""
    told = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    return sorted(set(re.findall(r"(/\S+) \(0x", told)))


@functools.cache
def files_of_packages():
    """By file: the package that dpkg's own lists of files name."""
    lists = pathlib.Path("/var/lib/dpkg/info").glob("*.list")
    return {path: each.stem.split(":")[0] for each in lists for path in each.read_text(encoding="utf-8").split("\n")}


def package_of(path):
    """The package that owns a file; empty when none does."""
    names = (path, "/usr" + path, str(pathlib.Path(path).resolve()))
    return next((files_of_packages()[name] for name in names if name in files_of_packages()), "")


@functools.cache
def installed():
    """By package: (version, architecture)."""
    told = subprocess.run(["dpkg-query", "-W", "-f", "${Package} ${Version} ${Architecture}\n"], capture_output=True, text=True, check=True).stdout
    return {words[0]: tuple(words[1:]) for words in map(str.split, told.splitlines())}


def faults(document):
    """What is wrong with a document by the rules of SPDX 2.3 that it could break."""
    found = []
    for field, wanted in (("spdxVersion", "SPDX-2.3"), ("dataLicense", "CC0-1.0"), ("SPDXID", "SPDXRef-DOCUMENT")):
        if document.get(field) != wanted:
            found.append(f"{field} is {document.get(field)}")
    if not re.fullmatch(r"https://sightline\.invalid/spdx/[\w.-]+", document["documentNamespace"]):
        found.append("namespace")
    if not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", document["creationInfo"]["created"]):
        found.append("date")
    names = ["SPDXRef-DOCUMENT"] + [package["SPDXID"] for package in document["packages"]]
    found += [f"{name} is there twice" for name in sorted({name for name in names if names.count(name) > 1})]
    found += [f"{name} is no identifier" for name in names if not re.fullmatch(r"SPDXRef-[A-Za-z0-9.-]+", name)]
    pairs = [(each["spdxElementId"], each["relationshipType"], each["relatedSpdxElement"]) for each in document["relationships"]]
    if len(set(pairs)) < len(pairs):
        found.append("a relationship is there twice")
    for one, kind, other in pairs:
        found += [f"{name} is unknown" for name in (one, other) if name not in names]
        found += [f"{kind} is no relationship of these documents"] if kind not in RELATIONS else []
    related = {name for one, _, other in pairs for name in (one, other)}
    found += [f"{name} is related to nothing" for name in names if name not in related]
    texts = {each["licenseId"] for each in document["hasExtractedLicensingInfos"] if each["extractedText"].strip()}
    for package in document["packages"]:
        used = set(re.findall(r"LicenseRef-[A-Za-z0-9.-]+", package["licenseDeclared"]))
        found += [f"the text of {reference} is missing" for reference in used - texts]
        found += [f"{package['name']} has no {field}" for field in ("downloadLocation", "licenseConcluded", "copyrightText", "supplier") if not package.get(field)]
        if package["licenseDeclared"].count("(") != package["licenseDeclared"].count(")"):
            found.append(f"license {package['licenseDeclared']}")
    return found


def linked(document, program):
    """The names of the packages that a program reaches by DYNAMIC_LINK."""
    name_of = {package["SPDXID"]: package["name"] for package in document["packages"]}
    reached, waiting = set(), [f"SPDXRef-program-{program.name}"]
    while waiting:
        at = waiting.pop()
        new = {each["relatedSpdxElement"] for each in document["relationships"] if (each["spdxElementId"], each["relationshipType"]) == (at, "DYNAMIC_LINK")}
        waiting += new - reached
        reached |= new
    return {name_of.get(name) for name in reached}


def not_as_loaded(document, program):
    """The packages that ldd finds and the document does not link, or the other way round."""
    return {package_of(path) for path in libraries(program)} ^ linked(document, program)


class Sbom(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        code, said, cls.text = sbom("--optional", "libegl1, no-such-package")
        assert code == 0, said
        cls.document = json.loads(cls.text)
        cls.by_name = {package["name"]: package for package in cls.document["packages"] if package["SPDXID"].startswith("SPDXRef-deb-")}

    def related(self, kind, program):
        """The names of what has a relationship with a program."""
        name_of = {package["SPDXID"]: package["name"] for package in self.document["packages"]}
        both = [(each["spdxElementId"], each["relatedSpdxElement"]) for each in self.document["relationships"] if each["relationshipType"] == kind]
        mine = f"SPDXRef-program-{program.name}"
        return {name_of[pair[1 - pair.index(mine)]] for pair in both if mine in pair}

    def test_it_keeps_the_rules_of_spdx(self):
        self.assertEqual(faults(self.document), [])

    def test_every_library_that_ldd_reports_belongs_to_a_linked_package(self):
        for program in (SIGHTLINED, SIGHTLINE):
            self.assertGreater(len(libraries(program)), 20)
            self.assertEqual(not_as_loaded(self.document, program), set())

    def test_versions_and_addresses_are_those_that_dpkg_knows(self):
        self.assertGreater(len(self.by_name), 40)
        for name, package in self.by_name.items():
            self.assertEqual(package["versionInfo"], installed()[name][0])
            address = package["externalRefs"][0]["referenceLocator"]
            found = re.fullmatch(r"pkg:deb/[a-z]+/([^@]+)@([^?]+)\?arch=(\w+)(&distro=\w+)?", address)
            self.assertEqual([urllib.parse.unquote(part) for part in found.groups()[:2]], [name, installed()[name][0]])
            self.assertEqual(found[3], installed()[name][1])
            self.assertNotRegex(address.removeprefix("pkg:"), "[+:]", "these signs must be quoted")

    def test_what_is_compiled_in_is_named_for_the_program_that_has_it(self):
        for program in (SIGHTLINED, SIGHTLINE):
            self.assertLessEqual({"libglm-dev", "libcli11-dev", "libexpected-dev", "nlohmann-json3-dev", "libc6-dev"}, self.related("STATIC_LINK", program))
            self.assertLessEqual({"cmake", "ninja-build", "protobuf-compiler", "libgrpc++-dev"}, self.related("BUILD_DEPENDENCY_OF", program))
        self.assertIn("libstb-dev", self.related("STATIC_LINK", SIGHTLINE))
        self.assertNotIn("libstb-dev", self.related("STATIC_LINK", SIGHTLINED), "it writes no pictures")
        self.assertIn("three", self.related("CONTAINS", SIGHTLINE))
        self.assertEqual(self.related("CONTAINS", SIGHTLINED), {"sightline"})

    def test_licenses_are_those_of_the_copyright_files(self):
        for name, wanted in (("libglm-dev", "MIT"), ("libembree3-3", "Apache-2.0"), ("libcap2", "BSD-3-Clause OR GPL-2.0-only"),
                             ("liblz4-1", "(GPL-2.0-or-later OR BSD-2-Clause) AND BSD-2-Clause AND GPL-2.0-or-later"), ("libc6", "NOASSERTION")):
            if name in self.by_name:
                self.assertEqual(self.by_name[name]["licenseDeclared"], wanted)
        self.assertIn("not machine-readable", self.by_name["libc6"]["licenseComments"])

    def test_no_host_serves_what_it_names(self):
        identifiers = json.dumps({**self.document, "hasExtractedLicensingInfos": []})
        self.assertEqual(set(re.findall(r"\w+://([\w.-]+)", identifiers)), {"sightline.invalid"})

    def test_it_is_the_same_twice(self):
        self.assertEqual(sbom("--optional", "libegl1, no-such-package", PYTHONHASHSEED="7")[2], self.text)
        later = json.loads(sbom(SOURCE_DATE_EPOCH="1700000001")[2])
        self.assertEqual(later["creationInfo"]["created"], "2023-11-14T22:13:21Z")
        self.assertNotEqual(later["documentNamespace"], self.document["documentNamespace"], "another document has another name")

    def test_damaged_documents_are_found_out(self):
        def damaged(change):
            document = copy.deepcopy(self.document)
            change(document)
            return faults(document) + sorted(map(str, not_as_loaded(document, SIGHTLINED)))

        at = next(i for i, package in enumerate(self.document["packages"]) if package["name"] == "libembree3-3")
        self.assertIn("SPDXRef-deb-libembree3-3 is unknown", damaged(lambda document: document["packages"].pop(at)))
        self.assertIn("SPDXRef-deb-libembree3-3 is there twice", damaged(lambda document: document["packages"].append(document["packages"][at])))
        self.assertIn("libembree3-3", damaged(lambda document: document.update(
            relationships=[each for each in document["relationships"] if each["relatedSpdxElement"] != "SPDXRef-deb-libembree3-3"])))
        self.assertIn("SPDXRef-deb-glm is unknown", damaged(lambda document: document["relationships"][0].update(relatedSpdxElement="SPDXRef-deb-glm")))
        self.assertIn("LicenseRef-Sightline", " ".join(damaged(lambda document: document.update(hasExtractedLicensingInfos=[]))))

    def test_a_library_of_no_package_is_an_error(self):
        with tempfile.TemporaryDirectory() as folder:
            own = next(path for path in libraries(SIGHTLINED) if "libxxhash" in path)
            shutil.copy(own, folder)
            code, said, text = sbom(LD_LIBRARY_PATH=folder)
            self.assertEqual((code, text), (1, ""))
            self.assertIn(f"{folder}/{pathlib.Path(own).name}, which belong to no Debian package", said)


class Image(unittest.TestCase):
    """A folder with dpkg's files, as the image build takes them from its last stage."""

    def image(self, folder, *without):
        status = pathlib.Path("/var/lib/dpkg/status").read_text(encoding="utf-8")
        kept = {package_of(path) for program in (SIGHTLINED, SIGHTLINE) for path in libraries(program)} | {"base-files", "tzdata"}
        chosen = [block for block in status.split("\n\n") if (name := block.partition("\n")[0].removeprefix("Package: ")) in kept and name not in without]
        os.makedirs(f"{folder}/var/lib/dpkg/info")
        pathlib.Path(folder, "var/lib/dpkg/status").write_text(
            "\n\n".join(re.sub(r"(?m)^(Version: .*)", r"\1+image1", block) for block in chosen) + "\n", encoding="utf-8")
        os.makedirs(f"{folder}/usr/lib")
        shutil.copy("/usr/lib/os-release", f"{folder}/usr/lib")
        os.makedirs(f"{folder}/usr/share")
        os.symlink("/usr/share/doc", f"{folder}/usr/share/doc")
        return {block.partition("\n")[0].removeprefix("Package: ") for block in chosen}

    def test_it_names_every_package_of_the_image_and_the_programs_checksums(self):
        with tempfile.TemporaryDirectory() as folder:
            held = self.image(folder)
            code, said, text = sbom("--root", folder, "--name", "sightline-cpu", "--optional", "libegl1")
        self.assertEqual(code, 0, said)
        document = json.loads(text)
        self.assertEqual(faults(document), [])
        packages = {package["SPDXID"]: package for package in document["packages"]}
        contained = {each["relatedSpdxElement"] for each in document["relationships"]
                     if (each["spdxElementId"], each["relationshipType"]) == ("SPDXRef-sightline-cpu", "CONTAINS")}
        self.assertEqual({packages[key]["name"] for key in contained}, held | {"sightlined", "sightline"})
        self.assertEqual(packages["SPDXRef-sightline-cpu"]["primaryPackagePurpose"], "CONTAINER")
        for package in packages.values():
            if package["name"] in held:
                self.assertTrue(package["versionInfo"].endswith("+image1"), package["name"])
        told = subprocess.run(["sha256sum", SIGHTLINED], capture_output=True, text=True, check=True).stdout.split()[0]
        self.assertEqual(packages["SPDXRef-program-sightlined"]["checksums"], [{"algorithm": "SHA256", "checksumValue": told}])
        self.assertNotIn("OPTIONAL_DEPENDENCY_OF", text, "this image has no OpenGL")

    def test_an_image_without_a_library_that_is_loaded_is_an_error(self):
        with tempfile.TemporaryDirectory() as folder:
            self.image(folder, "libembree3-3")
            code, said, text = sbom("--root", folder)
        self.assertEqual((code, text), (1, ""))
        self.assertIn("loads libraries of libembree3-3, which the image does not hold", said)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
