#!/usr/bin/env bash
# Kills streams and daemons while cameras film: tests/fault.sh [STREAMS [DAEMONS]]
#
# The default is 10,000 streams and 100 daemons, which takes about 10 minutes on an idle machine. Needs a build in build/release. Prints the counts as
# JSON, and writes them to build/faults.json. The exit status is 0 when every session went on within a second and no camera jumped. tests/fault/README.md describes the faults.
set -euo pipefail
cd "$(dirname "$0")/.."
python=$(command -v /usr/bin/python3)
exec "$python" tests/fault/fault_test.py build/release/bin/sightlined build/release/python --streams "${1:-10000}" --daemons "${2:-100}" \
  --stops 5 --floods 5 --sessions 8 --most-wait-s 1.0 --out build/faults.json
