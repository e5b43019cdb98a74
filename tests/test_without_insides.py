#!/usr/bin/env python3
"""bench/without_insides.py: hollow lamps lose their inner walls and what is in them; nothing else changes."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = pathlib.Path(os.environ.get("OCTRAD", ROOT / "build" / "octrad"))
SCENE = """<scene version="3.0.0"><sensor type="perspective"><transform name="to_world"><lookat origin="0, 0, 9" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
%s</scene>"""
LAMP = '<shape type="obj"><string name="filename" value="meshes/%s"/><emitter type="area"><rgb name="radiance" value="3"/></emitter></shape>'
PLAIN = '<shape type="obj"><string name="filename" value="meshes/%s"/></shape>'


def cube(half, inwards, first):
    """Lines of a cube of triangles around the origin, as an OBJ file has them, with vertices from number `first` on."""
    lines = ["v %g %g %g" % (half * x, half * y, half * z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    for a, b, c, d in ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)):
        corners = (a, d, c, b) if inwards else (a, b, c, d)
        lines.append("f " + " ".join(str(first + i) for i in corners))
    return lines


def faces(path):
    return [line for line in path.read_text().split("\n") if line.startswith("f ")]


class WithoutInsides(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="octrad-lamps-")
        self.addCleanup(folder.cleanup)
        self.folder, self.new = pathlib.Path(folder.name) / "scene", pathlib.Path(folder.name) / "new"
        (self.folder / "meshes").mkdir(parents=True)
        wall = cube(1, False, 1) + cube(0.99, True, 9)
        for name, lines in (("hollow.obj", wall), ("box.obj", wall), ("filament.obj", cube(0.1, False, 1)), ("solid.obj", [*cube(2, False, 1), "o other", *cube(0.5, False, 9)])):
            (self.folder / "meshes" / name).write_text("\n".join(lines) + "\n")
        (self.folder / "scene.xml").write_text(SCENE % (LAMP % "hollow.obj" + LAMP % "filament.obj" + PLAIN % "box.obj"))

    def copy(self):
        return subprocess.run([sys.executable, str(ROOT / "bench" / "without_insides.py"), str(self.folder), str(self.new)], capture_output=True, text=True)

    def test_a_hollow_lamp(self):
        done = self.copy()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout, "hollow.obj: 6 of 12 faces are an inner wall, left out\nfilament.obj: within another lamp, left out\n")
        self.assertEqual(faces(self.new / "meshes/hollow.obj"), faces(self.folder / "meshes/hollow.obj")[:6])
        self.assertTrue((self.new / "meshes/box.obj").is_symlink())  # no lamp
        self.assertEqual((self.new / "scene.xml").read_text().count("<emitter"), 1)
        self.assertEqual(len(faces(self.folder / "meshes/hollow.obj")), 12)  # the scene is as it was
        if PROGRAM.exists():
            done = subprocess.run([str(PROGRAM), "info", str(self.new / "scene.xml"), "--json"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)

    def test_what_faces_outwards_stays(self):
        (self.folder / "scene.xml").write_text(SCENE % (LAMP % "solid.obj"))
        self.assertEqual(self.copy().stdout, "")
        self.assertEqual((self.new / "meshes/solid.obj").read_text(), (self.folder / "meshes/solid.obj").read_text())

    def test_refusals(self):
        self.new.mkdir()
        done = self.copy()
        self.assertEqual((done.returncode, done.stderr), (1, "%s is there already\n" % self.new.resolve()))
        done = subprocess.run([sys.executable, str(ROOT / "bench" / "without_insides.py")], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("SCENE_FOLDER NEW_FOLDER", done.stderr)


if __name__ == "__main__":
    unittest.main()
