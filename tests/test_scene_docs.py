#!/usr/bin/env python3
"""What octrad info --plugins says, and the tables of docs/scenes.md, which are made of it: they name every type of object and every
parameter that scenes may have and no others, and a parameter that is given with its documented default changes no bit of a picture,
with another value it does.

    OCTRAD=path/to/octrad test_scene_docs.py            checks
    OCTRAD=path/to/octrad test_scene_docs.py --write    writes the tables into docs/scenes.md
"""
import json
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "cli"))

from measured_file import measured_file  # noqa: E402

PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))
DOCUMENT = ROOT / "docs" / "scenes.md"
BEGIN, END = "<!-- %s: written by tests/test_scene_docs.py --write -->\n", "<!-- end of %s -->\n"  # around each table
OLD = {"lambda_min", "lambda_max"}  # spellings of older versions

BITMAP = '<string name="filename" value="picture.png"/>'
AIMED = '<transform name="to_world"><lookat origin="0, 0, 3" target="0, 0, 0" up="0, 1, 0"/></transform>'
DIFFUSE, SPHERE = '<bsdf type="diffuse"/>', '<shape type="sphere"/>'
# What an object must hold.
NEEDS = {("bsdf", "blendbsdf"): '<float name="weight" value="0.5"/>' + DIFFUSE + DIFFUSE, ("bsdf", "twosided"): DIFFUSE, ("bsdf", "mask"): DIFFUSE,
         ("bsdf", "measured"): '<string name="filename" value="material_rgb.bsdf"/>',
         ("bsdf", "bumpmap"): '<texture type="bitmap">%s</texture>' % BITMAP + DIFFUSE,
         ("bsdf", "normalmap"): '<texture name="normalmap" type="bitmap">%s<boolean name="raw" value="true"/></texture>' % BITMAP + DIFFUSE,
         ("texture", "bitmap"): BITMAP, ("texture", "mesh_attribute"): '<string name="name" value="vertex_color"/>',
         ("spectrum", "srgb"): '<rgb name="color" value="0.5"/>', ("spectrum", "rawconstant"): '<float name="value" value="0.5"/>',
         ("spectrum", "regular"): '<string name="values" value="1, 2"/>',
         ("spectrum", "irregular"): '<string name="wavelengths" value="400, 700"/><string name="values" value="1, 2"/>',
         ("emitter", "envmap"): BITMAP, ("emitter", "projector"): AIMED + '<texture name="irradiance" type="bitmap">%s</texture>' % BITMAP,
         ("emitter", "spot"): AIMED, ("emitter", "directional"): AIMED,
         ("shape", "obj"): '<string name="filename" value="mesh.obj"/>', ("shape", "ply"): '<string name="filename" value="mesh.ply"/>',
         ("shape", "linearcurve"): '<string name="filename" value="curves.txt"/>', ("shape", "bsplinecurve"): '<string name="filename" value="curves.txt"/>',
         ("shape", "serialized"): '<string name="filename" value="mesh.serialized"/>', ("shape", "shapegroup"): SPHERE, ("shape", "merge"): SPHERE,
         ("shape", "instance"): '<shape type="shapegroup">%s</shape>' % SPHERE, ("sensor", "thinlens"): '<float name="aperture_radius" value="0.2"/>'}
