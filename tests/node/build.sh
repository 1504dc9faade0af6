#!/usr/bin/env bash
# Builds the Node client from a copy of what it needs, as users of a checkout do: build.sh NPM SOURCE_ROOT FOLDER. The package is then in
# FOLDER/client/node. Does nothing, quickly, when its sources have not changed.
set -euo pipefail
npm=$1 root=$2 folder=$3
stamp=$(cd "$root" && find proto client/node -path client/node/node_modules -prune -o -path client/node/dist -prune -o -path client/node/src/gen -prune \
  -o -type f -print0 | sort -z | xargs -0 sha256sum | sha256sum)
[ "$(cat "$folder/stamp" 2>/dev/null)" = "$stamp" ] && exit 0
rm -rf "$folder/proto" "$folder/client/node/src" "$folder/client/node/dist" "$folder/stamp"
mkdir -p "$folder/client/node"
cp -r "$root/proto" "$folder/proto"
(cd "$root/client/node" && cp -r src ./*.json ./*.mjs ./*.yaml .npmrc README.md "$folder/client/node")
rm -rf "$folder/client/node/src/gen"
cd "$folder/client/node"
# The package of buf holds its program, so --ignore-scripts is safe.
cmp -s package-lock.json node_modules/installed || { "$npm" ci --prefer-offline --ignore-scripts --no-audit --no-fund --loglevel=error; cp package-lock.json node_modules/installed; }
"$npm" run build --silent
echo "$stamp" > "$folder/stamp"
