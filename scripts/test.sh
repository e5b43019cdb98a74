#!/usr/bin/env bash
# Every check of the project, from a bare clone: installs what is missing, builds, tests, and ends with one line
# "N passed, N failed, N skipped". About half an hour on two cores the first time, mostly compiling.
#   scripts/test.sh              everything
#   scripts/test.sh --fast       without the sanitizers, clang, a million rays against Embree and the demo
#   scripts/test.sh --long       everything, a minute of fuzzing for every reader of files, and fifty kills in each test of kills
# The work tree is only read; builds are in build-test, build-sanitize and build-thread.
# Scenes that are not part of this repository are looked for in $OCTRAD_SHARED, else in ../shared; tests that need them
# are skipped without them.
set -uo pipefail
cd "$(dirname "$0")/.."

fast=0 long=0
case "${1:-}" in
  "") ;;
  --fast) fast=1 ;;
  --long) long=1 ;;
  *) echo "usage: scripts/test.sh [--fast | --long]" >&2; exit 1 ;;
esac

started=$SECONDS
passed=0 failed=0 skipped=0
logs=$(mktemp -d)
trap 'rm -rf "$logs"' EXIT
[ $long = 0 ] || export OCTRAD_KILLS=50
export CLICOLOR=0 GTEST_COLOR=no PYTHONDONTWRITEBYTECODE=1

# Wall time, and processor time of what ran so far.
step() {
  times >"$logs/times"
  printf '\n== %s  [%d s, %.0f s of processors]\n' "$*" $((SECONDS - started)) \
    "$(tail -n 1 "$logs/times" | awk '{ split($1, u, /[ms]/); split($2, k, /[ms]/); print 60 * (u[1] + k[1]) + u[2] + k[2] }')"
}
finish() {
  printf '\nTook %d min %d s.\n' $(((SECONDS - started) / 60)) $(((SECONDS - started) % 60))
  echo "$passed passed, $failed failed, $skipped skipped"
  [ "$failed" = 0 ]
  exit
}
last_number() { grep -oE "$2" "$1" | tail -n 1 | grep -oE '[0-9]+' | head -n 1; }