# What a parameter needs beside it to change a picture: of the type "TYPE.NAME", else of every type "NAME".
COLOR = '<rgb name="base_color" value="0.9, 0.4, 0.1"/>'
THIN = '<float name="spec_trans" value="0.5"/>' + COLOR
WINDOW = "".join('<integer name="%s" value="%d"/>' % item for item in (("width", 8), ("height", 8), ("crop_width", 4), ("crop_height", 4)))
BESIDE = {"nonlinear": '<rgb name="diffuse_reflectance" value="0.9, 0.4, 0.1"/>', "spec_tint": '<float name="metallic" value="0.2"/>' + COLOR,
          "flatness": '<float name="roughness" value="0.8"/>', "sheen_tint": '<float name="sheen" value="1"/>' + COLOR,
          "clearcoat_gloss": '<float name="clearcoat" value="1"/>', "clearcoat_sampling_rate": '<float name="clearcoat" value="1"/>',
          "fov_axis": '<float name="fov" value="40"/>', "crop_offset_x": WINDOW, "crop_offset_y": WINDOW, "principledthin.spec_tint": THIN,
          "hair.scale": '<rgb name="sigma_a" value="0.1 0.2 0.4"/>', "principledthin.anisotropic": THIN, "principledthin.eta": THIN, "specular_reflectance_sampling_rate": THIN,
          "specular_transmittance_sampling_rate": THIN, "principledthin.diffuse_reflectance_sampling_rate": THIN,
          "diffuse_transmittance_sampling_rate": '<float name="diff_trans" value="0.5"/>'}
# Another value than the default, where half of it and 0.3 are not one.
OTHER = {"true": "false", "false": "true", "air": "water", "polypropylene": "diamond", "bk7": "diamond", "amber": "diamond", "beckmann": "ggx", "bilinear": "nearest",
         "repeat": "clamp", "none": "Au", "x": "y", "50mm": "80mm", "far_clip": "2"}
INTEGERS = ("lobes", "shape_index", "width", "height", "crop_offset_x", "crop_offset_y")


def octrad(*words, folder=None):
    return subprocess.run([PROGRAM, *words], capture_output=True, text=True, cwd=folder)


def png(values):
    """A picture two pixels high of RGB bytes."""
    rows = b"".join(b"\0" + bytes(values[::step]) for step in (1, -1))
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", len(values) // 3, 2, 8, 2, 0, 0, 0)), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data)) for tag, data in chunks)


def serialized():
    """Two meshes of one triangle each, version 4 in single precision."""
    data, offsets = b"", []
    for size in (1, 0.5):
        positions, indices = struct.pack("<9f", -size, -size, 0, size, -size, 0, 0, size, 0.5), struct.pack("<3I", 0, 1, 2)
        mesh = struct.pack("<I", 0x1000) + b"\0" + struct.pack("<QQ", 3, 1) + positions + indices
        offsets.append(len(data))
        data += struct.pack("<HH", 0x041C, 4) + zlib.compress(mesh)
    return data + struct.pack("<2QI", *offsets, 2)


def plugins():
    """{tag: types}, and {tag: {"all": text or None, "entries": [{"types", "as", "text"}]}}."""
    said = json.loads(octrad("info", "--plugins", "--json").stdout)
    return said, said.pop("help")


def table(tag, kind):
    """The help for one kind of object in Markdown."""
    rows = [("all", kind["all"])] if kind["all"] else []
    for entry in kind["entries"]:
        rows.append((", ".join("`%s`" % name for name in entry["types"]), ("the same, " if entry["as"] else "") + entry["text"]))
    lines = ["| %s | parameters (default) |" % tag, "|---|---|"] + ["| %s | %s |" % (types, text.replace("|", "\\|")) for types, text in rows]
    return "\n".join(lines) + "\n"


def with_tables(text, tables):
    """The document with these tables, {tag: table}, between their marks."""
    for tag, lines in tables.items():
        head, rest = text.split(BEGIN % tag)
        text = head + BEGIN % tag + "\n" + lines + "\n" + END % tag + rest.split(END % tag)[1]
    return text


def parameters(text):
    """{name: default or None} of a text such as "`alpha`, `beta` (0 each), `gamma` (1; text)"."""
    found, run = {}, []
    for name, default, end in re.findall(r"`([\w]+)`(?: \(([^)]*)\))?|([;:])", text):
        if end:
            run = []
            continue
        run.append(name)
        found.setdefault(name, None)
        if default:
            value = default.split(";")[0].strip("` ")
            each = value.endswith(" each")
            value = value.replace(" each", "")
            if re.fullmatch(r"-?[\d./]+", value) or value in OTHER:
                for other in run if each else run[-1:]:
                    found[other] = value
            run = []
    return found


