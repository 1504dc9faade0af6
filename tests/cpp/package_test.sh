#!/usr/bin/env bash
# The C++ client as a package: package_test.sh SIGHTLINED SOURCE_ROOT WORK_FOLDER. Builds and installs the client alone, prints the seconds that the
# build took, then builds the example with it by the lines of client/cpp/README.md, once for CMake and once for pkg-config, and runs both
# against a daemon.
set -euo pipefail
sightlined=$1 root=$2 work=$3
rm -rf "$work"
mkdir -p "$work"
cmake -S "$root" -B "$work/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSIGHTLINE_CLIENT_ONLY=ON -DCMAKE_INSTALL_PREFIX="$work/prefix" > /dev/null
if ninja -C "$work/build" -t commands | grep -iE 'embree|epoxy|draco|npm|glm/'; then
  echo "the client alone is built with parts of the server" >&2
  exit 1
fi
TIMEFORMAT="the client alone: %R s, of which the processors worked %U s, with $(nproc) cores and no compiler cache"
time CCACHE_DISABLE=1 cmake --build "$work/build" --parallel "$(nproc)"
cmake --install "$work/build" --component client > /dev/null

mkdir "$work/game"
cp "$root/client/cpp/example.cpp" "$work/game"
{
  printf 'cmake_minimum_required(VERSION 3.25)\nproject(game LANGUAGES C CXX)\nadd_executable(game example.cpp)\n'
  sed -n '/^```cmake$/,/^```$/{/^```/!p}' "$root/client/cpp/README.md"
} > "$work/game/CMakeLists.txt"
cmake -S "$work/game" -B "$work/game/build" -G Ninja -DCMAKE_PREFIX_PATH="$work/prefix" > /dev/null
cmake --build "$work/game/build"
cp "$work/game/example.cpp" "$work/game/game.cpp"
line=$(grep '^c++ ' "$root/client/cpp/README.md" | sed "s|/opt/sightline|$work/prefix|")
(cd "$work/game" && eval "$line" && mv game by-pkg-config)

ready=$work/game/ready
"$sightlined" --sampler embree --log-level error --listen 127.0.0.1:0 --ready-file "$ready" &
daemon=$!
trap 'kill $daemon' EXIT
for _ in $(seq 600); do [ -e "$ready" ] && break; sleep 0.1; done
address=$(awk '{print $1; exit}' "$ready")
for program in "$work/game/build/game" "$work/game/by-pkg-config"; do
  "$program" "$address" > "$program.out"
  [ "$(wc -l < "$program.out")" -eq 300 ]
  [ "$(grep -c '100% 100%$' "$program.out")" -gt 150 ] || { echo "$program: the targets are seldom visible" >&2; exit 1; }
done
[ "$(wc -l < "$root/client/cpp/example.cpp")" -lt 60 ]
