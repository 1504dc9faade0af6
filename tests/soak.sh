#!/usr/bin/env bash
# A daemon under load for hours, with a verdict: tests/soak.sh [HOURS]
#
# HOURS (default 1) may be a fraction. Sixteen sessions at 60 Hz change their scenes, come back and upload files; soak/soak.py says what
# is judged. The figures are written to build/soak/soak.json. Runs longer than a test should: it is not part of tests/run.sh. The exit
# status is 0 when every verdict passes.
set -euo pipefail
cd "$(dirname "$0")/.."
deploy/install-packages.sh build
cmake --preset release -DSIGHTLINE_TESTS=ON >/dev/null
cmake --build --preset release --parallel "$(nproc)" --target sightlined soak_client
exec /usr/bin/python3 tests/soak/soak.py build/release/bin/sightlined build/release/bin/soak_client "${1:-1}" build/soak/soak.json
