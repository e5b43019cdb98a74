#!/usr/bin/env python3
"""octrad as a library: installs the build folder OCTRAD_BUILD (default: build-test) and uses it as another project would.

The programs of examples/ are built in a clean folder with nothing but the place of the installation, and run. Nothing
of octrad is compiled again.
"""
import json
import os
import pathlib
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "cli"))
from exr import read_exr  # noqa: E402

BUILD = pathlib.Path(os.environ.get("OCTRAD_BUILD", ROOT / "build-test"))
BOX = ROOT / "scenes" / "cornell-box" / "scene.xml"

# Nine things side by side, a pixel each of a picture of 9 x 9; from the last ray the environment is seen.
ROW = """<scene version="3.0.0">
  <sensor type="perspective">
    <float name="fov" value="53.1301"/>
    <transform name="to_world"><lookat origin="0, 0, 9" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="9"/><integer name="height" value="9"/><rfilter type="box"/></film>
  </sensor>
  <emitter type="constant"><rgb name="radiance" value="0.2, 0.3, 0.4"/></emitter>
  <shape type="rectangle">
    <transform name="to_world"><rotate x="1" angle="180"/><scale value="30"/><translate x="0" y="0" z="12"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.4, 0.2"/></bsdf></bsdf>
  </shape>
%s
</scene>
"""
DIFFUSE = '<bsdf type="diffuse"><rgb name="reflectance" value="0.2, 0.5, 0.7"/></bsdf>'
THINGS = [
    '<bsdf type="conductor"/>', '<bsdf type="roughconductor"><float name="alpha" value="0.02"/></bsdf>',
    '<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>', '<bsdf type="plastic"/>',
    '<bsdf type="roughplastic"><float name="alpha" value="0.15"/></bsdf>',
    DIFFUSE + '<emitter type="area"><rgb name="radiance" value="5, 4, 3"/></emitter>',
    '<bsdf type="mask"><float name="opacity" value="0.3"/>%s</bsdf>' % DIFFUSE, DIFFUSE]

# A project that uses octrad by add_subdirectory, and what must still be its own.
PARENT = """cmake_minimum_required(VERSION 3.25)
project(parent LANGUAGES CXX)
add_subdirectory("%s" octrad)
add_executable(app app.cc)
target_link_libraries(app PRIVATE octrad::octrad)
foreach(name CMAKE_BUILD_TYPE CMAKE_CXX_STANDARD CMAKE_CXX_EXTENSIONS CMAKE_CXX_COMPILER_LAUNCHER CMAKE_CUDA_COMPILER
        CMAKE_CUDA_ARCHITECTURES CMAKE_EXPORT_COMPILE_COMMANDS BUILD_TESTING)
  if(NOT "${${name}}" STREQUAL "")
    message(FATAL_ERROR "octrad sets ${name} to ${${name}}")
  endif()
endforeach()
foreach(name octrad test_base)
  if(TARGET ${name})
    message(FATAL_ERROR "octrad adds the target ${name}")
  endif()
endforeach()
"""


def run(*words, cwd=None, expect=0, silent=False, **more):
    done = subprocess.run([str(w) for w in words], cwd=cwd, capture_output=True, text=True, timeout=600, stdin=subprocess.DEVNULL, **more)
    if done.returncode != expect:
        raise AssertionError("%s\nended with %d\n%s\n%s" % (shlex.join(map(str, words)), done.returncode, done.stdout[-4000:], done.stderr[-4000:]))
    if silent and done.stderr:
        raise AssertionError("%s\nwrote to standard error: %s" % (shlex.join(map(str, words)), done.stderr))
    return done.stdout


def png_rows(file):
    """Size and filtered rows of an 8-bit PNG."""
    data = file.read_bytes()
    size, body, at = struct.unpack(">II", data[16:24]), b"", 8
    while at < len(data):
        length = struct.unpack(">I", data[at:at + 4])[0]
        body += data[at + 8:at + 8 + length] if data[at + 4:at + 8] == b"IDAT" else b""
        at += length + 12
    return size, zlib.decompress(body)


