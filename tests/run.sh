#!/usr/bin/env bash
# Installs missing packages, builds everything and runs all tests. A second run builds only what changed.
#   tests/run.sh               all tests
#   tests/run.sh -L unit       any flags of ctest: -L label, -R name, -j N ...
#   PRESET=asan tests/run.sh   another preset of CMakePresets.json (default: release)
set -euo pipefail
cd "$(dirname "$0")/.."
preset=${PRESET:-release}
# For the sanitizers: undefined behaviour fails the test, and reports from inside gRPC are suppressed.
export UBSAN_OPTIONS=${UBSAN_OPTIONS:-halt_on_error=1:print_stacktrace=1}
export TSAN_OPTIONS=${TSAN_OPTIONS:-suppressions=$PWD/tests/service/tsan.supp}
# This script installs Mesa, so tests of OpenGL must find a context here.
export SIGHTLINE_REQUIRE_EGL=1

deploy/install-packages.sh test
cmake --preset "$preset" -DSIGHTLINE_TESTS=ON >/dev/null
cmake --build --preset "$preset" --parallel "$(nproc)"
ctest --test-dir "build/$preset" --output-on-failure --parallel "$(nproc)" "$@" && exit
# What failed runs once more, alone, so that its output stands at the end. The first result counts.
status=$?
ctest --test-dir "build/$preset" --rerun-failed --output-on-failure || true
exit "$status"
