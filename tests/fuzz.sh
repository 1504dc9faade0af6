#!/usr/bin/env bash
# Fuzzes what reads bytes of others: tests/fuzz.sh [MINUTES] [TARGET...]
#
# The time (default 5 minutes) may be a fraction such as 0.5. It is divided equally between the targets: access, config, control, delta, frames,
# gltf and mcap. Each target runs for at least a second. It starts from its kept corpus in tests/fuzz/corpus (mcap: tests/record/mcap_corpus), and
# runs with clang 14, the sanitizers of addresses and undefined behaviour, and at most 2 GB. New finds go to build/fuzz, not to the kept corpus.
# After a failure the input is in build/fuzz: add it to the kept corpus when the fault is mended. The number of executions of each run is added to
# build/fuzz/executions. The exit status is 0 when nothing was found, and 2 when an argument is wrong.
set -euo pipefail
cd "$(dirname "$0")/.."
minutes=${1-5}
targets=("${@:2}")
known=(access config control delta frames gltf mcap)
# libFuzzer takes 0 seconds for no limit at all, so this is checked before.
if ! [[ $minutes =~ ^([0-9]+([.][0-9]*)?|[.][0-9]+)$ && $minutes =~ [1-9] ]]; then
  echo "MINUTES must be a positive number such as 5 or 0.5, got '$minutes'" >&2
  exit 2
fi
for target in "${targets[@]}"; do
  [[ " ${known[*]} " == *" $target "* ]] || { echo "there is no target $target: ${known[*]}" >&2; exit 2; }
