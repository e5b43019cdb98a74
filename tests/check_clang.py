#!/usr/bin/env python3
"""clang understands the program's sources without a warning, and headers compile alone. Nothing is generated.
The library's sources are compiled by clang with the sanitizers (scripts/test.sh).

    OCTRAD_BUILD=build check_clang.py [FILE ...]      src/app and all headers of src/ but those of tests, or these
                       check_clang.py --without DIR   all but the sources of a folder that clang compiles anyway

The folders of the libraries come from compile_commands.json of the build. The sources of a folder are read as one, as
the build does. Headers with which the source of their name begins are not tried again. Ends with "N passed, N failed,
N skipped"; skipped without clang.
"""
import concurrent.futures
import itertools
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = pathlib.Path(os.environ.get("OCTRAD_BUILD", ROOT / "build"))
# Kernels' constants, such as kMinBlocks, are used where nvcc compiles them.
FLAGS = ["-std=c++20", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off",
         "-Wno-unused-const-variable"]


def library_flags():
    """Where the headers of the libraries are, and what is defined for them and for single sources; nothing of CUDA."""
    flags = {("-I%s" % (ROOT / "src"),): None}
    for command in json.loads((BUILD / "compile_commands.json").read_text()):
        words = shlex.split(command["command"])
        for word, following in zip(words, words[1:]):
            if word == "-isystem" and "cuda" not in following:
                flags[word, following] = None
            elif word.startswith("-D") and "CUDA" not in word and word != "-DNDEBUG":
                flags[(word,)] = None
    return [word for flag in flags for word in flag]


def first_include(path):
    found = re.search(r'^#include [<"](.*)[>"]', path.read_text(), re.M)
    return found and found[1]


def wanted():
    """Lists of files that are compiled together: the sources of each folder of the program, and headers alone."""
    files = [p for kind in ("*.cc", "*.h") for p in sorted((ROOT / "src").rglob(kind)) if "_test" not in p.name]
    program = [p for p in files if ROOT / "src/app" in p.parents and p.suffix == ".cc"]
    # Highway's *-inl.h files are included once for each instruction set, by sources that prepare for it.
    begun = {first_include(p) for p in files if p.suffix == ".cc"}
    headers = [[p] for p in files if p.suffix == ".h" and not p.name.endswith("-inl.h")
               and not (p.relative_to(ROOT / "src").as_posix() in begun and p.with_suffix(".cc").exists())]
    return [list(folder) for _, folder in itertools.groupby(program, lambda p: p.parent)] + headers


def main():
    clang = shutil.which("clang++")
    if not clang:
        print("SKIPPED: clang is not installed\n0 passed, 0 failed, 1 skipped")
        return 0
    print(subprocess.run([clang, "--version"], capture_output=True, text=True).stdout.splitlines()[0])
    flags = FLAGS + library_flags()

    def compile_together(paths):
        unit = "".join('#include "%s"\n' % path for path in paths)
        return paths, subprocess.run([clang, *flags, "-x", "c++", "-"], input=unit, capture_output=True, text=True)

    if sys.argv[1:2] == ["--without"]:
        together = [paths for paths in wanted() if paths[0].suffix == ".h" or paths[0].parent != pathlib.Path(sys.argv[2]).resolve()]
    else:
        together = [[pathlib.Path(p).resolve()] for p in sys.argv[1:]] or wanted()
    passed = failed = 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for paths, done in pool.map(compile_together, together):
            passed, failed = passed + (done.returncode == 0), failed + (done.returncode != 0)
            if done.returncode != 0:
                print("%s:\n%s" % (", ".join(map(str, paths)), done.stderr))
    print("%d passed, %d failed, 0 skipped" % (passed, failed))
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main())
