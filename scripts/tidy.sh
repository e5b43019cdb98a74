#!/usr/bin/env bash
# clang-tidy with the checks of .clang-tidy.
#   scripts/tidy.sh            every header of the library, as one unit: what the tests run, under a minute
#   scripts/tidy.sh BUILD      also every source that the build folder BUILD compiles; many minutes
set -euo pipefail
cd "$(dirname "$0")/.."
unit=$(mktemp -d)
trap 'rm -rf "$unit"' EXIT
(cd src && find octrad -name '*.h' ! -name '*-inl.h' ! -name '*_test_*' | sort | sed 's/.*/#include "&"/') \
  >"$unit/headers.cc"
cp .clang-tidy "$unit"
echo "clang-tidy: $(wc -l <"$unit/headers.cc") headers"
clang-tidy --quiet "$unit/headers.cc" -- -std=c++20 -Isrc
if [ $# -gt 0 ]; then
  python3 -c 'import json, sys; print(*[e["file"] for e in json.load(open(sys.argv[1])) if e["command"].find("-x cu") < 0], sep="\n")' \
    "$1/compile_commands.json" | xargs -P "$(nproc)" -n 4 clang-tidy --quiet -p "$1"
fi