done
[ ${#targets[@]} -gt 0 ] || targets=("${known[@]}")
deploy/install-packages.sh build
deploy/install-packages.sh fuzz
out=build/fuzz
seconds=$(awk -v minutes="$minutes" -v targets=${#targets[@]} 'BEGIN { share = int(minutes * 60 / targets); print share < 1 ? 1 : share }')
flags=(-std=c++20 -O1 -g -I. -DGLM_FORCE_DEPTH_ZERO_TO_ONE -DGLM_ENABLE_EXPERIMENTAL -ffp-contract=off
       -fsanitize=address,undefined -fno-sanitize-recover=undefined
       -Ibuild/fuzz/generated -isystem build/fuzz/proto -march=x86-64-v2 -DSPDLOG_COMPILED_LIB -DSPDLOG_FMT_EXTERNAL
       "-DSIGHTLINE_VERSION=\"fuzz\"" "-DSIGHTLINE_BUILD=\"fuzz\"")
base=(server/base/{camera,check,control_group,cpu_budget,error,hash,parallel,random,thread_pool,transform}.cpp)
gate=(server/gate/{access,frame_watch,listening_socket,small_file}.cpp)
session=(server/{scene,bound,aggregate,move,step,session}/*.cpp server/sample/{depth_map,extent,plan}.cpp server/sample/embree_*.cpp server/settings/rules.cpp
         server/wire/*.cpp server/service/session_budget.cpp "${base[@]}")

# compile SOURCE...: the object of each source that has changed, or one of whose headers has, two at a time. The method of a step is built
# for speed and without the fuzzer's counters, which would take two thirds of the time of `control`: it reads no bytes of others.
compile() {
  printf '%s\n' "$@" | xargs -P 2 -I SOURCE bash -c '
    object='"$out"'/objects/$(echo SOURCE | tr / _).o
    up_to_date() { [ -e "$object.d" ] && [ -z "$(find $(sed "s/^[^:]*://; s/\\\\$//" "$object.d") -newer "$object" -print -quit 2>&1)" ]; }
    case SOURCE in
      server/aggregate/* | server/move/* | server/bound/* | server/sample/* | server/step/*) coverage=-O2 ;;
      *) coverage=-fsanitize=fuzzer-no-link ;;
    esac
    up_to_date || clang++-14 '"${flags[*]@Q}"' $coverage -MMD -MF "$object.d" -c SOURCE -o "$object"'
}

# The messages, and the settings as structs, as the normal build makes them.
generate() {
  [ -e "$out/generated.stamp" ] && [ -z "$(find proto server/settings -newer "$out/generated.stamp" -print -quit)" ] && return
  mkdir -p "$out"/{proto,generated,descriptors}
  protoc -Iproto --cpp_out="$out/proto" proto/sightline/{v1,options/v1,tuning/v1alpha1}/*.proto proto/google/rpc/*.proto
  protoc -Iproto --python_out="$out/descriptors" proto/sightline/options/v1/setting.proto
  protoc -Iproto --include_imports --include_source_info --descriptor_set_out="$out/descriptors/settings.pb" \
    proto/sightline/v1/settings.proto proto/sightline/tuning/v1alpha1/tuning.proto
  PYTHONPATH=$out/descriptors PYTHONDONTWRITEBYTECODE=1 /usr/bin/python3 server/settings/generate.py "$out/descriptors/settings.pb" "$out/generated"
  touch "$out/generated.stamp"
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

# run TARGET CORPUS LONGEST_INPUT [FLAG...]
run() {
  mkdir -p "$out/corpus-$1"
  echo "== $1: $seconds s"
  local status=0
  # The stack of every allocation would take a third of the time. Run the input of a failure without these options to see the stacks.
  # Inputs that take long are tried less often than others, by at most a factor of 30.
  ASAN_OPTIONS=malloc_context_size=0:${ASAN_OPTIONS-} \
    "$out/$1" -max_total_time="$seconds" -rss_limit_mb=2048 -malloc_limit_mb=1024 -max_len="$3" -timeout=20 -verbosity=0 \
    -artifact_prefix="$out/$1-" -print_final_stats=1 -entropic_scale_per_exec_time=1 "${@:4}" \
    "$out/corpus-$1" "$2" 2>&1 | tee "$out/$1.log" || status=1
  local executions taken
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$out/$1.log")
  taken=$(sed -n 's/^Done .* in \([0-9]*\) second(s)$/\1/p' "$out/$1.log")
  echo "$1 ${executions:-0} ${taken:-$seconds}" >>"$out/executions"
  return $status
}

mkdir -p "$out/objects"
for target in "${targets[@]}"; do
  case $target in
    access)
      build access tests/fuzz/access_fuzz.cpp "-lcrypto -lxxhash" "${gate[@]}" server/base/{error,hash}.cpp
      run access tests/fuzz/corpus/access 4096 ;;
    config)
      generate
      build config tests/fuzz/config_fuzz.cpp "" server/{flags,config_file,faulty_device,command_table}.cpp server/base/{control_group,error,memory_budget}.cpp
      run config tests/fuzz/corpus/config 4096 ;;
    control)
      generate
      build control tests/fuzz/control_fuzz.cpp "-lprotobuf -lembree3 -ltinygltf -ldraco -lmeshoptimizer -lxxhash -lcrypto" "${session[@]}" \
        "$out"/generated/server/{settings,wire}/*.cpp $(find "$out/proto" -name '*.pb.cc')
      run control tests/fuzz/corpus/control 8192 ;;
    delta)
      build delta tests/fuzz/delta_fuzz.cpp "-ltinygltf -ldraco -lmeshoptimizer -lxxhash -lcrypto" server/scene/*.cpp "${base[@]}"
      run delta tests/fuzz/corpus/delta 4096 ;;
    frames)
      build frames tests/fuzz/frames_fuzz.cpp "" server/gate/frame_watch.cpp
      run frames tests/fuzz/corpus/frames 65536 ;;
    gltf)
      build gltf tests/fuzz/gltf_fuzz.cpp "-ltinygltf -ldraco -lmeshoptimizer -lxxhash -lcrypto" server/scene/*.cpp "${base[@]}"
      run gltf tests/fuzz/corpus/gltf 65536 ;;
    mcap)
      build mcap tests/record/mcap_fuzz.cpp "-lzstd -llz4 -lz" \
        server/record/{byte_io,chunk_codec,mcap_format,mcap_reader,mcap_recover,mcap_scanner,mcap_verify,mcap_writer}.cpp server/base/error.cpp
      # Its many rare features make the choice of inputs by entropy take two thirds of the time.
      run mcap tests/record/mcap_corpus 16384 -entropic=0 ;;
  esac
done
