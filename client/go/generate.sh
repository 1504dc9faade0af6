#!/usr/bin/env bash
# Generates the messages and the service from proto/ into a folder (default: this one): generate.sh [FOLDER]. It needs protoc,
# protoc-gen-go v1.36.10 and protoc-gen-go-grpc v1.5.1.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=${1:-client/go}
find proto/sightline -name '*.proto' -print0 | sort -z | xargs -0 \
  protoc -I proto --go_out="$out" --go_opt=module=sightline.dev/go --go-grpc_out="$out" --go-grpc_opt=module=sightline.dev/go
