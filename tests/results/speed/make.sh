#!/usr/bin/env bash
# Makes the page on speed again: builds, measures, and writes README.md, tables and plots here. Nothing else should run meanwhile.
#   tests/results/speed/make.sh            # 7 minutes on two cores, 12 GiB of memory for 28 million triangles
#   tests/results/speed/make.sh --quick    # fewer frames and smaller scenes, into out/speed instead of here; for trying
#   SIGHTLINE_BIN=path/to/bin tests/results/speed/make.sh   # with these programs, without building
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
  cmake --build --preset release --parallel "$(nproc)" --target sightline sightlined speed_bench load_bench
  SIGHTLINE_BIN=build/release/bin
fi
bin=$SIGHTLINE_BIN raw=out/speed/raw
rm -rf "$raw" && mkdir -p "$raw/service" "$page"
SECONDS=0

"$bin/speed_bench" --out "$raw" "${quick[@]}" | tee "$raw/log.txt"
"$bin/load_bench" --csv "$raw/load.csv" "${sizes[@]}"

# Name and seconds at most, then what `sightline bench` is told.
load() {
  local name=$1 at_most=$2
  shift 2
  "$bin/sightline" bench --rate 60 --targets 2 --resolution 7 --candidates 343 --max-duration "$at_most" --json "$raw/service/$name.json" "$@" ||
    echo "$name: not measured" >&2
}
plain=(--preset paper --settings '{"settings":{"prediction_s":0},"tuning":{"bound":{"mode":"BOUND_MODE_HORIZON"},"aggregate":{"volume":"VOLUME_LATTICE","filter":{"mode":"FILTER_MODE_NONE"}},"move":{"strategy":"STRATEGY_BASIC"}}}')
load one-plain $lone_seconds --sessions 1 --window 5 "${plain[@]}" --points 0 --echo
load one-default $lone_seconds --sessions 1 --window 5 --echo
load fifty-plain $seconds --stable-windows 99 --sessions 50 "${plain[@]}" --points 8
load hundred-plain $seconds --stable-windows 99 --sessions 100 "${plain[@]}" --points 8
load hundred-default $seconds --stable-windows 99 --sessions 100
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
