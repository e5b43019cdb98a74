#!/usr/bin/env bash
# Evidence from a GPU in one command: octrad selftest and the main timings, into bench/results/<date>-<gpu>.json.
#   bench/gpu.sh [-o OUT.json] [SCENE.xml ...]        options: bench/gpu.sh --help
# Without a GPU it says so, runs what the CPU can emulate, and keeps nothing unless -o says where.
set -euo pipefail
exec python3 "$(dirname "$0")/gpu.py" "$@"
