#!/usr/bin/env bash
# Builds for arm64 on an amd64 machine with Debian 12, and runs what was built under qemu:
#   tests/deploy/arm64.sh [--into FOLDER] [TEST...]
# TEST: unit tests to build and run; default: those that link neither gRPC nor a graphics library. The C++ client is built in any case, and its
# example steers a camera of the daemon in build/release, where there is one. FOLDER (default: build/arm64) takes the packages of arm64,
# which are unpacked there and not installed.
set -euo pipefail
cd "$(dirname "$0")/../.."
work=$PWD/build/arm64
if [ "${1:-}" = --into ]; then work=$2; shift 2; fi
tests=("$@")
[ ${#tests[@]} -gt 0 ] || tests=(base_test scene_test bound_test aggregate_test move_test)
sysroot=$work/sysroot
# It installs a seccomp filter, which qemu does not offer to its programs.
not_under_qemu=Confined.NorDoesItWithoutOpenat2
for tool in aarch64-linux-gnu-g++ qemu-aarch64-static protoc grpc_cpp_plugin; do
  command -v "$tool" > /dev/null || { echo "Skipped: there is no $tool (packages g++-aarch64-linux-gnu, qemu-user-static, protobuf-compiler-grpc)"; exit 0; }
done

# The packages that deploy/install-packages.sh installs to build, without those that only run on the building machine.
packages() {
  sed -n '/^build_packages=(/,/^)/p' deploy/install-packages.sh | grep -oE '\blib[a-z0-9.+-]+|nlohmann-json3-dev|zlib1g-dev|prometheus-cpp-dev' |
    grep -vE '^(libegl-mesa0|libgl1-mesa-dri)$'
}

unpack_packages() {
  [ -e "$sysroot/complete" ] && return
  local apt=$work/apt
  mkdir -p "$apt/lists/partial" "$apt/archives/partial" "$sysroot"
  : > "$apt/status"
  local options=(-qq -o "APT::Architecture=arm64" -o "APT::Architectures::=arm64" -o "Dir::State::Lists=$apt/lists"
                 -o "Dir::State::status=$apt/status" -o "Dir::Cache=$apt" -o "Dir::Cache::archives=$apt/archives")
  apt-get "${options[@]}" update
  # shellcheck disable=SC2046
  apt-get "${options[@]}" -y --no-install-recommends --download-only install libc6-dev libstdc++-12-dev libgcc-12-dev protobuf-compiler-grpc $(packages)
  for package in "$apt"/archives/*.deb; do dpkg-deb -x "$package" "$sysroot"; done
  # Generators run on the building machine. They are of the same version.
  for tool in protoc grpc_cpp_plugin; do ln -sf "$(command -v "$tool")" "$sysroot/usr/bin/$tool"; done
  # The cross compiler looks for its headers of C++ here.
  ln -sfn /usr/aarch64-linux-gnu "$sysroot/usr/aarch64-linux-gnu"
  # Links to absolute paths would lead out of the folder.
  find "$sysroot" -type l -lname '/lib/*' -printf '%p %l\n' | while read -r link target; do ln -sfn "$sysroot$target" "$link"; done
  # Draco's package names its files by absolute paths.
  sed -i "s|\"/usr/|\"$sysroot/usr/|g" "$sysroot"/usr/lib/aarch64-linux-gnu/cmake/draco/*.cmake
  touch "$sysroot/complete"
}

write_toolchain() {
  cat > "$work/toolchain.cmake" <<CMAKE
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_SYSROOT $sysroot)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static -L $sysroot)
set(Protobuf_PROTOC_EXECUTABLE $(command -v protoc))
CMAKE
  export PKG_CONFIG_SYSROOT_DIR=$sysroot PKG_CONFIG_LIBDIR=$sysroot/usr/lib/aarch64-linux-gnu/pkgconfig:$sysroot/usr/share/pkgconfig
}

on_arm64() { qemu-aarch64-static -L "$sysroot" "$@"; }

configure() {
  cmake -S . -B "$1" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_TOOLCHAIN_FILE="$work/toolchain.cmake" "${@:2}" > "$1.log" || { tail -20 "$1.log"; exit 1; }
}

try_client() {
  configure "$work/client" -DSIGHTLINE_CLIENT_ONLY=ON
  nice cmake --build "$work/client" --target camera_example
  file_type=$(head -c 20 "$work/client/bin/camera_example" | od -An -tu1 -j18 -N1)
  [ "$file_type" -eq 183 ] || { echo "camera_example is not a program of arm64" >&2; exit 1; }
  [ -x build/release/bin/sightlined ] || { echo "client: built; not run, since build/release has no daemon"; return 0; }
  rm -f "$work/ready"
  build/release/bin/sightlined --sampler embree --log-level error --listen 127.0.0.1:0 --ready-file "$work/ready" &
  daemon=$!
  trap 'kill $daemon' EXIT
  for _ in $(seq 600); do [ -e "$work/ready" ] && break; sleep 0.1; done
  on_arm64 "$work/client/bin/camera_example" "$(awk '{print $1; exit}' "$work/ready")" > "$work/camera_example.out"
  [ "$(grep -c '^[0-9.]* s  camera' "$work/camera_example.out")" -eq 300 ] || { echo "the example did not get 300 replies" >&2; exit 1; }
  echo "client: 300 replies to an arm64 program"
}

run_tests() {
  configure "$work/tests" -DSIGHTLINE_TESTS=ON
  local failed=0
  for test in "${tests[@]}"; do
    nice cmake --build "$work/tests" --target "$test"
    on_arm64 "$work/tests/bin/$test" --gtest_filter=-"$not_under_qemu" > "$work/$test.out" 2>&1 || failed=1
    echo "$test: $(grep -E '^\[  (PASSED|FAILED)  \] [0-9]+ test' "$work/$test.out" | tr '\n' ' ')"
    grep -E '^\[  FAILED  \] [A-Z]' "$work/$test.out" | sort -u || true
  done
  return $failed
}

# The steps of a whole scene, as hashes of every answer, beside those of the same program in build/release, where there is one.
compare_steps() {
  nice cmake --build "$work/tests" --target step_digest
  on_arm64 "$work/tests/bin/step_digest" hall > "$work/steps.arm64"
  [ -x build/release/bin/step_digest ] || { echo "steps: $(wc -l < "$work/steps.arm64") settings ran; build/release has no step_digest to compare with"; return 0; }
  build/release/bin/step_digest hall > "$work/steps.amd64"
  local all paths
  all=$(sort "$work/steps.arm64" "$work/steps.amd64" | uniq -d | wc -l)
  paths=$(awk '{print $1, $2, $3}' "$work/steps.arm64" "$work/steps.amd64" | sort | uniq -d | wc -l)
  echo "steps: of $(wc -l < "$work/steps.amd64") settings, $paths give the camera path of this machine, bit for bit, and $all every answer"
}

mkdir -p "$work"
unpack_packages
write_toolchain
try_client
run_tests
compare_steps
