#!/usr/bin/env bash
# Installs what is missing, builds everything and runs all tests. The second run is quick: only what changed is built.
#   tests/run.sh               all tests
#   tests/run.sh -L unit       anything that ctest takes: -L label, -R name, -j N ...
#   PRESET=asan tests/run.sh   another preset of CMakePresets.json (default: release)
set -euo pipefail
cd "$(dirname "$0")/.."
preset=${PRESET:-release}
# Read by the sanitizers alone: undefined behaviour fails the test that met it, and what is not ours is left out.
export UBSAN_OPTIONS=${UBSAN_OPTIONS:-halt_on_error=1:print_stacktrace=1}
export TSAN_OPTIONS=${TSAN_OPTIONS:-suppressions=$PWD/tests/service/tsan.supp}

deploy/install-packages.sh test
cmake --preset "$preset" -DSIGHTLINE_TESTS=ON >/dev/null
cmake --build --preset "$preset" --parallel "$(nproc)"
ctest --test-dir "build/$preset" --output-on-failure --parallel "$(nproc)" "$@"
