#!/usr/bin/env python3
"""docs/extending.md is a recipe that works: every step is carried out on a copy of the tree, with the files of templates/.

Then the library is built once (optimised little, without the program), the tests that follow the lists run, and
templates/try.cc makes pictures. Steps on the page, in its order, lines joined:
    copy `templates/FILE` to `FOLDER/`
    in `FILE`, above | below | instead of `TEXT`: an indented block, put above or below the one line that holds TEXT, or in
    the place of TEXT.
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
STEP = re.compile(r"[Cc]opy `(?P<source>templates/[^`]+)` to `(?P<folder>[^`]+/)`"
                  r"|[Ii]n `(?P<file>[^`]+)`, (?P<how>above|below|instead of) `(?P<anchor>[^`]+)`:\n\n(?P<block>(?:    .*\n|\n(?=    ))+)")
TESTS = ("bsdf_test.cc", "plugin_help_test.cc", "planes_test.cc", "field_test.cc")  # those that follow the lists, or came with a template

PARENT = """cmake_minimum_required(VERSION 3.25)
project(templates LANGUAGES CXX)
set(OCTRAD_TESTS ON)
add_subdirectory(tree)
add_executable(try tree/templates/try.cc)
target_link_libraries(try PRIVATE octrad::octrad)
# What runs for long is optimised: networks, encodings, and the tests of scattering models. The rest compiles for longer.
foreach(name base image device scene transport model perceptual train render)
  target_compile_options(octrad_${name} PRIVATE -O0)
endforeach()
"""

SCENE = """<scene version="3.0.0">
  <integrator type="path"/>
  <sensor type="perspective"><float name="fov" value="45"/>
    <transform name="to_world"><lookat origin="0, 2, 5" target="0, 0.5, 0" up="0, 1, 0"/></transform></sensor>
  <emitter type="constant"><rgb name="radiance" value="1"/></emitter>
  <shape type="sphere"><point name="center" x="0" y="0.8" z="0"/><float name="radius" value="0.8"/>%s</shape>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>%s</shape>
</scene>
"""


def run(*words, **more):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, stdin=subprocess.DEVNULL, **more)
    if done.returncode != 0:
        raise AssertionError("%s\nended with %d\n%s\n%s" % (" ".join(map(str, words)), done.returncode, done.stdout[-6000:], done.stderr[-2000:]))
    return done.stdout


def steps():
    text = (ROOT / "docs" / "extending.md").read_text()
    joined = re.sub(r"(?<=\S)\n(?=\S)(?!    )", " ", text)  # steps may be broken over lines
    return list(STEP.finditer(joined))


def take(step, tree):
    if step["source"]:
        target = tree / step["folder"] / pathlib.Path(step["source"]).name
        if not target.parent.is_dir() or target.exists():
            raise AssertionError("%s cannot be copied to %s" % (step["source"], step["folder"]))
        shutil.copy(tree / step["source"], target)
        return
    path, anchor = tree / step["file"], step["anchor"]
    lines = path.read_text().splitlines(keepends=True)
    at = [i for i, line in enumerate(lines) if anchor in line]
    if len(at) != 1:
        raise AssertionError("%s has %d lines with `%s`, not one" % (step["file"], len(at), anchor))
    block = re.sub(r"(?m)^    ", "", step["block"]).rstrip("\n")
    if step["how"] == "instead of":
        lines[at[0]] = lines[at[0]].replace(anchor, block)
    else:
        lines.insert(at[0] + (step["how"] == "below"), block + "\n")
    path.write_text("".join(lines))


class Templates(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        tree = cls.folder / "tree"
        for name in ("cmake", "configs", "src", "templates", "tests"):
            shutil.copytree(ROOT / name, tree / name)
        shutil.copy(ROOT / "CMakeLists.txt", tree)
        for test in tree.rglob("*_test.cc"):
            if test.name not in TESTS:
                test.unlink()
        taken = [step for step in steps() if take(step, tree) is None]
        cls.copied = {step["source"] for step in taken if step["source"]}
        for test in tree.rglob("templates/*_test.cc"):
            test.unlink()
        (cls.folder / "CMakeLists.txt").write_text(PARENT)
        environment = {**os.environ, "CCACHE_BASEDIR": str(cls.folder), "CCACHE_NOHASHDIR": "1"}
        launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
        run("cmake", "-G", "Ninja", "-S", cls.folder, "-B", cls.folder / "build", "-DOCTRAD_CUDA=off", "-DOCTRAD_WERROR=ON",
            "-DCMAKE_CXX_FLAGS=-O1", *launcher, env=environment)
        run("cmake", "--build", cls.folder / "build", "--target", "try", "test_scene", "test_shading", "test_encoding", "test_model", env=environment)

    def passed(self, program, tests):
        out = run(self.folder / "build" / "tree" / program, "--gtest_filter=" + tests, cwd=self.folder)
        self.assertRegex(out, r"\[  PASSED  \] [1-9]")

    def numbers(self, bsdf, field="planes", steps=3):
        scene = self.folder / "scene.xml"
        scene.write_text(SCENE % (bsdf, bsdf))
        return json.loads(run(self.folder / "build" / "try", scene, field, str(steps)))

    def test_every_template_is_in_the_recipes(self):
        files = {"templates/" + p.name for p in (ROOT / "templates").iterdir()} - {"templates/try.cc"}
        self.assertEqual(files, self.copied)

    def test_scattering_model(self):
        self.passed("test_shading", "Bsdf.*")
        self.passed("test_scene", "PluginHelp.*")
        velvet = '<bsdf type="velvet"><rgb name="reflectance" value="0.7"/><float name="fuzz" value="%s"/></bsdf>'
        diffuse = self.numbers('<bsdf type="diffuse"><rgb name="reflectance" value="0.7"/></bsdf>')
        smooth, fuzzy = self.numbers(velvet % 0), self.numbers(velvet % 1)
        self.assertEqual(smooth["path"], diffuse["path"])
        self.assertLess(fuzzy["path"], 0.95 * smooth["path"])
        self.assertNotEqual(fuzzy["fingerprint"], smooth["fingerprint"])

    def test_encoding(self):
        self.passed("test_encoding", "Planes.*")

    def test_field(self):
        self.passed("test_model", "Registry/AllFields.*/planes")
        seen = self.numbers('<bsdf type="diffuse"/>', steps=150)
        self.assertLess(abs(seen["lhs"] - seen["path"]), 0.05 * seen["path"])  # a cache of a simple scene has its brightness

    def test_integrator(self):
        seen = self.numbers('<bsdf type="diffuse"/>')
        self.assertGreater(seen["occlusion"], 0.5)
        self.assertLess(seen["occlusion"], 0.99)
        self.assertLess(seen["differing"], 0.02)  # on a stream: other trees, the same samples


if __name__ == "__main__":
    unittest.main()
