#!/usr/bin/env bash
# Installs buf from the npm registry, once for each build folder: install.sh NPM FOLDER. The package holds the program,
# so --ignore-scripts is safe.
set -euo pipefail
npm=$1 folder=$2 version=1.75.0
[ "$("$folder/node_modules/.bin/buf" --version 2>/dev/null)" = "$version" ] && exit 0
mkdir -p "$folder"
"$npm" install --prefix "$folder" --no-save --prefer-offline --ignore-scripts --no-audit --no-fund --loglevel=error "@bufbuild/buf@$version"
