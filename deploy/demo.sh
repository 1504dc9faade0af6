#!/usr/bin/env bash
# The main job, end to end: installs what is missing, builds, starts the daemon, lets it steer a camera through the hall,
# prints how well it did and where the picture and the page of the session are, stops the daemon, and makes a page of what
# the daemon recorded.
#   deploy/demo.sh [--sampler auto|egl|embree] [--scene hall|rooms|arena|fence|city] [--out FOLDER] [more flags of sightline drive]
set -euo pipefail
cd "$(dirname "$0")/.."
sampler=auto scene=hall out=out/demo drive=()
while [ $# -gt 0 ]; do
  case "$1" in
    --sampler) sampler=${2:?--sampler needs auto, egl or embree}; shift 2 ;;
    --scene) scene=${2:?--scene needs a name}; shift 2 ;;
    --out) out=${2:?--out needs a folder}; shift 2 ;;
    -h | --help) sed -n '2,5s/^# //p' "$0"; exit 0 ;;
    *) drive+=("$1"); shift ;;
  esac
done

deploy/install-packages.sh build
cmake --preset release >/dev/null
cmake --build --preset release --parallel "$(nproc)" --target sightlined sightline make-scenes
bin=build/release/bin

run=$(mktemp -d)
daemon=
stop_daemon() {
  [ -z "$daemon" ] || { kill -TERM "$daemon" 2>/dev/null && wait "$daemon" || true; }
  daemon=
}
stop() {
  stop_daemon
  rm -rf "$run"
}
trap stop EXIT

mkdir -p "$out"
"$bin/make-scenes" --out "$run/scenes" "$scene"
"$bin/sightlined" --listen none --listen-unix "$run/sightline.sock" --sampler "$sampler" --ready-file "$run/ready" \
  --record-dir "$out/recordings" --record-scenes &
daemon=$!
for _ in $(seq 100); do
  [ -e "$run/ready" ] && break
  kill -0 "$daemon" 2>/dev/null || { echo "The daemon did not start." >&2; daemon=; exit 1; }
  sleep 0.1
done
"$bin/sightline" drive "$run/scenes/$scene.glb" --server "unix:$run/sightline.sock" --out "$out" --page "$out/session.html" "${drive[@]}"

# The recording is whole once the daemon has gone.
stop_daemon
recording=$(find "$out/recordings" -name '*.mcap' -printf '%T@ %p\n' | sort -n | tail -n 1 | cut -d ' ' -f 2-)
"$bin/sightline" report "$recording" --out "$out/report.html"
echo "record  $recording"
