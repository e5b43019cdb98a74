#!/usr/bin/env python3
"""House rules that a program can check (ARCHITECTURE.md). Prints each breach, then "N passed, N failed, N skipped".

- Includes go down only, and each module includes only what it may know; folders inside a module too. No circles of files.
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
ALLOWED["perceptual"] = ALLOWED["model"] | {"image", "model"}
ALLOWED["train"] = ALLOWED["transport"] | ALLOWED["model"] | {"transport", "model"}
ALLOWED["render"] = set(ALLOWED["train"])
ALLOWED["octrad.h"] = ALLOWED["train"] | {"perceptual", "train", "render"}  # the umbrella header, for users of the library alone
ALLOWED["app"] = set(ALLOWED["octrad.h"])

# What readers of other scene files need to make a description of Mitsuba's kind of what they read.
SCENE_FILES = {"scene/" + name + ".h" for name in ("built_files", "description", "limits", "make_element", "picture_values", "texture",
                                                   "transform", "write_xml")}

# Folder inside a module -> (what of the module it may include besides itself, what of the module may include it).
INSIDE = {
    "app/cli": ({"app/paper", "app/report", "app/selftest", "app/view"}, set()),
    "app/report": (set(), {"app/cli", "app/paper", "app/view"}),
    "app/view": ({"app/report"}, {"app/cli"}),
    "app/selftest": (set(), {"app/cli"}),
    "app/paper": ({"app/report"}, {"app/cli"}),
    "scene/gltf": (SCENE_FILES | {"scene/load.h"}, {"scene/description.cc"}),
    "scene/pbrt": (SCENE_FILES | {"scene/curves.h", "scene/load.h", "scene/mesh.h", "scene/named_materials.h", "scene/params.h",
                                  "scene/report.h", "scene/spectrum.h"}, {"scene/description.cc"}),
    "shading/bsdf": ({"shading/bsdf_types.h", "shading/fresnel.h", "shading/material_record.h", "shading/microfacet.h", "shading/square_maps.h"}, {"shading/bsdf_math.h"}),
}

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


def unit_of(name):
    """"app/cli" of "app/cli/main.cc", "shading/bsdf" of "octrad/shading/bsdf/diffuse.h", "shading/fresnel.h" of a file at the top
    of its module."""
    parts = name.removeprefix("octrad/").split("/")
    return "/".join(parts[:-1] if len(parts) > 2 else parts)


def inside(name, target):
    """What is wrong when a file includes another one of its module, or None."""
    unit, other = unit_of(name), unit_of(target)
    if unit == other:
        return None
    if unit in INSIDE and other not in INSIDE[unit][0]:
        return "%s must not include %s" % (unit, target)
    if other in INSIDE and unit not in INSIDE[other][1]:
        return "%s is not for %s" % (target, unit)
    return None


def circles(includes):
    """Circles of files that include each other, each once, from {file: files that it includes}."""
    state, found = {}, []

    def visit(name, way):
        state[name] = "open"
        for target in sorted(includes.get(name, ())):
            if state.get(target) == "open":
                found.append(way[way.index(target):] + [target])
            elif target not in state:
                visit(target, way + [target])
        state[name] = "done"

    for name in sorted(includes):
        if name not in state:
            visit(name, [name])
    return found


def breaches(path, text):
    own = path.relative_to(SOURCE).as_posix()
    module = module_of(own)
    if module not in ALLOWED:
        yield "module %s is not in ARCHITECTURE.md" % module
        return
    if unit_of(own).count("/") and "." not in unit_of(own) and unit_of(own) not in INSIDE:
        yield "folder %s has no rule in INSIDE" % unit_of(own)
    for kind, name in INCLUDE.findall(text):
        target = module_of(name)
        if kind == '"' and target not in ALLOWED:
            yield 'include "%s" names no module (write "octrad/module/file.h")' % name
        elif target in ALLOWED and target != module and target not in ALLOWED[module]:
            yield "%s must not include %s (%s)" % (module, target, name)
        elif kind == '"' and target == module and inside(own, name):
            yield inside(own, name)
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


def self_test():
    """The rules themselves, on breaches that are known."""
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == [["b", "c", "b"]]
    assert not circles({"a": {"b", "c"}, "b": {"c"}})
    assert inside("app/selftest/checks.cc", "app/cli/common.h") and not inside("app/cli/selftest.cc", "app/selftest/selftest.h")
    assert inside("octrad/shading/lights.cc", "octrad/shading/bsdf/plastic.h")
    assert inside("octrad/shading/bsdf/plastic.h", "octrad/shading/lights.h")
    assert not inside("octrad/shading/bsdf/roughplastic.h", "octrad/shading/bsdf/plastic.h")


def main():
    self_test()
    failed = passed = 0
    includes = {}
    for path in sorted(p for p in SOURCE.rglob("*") if p.suffix in (".h", ".cc", ".cu")):
        text = path.read_text()
        includes[path.relative_to(SOURCE).as_posix()] = {name for kind, name in INCLUDE.findall(text) if kind == '"'}
        found = list(breaches(path, text))
        for breach in found:
            print("%s: %s" % (path.relative_to(SOURCE.parent), breach))
        failed, passed = failed + bool(found), passed + (not found)
    for circle in circles(includes):
        print("a circle of includes: %s" % " -> ".join(circle))
        failed += 1
    if passed + failed == 0:
        print("no sources found under %s" % SOURCE)
        failed = 1
    print("%d passed, %d failed, 0 skipped" % (passed, failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
