"""glTF: the same scene as XML gives the same picture; converted, checked, trained."""
import os
import unittest

from broken_inputs import png
from exr import read_exr
from gltf import Gltf
from support import SMALL, Case, run

GROUND = [-3, 0, 3, 3, 0, 3, 3, 0, -3, -3, 0, -3]
UVS = [0, 1, 1, 1, 1, 0, 0, 0]
TENT = [-1, 0, 0, 1, 0, 0, 1, 1, -1, -1, 1, -1]
LAMP = [-1, 3, -1, 1, 3, -1, 1, 3, 1, -1, 3, 1]
SQUARE = [0, 1, 2, 0, 2, 3]
# Column after column, as glTF has them: a camera at (0, 1, 5), and a place for the tent.
CAMERA = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 5, 1]
PLACE = [0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0.5, 0.25, -0.5, 1]


def picture():
    return png(2, 2, b"\0" + bytes([255, 30, 30, 40, 200, 90]) + b"\0" + bytes([10, 60, 230, 250, 240, 20]), 2)


def scene():
    g = Gltf()
    g.add("images", {"bufferView": g.view(picture()), "mimeType": "image/png"})
    g.add("samplers", {"magFilter": 9728, "wrapS": 33071, "wrapT": 33071})
    g.add("textures", {"source": 0, "sampler": 0})
    tiles = g.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0.6}, "doubleSided": True})
    metal = g.add("materials", {"pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.6, 0.3, 1], "roughnessFactor": 0.25}, "doubleSided": True})
    lamp = g.add("materials", {"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}, "emissiveFactor": [1, 0.75, 0.5],
                               "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}})
    g.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 1.25, "znear": 0.1}})
    g.node(mesh=g.mesh(GROUND, SQUARE, uvs=UVS, material=tiles))
    tent = g.mesh(TENT, SQUARE, normals=[0, 1, 1, 0, 1, 1, 0, 2, 1, 0, 2, 1], material=metal)
    g.node(mesh=tent, matrix=PLACE)
    g.node(mesh=tent, translation=[-1, 0, -1])
    g.node(mesh=g.mesh(LAMP, SQUARE, material=lamp))
    g.node(camera=0, matrix=CAMERA)
    return g


def ply(positions, normals=None, uvs=None):
    columns = [(positions, 3), (normals, 3), (uvs, 2)]
    names = [name for (data, _), names in zip(columns, (("x", "y", "z"), ("nx", "ny", "nz"), ("u", "v"))) if data for name in names]
    rows = "".join(" ".join(str(v) for data, n in columns if data for v in data[n * i:n * i + n]) + "\n" for i in range(4))
    return ("ply\nformat ascii 1.0\nelement vertex 4\n" + "".join(f"property float {n}\n" for n in names) +
            "element face 2\nproperty list uchar int vertex_indices\nend_header\n" + rows + "3 0 1 2\n3 0 2 3\n")


XML = """<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="45.83662361046586"/><string name="fov_axis" value="y"/><float name="near_clip" value="0.1"/>
<transform name="to_world"><lookat origin="0, 1, 5" target="0, 1, 4" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="900"/><integer name="height" value="720"/></film></sensor>
<bsdf type="twosided" id="tiles"><bsdf type="principled"><texture type="bitmap" name="base_color"><string name="filename" value="t.png"/>
<string name="filter_type" value="nearest"/><string name="wrap_mode" value="clamp"/></texture><float name="roughness" value="0.6"/><float name="eta" value="1.5"/></bsdf></bsdf>
<bsdf type="twosided" id="metal"><bsdf type="principled"><rgb name="base_color" value="0.9, 0.6, 0.3"/><float name="roughness" value="0.25"/><float name="metallic" value="1"/>
<float name="eta" value="1.5"/></bsdf></bsdf>
<shape type="ply"><string name="filename" value="ground.ply"/><boolean name="face_normals" value="true"/><ref id="tiles"/></shape>
<shape type="shapegroup" id="tent"><shape type="ply"><string name="filename" value="tent.ply"/><ref id="metal"/></shape></shape>
<shape type="instance"><ref id="tent"/><transform name="to_world"><matrix value="0 0 1 0.5 0 1 0 0.25 -1 0 0 -0.5 0 0 0 1"/></transform></shape>
<shape type="instance"><ref id="tent"/><transform name="to_world"><translate x="-1" z="-1"/></transform></shape>
<shape type="ply"><string name="filename" value="lamp.ply"/><boolean name="face_normals" value="true"/><bsdf type="principled"><rgb name="base_color" value="0"/><float name="roughness" value="1"/>
<float name="metallic" value="1"/><float name="eta" value="1.5"/></bsdf><emitter type="area"><rgb name="radiance" value="8, 6, 4"/></emitter></shape>
</scene>"""


def write_files(case):
    """What the scenes name."""
    with open(case.path("t.png"), "wb") as out:
        out.write(picture())
    case.write("ground.ply", ply(GROUND, uvs=UVS))
    case.write("tent.ply", ply(TENT, normals=[0, 1, 1, 0, 1, 1, 0, 2, 1, 0, 2, 1]))
    case.write("lamp.ply", ply(LAMP))


class GltfScenes(Case):
    def write_bytes(self, name, data):
        with open(self.path(name), "wb") as out:
            out.write(data)
        return self.path(name)

    def picture_of(self, file, *more):
        out = self.path("o.exr")
        self.ok("render", file, "-o", out, "--integrator", "path", "--spp", "4", "--width", "45", "-q", *more)
        width, height, data, _ = read_exr(out)
        return width, height, data

    def test_same_picture_as_xml_and_converted(self):
        write_files(self)
        expected = self.picture_of(self.write("s.xml", XML))
        self.assertEqual(expected[:2], (45, 36))
        text, container = self.write("s.gltf", scene().text()), self.write_bytes("s.glb", scene().container())
        for file in (text, container, self.write_bytes("unnamed", scene().container())):
            self.assertEqual(self.picture_of(file), expected)
        os.mkdir(self.path("sub"))
        out = self.path("sub/out.xml")
        report = self.ok("convert", text, "-o", out, "--json").json()
        self.assertEqual(report["files"], 4)
        self.assertEqual(sorted(os.listdir(self.path("sub/out-files"))), ["mesh0.ply", "mesh1.ply", "mesh2.ply", "picture0.png"])
        with open(self.path("sub/out-files/picture0.png"), "rb") as file:
            self.assertEqual(file.read(), picture())
        self.assertEqual(self.picture_of(out), expected)
        self.assertEqual(self.ok("info", out, "--json").json()["fingerprint"], report["fingerprint"])

    def test_check_and_permissive(self):
        g = scene()
        g.json["materials"].append({"normalTexture": {"index": 0}, "alphaMode": "GLOW"})
        g.json["extensionsRequired"] = ["KHR_texture_basisu"]
        g.json["meshes"][0]["primitives"][0]["material"] = 3
        file = self.write("s.gltf", g.text())
        self.fails(2, "s.gltf: the file requires the extension KHR_texture_basisu", "info", file)
        result = run("info", file, "--check", "--json")
        self.assertEqual(result.code, 2)
        refused = result.json()["refused"]
        self.assertEqual([issue["where"].split("s.gltf")[1] for issue in refused], ["", ": materials[3]"])
        self.assertIn("alphaMode must be", refused[1]["what"])
        self.assertEqual(self.ok("info", file, "--permissive", "--json").json()["shapes"], 4)
        self.fails(2, "it has none at all", "info", self.write("t.gltf", scene().text()), "-D", "a=1")

    def test_trains(self):
        file = self.write_bytes("s.glb", scene().container())
        self.ok("train", file, "-o", self.path("m.octrad"), "--steps", "5", *SMALL)
        self.ok("render", file, "-o", self.path("o.exr"), "--model", self.path("m.octrad"), "--width", "16", "--spp", "1", "-q")


if __name__ == "__main__":
    unittest.main()
