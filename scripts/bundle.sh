#!/usr/bin/env bash
# Packs octrad for machines without its packages: any x86-64 Linux with glibc 2.34 or newer, no network, no root.
#   scripts/bundle.sh [options] -o octrad.tar.xz        (.tar: not compressed; .tar.gz)
#   --cuda            with the CUDA backend, and a twin octrad-nofmad whose kernels do not fuse multiply-adds, as the CPU's code does not;
#                     for CMAKE_CUDA_ARCHITECTURES (of the environment), default 90-real
#   --tests           with the unit tests that have a variant for GPUs
#   --scenes FOLDER   with this scene (scene.xml and all beside it), as shared/scenes/NAME; may be repeated
#   --build FOLDER    takes the programs of this build and compiles nothing; --build-nofmad FOLDER: the twin's
# docs/bundle.md says what is in it and what it needs.
set -euo pipefail
start=$PWD
root=$(cd "$(dirname "$0")/.." && pwd)
newest=2.34  # glibc that it runs on

fail() { echo "scripts/bundle.sh: $*" >&2; exit 1; }
cuda=0 tests=0 scenes=() build='' twin='' output=''
while [ $# -gt 0 ]; do
  case "$1" in
    --cuda) cuda=1 ;;
    --tests) tests=1 ;;
    --scenes) while [ $# -gt 1 ] && [[ $2 != -* ]]; do scenes+=("$2"); shift; done ;;
    --build|--build-nofmad|-o)
      [ $# -gt 1 ] || fail "$1 needs a value"
      case "$1" in --build) build=$2 ;; --build-nofmad) twin=$2 ;; -o) output=$2 ;; esac
      shift ;;
    -h|--help) sed -n '2,10s/^# \{0,1\}//p' "$0"; exit ;;
    *) fail "unknown option $1 (see --help)" ;;
  esac
  shift
done
case "$output" in
  *.tar.xz|*.tar.gz|*.tar) ;;
  '') fail "-o OUT.tar.xz says where the bundle goes" ;;
  *) fail "-o $output: expected a name that ends in .tar.xz, .tar.gz or .tar" ;;
esac
for scene in ${scenes[@]+"${scenes[@]}"}; do [ -f "$scene/scene.xml" ] || fail "--scenes $scene: no scene.xml in it"; done
for tool in dpkg-query objdump python3 strip tar; do command -v $tool >/dev/null || fail "$tool is needed"; done

