#!/usr/bin/env bash
# Builds octrad: scripts/build.sh [FOLDER [cmake options...]]   (default: build, optimised, the program only)
# TARGETS="a b" builds these targets instead.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:-build}
shift || true

# ccache serves a clone at any path from the same cache.
export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$PWD} CCACHE_NOHASHDIR=1 CCACHE_SLOPPINESS=pch_defines,time_macros

cmake -G Ninja -S . -B "$folder" -DCMAKE_BUILD_TYPE=Release "$@" >"$folder.log" 2>&1 || { cat "$folder.log" >&2; rm -f "$folder.log"; exit 1; }
rm -f "$folder.log"
# shellcheck disable=SC2086
cmake --build "$folder" --target ${TARGETS:-octrad}
