#!/usr/bin/env bash
# The committed Go code is what the line in client/go/README.md generates: generated_test.sh GO MODULE WORK_FOLDER.
set -euo pipefail
go=$1 module=$2 work=$3
mkdir -p "$work/bin"
for plugin in google.golang.org/protobuf/cmd/protoc-gen-go@v1.36.10 google.golang.org/grpc/cmd/protoc-gen-go-grpc@v1.5.1; do
  name=$(basename "${plugin%@*}")
  [ -x "$work/bin/$name" ] || GOBIN="$work/bin" "$go" install "$plugin"
done
rm -rf "$work/out"
mkdir "$work/out"
PATH="$work/bin:$PATH" "$module/generate.sh" "$work/out"
# The version of protoc is in a comment.
diff -r -I '^// .*protoc' "$module/sightline" "$work/out/sightline"
