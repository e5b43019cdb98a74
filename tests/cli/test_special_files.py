"""Pipes that nobody writes to, and devices without an end, in the place of every file that is read."""
import os
import unittest

from broken_inputs import CUBE, SENSOR, textured
from gltf import triangle
from support import ROOM, SMALL, Case, measured

SECONDS = 2  # of a processor
HANGS = 60  # seconds after which a run that waits for a pipe is ended
MEGABYTES = 100
POINTS = "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n0,-1,0,0,1,0,0,1,0,0.5,0.5,0.5,0.05\n"


def scene(inside):
    return f'<scene version="3.0.0">{SENSOR}{CUBE}{inside}</scene>'


def shape(kind):
    return scene(f'<shape type="{kind}"><string name="filename" value="FILE"/></shape>')


def bitmap(role, material):
    return scene(f'<bsdf type="{material}"><texture name="{role}" type="bitmap"><string name="filename" value="FILE"/></texture></bsdf>')


def gltf_image():
    made = triangle()
    textured({"uri": "FILE"})(made)
    return made.text()


RENDER, TRAIN, COMPARE, MERGE = (["render", "room.xml", "-o", "o.exr", "--spp", "1"], ["train", "room.xml", "-o", "n.octrad", "--steps", "1", *SMALL], ["compare", "a.exr", "b.exr"],
                                 ["merge", "a.exr", "b.exr", "-o", "o.exr"])
QUERY = ["query", "m.octrad", "--points", "p.csv"]
# What is read, the ending of its name, a scene s.xml (or s.gltf) that names it, and what is run, where FILE is the name
PLACES = [
    ("scene of info", ".xml", "", ["info", "FILE"]), ("scene of render", ".xml", "", ["render", "FILE", "-o", "o.exr"]), ("scene of train", ".xml", "", ["train", "FILE", "-o", "n.octrad", "--steps", "1"]),
    ("scene of convert", ".xml", "", ["convert", "FILE", "-o", "o.xml"]), ("scene of view", ".xml", "", ["view", "FILE"]), ("glTF", ".gltf", "", ["info", "FILE"]), ("binary glTF", ".glb", "", ["info", "FILE"]),
    ("include", ".xml", scene('<include filename="FILE"/>'), ["info", "s.xml"]), ("OBJ", ".obj", shape("obj"), ["info", "s.xml"]), ("PLY", ".ply", shape("ply"), ["info", "s.xml"]),
    ("measured material", ".bsdf", scene('<bsdf type="measured"><string name="filename" value="FILE"/></bsdf>'), ["info", "s.xml"]), ("serialized mesh", ".serialized", shape("serialized"), ["info", "s.xml"]), ("texture", ".png", bitmap("reflectance", "diffuse"), ["info", "s.xml"]), ("roughness", ".exr", bitmap("alpha", "roughconductor"), ["info", "s.xml"]),
    ("envmap", ".exr", scene('<emitter type="envmap"><string name="filename" value="FILE"/></emitter>'), ["info", "s.xml"]),
    ("spectrum", ".spd", scene('<bsdf type="diffuse"><spectrum name="reflectance" filename="FILE"/></bsdf>'), ["info", "s.xml"]),
    ("buffer of glTF", ".bin", triangle().text().replace('"data:', '"FILE", "x": "'), ["info", "s.gltf"]), ("image of glTF", ".png", gltf_image(), ["info", "s.gltf"]),
    ("camera", ".json", "", [*RENDER, "--camera", "FILE"]), ("camera path", ".json", "", ["render", "room.xml", "-o", "o##.exr", "--path", "FILE"]), ("mask", ".png", "", [*RENDER, "--mask", "FILE"]),
    ("model of render", ".octrad", "", [*RENDER, "--model", "FILE"]), ("model of query", ".octrad", "", ["query", "FILE", "--points", "p.csv"]), ("model of info", ".octrad", "", ["info", "FILE"]),
    ("model of view", ".octrad", "", ["view", "room.xml", "--model", "FILE"]), ("model to resume", ".octrad", "", ["train", "room.xml", "-o", "FILE", "--resume", "--steps", "3"]),
    ("points", ".csv", "", ["query", "m.octrad", "--points", "FILE"]), ("scene of query", ".xml", "", [*QUERY, "--scene", "FILE"]),
    ("configuration of train", ".json", "", [*TRAIN, "--config", "FILE"]), ("configuration of info", ".json", "", ["info", "--keys", "--config", "FILE"]), ("reference of train", ".exr", "", [*TRAIN, "--reference", "FILE"]),
    ("train.cameras", ".json", "", [*TRAIN, "-D", "train.cameras=FILE"]), ("reference of view", ".exr", "", ["view", "room.xml", "--reference", "FILE"]),
    ("reference of compare", ".exr", "", ["compare", "FILE", "a.exr"]), ("picture of compare", ".exr", "", ["compare", "a.exr", "FILE"]), ("second reference", ".exr", "", [*COMPARE, "--reference-b", "FILE"]),
    ("mask of compare", ".png", "", [*COMPARE, "--mask", "FILE"]), ("layers of compare", ".exr", "", [*COMPARE, "--alpha-below", "0.5", "--aux", "FILE"]), ("list of frames", ".txt", "", ["compare", "FILE", "FILE", "--temporal"]),
    ("first of merge", ".exr", "", ["merge", "FILE", "a.exr", "-o", "o.exr"]), ("second of merge", ".exr", "", ["merge", "a.exr", "FILE", "-o", "o.exr"]), ("layers of merge", ".exr", "", [*MERGE, "--aux", "FILE"]),
    ("picture of info", ".exr", "", ["info", "FILE"]), ("picture of tonemap", ".exr", "", ["tonemap", "FILE", "-o", "o.png"]), ("picture of denoise", ".exr", "", ["denoise", "FILE", "-o", "o.exr"]),
    ("state of a picture", ".exr.state", "", ["render", "room.xml", "-o", "strange.exr", "--resume", "--spp", "4"]), ("matrix of paper", ".json", "", ["paper", "FILE", "--scenes", "room.xml", "-o", "report"]),
]


