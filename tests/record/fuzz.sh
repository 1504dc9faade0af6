#!/usr/bin/env bash
# Fuzzes the readers of MCAP, starting from the kept corpus (clang 14, address and undefined-behaviour sanitizers, at
# most 1 GB).
#   tests/record/fuzz.sh [SECONDS]     default 60; new finds go to build/fuzz, not to the kept corpus
# After a failure the input is in build/fuzz. Add it to tests/record/mcap_corpus when the fault is mended.
set -euo pipefail
cd "$(dirname "$0")/../.."
deploy/install-packages.sh build
deploy/install-packages.sh fuzz
out=build/fuzz
mkdir -p "$out/corpus"
clang++-14 -std=c++20 -O1 -g -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined -I. \
  tests/record/mcap_fuzz.cpp server/record/{byte_io,chunk_codec,mcap_format,mcap_reader,mcap_recover,mcap_scanner,mcap_verify,mcap_writer}.cpp \
  server/base/error.cpp -lzstd -lz -o "$out/mcap_fuzz"
"$out/mcap_fuzz" -max_total_time="${1:-60}" -rss_limit_mb=1024 -malloc_limit_mb=256 -max_len=16384 -timeout=10 \
  -artifact_prefix="$out/" -print_final_stats=1 "$out/corpus" tests/record/mcap_corpus
