#!/usr/bin/env bash
# Clients of one version with daemons of another: tests/skew.sh [COMMIT] [--keep]
#
# Builds the daemon of a former version from the history (default: the last one of version 0.1) into build/former, and plays
# skew/session.py with the former and the present client on both daemons. --keep writes the former daemon's answers to skew/former, which
# every test run compares with. Another COMMIT needs the client and the contract of that version in skew/former, too.
set -euo pipefail
cd "$(dirname "$0")/.."
commit=6ffd136a817c702bc56fb79f3461163f13a25a1a
keep=()
for argument in "$@"; do
  if [ "$argument" = --keep ]; then keep=(--keep); else commit=$argument; fi
done
deploy/install-packages.sh build
source=build/former/$commit
if [ ! -d "$source" ]; then
  mkdir -p "$source"
  git archive "$commit" | tar x -C "$source"
fi
cmake -S "$source" -B "$source/build/release" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSIGHTLINE_TESTS=OFF >/dev/null
cmake --build "$source/build/release" --parallel "$(nproc)" --target sightlined
cmake --preset release -DSIGHTLINE_TESTS=ON >/dev/null
cmake --build --preset release --parallel "$(nproc)" --target sightlined sightline_python_stubs
exec /usr/bin/python3 tests/skew/skew_test.py build/release/bin/sightlined build/release/python "$source/build/release/bin/sightlined" "${keep[@]}"
