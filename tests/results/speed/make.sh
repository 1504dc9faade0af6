#!/usr/bin/env bash
# Makes the page on speed. Builds, measures, and writes README.md, tables and plots into this folder. Nothing else
# should run.
#   tests/results/speed/make.sh            # 7 minutes on two cores; 28 million triangles need 12 GiB of memory
#   tests/results/speed/make.sh --quick    # a trial: fewer frames and smaller scenes, into out/speed
#   SIGHTLINE_BIN=path/to/bin tests/results/speed/make.sh   # use these programs and build nothing
set -euo pipefail
cd "$(dirname "$0")/../../.."

page=tests/results/speed quick=() seconds=40 lone_seconds=100 sizes=(280000 2800000 10000000)
case "${1:-}" in
  "") ;;
  --quick) page=out/speed quick=(--quick) seconds=12 lone_seconds=12 sizes=(280000) ;;
  *) echo "usage: $0 [--quick]" >&2; exit 2 ;;
esac

if [ -z "${SIGHTLINE_BIN:-}" ]; then
  deploy/install-packages.sh build
  cmake --preset release >/dev/null
  cmake --build --preset release --parallel "$(nproc)" --target sightline sightlined speed_bench load_bench echo_server
  SIGHTLINE_BIN=build/release/bin
fi
bin=$SIGHTLINE_BIN raw=out/speed/raw
rm -rf "$raw" && mkdir -p "$raw/service" "$page"
SECONDS=0

"$bin/speed_bench" --out "$raw" "${quick[@]}" | tee "$raw/log.txt"
"$bin/load_bench" --csv "$raw/load.csv" "${sizes[@]}"

# The name of the load and the most seconds it may take; then flags for `sightline bench`.
load() {
  local name=$1 at_most=$2
  shift 2
  "$bin/sightline" bench --rate 60 --targets 2 --resolution 7 --candidates 343 --max-duration "$at_most" --json "$raw/service/$name.json" "$@" ||
    echo "$name: not measured" >&2
}
plain=(--preset paper --settings '{"settings":{"prediction_s":0},"tuning":{"bound":{"mode":"BOUND_MODE_HORIZON"},"aggregate":{"volume":"VOLUME_LATTICE","filter":{"mode":"FILTER_MODE_NONE"}},"move":{"strategy":"STRATEGY_BASIC"}}}')
# The echo serves until its standard input, this pipe, is closed.
mkfifo "$raw/echo.stdin"
"$bin/echo_server" "unix:$raw/echo.sock" <"$raw/echo.stdin" >"$raw/echo.address" &
exec 9>"$raw/echo.stdin"
until [ -s "$raw/echo.address" ]; do sleep 0.1; done
load one-plain $lone_seconds --sessions 1 --window 5 "${plain[@]}" --points 0 --echo "unix:$raw/echo.sock"
load one-default $lone_seconds --sessions 1 --window 5 --echo "unix:$raw/echo.sock"
exec 9>&-
load fifty-plain $seconds --all-windows --sessions 50 "${plain[@]}" --points 8
load hundred-plain $seconds --all-windows --sessions 100 "${plain[@]}" --points 8
load hundred-default $seconds --all-windows --sessions 100
load twenty-egl $seconds --sessions 20 "${plain[@]}" --points 0 --daemon-flags "--sampler egl"

cp -r "$raw/rows.csv" "$raw/ratios.csv" "$raw/load.csv" "$raw/service" "$page/"
samplers=$(grep -E '^(egl|embree): ' "$raw/log.txt" | sed 's/^[a-z]*: //' | paste -sd '|' | sed 's/|/ and /')
python3 - "$page/how.json" <<EOF
import json, sys
json.dump({"minutes": $(((SECONDS + 59) / 60)), "cores": $(nproc), "cpu": "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1)",
           "samplers": "$samplers", "commit": "$(git rev-parse --short HEAD)"}, open(sys.argv[1], "w"), indent=2)
EOF
python3 tests/results/speed/make_page.py "$page"
echo "The page is $page/README.md"