def documented(kind):
    """{type: {parameter: default or None}}."""
    found = {}
    for entry in kind["entries"]:
        own = parameters(re.sub(r"\([^()]*\)", lambda match: match.group(0).replace("`", "").replace(":", ""), entry["text"]))
        own = {**found.get(entry["as"], {}), **own}
        for name in entry["types"]:
            found[name] = own
    return found


class SceneDocuments(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.folder = pathlib.Path(scratch.name)
        (cls.folder / "picture.png").write_bytes(png([40, 90, 200, 250, 130, 60, 110, 190, 140]))
        (cls.folder / "mesh.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 .6\nvn 0 .6 .8\nvn 0 0 1\nf 1/1/1 2/2/2 3/3/1\n")
        properties = "".join("property float %s\n" % name for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v", "r", "g", "b"))
        (cls.folder / "curves.txt").write_text("-1 0 0 .3\n0 .3 0 .4\n.5 -.3 .2 .3\n1 0 0 .2\n")
        (cls.folder / "mesh.ply").write_text("ply\nformat ascii 1.0\nelement vertex 3\n%selement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                                             "-1 -1 0 0 .6 .8 0 0 1 0 0\n1 -1 0 0 0 1 1 0 0 1 0\n0 1 0 0 .6 .8 0 .6 0 0 1\n3 0 1 2\n" % properties)
        (cls.folder / "mesh.serialized").write_bytes(serialized())
        (cls.folder / "material_rgb.bsdf").write_bytes(measured_file(0))
        cls.plugins, cls.help = plugins()
        cls.pictures = {}  # of scenes that were rendered

    def scene(self, tag, name, inside):
        """A scene with one object of this type, which holds `inside`."""
        role = {"texture": ' name="reflectance"', "spectrum": ' name="radiance"'}.get(tag, "")
        text = '<%s type="%s"%s>%s%s</%s>' % (tag, name, role, NEEDS.get((tag, name), ""), inside, tag)
        mesh = '<shape type="ply"><string name="filename" value="mesh.ply"/>%s</shape>'
        shape = {"shape": text, "bsdf": '<shape type="sphere">%s</shape>' % text, "texture": mesh % ('<bsdf type="diffuse">%s</bsdf>' % text),
                 "spectrum": '<shape type="sphere"><emitter type="area">%s</emitter></shape>' % text}.get(tag, mesh % "")
        if tag == "emitter":  # in the way of the light
            shape += '<shape type="sphere"><float name="radius" value="0.3"/><bsdf type="mask">%s</bsdf></shape>' % DIFFUSE
        if (tag, name) == ("emitter", "area"):
            shape = '<shape type="sphere">%s</shape>' % text
        light = text if tag == "emitter" and name != "area" else ""
        if "envmap" not in light and "constant" not in light:
            light += '<emitter type="envmap">%s</emitter>' % BITMAP
        film = text if tag == "film" else '<film type="hdrfilm"><integer name="width" value="6"/><integer name="height" value="5"/>%s</film>' % (
            text if tag == "rfilter" else "")
        place = '<transform name="to_world"><lookat origin="0.5, 0.4, 3.2" target="0, 0, 0" up="0, 1, 0"/></transform>'
        if tag == "sensor":
            sensor = text.replace("</sensor>", film + place + "</sensor>")
        else:
            sensor = '<sensor type="perspective">%s%s</sensor>' % (place, film)
        return '<scene version="3.0.0">%s%s%s</scene>' % (sensor, light, shape)

    def write(self, text):
        (self.folder / "scene.xml").write_text(text)

    def picture(self, tag, name, inside):
        """The bits of a small picture of such a scene."""
        scene = self.scene(tag, name, inside)
        if scene not in self.pictures:
            self.write(scene)
            effort = ("--spp", "1", "--max-depth", "1") if tag == "film" else ("--spp", "8")
            done = octrad("render", "scene.xml", "-o", "picture.pfm", "--integrator", "path", *effort, "--threads", "1", "-q", folder=self.folder)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.pictures[scene] = (self.folder / "picture.pfm").read_bytes()
        return self.pictures[scene]

    def accepted(self, tag, name):
        """The parameters that the program knows, from what it says of one that it does not."""
        self.write(self.scene(tag, name, '<float name="unheard_of" value="1"/>'))
        said = json.loads(octrad("info", "scene.xml", "--check", "--json", folder=self.folder).stdout)["refused"]
        texts = [issue["what"] for issue in said if "unheard_of" in issue["what"]]
        self.assertEqual(len(texts), 1, said)
        known = re.search(r"supported: ([^;]*)", texts[0]).group(1)
        return set() if known == "none" else set(known.split(", "))

    def test_tables(self):
        text = DOCUMENT.read_text()
        for tag, kind in self.help.items():
            with self.subTest(tag):
                self.assertEqual(with_tables(text, {tag: table(tag, kind)}), text, "run tests/test_scene_docs.py --write")

    def test_types_and_parameters(self):
        self.assertEqual(list(self.plugins), list(self.help))
        without_effect = set(re.findall(r"`(\w+)`", re.search(r"^No effect: (.*?)\n\n", DOCUMENT.read_text(), re.M | re.S).group(1)))
        for tag, types in self.plugins.items():
            entries = documented(self.help[tag])
            common = set(re.findall(r"`(\w+)`", self.help[tag]["all"] or ""))
            self.assertEqual(set(entries), set(types))
            accepted = {name: self.accepted(tag, name) - OLD for name in types}
            self.assertEqual(common - set().union(*accepted.values()) - set(self.plugins), set(), "said of all, and known to none: %s" % tag)
            for name, known in accepted.items():
                with self.subTest("%s %s" % (tag, name)):
                    said = set(entries[name]) | common
                    self.assertEqual(known - said - without_effect, set(), "not said by info --plugins")
                    others = set(sum(self.plugins.values(), []))
                    self.assertEqual(set(entries[name]) - known - others, set(), "info --plugins names them, and the program does not know them")

    def test_defaults(self):
        count = 0
        for tag in self.plugins:
            for name, defaults in documented(self.help[tag]).items():
                for parameter, default in defaults.items():
                    if default is None or 'name="%s"' % parameter in NEEDS.get((tag, name), ""):
                        continue
                    kind, other = "boolean" if default in ("true", "false") else "string", OTHER.get(default)
                    if re.fullmatch(r"[-\d./]+", default):
                        top, _, bottom = default.partition("/")
                        value = float(top) / float(bottom or 1)
                        kind, default, other = "float", "%.9g" % value, OTHER.get(parameter, "%.9g" % (0.5 * value + 0.3))
                        if parameter in INTEGERS:
                            kind, other = "integer", str(int(value) + 1)
                        elif parameter == "color":
                            kind = "rgb"
                    beside = BESIDE.get("%s.%s" % (name, parameter), BESIDE.get(parameter, ""))
                    given = beside + '<%s name="%s" value="%%s"/>' % (kind, parameter)
                    with self.subTest("%s %s: %s" % (tag, name, parameter)):
                        count += 1
                        absent = self.picture(tag, name, beside)
                        self.assertTrue(self.picture(tag, name, given % default) == absent, "%s is not the default" % default)
                        self.assertTrue(self.picture(tag, name, given % other) != absent, "%s has no effect" % other)
        self.assertGreater(count, 80)


if __name__ == "__main__":
    if "--write" in sys.argv:
        tables = {tag: table(tag, kind) for tag, kind in plugins()[1].items()}
        DOCUMENT.write_text(with_tables(DOCUMENT.read_text(), tables))
    else:
        unittest.main()
