#!/usr/bin/env python3
"""kubeconform_test.py GO FOLDER: kubeconform holds the manifests of deploy/kubernetes to Kubernetes's own schemas, strictly.

kubeconform is compiled into FOLDER, and the schemas come from a package of PyPI. Agones' Fleet has no schema in a registry, so it is left out by its
kind; Manifests checks the pods of a Fleet. The test is skipped where the tools cannot be downloaded."""
import json
import os
import pathlib
import re
import subprocess
import sys
import unittest
import zipfile

GO, FOLDER = sys.argv[1], pathlib.Path(sys.argv[2]).absolute()
HERE = pathlib.Path(__file__).resolve().parent
MANIFESTS = HERE.parents[1] / "deploy/kubernetes"
KUBECONFORM = "github.com/yannh/kubeconform/cmd/kubeconform@v0.7.0"
SCHEMAS = "kubernetes-validate==1.37.0"
VERSIONS = [f"1.{minor}.0" for minor in range(29, 38)]  # native sidecars begin with 1.29
WITHOUT_SCHEMA = {"Fleet"}
UNREACHABLE = (r"dial tcp|no such host|[Tt]imeout|timed out|connection refused|proxyconnect|ProxyError|NewConnectionError|reading \S+: [45]\d\d"
               r"|module lookup disabled|No matching distribution")


def fetch(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, **options)
    if done.returncode != 0:
        assert re.search(UNREACHABLE, done.stderr), (command, done.stderr)
        print("Skipped: a tool cannot be downloaded:", done.stderr.strip()[-500:])
        sys.exit(0)


def download():
    """The wheel with the schemas; kubeconform is then in FOLDER."""
    fetch(GO, "install", KUBECONFORM, env=dict(os.environ, GOBIN=str(FOLDER)))
    subprocess.run([sys.executable, "-m", "venv", FOLDER / "venv"], check=True)
    fetch(FOLDER / "venv/bin/pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps", "--only-binary", ":all:", "--dest", FOLDER, SCHEMAS)
    (wheel,) = FOLDER.glob("kubernetes_validate-*.whl")
    return wheel


def unpack(wheel):
    """The schemas of VERSIONS. Their references name a file of a server; here it is the file beside them."""
    with zipfile.ZipFile(wheel) as package:
        for name in package.namelist():
            found = re.search(r"/v(1\.\d+\.0)-local-strict/([^/]+\.json)$", name)
            if not found or found[1] not in VERSIONS:
                continue
            path = FOLDER / "schemas" / f"v{found[1]}" / found[2]
            path.parent.mkdir(parents=True, exist_ok=True)
            schema = json.loads(package.read(name).replace(b'"/api/_definitions.json#', b'"_definitions.json#'))
            schema.pop("$id", None)
            path.write_text(json.dumps(schema))


def render(folder):
    """What kustomize makes of a folder, as one text for each object."""
    done = subprocess.run([GO, "run", "./render", folder], cwd=HERE / "manifests", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split("\n---\n")


def kind_of(manifest):
    return re.search(r"^kind: (\w+)$", manifest, re.MULTILINE)[1]


def validate(version, *manifests):
    """kubeconform's verdict: its exit status, its summary and its words about objects that are not valid."""
    location = FOLDER / "schemas/{{.NormalizedKubernetesVersion}}/{{.ResourceKind}}{{.KindSuffix}}.json"
    done = subprocess.run([FOLDER / "kubeconform", "-strict", "-summary", "-output", "json", "-kubernetes-version", version,
                           "-skip", ",".join(WITHOUT_SCHEMA), "-schema-location", location],
                          input="\n---\n".join(manifests), capture_output=True, text=True)
    told = json.loads(done.stdout)
    return done.returncode, told["summary"], [resource["msg"] for resource in told["resources"]]


class Kubeconform(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folders = sorted(path.parent for path in MANIFESTS.glob("*/kustomization.yaml"))
        cls.rendered = {folder.name: render(folder) for folder in folders}

    def valid_ones(self):
        return [manifest for manifests in self.rendered.values() for manifest in manifests if kind_of(manifest) not in WITHOUT_SCHEMA]

    def test_every_folder_is_valid_for_every_version(self):
        self.assertEqual(set(self.rendered), {"base", "sidecar", "fleet", "pool"})
        for folder, manifests in self.rendered.items():
            fleets = sum(kind_of(manifest) in WITHOUT_SCHEMA for manifest in manifests)
            self.assertEqual(fleets, folder == "fleet")
            for version in VERSIONS:
                with self.subTest(folder=folder, version=version):
                    status, summary, words = validate(version, *manifests)
                    self.assertEqual(status, 0, words)
                    self.assertEqual(summary, {"valid": len(manifests) - fleets, "invalid": 0, "errors": 0, "skipped": fleets})

    def refused(self, manifest, word):
        for version in (VERSIONS[0], VERSIONS[-1]):
            status, summary, words = validate(version, manifest)
            self.assertEqual((status, summary["invalid"]), (1, 1), manifest)
            self.assertIn(word, words[0])

    def test_a_field_that_does_not_exist_is_refused_in_every_object(self):
        for manifest in self.valid_ones():
            self.refused(re.sub(r"^metadata:$", "metadata:\n  planted: 1", manifest, flags=re.MULTILINE), "planted")

    def test_a_field_that_does_not_exist_is_refused_deep_within_a_pod(self):
        (manifest,) = (manifest for manifest in self.rendered["sidecar"] if kind_of(manifest) == "Deployment")
        for field in ("restartPolicy: Always", "readOnlyRootFilesystem", "terminationGracePeriodSeconds"):
            self.assertIn(field, manifest)
            self.refused(manifest.replace(field, "planted" + field, 1), "planted")

    def test_a_value_of_the_wrong_type_is_refused(self):
        (manifest,) = (manifest for manifest in self.rendered["pool"] if kind_of(manifest) == "PodDisruptionBudget")
        self.assertRegex(manifest, r"maxUnavailable: \d")
        self.refused(re.sub(r"maxUnavailable: \d", "maxUnavailable: [1]", manifest), "maxUnavailable")


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    unpack(download())
    unittest.main(argv=sys.argv[:1])