# count NAME LOG STATUS TIME: adds the results that a test program printed, and prints the time it took; a program that
# ends badly without a failed test of its own (a crash, a sanitizer's report) is one failure.
count() {
  local name=$1 log=$2 status=$3 took=$4 p=0 f=0 s=0
  if grep -qE '^\[==========\] .* ran\.' "$log"; then                                  # GoogleTest
    p=$(last_number "$log" '^\[  PASSED  \] [0-9]+'); s=$(last_number "$log" '^\[  SKIPPED \] [0-9]+ test')
    f=$(last_number "$log" '^\[  FAILED  \] [0-9]+ test')
  elif grep -qE '^[0-9]+ passed, [0-9]+ failed' "$log"; then                           # our own scripts
    p=$(last_number "$log" '^[0-9]+ passed'); f=$(grep -oE '^[0-9]+ passed, [0-9]+ failed' "$log" | tail -n 1 | grep -oE '[0-9]+ failed' | grep -oE '[0-9]+')
    s=$(grep -oE '[0-9]+ skipped$' "$log" | tail -n 1 | grep -oE '[0-9]+')
  elif grep -qE '^Ran [0-9]+ test' "$log"; then                                        # Python's unittest
    f=$(($(grep -oE 'failures=[0-9]+' "$log" | tail -n 1 | grep -oE '[0-9]+' || echo 0) + $(grep -oE 'errors=[0-9]+' "$log" | tail -n 1 | grep -oE '[0-9]+' || echo 0)))
    s=$(grep -oE 'skipped=[0-9]+' "$log" | tail -n 1 | grep -oE '[0-9]+')
    p=$(($(last_number "$log" '^Ran [0-9]+') - f - ${s:-0}))
    [ "$p" -ge 0 ] || p=0  # every part of a test that failed counts
  elif [ "$status" = 0 ]; then
    p=1
  fi
  p=${p:-0} f=${f:-0} s=${s:-0}
  if [ "$status" != 0 ] && [ "$f" = 0 ]; then f=1; fi
  passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
  if [ "$status" != 0 ] || [ "$f" != 0 ]; then
    tail -n 60 "$log" | sed 's/^/    /'
    printf '  FAILED   %s (status %d, %d failed)  [%s]\n' "$name" "$status" "$f" "$took"
  elif [ "$p" = 0 ] && [ "$s" = 0 ]; then
    failed=$((failed + 1)); printf '  FAILED   %s: ran no test\n' "$name"
  else
    printf '  ok       %-32s %4d passed %s [%s]\n' "$name" "$p" "$([ "$s" = 0 ] || echo "$s skipped ")" "$took"
    # Tests that need a GPU have names that end in Cuda: one line for all of a program.
    local cuda
    cuda=$(grep -cE '^\[  SKIPPED \] [^ ]+Cuda$' "$log" || true)
    [ "$cuda" = 0 ] || printf '             SKIPPED: %d tests on a GPU: no CUDA device\n' "$cuda"
    grep -ohE '([0-9]+ inputs|pictures of [0-9]+ pixels): largest peak.*|peak over estimate.*' "$log" | sed 's/^/             /'
    grep -hE '^\[  SKIPPED \] [A-Za-z]+.*\.|skipped .|SKIPPED:' "$log" | grep -vE 'Cuda( |$)|^SKIPPED: no CUDA device' | sort -u | head -n 5 |
      sed 's/^/             /'
  fi
}
# add NAME COMMAND...: something for run_added, which runs as many at once as there are processors, in this order, and
# counts each when it ends. So what runs for longest is added first.
names=() commands=()
add() { names+=("$1"); shift; commands+=("$(printf '%q ' "$@")"); }
declare -A running=()
count_ended() {
  local i
  for i in "${!running[@]}"; do
    [ -s "$logs/$i.status" ] || continue  # has ended
    unset "running[$i]"
    count "${names[i]}" "$logs/$i.log" "$(cat "$logs/$i.status")" "$(tail -n 1 "$logs/$i.time")"
  done
}
run_added() {
  local i
  rm -f "$logs"/*.status
  for i in "${!names[@]}"; do
    while [ "$(jobs -rp | wc -l)" -ge "$(nproc)" ]; do wait -n; count_ended; done
    running[$i]=1
    (TIMEFORMAT='%0R s, processors %0U + %0S s'
      { time eval "${commands[i]}" >"$logs/$i.log" 2>&1 </dev/null; } 2>"$logs/$i.time"; echo $? >"$logs/$i.status") &
  done
  wait
  count_ended
  names=() commands=()
}
check() { add "$@"; run_added; }
skip() { skipped=$((skipped + 1)); printf '  SKIPPED  %s\n' "$*"; }
fatal() { failed=$((failed + 1)); printf '  FAILED   %s\n' "$*"; finish; }

step "Dependencies"
scripts/install_deps.sh --test || fatal "cannot install what is missing"
python=
for candidate in python3 /usr/bin/python3; do
  if "$candidate" -c 'import numpy' 2>/dev/null; then python=$candidate; break; fi
done
[ -n "$python" ] || fatal "no Python with numpy"

step "House rules"
formatted() { find src examples templates -name '*.h' -o -name '*.cc' -o -name '*.cu' | grep -v '_test_data\.h$' | xargs clang-format --dry-run -Werror; }
add "include directions" "$python" tests/check_includes.py
for script in scripts/*.sh .ci/run; do add "syntax of $script" bash -n "$script"; done
if clang-format --version 2>/dev/null | grep -q 'version 14\.'; then add "format" formatted; else skip "format: clang-format 14 is not installed"; fi
run_added

step "Build: optimised, assertions on, warnings are errors; with CUDA where nvcc is (for one architecture where no GPU is)"
TARGETS=all scripts/build.sh build-test -DOCTRAD_CUDA=auto -DOCTRAD_ASSERTS=ON -DOCTRAD_WERROR=ON -DOCTRAD_TESTS=ON >"$logs/build" 2>&1 ||
  { tail -n 60 "$logs/build"; fatal "the build"; }
export OCTRAD_BUILD=$PWD/build-test OCTRAD=$PWD/build-test/octrad

step "Tests, and what clang and nvcc say of the sources"
# What fuzzing starts from, of every reader of files; test_fuzz reads it.
"$python" tests/fuzz/make_seeds.py "$OCTRAD" "$logs/seeds" >"$logs/make_seeds" 2>&1 || { tail "$logs/make_seeds"; fatal "tests/fuzz/make_seeds.py"; }
export OCTRAD_FUZZ_SEEDS=$logs/seeds
# What takes long first: the command line, and four of the programs.
add "command line" "$python" tests/cli/run.py "$OCTRAD"
if [ $fast = 0 ]; then
  add "tests/check_clang.py" "$python" tests/check_clang.py --without src/app/view  # a part of view_server
  if command -v clang-tidy >/dev/null; then add "scripts/tidy.sh" scripts/tidy.sh; else skip "clang-tidy is not installed"; fi
fi
mapfile -t programs < <(cd build-test && printf '%s\n' test_train test_model test_transport test_shading test_* | awk '!seen[$0]++')
for program in "${programs[@]}"; do
  if [ "$program" = test_geometry ] && [ $fast = 0 ]; then  # own tree against Embree, in each shared scene
    add "$program, a million rays" env OCTRAD_TEST_RAYS=1000000 "build-test/$program"
  else
    add "$program" "build-test/$program"
  fi
done
for script in tests/test_templates.py tests/test_examples.py tests/test_*.py; do
  [[ " ${names[*]} " == *" $script "* ]] || add "$script" "$python" "$script"
done
if "$python" -c 'import mitsuba' 2>/dev/null; then
  add "random materials against Mitsuba" "$python" tests/random_models.py --tests build-test/test_shading
else
  skip "mitsuba is not installed for $python: tests/random_models.py"
fi
nvcc=$(command -v nvcc || ls /usr/local/cuda/bin/nvcc 2>/dev/null || true)
if [ -n "$nvcc" ]; then
  unit=$logs/math_headers.cu
  (cd src && find . -name '*_math.h' | sort | sed 's|^\./|#include "|; s|$|"|') >"$unit"
  add "nvcc: $(wc -l <"$unit") headers" "$nvcc" -std=c++17 --expt-relaxed-constexpr -arch=sm_75 -Isrc -c "$unit" -o "$logs/math_headers.o"
else
  skip "nvcc is not installed"
fi
run_added

# build_with FOLDER NAME SANITIZERS PROGRAM...: builds these test programs with sanitizers. By clang, which takes two
# thirds of g++'s time for it, and whose warnings are errors here too.
build_with() {
  local folder=$1 name=$2 compiler=()
  if command -v clang++ >/dev/null; then compiler=(-DCMAKE_CXX_COMPILER=clang++ -DOCTRAD_WERROR=ON); fi
  step "Build with the $name"
  TARGETS="${*:4}" scripts/build.sh "$folder" -DOCTRAD_ASSERTS=ON -DOCTRAD_TESTS=ON -DOCTRAD_CUDA=off -DOCTRAD_SANITIZE="$3" "${compiler[@]}" \
    -DCMAKE_CXX_FLAGS_RELEASE=-O1 >"$logs/$folder" 2>&1 || { tail -n 60 "$logs/$folder"; fatal "the build"; }
}
# add_from FOLDER FILTER PROGRAM...: their tests, those that GoogleTest's filter takes.
add_from() {
  local program
  for program in "${@:3}"; do
    # The viewer's server, by a client that sends it anything: tests/cli.
    if [ "$program" = view_server ]; then
      add "$1/view_server" env OCTRAD_VIEW_SERVER="$PWD/$1/view_server" "$python" tests/cli/run.py "$OCTRAD" test_view.Malformed test_view.Stream \
        test_live.Edits
    else
      add "$1/$program" env GTEST_FILTER="$2" "$1/$program"
    fi
  done
}

if [ $fast = 0 ]; then
  if [ $long = 1 ]; then
    step "Fuzzing: every reader of files for a minute"
    check "scripts/fuzz.sh" scripts/fuzz.sh
  fi

  step "Demo, small and short"
  check "scripts/demo.sh --quick" scripts/demo.sh --quick

  threaded=(view_server test_train test_render test_transport)
  build_with build-sanitize "address and undefined-behaviour sanitizers" address,undefined "${programs[@]}" view_server
  build_with build-thread "thread sanitizer" thread "${threaded[@]}"
  step "Unit tests with sanitizers"
  # Tests that take minutes with sanitizers leave themselves out.
  export OCTRAD_SANITIZED=1 UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 ASAN_OPTIONS=detect_stack_use_after_return=1
  export TSAN_OPTIONS=halt_on_error=1:suppressions=$PWD/tests/thread_sanitizer.txt
  # Large scenes run the same code as small ones, for minutes; that they are read stays.
  small='-*Bvh8SharedScenes*:*DeviceWorlds.Shared*:*DevicePaths.SharedScenes*'
  add_from build-sanitize "$small" test_model view_server  # for longest
  add_from build-thread '-*Shared*:*LosslessObjects*' "${threaded[@]}"
  for program in "${programs[@]}"; do [ "$program" = test_model ] || add_from build-sanitize "$small" "$program"; done
  run_added
fi

finish
