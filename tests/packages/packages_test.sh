#!/usr/bin/env bash
# The Debian packages: packages_test.sh BUILD_FOLDER SOURCE_ROOT VERSION WORK_FOLDER. Unpacks them, runs the programs, builds the example with the
# client package, and compares the list of third parties with the dependencies that dpkg-shlibdeps has found.
set -euo pipefail
build=$1 root=$2 version=$3 work=$4
command -v dpkg-shlibdeps > /dev/null || { echo "Skipped: dpkg-shlibdeps is missing (deploy/install-packages.sh test)"; exit 0; }
cmake --build "$build" --target packages > "$work.log" 2>&1 || { cat "$work.log" >&2; exit 1; }
rm -rf "$work"
mkdir -p "$work/root"
packages=("$build/packages/sightline_$version"_*.deb "$build/packages/libsightline-client-dev_$version"_*.deb)
for package in "${packages[@]}"; do dpkg-deb -x "$package" "$work/root"; done
if command -v lintian > /dev/null; then lintian --allow-root --fail-on error "${packages[@]}"; fi

# The programs run where they were unpacked.
bin=$work/root/usr/bin
[ "$("$bin/sightline" --version)" = "sightline $version" ]
[ "$("$bin/sightlined" --version)" = "sightlined $version" ]
"$bin/sightlined" demo --sampler embree --duration 0.5 --out "$work/demo" > "$work/demo.txt"
[ -s "$work/demo/rooms.html" ]
for page in man1/sightline.1.gz man8/sightlined.8.gz; do [ -s "$work/root/usr/share/man/$page" ]; done
for place in bash-completion/completions/sightline zsh/vendor-completions/_sightlined fish/vendor_completions.d/sightline.fish; do
  [ -s "$work/root/usr/share/$place" ]
done

# Every package that the programs depend on is in the list, and nothing else is loaded.
depends=$(dpkg-deb -f "${packages[0]}" Depends | tr ',' '\n' | sed 's/^ *//; s/ .*//' | sort)
listed=$(awk '$3 == "loaded" {print $1}' "$work/root/usr/share/doc/sightline/third-parties.txt" | sort)
installed=$(dpkg-query -W -f '${db:Status-Status} ${Package} ${Provides}\n' | awk '$1 == "installed"')
real=$(for name in $depends; do awk -v name="$name" '{for (i = 2; i <= NF; i++) if ($i == name || $i == name ",") print $2}' <<< "$installed"; done | sort -u)
diff <(echo "$real") <(echo "$listed")
for name in glm cli11 expected stb nlohmann; do grep -q "^[a-z-]*$name.* headers " "$work/root/usr/share/doc/sightline/third-parties.txt"; done
grep -q '^npm three .* page' "$work/root/usr/share/doc/sightline/third-parties.txt"
# The bill of materials links the same packages to the programs, and lists them with the same versions.
/usr/bin/python3 - "$work/root/usr/share/doc/sightline" <<'PYTHON'
import json, pathlib, sys
folder = pathlib.Path(sys.argv[1])
document = json.loads((folder / "sbom.spdx.json").read_text())
at = {package["SPDXID"]: (package["name"], package.get("versionInfo")) for package in document["packages"]}
linked = {at[each["relatedSpdxElement"]] for each in document["relationships"]
          if each["relationshipType"] == "DYNAMIC_LINK" and each["spdxElementId"].startswith("SPDXRef-program-")}
rows = (line.split() for line in (folder / "third-parties.txt").read_text().split("=====")[0].splitlines())
listed = {(row[0], row[1]) for row in rows if len(row) > 3 and row[2] == "loaded"}
assert linked == listed, linked ^ listed
PYTHON

# A game is built with the client package.
mkdir "$work/game"
cat > "$work/game/CMakeLists.txt" <<CMAKE
cmake_minimum_required(VERSION 3.25)
project(game LANGUAGES C CXX)
find_package(sightline ${version%.*} CONFIG REQUIRED)
add_executable(game $root/client/cpp/example.cpp)
target_link_libraries(game PRIVATE sightline::client)
CMAKE
cmake -S "$work/game" -B "$work/game/build" -G Ninja -DCMAKE_PREFIX_PATH="$work/root/usr" > /dev/null
cmake --build "$work/game/build"
"$bin/sightlined" --sampler embree --log-level error --listen 127.0.0.1:0 --ready-file "$work/ready" &
daemon=$!
trap 'kill $daemon' EXIT
for _ in $(seq 600); do [ -e "$work/ready" ] && break; sleep 0.1; done
"$work/game/build/game" "$(awk '{print $1; exit}' "$work/ready")" > "$work/game.txt"
[ "$(wc -l < "$work/game.txt")" -eq 300 ]
