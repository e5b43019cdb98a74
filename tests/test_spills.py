#!/usr/bin/env python3
"""No kernel of tests/kernels.txt spills registers, from what the CUDA assembler said while the build ran.

    OCTRAD_BUILD=build test_spills.py            checks; SKIPPED for a build without CUDA
    OCTRAD_BUILD=build test_spills.py --list     every kernel with its registers, stack and spills

cmake/ptxas_report.sh puts the assembler's words beside the object files. Ends with "N passed, N failed, N skipped".
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = pathlib.Path(os.environ.get("OCTRAD_BUILD", ROOT / "build"))
LIST = ROOT / "tests" / "kernels.txt"

FRAME = re.compile(r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads")


def parse(text):
    """-> [(mangled name, architecture, stack, spill stores, spill loads, registers)]; functions that were not inlined count
    for the kernel that they are reported with."""
    rows = []
    for part in text.split("Compiling entry function ")[1:]:
        name, arch = re.match(r"'(\w+)' for '(\w+)'", part).groups()
        frames = [tuple(map(int, m.groups())) for m in FRAME.finditer(part)]
        registers = re.search(r"Used (\d+) registers", part)
        assert frames and registers, "the assembler's report on %s has another form than expected:\n%s" % (name, part)
        rows.append((name, arch, *(max(f[i] for f in frames) for i in range(3)), int(registers[1])))
    return rows


def demangled(names):
    if not names or not shutil.which("c++filt"):
        return names
    return subprocess.run(["c++filt"], input="\n".join(names), capture_output=True, text=True, check=True).stdout.splitlines()


def short(name):
    """The struct of a launched functor, else the function without its parameters."""
    launched = re.search(r"launch(?:_levels)?_kernel<(.*)>\(unsigned int", name)
    name = launched[1] if launched else re.sub(r"^void ", "", name)
    return re.sub(r"octrad::|\(anonymous namespace\)::", "", name if launched else re.sub(r"\(.*", "", name.replace("(anonymous namespace)::", "")))


def listed():
    for line in LIST.read_text().splitlines():
        words = line.split("#")[0].split()
        if words:
            options = dict(word.split("=", 1) for word in words[1:])
            yield words[0], int(options.pop("stack", 0)), int(options.pop("spill", 0))
            assert not options, "%s: unknown options %s" % (LIST.name, options)


def self_test():
    """The reading itself, on words of the assembler that are known."""
    sample = ("ptxas info    : Compiling entry function '_Z1a' for 'sm_90'\nptxas info    : Function properties for _Z1a\n"
              "    16 bytes stack frame, 8 bytes spill stores, 12 bytes spill loads\nptxas info    : Used 40 registers, used 0 barriers\n")
    assert parse(sample) == [("_Z1a", "sm_90", 16, 8, 12, 40)], parse(sample)
    assert short("void octrad::launch_kernel<octrad::(anonymous namespace)::Trace>(unsigned int, octrad::(anonymous namespace)::Trace)") == "Trace"


def main():
    self_test()
    reports = sorted(BUILD.rglob("*.ptxas"))
    kernels = [row for report in reports for row in parse(report.read_text())]
    if not kernels:
        print("SKIPPED: %s was built without CUDA" % BUILD.name)
        print("0 passed, 0 failed, 1 skipped")
        return 0
    names = demangled([row[0] for row in kernels])
    if "--list" in sys.argv:
        for name, (_, arch, stack, stores, loads, registers) in sorted(zip(map(short, names), kernels)):
            print("%-6s %3d registers  %4d stack  %4d spilled  %4d reloaded  %s" % (arch, registers, stack, stores, loads, name[:150]))
        return 0
    passed = failed = 0
    covered = set()
    for pattern, allowed, spill in listed():
        found = [(name, row) for name, row in zip(names, kernels) if re.search(pattern, name)]
        covered.update(name for name, _ in found)
        bad = ["%s: %s" % (pattern, "no kernel has this name")] if not found else []
        for name, (_, arch, stack, stores, loads, registers) in found:
            if max(stores, loads) > spill or stack > allowed:
                bad.append("%s (%s, %d registers): stack %d of %d bytes allowed, %d spilled, %d reloaded"
                           % (short(name)[:150], arch, registers, stack, allowed, stores, loads))
        print("\n".join("FAILED   " + line for line in bad) or "ok       %s: %d kernels" % (pattern, len(found)))
        passed, failed = passed + (not bad), failed + bool(bad)
    for name, row in zip(names, kernels):
        if name not in covered and (row[3] or row[4]):
            print("note     not in the list, spills %d bytes: %s" % (row[3], short(name)[:150]))
    print("%d passed, %d failed, 0 skipped" % (passed, failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