class SpecialFiles(Case):
    def setUp(self):
        super().setUp()
        self.write("room.xml", ROOM)
        self.write("p.csv", POINTS)
        self.ok("train", "room.xml", "-o", "m.octrad", "--steps", "1", *SMALL, "-D", "lookup.offset=traced", cwd=self.folder)
        for seed, name in enumerate(("a.exr", "b.exr")):
            self.ok("render", "room.xml", "-o", name, "--spp", "1", "--seed", seed, "-q", cwd=self.folder)

    def each(self, make, what):
        """Runs every line of the table with the file that make(path) makes: the message names it and says what it is."""
        for place, ending, names_it, arguments in PLACES:
            with self.subTest(place=place):
                name = "strange" + ending
                make(self.path(name))
                for scene_name in ("s.xml", "s.gltf") if names_it else ():
                    self.write(scene_name, names_it.replace("FILE", name))
                before = os.listdir(self.folder)
                with open(self.path(".stderr"), "wb") as err:
                    code, peak, seconds = measured(*(word.replace("FILE", name) for word in arguments), hangs_after=HANGS, cwd=self.folder, stdout=err, stderr=err)
                with open(self.path(".stderr"), encoding="utf-8") as file:
                    message = file.read()
                os.remove(self.path(".stderr"))
                self.assertEqual(code, 3, message)
                self.assertEqual(message.count("octrad: error: "), 1, message)
                self.assertRegex(message, f"cannot read (.*/)?{name}: it is {what}, not a file\n(--permissive takes stand-ins for what cannot be used.\n)?$")
                self.assertLess(seconds, SECONDS)
                self.assertLess(peak / 2 ** 20, MEGABYTES)
                self.assertEqual(sorted(os.listdir(self.folder)), sorted(before), "something was left behind")
                os.remove(self.path(name))

    def test_pipes_that_nobody_writes_to(self):
        self.each(os.mkfifo, "a pipe")

    def test_devices_without_an_end(self):
        self.each(lambda path: os.symlink("/dev/zero", path), "a device")


if __name__ == "__main__":
    unittest.main()
