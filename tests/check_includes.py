#!/usr/bin/env python3
"""House rules that a program can check (ARCHITECTURE.md). Prints each breach, then "N passed, N failed, N skipped".

- Includes go down only, and each module includes only what it may know.
- *_math.h headers are host and device code: no heap, containers, exceptions or threads.
- Headers have #pragma once; sources stay below 800 lines and headers below 400 (tables of test data aside).
"""
import pathlib
import re
import sys

SOURCE = pathlib.Path(__file__).resolve().parent.parent / "src"

# Module -> modules it may include, besides itself.
ALLOWED = {"base": set(), "image": {"base"}, "device": {"base"}}
ALLOWED["scene"] = ALLOWED["image"] | {"image"}
ALLOWED["geometry"] = ALLOWED["scene"] | {"scene", "device"}
ALLOWED["shading"] = ALLOWED["geometry"] | {"geometry"}
ALLOWED["transport"] = ALLOWED["shading"] | {"shading"}
ALLOWED["encoding"] = {"base", "device"}
ALLOWED["network"] = {"base", "device"}
ALLOWED["model"] = {"base", "device", "encoding", "network"}
ALLOWED["train"] = ALLOWED["transport"] | ALLOWED["model"] | {"transport", "model"}
ALLOWED["render"] = set(ALLOWED["train"])
ALLOWED["octrad.h"] = ALLOWED["train"] | {"train", "render"}  # the umbrella header, for users of the library alone
ALLOWED["app"] = set(ALLOWED["octrad.h"])

INCLUDE = re.compile(r'^\s*#\s*include\s+([<"])([^>"]+)[>"]', re.M)
HOST_ONLY = {"vector", "string", "map", "unordered_map", "memory", "functional", "stdexcept", "iostream", "fstream", "thread",
             "mutex", "span", "optional"}


def code_of(text):
    """The text without comments and string literals."""
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', "", text, flags=re.S)


def module_of(name):
    """The module of "octrad/MODULE/file.h" or "app/..."; None where the name has no folder."""
    if name == "octrad/octrad.h":
        return "octrad.h"
    parts = name.split("/")
    if parts[0] == "octrad":
        parts = parts[1:]
    return parts[0] if len(parts) > 1 else None


def breaches(path, text):
    module = module_of(path.relative_to(SOURCE).as_posix())
    if module not in ALLOWED:
        yield "module %s is not in ARCHITECTURE.md" % module
        return
    for kind, name in INCLUDE.findall(text):
        target = module_of(name)
        if kind == '"' and target not in ALLOWED:
            yield 'include "%s" names no module (write "octrad/module/file.h")' % name
        elif target in ALLOWED and target != module and target not in ALLOWED[module]:
            yield "%s must not include %s (%s)" % (module, target, name)
        if path.name.endswith("_math.h") and kind == "<" and name in HOST_ONLY:
            yield "a _math.h header must not include <%s>" % name
    if path.name.endswith("_math.h"):
        for word in sorted(set(re.findall(r"\b(throw|new|delete|std::vector|std::string|virtual)\b", code_of(text)))):
            yield "a _math.h header must not use %s" % word
    lines = text.count("\n")
    if path.suffix == ".h":
        # Highway's *-inl.h files are included once for each instruction set.
        if "#pragma once" not in text and not path.name.endswith("-inl.h"):
            yield "no #pragma once"
        if lines > 400 and not path.stem.endswith("_test_data"):
            yield "%d lines; split headers above 400" % lines
    elif lines > 800:
        yield "%d lines; split sources above 800" % lines


def main():
    failed = passed = 0
    for path in sorted(p for p in SOURCE.rglob("*") if p.suffix in (".h", ".cc", ".cu")):
        found = list(breaches(path, path.read_text()))
        for breach in found:
            print("%s: %s" % (path.relative_to(SOURCE.parent), breach))
        failed, passed = failed + bool(found), passed + (not found)
    if passed + failed == 0:
        print("no sources found under %s" % SOURCE)
        failed = 1
    print("%d passed, %d failed, 0 skipped" % (passed, failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
