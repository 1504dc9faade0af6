#!/usr/bin/env bash
# The C++ client as a package: package_test.sh SIGHTLINED SOURCE_ROOT WORK_FOLDER. Builds and installs the client alone, then builds the
# example with it, once by CMake's package and once by pkg-config, and runs both against a daemon.
set -euo pipefail
sightlined=$1 root=$2 work=$3
mkdir -p "$work"
cmake -S "$root" -B "$work/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSIGHTLINE_CLIENT_ONLY=ON -DCMAKE_INSTALL_PREFIX="$work/prefix" > /dev/null
if ninja -C "$work/build" -t commands | grep -iE 'embree|epoxy|draco|npm|glm/'; then
  echo "the client alone is built with parts of the server" >&2
  exit 1
fi
cmake --build "$work/build"
rm -rf "$work/prefix" "$work/game"
cmake --install "$work/build" --component client > /dev/null

mkdir "$work/game"
cp "$root/client/cpp/example.cpp" "$work/game"
cat > "$work/game/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.25)
project(game LANGUAGES C CXX)
find_package(sightline 0.2 CONFIG REQUIRED)
add_executable(game example.cpp)
target_link_libraries(game PRIVATE sightline::client)
CMAKE
cmake -S "$work/game" -B "$work/game/build" -G Ninja -DCMAKE_PREFIX_PATH="$work/prefix" > /dev/null
cmake --build "$work/game/build"
libdir=$(dirname "$(find "$work/prefix" -name pkgconfig)")
flags=$(PKG_CONFIG_PATH="$libdir/pkgconfig" pkg-config --cflags --libs sightline-client)
# shellcheck disable=SC2086
c++ -std=c++20 -o "$work/game/by-pkg-config" "$work/game/example.cpp" $flags

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
