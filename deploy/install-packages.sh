#!/usr/bin/env bash
# Installs the Debian 12 packages that are missing to build, run or test Sightline. Works as root and with sudo. Returns at once when
# nothing is missing.
#   deploy/install-packages.sh build   packages to build the programs and the tests (the default)
#   deploy/install-packages.sh test    the same, and the browser and the tools that some tests use
#   deploy/install-packages.sh run     packages that the built programs need
#   deploy/install-packages.sh run-cpu the same without OpenGL, for machines without a GPU
#   deploy/install-packages.sh fuzz    packages that tests/fuzz.sh needs in addition to "build"
#   deploy/install-packages.sh mutation  packages that tests/mutation.sh needs in addition to "build"
set -euo pipefail

build_packages=(
  ca-certificates ccache cmake g++ git ninja-build pkg-config
  libgrpc++-dev libgrpc-dev libprotobuf-dev libprotoc-dev protobuf-compiler protobuf-compiler-grpc
  libc-ares-dev libre2-dev libssl-dev openssl zlib1g-dev libzstd-dev liblz4-dev libabsl-dev
  libegl-dev libepoxy-dev libegl1 libopengl0 libegl-mesa0 libgl1-mesa-dri
  libembree-dev libtbb-dev libglm-dev libtinygltf-dev nlohmann-json3-dev
  libspdlog-dev libfmt-dev libcli11-dev libexpected-dev libxxhash-dev libstb-dev
  libmeshoptimizer-dev libdraco-dev
  prometheus-cpp-dev libsystemd-dev
  libgtest-dev libgmock-dev libbenchmark-dev libbullet-dev
  python3 python3-grpcio python3-protobuf python3-venv
)
# An npm from another source is good enough, and would conflict with Debian's.
command -v npm >/dev/null || build_packages+=(nodejs npm)
test_packages=(dpkg-dev lintian man-db zsh fish mono-mcs chromium chromium-driver python3-selenium fonts-dejavu-core prometheus systemd haproxy python3-clang-14 clang-format-14)
cpu_packages=(
  libgrpc++1.51 libprotobuf32 libepoxy0 libembree3-3 libtinygltf2d
  libspdlog1.10 libfmt9 libxxhash0 libmeshoptimizer2d libdraco7 libprometheus-cpp-core1.0 libsystemd0 libzstd1 liblz4-1 zlib1g libssl3
)
run_packages=("${cpu_packages[@]}" libegl1 libopengl0 libegl-mesa0 libgl1-mesa-dri)
fuzz_packages=(
  clang-14 libclang-rt-14-dev
)
mutation_packages=(python3-clang-14)

case "${1:-build}" in
  build) wanted=("${build_packages[@]}") ;;
  test) wanted=("${build_packages[@]}" "${test_packages[@]}") ;;
  run) wanted=("${run_packages[@]}") ;;
  run-cpu) wanted=("${cpu_packages[@]}") ;;
  fuzz) wanted=("${fuzz_packages[@]}") ;;
  mutation) wanted=("${mutation_packages[@]}") ;;
  *) echo "usage: $0 [build|test|run|run-cpu|fuzz|mutation]" >&2; exit 2 ;;
esac

missing=()
for package in "${wanted[@]}"; do
  [ "$(dpkg-query -W -f='${db:Status-Abbrev}' "$package" 2>/dev/null)" = "ii " ] || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "Missing packages: ${missing[*]}. Install them, or run this as root or with sudo." >&2; exit 1; }
  as_root=(sudo)
fi
echo "Installing: ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
