#!/usr/bin/env bash
# Fuzzes the readers of files with libFuzzer, under the address and undefined-behaviour sanitizers. Needs clang.
#   scripts/fuzz.sh                        every target, a minute each
#   scripts/fuzz.sh TARGET --seconds N     one target (tests/fuzz/targets.cc lists them), N seconds
#   scripts/fuzz.sh --build                only builds
# What it learns stays in build-fuzz/corpus. A file that breaks a reader is kept in build-fuzz/found; made small
# (build-fuzz/fuzz -minimize_crash=1 FILE) it belongs into tests/fuzz/found/TARGET, where the tests replay it.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=60 target='' only_build=0
while [ $# -gt 0 ]; do
  case "$1" in
    --seconds) seconds=${2:?--seconds N}; shift ;;
    --build) only_build=1 ;;
    -*) sed -n '2,7s/^# \{0,1\}//p' "$0" >&2; exit 1 ;;
    *) target=$1 ;;
  esac
  shift
done

export CXX=${CXX:-clang++}
TARGETS=fuzz scripts/build.sh build-fuzz -DOCTRAD_CUDA=off -DOCTRAD_ASSERTS=ON -DOCTRAD_FUZZ=ON \
  -DOCTRAD_SANITIZE=address,undefined -DCMAKE_CXX_FLAGS_RELEASE=-O1
[ $only_build = 0 ] || exit 0

corpus=$PWD/build-fuzz/corpus found=$PWD/build-fuzz/found
mkdir -p "$corpus" "$found"
octrad=${OCTRAD:-}
if [ -z "$octrad" ]; then
  for candidate in build-test/octrad build/octrad; do [ -x $candidate ] && octrad=$candidate && break; done
fi
[ -n "$octrad" ] || { echo "no octrad to make seeds with: build one, or set OCTRAD" >&2; exit 1; }
python=python3
/usr/bin/python3 -c '' 2>/dev/null && python=/usr/bin/python3
if [ -n "$target" ]; then names=$target; else names=$(sed -n 's/^    {"\([a-z_]*\)", guarded.*/\1/p' tests/fuzz/targets.cc); fi
(  # several targets may be started side by side
  flock 9
  for name in $names; do
    [ -d "$corpus/$name" ] || { "$python" tests/fuzz/make_seeds.py "$octrad" "$corpus"; break; }
  done
) 9>"$corpus.lock"

# Each run writes a file: into memory, where that is a file system.
[ -w /dev/shm ] && export TMPDIR=${TMPDIR:-/dev/shm}
export ASAN_OPTIONS=allocator_may_return_null=0:detect_stack_use_after_return=1:quarantine_size_mb=64 UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
bad=0 passed=0
TIMEFORMAT=%U+%S
for name in $names; do
  log=build-fuzz/$name.log
  # -max_len: small files reach as much and are faster. A reader that takes 10 seconds for one is a finding too.
  if spent=$({ time OCTRAD_FUZZ=$name build-fuzz/fuzz "$corpus/$name" -dict="$corpus/$name.dict" -max_total_time="$seconds" -max_len=60000 \
    -timeout=10 -rss_limit_mb=2500 -malloc_limit_mb=800 -artifact_prefix="$found/$name-" -print_final_stats=1 >"$log" 2>&1; } 2>&1); then
    passed=$((passed + 1))
    printf '  ok       %-8s %s s of a processor  %s\n' "$name" "$spent" "$(grep -E '^#[0-9]+' "$log" | tail -n 1 | tr '\t' ' ')"
  else
    bad=$((bad + 1))
    printf '  FAILED   %s: %s\n' "$name" "$(grep -E 'SUMMARY|ERROR|Test unit written' "$log" | head -n 3 | tr '\n' ' ')"
  fi
done
echo "$passed passed, $bad failed, 0 skipped"
[ $bad = 0 ]