# Modules with unit tests for GPUs, as cmake/modules.cmake chooses them.
programs=(octrad)
if [ $tests = 1 ]; then
  for module in $(cd "$root/src/octrad" && grep -lE '(stream|device)_test_helper' -- */*_test.cc | cut -d/ -f1 | sort -u); do programs+=("test_$module"); done
fi
compile() {  # FOLDER TARGETS cmake options...
  local with=off
  [ $cuda = 0 ] || with=on
  TARGETS=$2 "$root/scripts/build.sh" "$1" -DOCTRAD_CUDA=$with -DCMAKE_CUDA_ARCHITECTURES="${CMAKE_CUDA_ARCHITECTURES:-90-real}" \
    -DOCTRAD_TESTS=$([ $tests = 1 ] && echo ON || echo OFF) "${@:3}"
}
if [ -z "$build" ]; then
  build=$root/build-bundle
  [ $cuda = 0 ] || build=$root/build-bundle-cuda
  compile "$build" "${programs[*]}"
fi
if [ $cuda = 1 ] && [ -z "$twin" ]; then
  twin=$root/build-bundle-nofmad
  tests=0 compile "$twin" octrad -DCMAKE_CUDA_FLAGS=-fmad=false
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
to=$work/octrad
mkdir -p "$to/bin" "$to/lib/gcc" "$to/licences" "$to/bench" "$to/scenes"
for program in "${programs[@]}"; do
  [ -x "$build/$program" ] || fail "$build/$program is not there; build it first, or leave --build away"
  strip -o "$to/bin/$program" "$build/$program"
done
if [ $cuda = 1 ]; then
  [ -x "$twin/octrad" ] || fail "$twin/octrad is not there"
  strip -o "$to/bin/octrad-nofmad" "$twin/octrad"
fi
# Before somebody carries it to a GPU.
if [ $cuda = 1 ] && ! "$build/octrad" info --json | python3 -c 'import json,sys; sys.exit(not json.load(sys.stdin)["built_with_cuda"])'; then
  fail "$build was built without CUDA"
fi

# Every library beyond those of glibc, with its licence. libgcc_s comes with glibc on every distribution, and theirs fits
# their glibc: ours, which needs 2.35, is for systems without one.
packages=()
while read -r library; do
  name=$(basename "$library")
  case "$name" in
    ld-linux*|libc.so.*|libm.so.*|libdl.so.*|librt.so.*|libpthread.so.*|linux-vdso*) continue ;;
    libgcc_s.so.*) place=$to/lib/gcc ;;
    *) place=$to/lib ;;
  esac
  real=$(readlink -f "$library")
  cp "$real" "$place/$name"
  package=$(dpkg-query -S "$real" 2>/dev/null || dpkg-query -S "${real#/usr}" 2>/dev/null) || fail "$library belongs to no Debian package, so its licence is not known"
  packages+=("${package%%:*}")
done < <(for program in "$to"/bin/*; do
  ldd "$program" | awk -v of="$program" '/not found/ { print of ": " $1 " is not installed" >"/dev/stderr"; exit 1 } $2 == "=>" { print $3 }'
done | sort -u)
[ ${#packages[@]} -gt 0 ] || fail "no library found"
# What is compiled in from headers.
packages+=(libcli11-dev nlohmann-json3-dev libboost-dev libhwy-dev)
for package in $(printf '%s\n' "${packages[@]}" | sort -u); do
  [ -f "/usr/share/doc/$package/copyright" ] || fail "no licence of $package in /usr/share/doc"
  mkdir -p "$to/licences/$package"
  cp -L "/usr/share/doc/$package/copyright" "$to/licences/$package/copyright"
  for text in $(grep -oE '/usr/share/common-licenses/[A-Za-z0-9.+-]*[A-Za-z0-9]' "$to/licences/$package/copyright" | sort -u); do
    mkdir -p "$to/licences/common-licenses"
    [ ! -f "$text" ] || cp -L "$text" "$to/licences/common-licenses/"
  done
done
cp "$root/LICENSE" "$to/licences/octrad"

# libstdc++ of Debian 12 names one function of glibc 2.36 (arc4random, in std::random_device, which octrad does not use).
python3 "$root/scripts/glibc_floor.py" --newest $newest --unversion arc4random "$to/lib/libstdc++.so.6"
python3 "$root/scripts/glibc_floor.py" --newest $newest "$to"/bin/* "$to"/lib/*.so*

for starter in octrad run $([ $cuda = 0 ] || echo octrad-nofmad); do
  cp "$root/scripts/bundle_start.sh" "$to/$starter"
  chmod 755 "$to/$starter"
done
cp "$root/bench/gpu.sh" "$root"/bench/gpu*.py "$to/bench/"
for scene in "$root"/scenes/*/; do cp -rL "$scene" "$to/scenes/"; done
for scene in ${scenes[@]+"${scenes[@]}"}; do
  mkdir -p "$to/shared/scenes"
  cp -rL "$scene" "$to/shared/scenes/"
done
changes=$(git -C "$root" status --porcelain 2>/dev/null | head -n 1 || true)
commit=$(git -C "$root" rev-parse --short HEAD 2>/dev/null || echo unknown)
printf '%s%s\n' "$commit" "${changes:+ with changes}" >"$to/commit"
cat >"$to/README" <<TEXT
octrad $("$build/octrad" --version | awk '{print $NF}'), for x86-64 Linux with glibc $newest or newer. Nothing needs to be installed.

    ./octrad train scenes/cornell-box/scene.xml --time 30s -o model.octrad
    ./octrad --help

The starter octrad finds the libraries of lib/ itself; it may be linked to from elsewhere, and the folder may lie anywhere.
Measurements on a GPU: bench/gpu.sh --help (needs Python 3.8). Unit tests, where they are packed: ./run test_device
Licences of octrad and of each library: licences/
TEXT

date=$(git -C "$root" log -1 --format=%ct 2>/dev/null || echo 0)
cd "$start"
case "$output" in
  *.xz) compress=(--use-compress-program "xz -T0 -8") ;;
  *.gz) compress=(--gzip) ;;
  *) compress=() ;;
esac
tar -C "$work" --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$date" ${compress[@]+"${compress[@]}"} -cf "$output.part" octrad
mv "$output.part" "$output"
echo "$output: $(du -m --apparent-size "$output" | cut -f1) MB, $(du -sm --apparent-size "$to" | cut -f1) MB unpacked"
