"""pbrt: the same scene as XML gives the same picture; converted, checked, trained."""
import json
import os
import unittest

from exr import read_exr
from support import SMALL, Case, run
from test_gltf import LAMP, SQUARE, TENT, write_files

PBRT = """LookAt 0 1 5  0 1 4  0 1 0
Camera "perspective" "float fov" 45.83662361046586 # of the height
Film "rgb" "integer xresolution" 900 "integer yresolution" 720
Integrator "volpath" "integer maxdepth" 6
PixelFilter "gaussian"
WorldBegin
Texture "tiles" "spectrum" "imagemap" "string filename" "t.png" "string filter" "point" "string wrap" "clamp"
MakeNamedMaterial "tiles" "string type" "coateddiffuse" "texture reflectance" "tiles" "float roughness" .09
MakeNamedMaterial "metal" "string type" "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k" "float roughness" .0625
NamedMaterial "tiles"
Shape "plymesh" "string filename" "ground.ply"
ObjectBegin "tent"
  NamedMaterial "metal"
  Shape "trianglemesh" "point3 P" [ %s ] "normal N" [ 0 1 1 0 1 1 0 2 1 0 2 1 ] "integer indices" [ %s ]
ObjectEnd
AttributeBegin
  Translate .5 .25 -.5
  Rotate 90 0 1 0
  ObjectInstance "tent"
AttributeEnd
AttributeBegin
  Translate -1 0 -1
  ObjectInstance "tent"
AttributeEnd
AttributeBegin
  Material "diffuse" "rgb reflectance" [ 0 0 0 ]
  AreaLightSource "diffuse" "rgb L" [ 1 .75 .5 ] "float scale" 8
  Shape "trianglemesh" "point3 P" [ %s ] "integer indices" [ %s ]
AttributeEnd
""" % (" ".join(map(str, TENT)), " ".join(map(str, SQUARE)), " ".join(map(str, LAMP)), " ".join(map(str, SQUARE)))