class Install(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        run("cmake", "--install", BUILD, "--prefix", cls.folder / "first")
        cls.prefix = cls.folder / "moved"  # an installation may be moved
        (cls.folder / "first").rename(cls.prefix)
        shutil.copytree(ROOT / "examples", cls.folder / "examples")
        cls.bin = cls.folder / "build"
        run("cmake", "-G", "Ninja", "-S", cls.folder / "examples", "-B", cls.bin, "-DCMAKE_PREFIX_PATH=%s" % cls.prefix,
            "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON")
        run("cmake", "--build", cls.bin)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def test_examples_run(self):
        model, picture = self.folder / "box.octrad", self.folder / "box.png"
        out = run(self.bin / "train_and_render", BOX, model, picture, "2", silent=True)  # the library prints nothing
        steps, queries = map(int, re.search(r"(\d+) steps, then (\d+) queries", out).groups())
        self.assertGreater(steps, 0)
        self.assertGreater(queries, 320 * 240 * 16 / 2)  # most rays of the box's camera hit something
        size, rows = png_rows(picture)
        self.assertEqual(size, (320, 240))
        self.assertGreater(len(set(rows)), 50)  # shades
        lines = run(self.bin / "query_points", model, BOX, silent=True).splitlines()
        self.assertGreater(len(lines), 4)
        for line in lines:
            numbers = [float(x) for x in re.match(r"at \S+ \S+ \S+: (\S+) (\S+) (\S+)$", line).groups()]
            self.assertTrue(all(0.0 <= x < 1000.0 for x in numbers), line)
        # The installed program reads what the library wrote.
        info = json.loads(run(self.prefix / "bin" / "octrad", "info", model, "--json"))
        self.assertIn("octaoctree", json.dumps(info))

    def test_query_points_has_the_values_of_pictures(self):
        """Of mirrors, near mirrors, coats, lamps, masks and the sky, whatever the model was trained with."""
        octrad, scene, model, picture = self.prefix / "bin" / "octrad", self.folder / "row.xml", self.folder / "row.octrad", self.folder / "row.exr"
        scene.write_text(ROW % "\n".join('<shape type="rectangle"><transform name="to_world"><scale value="0.5"/><translate x="%d" y="0" z="0"/></transform>%s</shape>'
                                         % (x - 4, thing) for x, thing in enumerate(THINGS)))
        small = ["--steps", "20", "-D", "train.points=256", "-D", "train.directions=2", "-D", "octree.levels=3", "-D", "decoder.width=16"]
        for keys in ([], ["render.highlights=bounce"], ["render.highlights=cache", "render.delta=cache"], ["target.emission=inside"],
                     ["field=ncr", "ncr.log2_table=10", "ncr.cone.log2_table=10"]):
            with self.subTest(keys):
                run(octrad, "train", scene, "-o", model, "-q", "--overwrite", *small, *[word for key in keys for word in ("-D", key)])
                run(octrad, "render", scene, "--model", model, "--integrator", "lhs", "--spp", "1", "-o", picture, "-q")
                width, height, channels, _ = read_exr(picture)
                self.assertEqual((width, height), (9, 9))
                pixels = {name: struct.unpack("<81f", channels[name])[4 * 9:5 * 9] for name in ("R", "G", "B", "depth.Z")}
                lines = run(self.bin / "query_points", model, scene).splitlines()
                self.assertEqual(len(lines), 9)
                for x, line in enumerate(lines):
                    point, values = line.split(": ")
                    self.assertEqual(point == "no point", pixels["depth.Z"][x] == 0, line)
                    for c, value in zip("RGB", values.split()):
                        self.assertAlmostEqual(float(value), pixels[c][x], delta=1e-5 * abs(pixels[c][x]), msg=line)
                if "target.emission=inside" not in keys:  # which takes more steps to learn
                    self.assertGreater(float(lines[5].split(": ")[1].split()[0]), 2, "the lamp shines")
                self.assertTrue(lines[8].startswith("no point: 0.2 0.3 0.4"), lines[8])

    def test_errors_arrive_as_exceptions(self):
        run(self.bin / "query_points", self.folder / "absent.octrad", BOX, expect=3)
        broken = self.folder / "broken.xml"
        broken.write_text('<scene version="3.0.0"><shape type="blob"/></scene>')
        run(self.bin / "train_and_render", broken, self.folder / "x.octrad", self.folder / "x.png", expect=2)

    def test_users_compile_as_the_library_does(self):
        command = json.loads((self.bin / "compile_commands.json").read_text())[0]["command"]
        self.assertIn("-ffp-contract=off", command)
        self.assertRegex(command, r"-std=(c|gnu)\+\+2\d")

    def test_only_public_headers(self):
        headers = [p.relative_to(self.prefix / "include").as_posix() for p in (self.prefix / "include").rglob("*") if p.is_file()]
        self.assertIn("octrad/octrad.h", headers)
        self.assertEqual([h for h in headers if not h.startswith("octrad/") or re.search(r"_test|test_|-inl\.h|app/|\.cc$", h)], [])
        named = re.findall(r'#include "([^"]+)"', "".join((self.prefix / "include" / h).read_text() for h in headers))
        self.assertEqual(sorted(set(named) - set(headers)), [], "installed headers include headers that are not installed")

    def test_one_version(self):
        version = re.search(r"project\(octrad VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
        self.assertTrue(run(self.prefix / "bin" / "octrad", "--version").startswith("octrad " + version))
        self.assertIn('"%s"' % version, next(self.prefix.rglob("octradConfigVersion.cmake")).read_text())
        self.assertIn(version, (ROOT / "CHANGELOG.md").read_text())
        wanted = self.folder / "wanted"
        wanted.mkdir()
        for asked, expect in ((version, 0), ("99.0", 1)):
            (wanted / "CMakeLists.txt").write_text(
                "cmake_minimum_required(VERSION 3.25)\nproject(wanted LANGUAGES CXX)\nfind_package(octrad %s CONFIG REQUIRED)\n" % asked)
            run("cmake", "-G", "Ninja", "-S", wanted, "-B", wanted / "build", "-DCMAKE_PREFIX_PATH=%s" % self.prefix, expect=expect)

    def test_presets(self):
        presets = json.loads((ROOT / "CMakePresets.json").read_text())["configurePresets"]
        known = (ROOT / "CMakeLists.txt").read_text() + (ROOT / "cmake" / "cuda.cmake").read_text()
        listed = run("cmake", "--list-presets", cwd=ROOT)
        for preset in presets:
            self.assertIn('"%s"' % preset["name"], listed)
            for option in preset["cacheVariables"]:
                self.assertTrue(option.startswith("CMAKE_") or option in known, "%s is no option" % option)

    @unittest.skipUnless(shutil.which("pkg-config"), "no pkg-config")
    def test_pkg_config(self):
        where = next(self.prefix.rglob("octrad.pc")).parent
        flags = run("pkg-config", "--cflags", "--libs", "octrad", env={**os.environ, "PKG_CONFIG_PATH": str(where)}).split()
        run("c++", "-std=c++20", self.folder / "examples" / "query_points.cc", "-o", self.folder / "query_points", *flags)
        run(self.folder / "query_points", self.folder / "absent.octrad", BOX, expect=3)

    def test_add_subdirectory_changes_nothing_for_the_parent(self):
        parent = self.folder / "parent"
        parent.mkdir()
        (parent / "CMakeLists.txt").write_text(PARENT % ROOT)
        (parent / "app.cc").write_text("#include <octrad/octrad.h>\nint main() {}\n")
        run("cmake", "-G", "Ninja", "-S", parent, "-B", parent / "build")
        targets = run("ninja", "-C", parent / "build", "-t", "targets", "all")
        self.assertIn("liboctrad.a", targets)
        self.assertNotIn("gtest", targets)
        cache = (parent / "build" / "CMakeCache.txt").read_text()
        self.assertNotRegex(cache, r"(?m)^(CCACHE|CMAKE_BUILD_TYPE:\w+=.)")


if __name__ == "__main__":
    unittest.main()
