#!/usr/bin/env bash
# Builds Sightline, starts the daemon, and lets it steer a camera through a crowd of people. Prints how well it did beside a
# plain follow camera, and where the pictures and the page of the session are. Takes under 30 s when everything is built.
#   deploy/demo.sh [--sampler egl|embree|auto] [--scene crowd|hall|rooms|arena|fence|city|...] [--out FOLDER] [flags of sightline drive]
#
# The demo takes depth maps with EGL, as the daemon does on a GPU. Without a GPU, OpenGL renders in software (Mesa's llvmpipe), and a
# daemon that may choose (--sampler auto) takes Embree instead, which is faster there.
# The camera is driven as fast as it answers, and every 10th frame is judged. Flags of your own replace these two (--fast
# --truth-every 10): without --fast the scene plays in real time.
set -euo pipefail
cd "$(dirname "$0")/.."
sampler=egl scene=crowd out=out/demo drive=()
while [ $# -gt 0 ]; do
  case "$1" in
    --sampler) sampler=${2:?--sampler needs egl, embree or auto}; shift 2 ;;
    --scene) scene=${2:?--scene needs a name}; shift 2 ;;
    --out) out=${2:?--out needs a folder}; shift 2 ;;
    -h | --help) sed -n '2,10s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) drive+=("$1"); shift ;;
  esac
done
[ ${#drive[@]} -gt 0 ] || drive=(--fast --truth-every 10)

deploy/install-packages.sh build
cmake --preset release >/dev/null
cmake --build --preset release --parallel "$(nproc)" --target sightlined sightline make-scenes sightline_python_stubs
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
  kill -0 "$daemon" 2>/dev/null || { echo "The daemon did not start. Without OpenGL, try --sampler embree." >&2; daemon=; exit 1; }
  sleep 0.1
done
"$bin/sightline" drive "$run/scenes/$scene.glb" --server "unix:$run/sightline.sock" --out "$out" "${drive[@]}"

# The recording is complete once the daemon has stopped.
stop_daemon
recording=$(find "$out/recordings" -name '*.mcap' -printf '%T@ %p\n' | sort -n | tail -n 1 | cut -d ' ' -f 2-)
"$bin/sightline" report "$recording" --out "$out/report.html" --pictures 12
echo "record  $recording"