# Mitsuba's x runs to the left.
XML = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="7"/></integrator>
<sensor type="perspective"><float name="fov" value="45.83662361046586"/><string name="fov_axis" value="y"/><float name="near_clip" value="0.0001"/><float name="far_clip" value="1e10"/>
<transform name="to_world"><scale x="-1" y="1" z="1"/><lookat origin="0, 1, 5" target="0, 1, 4" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="900"/><integer name="height" value="720"/></film></sensor>
<bsdf type="twosided" id="tiles"><bsdf type="roughplastic"><texture type="bitmap" name="diffuse_reflectance"><string name="filename" value="t.png"/>
<string name="filter_type" value="nearest"/><string name="wrap_mode" value="clamp"/></texture><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/>
<boolean name="nonlinear" value="true"/><string name="distribution" value="ggx"/><float name="alpha" value="0.3"/></bsdf></bsdf>
<shape type="ply"><string name="filename" value="ground.ply"/><boolean name="flip_tex_coords" value="true"/><boolean name="face_normals" value="true"/><ref id="tiles"/></shape>
<bsdf type="twosided" id="metal"><bsdf type="roughconductor"><string name="distribution" value="ggx"/><float name="alpha" value="0.25"/><string name="material" value="Au"/></bsdf></bsdf>
<shape type="shapegroup" id="tent"><shape type="ply"><string name="filename" value="tent.ply"/><ref id="metal"/></shape></shape>
<shape type="instance"><ref id="tent"/><transform name="to_world"><rotate y="1" angle="90"/><translate x="0.5" y="0.25" z="-0.5"/></transform></shape>
<shape type="instance"><ref id="tent"/><transform name="to_world"><translate x="-1" y="0" z="-1"/></transform></shape>
<bsdf type="twosided" id="black"><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></bsdf>
<shape type="ply"><string name="filename" value="lamp.ply"/><boolean name="face_normals" value="true"/><ref id="black"/><emitter type="area"><rgb name="radiance" value="8, 6, 4"/></emitter></shape>
</scene>
"""


class Pbrt(Case):
    def files(self):
        write_files(self)
        return self.write("s.pbrt", PBRT)

    def picture_of(self, file):
        out = self.path("o.exr")
        self.ok("render", file, "-o", out, "--integrator", "path", "--spp", "4", "--width", "45", "-q")
        width, height, data, _ = read_exr(out)
        return width, height, data

    def test_same_picture_as_xml_and_converted(self):
        file = self.files()
        expected = self.picture_of(self.write("s.xml", XML))
        self.assertEqual(expected[:2], (45, 36))
        self.assertEqual(self.picture_of(file), expected)
        os.mkdir(self.path("sub"))
        out = self.path("sub/out.xml")
        report = self.ok("convert", file, "-o", out, "--json").json()
        self.assertEqual(sorted(os.listdir(self.path("sub/out-files"))), ["mesh0.ply", "mesh1.ply"])
        self.assertEqual(self.picture_of(out), expected)
        self.assertEqual(self.ok("info", out, "--json").json()["fingerprint"], report["fingerprint"])

    def test_mirrored_views(self):
        """pbrt's x runs to the right: what looks at it from elsewhere shows it so."""
        file, out = self.files(), self.path("o.exr")
        self.assertIs(self.ok("info", file, "--json").json()["cameras"][0]["mirrored"], True)
        width, height, expected = self.picture_of(file)
        pose = {"origin": [0, 1, 5], "target": [0, 1, 4], "fov": 45.83662361046586, "fov_axis": "y", "near_clip": 1e-4, "far_clip": 1e10,
                "width": width, "height": height}
        path = {"frames": 2, "keys": [dict(pose, mirrored=True), dict(pose, mirrored=True)]}
        for words in (["--origin", "0,1,5", "--target", "0,1,4"], ["--camera", self.write("c.json", json.dumps(dict(pose, mirrored=True)))],
                      ["--path", self.write("p.json", json.dumps(path))]):
            with self.subTest(words[0]):
                frames = words[0] == "--path"
                name = self.path("f_####.exr") if frames else out
                self.ok("render", file, "-o", name, "--integrator", "path", "--spp", "4", "--width", width, "--height", height, "-q", *words)
                self.assertEqual(read_exr(self.path("f_0000.exr") if frames else out)[2], expected)
        path["keys"][1]["mirrored"] = False
        self.fails(2, "all keys are mirrored, or none is", "render", file, "-o", self.path("f_####.exr"), "--integrator", "path", "--path",
                   self.write("p.json", json.dumps(path)))

    def test_curves_and_pictures_are_converted(self):
        self.files()
        text = PBRT + 'Texture "half" "spectrum" "scale" "texture tex" "tiles" "float scale" .5\nMaterial "diffuse" "texture reflectance" "half"\nShape "sphere"\n' \
            'Material "hair"\nShape "curve" "point3 P" [ 0 0 0 0 1 0 1 1 0 1 2 0 ] "float width" .1\n'
        out = self.path("out.xml")
        report = self.ok("convert", self.write("c.pbrt", text), "-o", out, "--json").json()
        self.assertEqual(sorted(os.listdir(self.path("out-files"))), ["curves0.txt", "mesh0.ply", "mesh1.ply", "picture0.exr"])
        self.assertEqual(self.ok("info", out, "--json").json()["fingerprint"], report["fingerprint"])

    def test_check_and_permissive(self):
        self.files()
        file = self.write("b.pbrt", PBRT + 'MediumInterface "fog" ""\nMaterial "velvet"\nShape "sphere"\nShape "nurbs"\n')
        self.fails(2, "b.pbrt:30:1: a medium is not supported", "info", file)
        result = run("info", file, "--check", "--json")
        self.assertEqual(result.code, 2)
        refused = result.json()["refused"]
        self.assertEqual(sorted(issue["where"].split("b.pbrt")[1] for issue in refused), [":30:1", ":31:1", ":33:1"])
        self.assertEqual(self.ok("info", file, "--permissive", "--json").json()["shapes"], 5)
        self.fails(2, "it has none at all", "info", self.path("s.pbrt"), "-D", "a=1")

    def test_trains(self):
        file = self.files()
        self.ok("train", file, "-o", self.path("m.octrad"), "--steps", "5", *SMALL)
        self.ok("render", file, "-o", self.path("o.exr"), "--model", self.path("m.octrad"), "--width", "16", "--spp", "1", "-q")


if __name__ == "__main__":
    unittest.main()
