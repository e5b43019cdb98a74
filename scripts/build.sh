#!/usr/bin/env bash
# Builds octrad: scripts/build.sh [FOLDER [cmake options...]]   (default: build, optimised, the program only)
# TARGETS="a b" builds these targets instead.
# Where no NVIDIA GPU is, the CUDA kernels are left out, which saves minutes; -DOCTRAD_CUDA=on compiles them all the same.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:-build}
shift || true

# ccache serves a clone at any path from the same cache.
export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$PWD} CCACHE_NOHASHDIR=1 CCACHE_SLOPPINESS=pch_defines,time_macros

# What the arguments say of CUDA comes after this, and wins.
cuda=off
for gpu in /dev/nvidiactl /dev/nvidia0 /dev/dxg; do [ -e "$gpu" ] && cuda=auto; done

cmake -G Ninja -S . -B "$folder" -DCMAKE_BUILD_TYPE=Release -DOCTRAD_CUDA=$cuda "$@" >"$folder.log" 2>&1 || { cat "$folder.log" >&2; rm -f "$folder.log"; exit 1; }
rm -f "$folder.log"
# shellcheck disable=SC2086
cmake --build "$folder" --target ${TARGETS:-octrad}
