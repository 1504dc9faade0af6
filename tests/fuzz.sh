#!/usr/bin/env bash
# Fuzzes what reads bytes of others: tests/fuzz.sh [MINUTES] [TARGET...]
#
# The time (default 5 minutes) is divided equally between the targets: access, frames, gltf and mcap. Each starts from its kept corpus in
# tests/fuzz/corpus (mcap: tests/record/mcap_corpus), and runs with clang 14, the sanitizers of addresses and undefined behaviour, and at
# most 2 GB. New finds go to build/fuzz, not to the kept corpus. After a failure the input is in build/fuzz: add it to the kept corpus when
# the fault is mended. The exit status is 0 when nothing was found.
set -euo pipefail
cd "$(dirname "$0")/.."
minutes=${1:-5}
targets=("${@:2}")
[ ${#targets[@]} -gt 0 ] || targets=(access frames gltf mcap)
deploy/install-packages.sh build
deploy/install-packages.sh fuzz
out=build/fuzz
seconds=$((minutes * 60 / ${#targets[@]}))
flags=(-std=c++20 -O1 -g -I. -DGLM_FORCE_DEPTH_ZERO_TO_ONE -DGLM_ENABLE_EXPERIMENTAL -ffp-contract=off
       -fsanitize=address,undefined -fno-sanitize-recover=undefined)
base=(server/base/{camera,check,cpu_budget,error,hash,parallel,random,thread_pool,transform}.cpp)
gate=(server/gate/{access,frame_watch,listening_socket,small_file}.cpp)

# compile SOURCE...: the object of each source that has changed, two at a time.
compile() {
  printf '%s\n' "$@" | xargs -P 2 -I SOURCE bash -c '
    object='"$out"'/objects/$(echo SOURCE | tr / _).o
    [ -e "$object" ] && [ -z "$(find SOURCE server -newer "$object" -name "*.[hc]*" -print -quit)" ] ||
      clang++-14 '"${flags[*]}"' -fsanitize=fuzzer-no-link -c SOURCE -o "$object"'
}

# build TARGET DRIVER "LIBRARIES" SOURCE...
build() {
  local target=$1 driver=$2 libraries=$3
  shift 3
  compile "$driver" "$@"
  local objects=()
  for source in "$driver" "$@"; do objects+=("$out/objects/$(echo "$source" | tr / _).o"); done
  # shellcheck disable=SC2086
  clang++-14 -fsanitize=fuzzer,address,undefined "${objects[@]}" $libraries -lpthread -o "$out/$target"
}

# run TARGET CORPUS LONGEST_INPUT
run() {
  mkdir -p "$out/corpus-$1"
  echo "== $1: $seconds s"
  "$out/$1" -max_total_time="$seconds" -rss_limit_mb=2048 -malloc_limit_mb=1024 -max_len="$3" -timeout=20 -verbosity=0 \
    -artifact_prefix="$out/$1-" -print_final_stats=1 "$out/corpus-$1" "$2"
}

mkdir -p "$out/objects"
for target in "${targets[@]}"; do
  case $target in
    access)
      build access tests/fuzz/access_fuzz.cpp "-lcrypto -lxxhash" "${gate[@]}" server/base/{error,hash}.cpp
      run access tests/fuzz/corpus/access 4096 ;;
    frames)
      build frames tests/fuzz/frames_fuzz.cpp "" server/gate/frame_watch.cpp
      run frames tests/fuzz/corpus/frames 65536 ;;
    gltf)
      build gltf tests/fuzz/gltf_fuzz.cpp "-ltinygltf -ldraco -lmeshoptimizer -lxxhash -lcrypto" server/scene/*.cpp "${base[@]}"
      run gltf tests/fuzz/corpus/gltf 65536 ;;
    mcap)
      build mcap tests/record/mcap_fuzz.cpp "-lzstd -llz4 -lz" \
        server/record/{byte_io,chunk_codec,mcap_format,mcap_reader,mcap_recover,mcap_scanner,mcap_verify,mcap_writer}.cpp server/base/error.cpp
      run mcap tests/record/mcap_corpus 16384 ;;
    *) echo "there is no target $target: access, frames, gltf, mcap" >&2; exit 2 ;;
  esac
done
