"""Broken, hostile and odd inputs: a table of cases for test_broken_inputs.py.

A case is (name, files {name: str or bytes}, arguments, exit code, text that the error or warning holds, or where there is
none of it the output). Files are made in a folder of the case's own, in which the program runs.
"""
import base64
import gzip
import json
import os
import random
import struct
import tempfile
import zlib

from exr import write_exr
from gltf import glb, triangle
from measured_file import measured_file
from support import ROOM

SENSOR = """<sensor type="perspective"><transform name="to_world"><lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/><rfilter type="box"/></film></sensor>"""
CUBE = '<shape type="cube"/>'
LIGHT = '<emitter type="constant"/>'
CASES = []


def scene(body, version="3.0.0"):
    return f'<scene version="{version}">\n{body}\n</scene>\n'


def case(name, files, arguments, code, text):
    CASES.append((name, files, arguments, code, text))


def bad(name, xml, text, code=2, arguments=(), **files):
    """A whole scene file that `info` refuses; other files by keyword, with _ for the dot."""
    case(name, {"s.xml": xml, **{key.replace("_", "."): value for key, value in files.items()}}, ["info", "s.xml", *arguments], code, text)


def body(name, inside, text, code=2, **files):
    bad(name, scene(SENSOR + CUBE + inside), text, code, **files)


def odd(name, xml, text="", **files):
    """What renders, with a warning where `text` says so."""
    case(name, {"s.xml": xml, **{key.replace("_", "."): value for key, value in files.items()}},
         ["render", "s.xml", "-o", "a.exr", "--spp", "2", "--width", "8", "--height", "8", "-q"], 0, text)


def sensor(inside, film=""):
    return scene(f'<sensor type="perspective">{inside}{film}</sensor>' + CUBE)


# XML
bad("empty", "", "not well-formed XML")
bad("only-text", "hello", "not well-formed XML")
bad("only-a-comment", "<!-- -->", "not well-formed XML")
bad("binary", bytes(range(256)), "not well-formed XML")
bad("cut-off", scene(SENSOR + CUBE)[:-20], "not well-formed XML")
bad("crossed-tags", scene("<shape></sensor></shape>"), "not well-formed XML")
bad("two-scenes", scene(SENSOR + CUBE) * 2, "second top-level element")
bad("another-root", "<mitsuba/>", "top-level element is <mitsuba>")
bad("no-version", "<scene/>", "no version attribute")
bad("another-version", scene("", "4.0.0"), 'version "4.0.0" is not supported')
for name, inside, message in (
        ("mixture", '<bsdf type="mixturebsdf"><string name="weights" value="1, 1"/><bsdf type="diffuse"/></bsdf>', "as many weights"), ("cloth", '<bsdf type="irawan"/>', "woven cloth"),
        ("coat-of-nothing", '<bsdf type="coating"/>', "is not supported"), ("blackbody", '<emitter type="constant"><blackbody name="radiance" temperature="hot"/></emitter>', "not a finite number"),
        ("gamma", '<bsdf type="diffuse"><texture name="reflectance" type="bitmap"><float name="gamma" value="nan"/></texture></bsdf>', "filename"),
        ("phong-nan", '<bsdf type="phong"><float name="exponent" value="nan"/><rgb name="diffuseReflectance" value="nan"/></bsdf>', "s.xml"),
        ("scaled-texture", '<bsdf type="bumpmap"><texture type="scale"/></bsdf>', "bsdf"),
        ("scale-of-itself", '<texture type="scale" id="a"><ref id="a"/></texture><bsdf type="diffuse"><ref id="a" name="reflectance"/></bsdf>', 'texture "scale" is not supported'),
        ("scale-of-nothing", '<bsdf type="diffuse"><texture type="scale" name="reflectance"><ref id="none"/></texture></bsdf>', 'texture "scale" is not supported')):
    bad("old-" + name, scene(inside, "0.6.0"), message)
# Each has the parameters of the texture that it refers to.
bad("cost-scales", scene('<texture type="bitmap" id="a"><string name="filename" value="s.xml"/>' + '<float name="b" value="1"/>' * 900 + "</texture>" + '<texture type="scale"><ref id="a"/></texture>' * 20000, "0.6.0"),
    "the textures that are scaled", 4)
bad("deep-elements", scene("<a>" * 100000 + "</a>" * 100000), "nested more than 64 deep")
bad("attribute-twice", scene('<shape type="cube" type="cube"/>'), "given twice")
bad("many-attributes", scene("<shape " + " ".join(f'a{i}="1"' for i in range(50000)) + "/>"), "more than 64 attributes")
bad("many-parameters", scene('<shape type="cube">' + "".join(f'<float name="a{i}" value="1"/>' for i in range(50000)) + "</shape>"), "more than 1000 parameters")
case("text-between", {"s.xml": scene(SENSOR + CUBE + "hello")}, ["info", "s.xml", "--check"], 0, "")
odd("id-empty", scene(SENSOR + CUBE + '<bsdf type="diffuse" id=""/>'))
bad("entity-bomb", '<!DOCTYPE s [<!ENTITY a "1"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>'
    + scene(SENSOR + '<shape type="sphere"><float name="radius" value="&c;"/></shape>'), '"&c;" is not a finite number')
bad("external-entity", '<!DOCTYPE s [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + scene(SENSOR + '<shape type="&x;"/>'), 'shape "&x;" is not supported')
bad("not-utf8", scene('<shape type="W\xfcrfel"/>').encode("latin-1"), r'shape "W\xfcrfel" is not supported')
bad("control-characters", scene('<shape type="\x1b]0;title\x07"/>'), r'shape "\x1b]0;title\x07" is not supported')
bad("nul-byte", scene('<shape type="cu\0be"/>'), "s.xml:2:14: not well-formed XML")
bad("undefined-parameter", scene('<shape type="$what"/>'), "undefined parameter $what")
bad("lone-dollar", scene('<shape type="$"/>'), "undefined parameter $")
bad("long-substitution", scene('<default name="a" value="' + "x" * 60000 + '"/><shape type="$a$a"/>'), "longer than 65536 characters")
bad("many-substitutions", scene('<default name="a" value="' + "x" * 60000 + '"/>' + '<shape type="cube" id="$a"/>' * 20000), "the budget is", 4)
bad("large-includes", scene('<include filename="t.xml"/>' * 900), "the budget is", 4, t_xml=scene("<!--" + "x" * 1000000 + '--><bsdf type="diffuse"/>'))
bad("bad-default", scene('<default name="" value="1"/>'), "an empty name")
bad("unknown-definition", scene(SENSOR + CUBE), "it has none at all", 2, ["-D", "nothing=1"])
bad("include-itself", scene('<include filename="s.xml"/>'), "includes itself")
bad("include-in-a-circle", scene('<include filename="t.xml"/>'), "includes itself", t_xml=scene('<include filename="s.xml"/>'))
bad("include-nothing", scene('<include filename="none.xml"/>'), "does not exist")
bad("include-too-deep", scene('<include filename="0.xml"/>'), "nested more than 16 deep",
    **{f"{i}_xml": scene(f'<include filename="{i + 1}.xml"/>') for i in range(20)})
bad("include-too-many", scene('<include filename="t.xml"/>' * 1001), "more than 1000 files", t_xml=scene(""))
bad("include-a-folder", scene('<include filename="."/>'), "is a folder")
bad("include-outside", scene('<include filename="../../../../../../etc/hostname"/>'), "not well-formed XML", 2)
bad("include-a-device", scene('<include filename="/dev/zero"/>'), "a device, not a file", 3)
bad("path-to-nothing", scene('<path value="none"/>'), "is not a folder")
bad("alias-of-nothing", scene('<alias id="a" as="b"/>'), 'nothing has the id "a"')
bad("alias-taken", scene('<bsdf type="diffuse" id="a"/><bsdf type="diffuse" id="b"/><alias id="a" as="b"/>'), "taken already")
bad("id-twice", scene('<bsdf type="diffuse" id="a"/><bsdf type="diffuse" id="a"/>'), "is taken already")
body("reference-to-nothing", '<shape type="cube"><ref id="a"/></shape>', '"a"')
body("reference-to-itself", '<ref id="a"/><alias id="a" as="a"/>', 'nothing has the id "a"')
body("material-of-itself", '<bsdf type="twosided" id="a"><ref id="a"/></bsdf>', "itself")
body("materials-in-a-circle", '<bsdf type="twosided" id="a"><ref id="b"/></bsdf><bsdf type="mask" id="b"><ref id="a"/></bsdf>', "itself")
body("group-of-itself", '<shape type="shapegroup" id="g"><shape type="instance"><ref id="g"/></shape></shape>', "cannot hold another one")
body("group-of-lights", '<shape type="shapegroup" id="g"><shape type="cube"><emitter type="area"/></shape></shape>', "cannot stand in a shapegroup")
body("instance-of-nothing", '<shape type="instance"/>', "one <ref> to a shapegroup")
body("instance-flattened", '<shape type="shapegroup" id="g">' + CUBE + '</shape><shape type="instance"><ref id="g"/><transform name="to_world"><scale y="0"/></transform></shape>', "singular")
body("instance-far-away", '<shape type="shapegroup" id="g">' + CUBE + '</shape><shape type="instance"><ref id="g"/><transform name="to_world"><translate x="1e18"/></transform></shape>', "too far away")
bad("many-instances", scene(SENSOR + '<shape type="shapegroup" id="g">' + CUBE * 900 + "</shape>" + '<shape type="instance"><ref id="g"/></shape>' * 5000), "the budget is", 4)
body("unknown-element", "<thing/>", "unknown element <thing>")
odd("a-medium", scene(SENSOR + CUBE + '<medium type="homogeneous"/>'), "is not used")
body("a-medium-in-use", '<medium type="homogeneous" id="m"/><shape type="cube"><ref name="interior" id="m"/></shape>', "is not supported")

# Values of the wrong kind
for value in ("abc", "", "1e999", "nan", "inf", "-inf", "1,2", "0x10", "1 2", "--1"):
    body(f"float-{value or 'empty'}", f'<shape type="sphere"><float name="radius" value="{value}"/></shape>', "is not a finite number")
for value in ("1.5", "99999999999", "abc", "1e3", ""):
    bad(f"integer-{value or 'empty'}", sensor("", f'<film type="hdrfilm"><integer name="width" value="{value}"/></film>'), "is not a 32-bit integer")
body("boolean-maybe", '<shape type="cube"><boolean name="flip_normals" value="maybe"/></shape>', "is not a boolean")
body("value-missing", '<shape type="sphere"><float name="radius"/></shape>', 'needs the attribute "value"')
body("name-missing", '<shape type="sphere"><float value="1"/></shape>', "needs a name")
body("parameter-twice", '<shape type="sphere"><float name="radius" value="1"/><float name="radius" value="2"/></shape>', "given twice")
body("parameter-unknown", '<shape type="sphere"><float name="radios" value="1"/></shape>', 'did you mean "radius"')
body("parameter-of-another-kind", '<shape type="sphere"><string name="radius" value="1"/></shape>', "must be <float>")
body("rgb-of-two", '<bsdf type="diffuse"><rgb name="reflectance" value="1 2"/></bsdf>', "is not a colour")
body("rgb-of-letters", '<bsdf type="diffuse"><rgb name="reflectance" value="#12345g"/></bsdf>', "is not a colour")
body("point-of-two", '<shape type="sphere"><point name="center" value="1 2"/></shape>', "not one or three finite numbers")
body("point-twice", '<shape type="sphere"><point name="center" value="1 2 3" x="1"/></shape>', "give one of them")
body("matrix-of-five", '<shape type="cube"><transform name="to_world"><matrix value="1 2 3 4 5"/></transform></shape>', "needs 16 (or 9)")
body("matrix-projective", '<shape type="cube"><transform name="to_world"><matrix value="1 0 0 0 0 1 0 0 0 0 1 0 1 0 0 1"/></transform></shape>', "last row")
body("axis-zero", '<shape type="cube"><transform name="to_world"><rotate angle="5"/></transform></shape>', "<rotate>")
for name, value, message in (("falling", "700:1, 400:2", "must increase"), ("single", "400:1", "at least two"), ("uneven", "400:1, 700", "pairs"), ("infinite", "400:1, 700:1e999", "pairs"), ("empty", ":", "pairs")):
    body(f"spectrum-{name}", f'<bsdf type="diffuse"><spectrum name="reflectance" value="{value}"/></bsdf>', message)
for name, data, message in (("empty", b"", "at least two"), ("words", b"hello world\n", "expected a wavelength"), ("binary", bytes(range(256)), "expected a wavelength"), ("nan", b"400 1\n500 nan\n", "expected a wavelength")):
    body(f"spectrum-file-{name}", '<bsdf type="diffuse"><spectrum name="reflectance" filename="s.spd"/></bsdf>', message, s_spd=data)
body("spectrum-hot", '<emitter type="constant"><spectrum name="radiance" type="blackbody"><float name="temperature" value="1e30"/></spectrum></emitter>', "between 1 and")
body("spectrum-glowing-paint", '<bsdf type="diffuse"><spectrum name="reflectance" type="blackbody"/></bsdf>', "of emitters only")

# Cameras and films
odd("no-sensor", scene(CUBE), "no sensor: one that looks at all of it")
case("model-as-scene", {"m.octrad": b"\x40\0\0\0\0\0\0\0{}"}, ["render", "m.octrad", "-o", "a.exr"], 2, "m.octrad: a trained model, not a scene")
bad("no-shape", scene(SENSOR), "no surface")
bad("sensor-unknown", scene('<sensor type="orthograpic"/>' + CUBE), 'did you mean "orthographic"')
odd("spot-sharp", scene(SENSOR + CUBE + '<emitter type="spot"><float name="beam_width" value="30"/></emitter>'))
odd("lens-of-0", scene('<sensor type="thinlens"><float name="aperture_radius" value="0"/></sensor>' + CUBE))
odd("ellipsoid", scene(SENSOR + '<shape type="sphere"><transform name="to_world"><scale x="2"/></transform></shape>'))
bad("lens-of-nothing", scene('<sensor type="thinlens"/>' + CUBE), "needs an aperture_radius")
bad("lens-behind", scene('<sensor type="thinlens"><float name="aperture_radius" value="1"/><float name="focus_distance" value="0"/></sensor>' + CUBE), "focus_distance must be above 0")
bad("orthographic-far-away", scene('<sensor type="orthographic"><transform name="to_world"><scale value="1e30"/></transform></sensor>' + CUBE), "too far away")
bad("orthographic-sheared", scene('<sensor type="orthographic"><transform name="to_world"><matrix value="1 1 0 0 1 0 0 0 1"/></transform></sensor>' + CUBE), "must not shear")
for fov in ("0", "180", "-5", "1e30"):
    bad(f"fov-{fov}", sensor(f'<float name="fov" value="{fov}"/>'), "above 0 and below 180")
bad("fov-axis", sensor('<float name="fov" value="40"/><string name="fov_axis" value="z"/>'), 'cannot be "z"')
bad("two-lenses", sensor('<float name="fov" value="40"/><string name="focal_length" value="50mm"/>'), "either fov or focal_length")
bad("focal-length", sensor('<string name="focal_length" value="-50mm"/>'), "is not a length")
bad("near-zero", sensor('<float name="near_clip" value="0"/>'), "near_clip must be above 0")
bad("near-behind-far", sensor('<float name="near_clip" value="5"/><float name="far_clip" value="2"/>'), "greater than near_clip")
bad("near-far-away", sensor('<float name="near_clip" value="1e30"/><float name="far_clip" value="1e32"/>'), "too far away")
bad("origin-far-away", sensor('<transform name="to_world"><translate x="1e19"/></transform>'), "too far away")
bad("lens-shifted-away", sensor('<float name="principal_point_offset_x" value="1e38"/>'), "between -100 and 100")
bad("sensor-scaled", sensor('<transform name="to_world"><scale value="2"/></transform>'), "must not scale")
bad("lookat-nowhere", sensor('<transform name="to_world"><lookat origin="0 0 0" target="0 0 0"/></transform>'), "do not define a view")
for side in ("0", "-1", "131073", "2147483647"):
    bad(f"film-{side}", sensor("", f'<film type="hdrfilm"><integer name="width" value="{side}"/></film>'), "between 1 and 131072")
bad("two-films", sensor("", '<film type="hdrfilm"/>' * 2), "at most one film")
odd("film-unknown", sensor("", '<film type="ldrfilm"><float name="exposure" value="1"/></film>'), 'film "ldrfilm" read as hdrfilm')
bad("film-crop", sensor("", '<film type="hdrfilm"><integer name="crop_offset_x" value="7"/></film>'), "reaches beyond the film")
bad("film-crop-huge", sensor("", '<film type="hdrfilm"><integer name="crop_offset_x" value="2147483647"/></film>'), "between 0 and 131072")
bad("filter-unknown", sensor("", '<film type="hdrfilm"><rfilter type="lancos"/></film>'), 'rfilter "lancos" is not supported')
bad("filter-of-many-lobes", sensor("", '<film type="hdrfilm"><rfilter type="lanczos"><integer name="lobes" value="1000000"/></rfilter></film>'), "between 1 and 8")
bad("filter-wide", sensor("", '<film type="hdrfilm"><rfilter type="gaussian"><float name="stddev" value="16"/></rfilter></film>'), "s.xml:2:")

# Shapes
body("shape-unknown", '<shape type="cubes"/>', 'did you mean "cube"')
body("flattened", '<shape type="cube"><transform name="to_world"><scale x="0"/></transform></shape>', "singular")
body("scaled-away", '<shape type="cube"><transform name="to_world"><scale value="1e300"/></transform></shape>', "to_world of shape \"cube\" is singular")
body("moved-away", '<shape type="rectangle"><transform name="to_world"><translate x="1e18"/></transform></shape>', "too far away")
for radius in ("0", "-1", "1e18"):
    body(f"radius-{radius}", f'<shape type="sphere"><float name="radius" value="{radius}"/></shape>', "sphere")
body("tube-of-no-length", '<shape type="cylinder"><point name="p1" x="0" y="0" z="0"/></shape>', "must differ")
body("tube-inside-out", '<shape type="cylinder"><float name="radius" value="-1"/></shape>', "must be above 0")
bad("many-disks", scene(SENSOR + '<shape type="disk"/>' * 20000), "the budget is", 4)
body("mesh-missing", '<shape type="obj"><string name="filename" value="none.obj"/></shape>', "does not exist")
body("mesh-unnamed", '<shape type="obj"><string name="filename" value=""/></shape>', "is empty")
body("mesh-a-folder", '<shape type="ply"><string name="filename" value="."/></shape>', "is a folder")
body("mesh-a-device", '<shape type="ply"><string name="filename" value="/dev/zero"/></shape>', "a device, not a file", 3)
body("two-materials", '<shape type="cube"><bsdf type="diffuse"/><bsdf type="diffuse"/></shape>', "at most one bsdf")
bad("many-cubes", scene(SENSOR + CUBE * 400000), "the budget is", 4)

# Meshes
OBJ_BOX = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
for name, text, message in (
        ("empty", "", "no vertex"),
        ("index-0", OBJ_BOX + "f 0 1 2\n", "there is no vertex 0"), ("index-9", OBJ_BOX + "f 1 2 9\n", "there is no vertex 9"),
        ("index-minus-9", OBJ_BOX + "f 1 2 -9\n", "there is no vertex -9"), ("index-huge", OBJ_BOX + "f 1 2 99999999999\n", "expected the index"),
        ("index-word", OBJ_BOX + "f a b c\n", "expected the index"), ("vt-missing", OBJ_BOX + "f 1/1 2/1 3/1\n", "there is no texture vertex 1"),
        ("vn-missing", OBJ_BOX + "f 1//1 2//1 3//1\n", "there is no vertex normal 1"), ("vertex-nan", "v nan 0 0\n", "not finite"),
        ("vertex-huge", "v 1e99 0 0\n", "not finite"), ("vertex-short", "v 1 2\n", "expected a number"), ("vertex-glued", "v 1x 2 3\n", "expected a blank"),
        ("vertex-far", "v 1e30 0 0\nv 0 1 0\nv 1 0 0\nf 1 2 3\n", "too far away"), ("nul", OBJ_BOX + "f 1 2\0 3\n", "m.obj:4:6: face: expected a blank")):
    body(f"obj-{name}", '<shape type="obj"><string name="filename" value="m.obj"/></shape>', message, m_obj=text)


def ply(vertices=3, faces=1, rows="0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", form="ascii", properties="xyz", kind="float", face="list uchar int vertex_indices"):
    return (f"ply\nformat {form} 1.0\nelement vertex {vertices}\n" + "".join(f"property {kind} {p}\n" for p in properties)
            + f"element face {faces}\nproperty {face}\nend_header\n").encode() + (rows if isinstance(rows, bytes) else rows.encode())


TRIANGLE = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
for name, data, message in (
        ("empty", b"", "ends before end_header"), ("another-file", b"solid\n", "not a PLY file"), ("endless-header", b"ply\nformat ascii 1.0\n", "ends before end_header"),
        ("no-format", b"ply\nend_header\n", "no format line"), ("format-unknown", ply(form="middle_endian"), "unknown PLY format"),
        ("type-unknown", ply(kind="quad"), "unknown PLY type"), ("vertices-huge", ply(vertices=4000000000), "the header announces"),
        ("vertices-beyond-64-bits", ply(vertices=10 ** 30), "is not a number of elements"), ("vertices-negative", ply(vertices=-1), "is not a number of elements"),
        ("faces-huge", ply(faces=500000000), "the header announces"), ("no-vertices", ply(vertices=0, rows="3 0 1 2\n"), "refers to vertex"),
        ("no-z", ply(properties="xy", rows="0 0\n1 0\n0 1\n3 0 1 2\n"), "lacks x, y or z"),
        ("two-corners-index-negative", ply(rows="0 0 0\n1 0 0\n0 1 0\n2 0 -1\n"), "refers to vertex -1"), ("index-9", ply(rows="0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"), "refers to vertex 9"),
        ("index-negative", ply(rows="0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"), "refers to vertex -1"), ("cut-off", ply(rows="0 0 0\n1 0 0\n"), "ends early"),
        ("nan", ply(rows="0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n"), "not finite"), ("word", ply(rows="0 0 z\n1 0 0\n0 1 0\n3 0 1 2\n"), "expected a number"),
        ("float-length", ply(face="list float int vertex_indices"), "integer type"), ("no-indices", ply(face="list uchar int things"), "lacks the list"),
        ("list-negative", ply(form="binary_little_endian", face="list char int vertex_indices", rows=TRIANGLE + b"\xff" + bytes(12)), "does not fit"),
        ("list-huge", ply(form="binary_little_endian", face="list uint int vertex_indices", rows=TRIANGLE + b"\xff" * 16), "does not fit"),
        ("binary-cut-off", ply(form="binary_little_endian", rows=TRIANGLE + b"\3\0\0\0\0\1"), "ends early"),
        ("binary-inf", ply(form="binary_little_endian", rows=struct.pack("<9f", *[float("inf")] * 9) + b"\3" + bytes(12)), "not finite")):
    body(f"ply-{name}", '<shape type="ply"><string name="filename" value="m.ply"/></shape>', message, m_ply=data)



def deflated(data, zeros):
    """And so many zeros more: piece by piece, as children inherit the peak memory of this process."""
    stream = zlib.compressobj()
    return stream.compress(data) + b"".join(stream.compress(bytes(min(zeros - at, 1 << 20))) for at in range(0, zeros, 1 << 20)) + stream.flush()


def serialized(data=None, version=4, flags=0x1000, vertices=3, triangles=1, corner=2, positions=TRIANGLE, count=1, offset=0, zeros=0):
    """A mesh file of Mitsuba's own kind."""
    if data is None:
        data = struct.pack("<I", flags) + (b"a\0" if version == 4 else b"") + struct.pack("<QQ", vertices, triangles) + positions + struct.pack("<3I", 0, 1, corner)
    return struct.pack("<HH", 0x041C, version) + deflated(data, zeros) + struct.pack("<Q" if version == 4 else "<I", offset) * count + struct.pack("<I", count)


for name, data, message in (
        ("empty", b"", "not a serialized mesh"), ("another-file", b"ply\nformat ascii 1.0\n", "not a serialized mesh"), ("version", serialized(version=2), "version 2 are not supported"),
        ("cut-off", serialized()[:-1], "no table of its meshes"), ("half", serialized()[:30], "no table of its meshes"), ("no-table", serialized(count=0), "no table"), ("table-huge", serialized()[:-4] + b"\xff" * 4, "no table"),
        ("hollow", serialized(b""), "ends early"), ("vertices-huge", serialized(vertices=2 ** 28), "announces"), ("vertices-beyond", serialized(vertices=2 ** 63), "too many"),
        ("triangles-huge", serialized(triangles=2 ** 28), "announces"), ("index-9", serialized(corner=9), "refers to vertex 9"),
        ("index-huge", serialized(corner=2 ** 32 - 1), "refers to vertex 4294967295"), ("nan", serialized(positions=struct.pack("<9f", *[float("nan")] * 9)), "not finite"),
        ("no-zlib", struct.pack("<HH", 0x041C, 4) + b"\xff" * 40 + struct.pack("<QI", 0, 1), "damaged"), ("endless-name", serialized(struct.pack("<I", 0x1000) + b"x" * 1000), "ends early"),
        ("bomb", serialized(struct.pack("<I", 0x1000) + b"a\0" + struct.pack("<QQ", 40000000, 1), zeros=480000012), "the budget is")):
    body(f"serialized-{name}", '<shape type="serialized"><string name="filename" value="m.serialized"/></shape>', message, 4 if name == "bomb" else 2, m_serialized=data)
body("serialized-index", '<shape type="serialized"><string name="filename" value="m.serialized"/><integer name="shape_index" value="3"/></shape>', "holds 1 meshes", m_serialized=serialized())
body("serialized-offset", '<shape type="serialized"><string name="filename" value="m.serialized"/><integer name="shape_index" value="1"/></shape>', "begins outside",
     m_serialized=serialized(count=2, offset=2 ** 60))

for kind, name, data, message in (
        ("linear", "empty", "", "holds no curve"), ("linear", "lone-point", "0 0 0 1\n", "needs 2"), ("bspline", "three-points", "0 0 0 1\n1 0 0 1\n2 0 0 1\n", "needs 4"),
        ("linear", "no-radius", "0 0 0\n1 0 0\n", "expected a number"), ("linear", "negative", "0 0 0 -1\n1 0 0 1\n", "radius is negative"),
        ("linear", "nan", "0 0 nan 1\n1 0 0 1\n", "not finite"), ("linear", "far", "0 0 0 1\n1e30 0 0 1\n", "too far away"), ("bspline", "wide", "0 0 0 1\n1 0 0 1e20\n2 0 0 1\n3 0 0 1\n", "too far away")):
    body(f"curves-{kind}-{name}", f'<shape type="{kind}curve"><string name="filename" value="m.txt"/></shape>', message, m_txt=data)

MEASURED = measured_file(0)
for name, data, message in (
        ("empty", b"", "not a measured material"), ("another-file", b"ply\nformat ascii 1.0\n", "not a measured material"), ("version", MEASURED[:12] + b"\2" + MEASURED[13:], "version 2.0 are not supported"),
        ("header", MEASURED[:50], "ends early"), ("half", MEASURED[:5000], "is cut off"), ("endless-list", MEASURED[:14] + b"\xff" * 4 + MEASURED[18:], "ends early"),
        ("no-spectra", measured_file(0, wavelengths=((2,), (400, 700), False)), 'no tensor "spectra"'),
        ("wavelengths", measured_file(0, wavelengths=((2,), (700, 400), False), spectra=((1, 5, 2, 8, 8), [0.5] * 640, False)), "must ascend"), ("no-normals", measured_file(0, ndf=None), 'no tensor "ndf"'),
        ("bytes", measured_file(0, ndf=((9, 16), bytes(144), True)), "does not fit"), ("shape", measured_file(0, vndf=((1, 4, 2, 2), [1] * 16, False)), "does not fit"),
        ("huge", measured_file(0, ndf=((2 ** 40, 2 ** 40), [1], False)), "larger than the file"), ("hollow", measured_file(0, ndf=((0, 16), [], False)), "is empty"),
        ("narrow", measured_file(0, ndf=((9, 1), [1] * 9, False)), "two points"), ("oblong", measured_file(0, luminance=((1, 5, 2, 3), [1] * 30, False)), "as high as it is wide"),
        ("nan", measured_file(0, ndf=((2, 2), [1, float("nan"), 1, 1], False)), "not finite"), ("order", measured_file(0, theta_i=((5,), (0, 1, 1, 2, 3), False)), "must ascend"),
        ("arc", measured_file(4, phi_i=((5,), (0, .1, .2, .3, 2), False)), "must cover"), ("turned", measured_file(1, phi_i=((5,), (0, 1.6, 3.1, 4.7, 6.28), False)), "from -pi on"),
        ("bright", measured_file(0, rgb=((1, 5, 3, 8, 8), [1e30] * 960, False)), "above 1e10"), ("dimensions", measured_file(0, ndf=((1, 1, 1, 1, 1, 9), [1] * 9, False)), "does not fit")):
    body(f"measured-{name}", '<shape type="sphere"><bsdf type="measured"><string name="filename" value="m.bsdf"/></bsdf></shape>', message, m_bsdf=data)

# Materials and lights
for name, inside, message in (
        ("reflectance-2", '<bsdf type="diffuse"><rgb name="reflectance" value="2"/></bsdf>', "between 0 and 1"),
        ("reflectance-negative", '<bsdf type="diffuse"><rgb name="reflectance" value="-1 0 0"/></bsdf>', "between 0 and 1"),
        ("alpha-negative", '<bsdf type="roughconductor"><float name="alpha" value="-1"/></bsdf>', "between 0 and 10"),
        ("alpha-huge", '<bsdf type="roughconductor"><float name="alpha" value="1e30"/></bsdf>', "between 0 and 10"),
        ("eta-huge", '<bsdf type="conductor"><rgb name="eta" value="1e30"/></bsdf>', "between 0 and 1000"),
        ("ior-0", '<bsdf type="dielectric"><float name="int_ior" value="0"/></bsdf>', "index of refraction"),
        ("ior-1000", '<bsdf type="dielectric"><float name="int_ior" value="1000"/></bsdf>', "index of refraction"),
        ("ior-unknown", '<bsdf type="dielectric"><string name="int_ior" value="glas"/></bsdf>', "unknown medium"),
        ("ior-inside-out", '<bsdf type="plastic"><float name="int_ior" value="1"/><float name="ext_ior" value="2"/></bsdf>', "greater than ext_ior"),
        ("metal-unknown", '<bsdf type="conductor"><string name="material" value="Xx"/></bsdf>', "unknown conductor"),
        ("bsdf-unknown", '<bsdf type="difuse"/>', 'did you mean "diffuse"'), ("twosided-of-glass", '<bsdf type="twosided"><bsdf type="dielectric"/></bsdf>', "cannot hold"),
        ("mask-of-mask", '<bsdf type="mask"><texture name="opacity" type="checkerboard"/><bsdf type="mask"><texture name="opacity" type="checkerboard"/><bsdf type="diffuse"/></bsdf></bsdf>', "mask inside a mask"),
        ("bump-of-nothing", '<bsdf type="bumpmap"><bsdf type="diffuse"/></bsdf>', "exactly one <texture>"),
        ("radiance-negative", '<emitter type="constant"><rgb name="radiance" value="-1"/></emitter>', "not negative"),
        ("radiance-1e39", '<emitter type="constant"><rgb name="radiance" value="1e39"/></emitter>', "finite"),
        ("light-unknown", '<emitter type="points"/>', 'did you mean "point"'), ("sky", '<emitter type="sunsky"/>', "bake it"), ("light-far-away", '<emitter type="point"><point name="position" x="1e30" y="0" z="0"/></emitter>', "too far away"),
        ("light-flattened", '<emitter type="spot"><transform name="to_world"><scale z="0"/></transform></emitter>', "singular"), ("light-nowhere", '<emitter type="directional"><vector name="direction" x="0" y="0" z="0"/></emitter>', "must not be zero"),
        ("spot-angle", '<emitter type="spot"><float name="cutoff_angle" value="1e9"/></emitter>', "between"),
        ("projector-missing", '<emitter type="projector"><texture name="irradiance" type="bitmap"><string name="filename" value="none"/></texture></emitter>', "does not exist"),
        ("sky-flattened", '<emitter type="envmap"><string name="filename" value="s.xml"/><transform name="to_world"><scale x="0"/></transform></emitter>', "flattens the sky"), ("light-without-shape", '<emitter type="area"/>', "must stand inside a shape"),
        ("two-lights", '<shape type="cube"><emitter type="area"/><emitter type="area"/></shape>', "at most one emitter"),
        ("two-skies", '<emitter type="constant"/>' * 2, "second environment"), ("sky-missing", '<emitter type="envmap"><string name="filename" value="none"/></emitter>', "does not exist")):
    body(name, inside, message)


# Pictures
def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, data=b"", color=0, bits=8):
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, color, 0, 0, 0)) + chunk(b"IDAT", zlib.compress(data, 9))
            + chunk(b"IEND", b""))


# glTF
def gltf(name, change, text, code=2, make=triangle, **files):
    """A triangle with something wrong: change(scene) -> the text that the file holds instead, if any."""
    made = make()
    other = change(made)
    case("gltf-" + name, {"s.gltf": other if isinstance(other, str) else made.text(), **{key.replace("_", "."): value for key, value in files.items()}}, ["info", "s.gltf"], code, text)


def put(*path, value):
    """A change of one value of the file."""
    def change(made):
        item = made.json
        for key in path[:-1]:
            item = item[key]
        item[path[-1]] = value
    return change


def textured(image):
    def change(made):
        made.json["images"] = [image]
        made.json["textures"] = [{"source": 0}]
        made.json["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        primitive = made.json["meshes"][0]["primitives"][0]
        primitive["material"] = 0
        primitive["attributes"]["TEXCOORD_0"] = made.accessor("VEC2", [0, 0, 1, 0, 0, 1])
    return change


gltf("empty", lambda g: "", "not valid JSON")
gltf("a-list", lambda g: "[]", "a JSON object")
gltf("of-nothing", lambda g: "{}", "no asset.version")
gltf("version-1", put("asset", value={"version": "1.0"}), "glTF 1.0 is not supported")
gltf("deep", lambda g: '{"extras": ' + "[" * 100000 + "]" * 100000 + "}", "nested more than 100 deep")
gltf("lists-of-other-kind", put("nodes", value={}), '"nodes" must be a list')
gltf("node-missing", put("scenes", 0, "nodes", value=[7]), "node 7 does not exist")
gltf("node-of-itself", put("nodes", 0, "children", value=[0]), "stands in the tree twice")
gltf("mesh-missing", put("nodes", 0, "mesh", value=3), "the file has 1 meshes")
gltf("matrix-projective", put("nodes", 0, "matrix", value=[1, 0, 0, 1] * 4), "last row")
gltf("rotation-zero", put("nodes", 0, "rotation", value=[0, 0, 0, 0]), "quaternion")
gltf("far-away", put("nodes", 0, "translation", value=[1e20, 0, 0]), "too far away")
gltf("accessor-beyond", put("accessors", 0, "count", value=4), "lead beyond the buffer view")
gltf("accessor-huge", put("accessors", 0, "count", value=2 ** 50), "too many elements")
gltf("accessor-of-zeros", lambda g: g.json["accessors"][0].update(count=2 ** 24 + 1) or g.json["accessors"][0].pop("bufferView"), "too many elements")
gltf("accessor-of-twos", put("accessors", 0, "type", value="VEC2"), "must be VEC3 here")
gltf("accessor-of-doubles", put("accessors", 0, "componentType", value=5130), "componentType")
gltf("offset-negative", put("accessors", 0, "byteOffset", value=-4), "whole number")
gltf("view-beyond", put("bufferViews", 0, "byteLength", value=37), "lead beyond the buffer")
gltf("stride-narrow", put("bufferViews", 0, "byteStride", value=4), "byteStride")
gltf("index-beyond", lambda g: g.json["meshes"][0]["primitives"][0].update(indices=g.accessor("SCALAR", [0, 1, 3], 5123)), "index 3 is beyond")
gltf("corners-two", lambda g: g.json["meshes"][0]["primitives"][0].update(indices=g.accessor("SCALAR", [0, 1], 5123)), "neither a shape with triangles nor a sensor")
gltf("positions-none", put("meshes", 0, "primitives", 0, "attributes", value={}), "neither a shape with triangles nor a sensor")
gltf("normals-two", lambda g: g.json["meshes"][0]["primitives"][0]["attributes"].update(NORMAL=g.accessor("VEC3", [0, 0, 1] * 2)), "2 of NORMAL, but 3 positions")
gltf("nan", lambda g: put("accessors", value=[])(g) or g.accessor("VEC3", [float("nan")] * 9), "is not finite")
gltf("sparse-beyond", lambda g: g.json["accessors"][0].update(sparse={"count": 1, "indices": {"bufferView": g.view(b"\x09"), "componentType": 5121}, "values": {"bufferView": 0}}), "index 9 is beyond")
gltf("color-of-two", lambda g: put("materials", value=[{"pbrMetallicRoughness": {"baseColorFactor": [1, 1]}}])(g) or put("meshes", 0, "primitives", 0, "material", value=0)(g), "a list of 4 numbers")
GLOSS, TWO_TEXTURES = "KHR_materials_pbrSpecularGlossiness", {"diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 0}}
for name, extension, value, message in (("gloss-of-another-kind", GLOSS, 5, "must be an object"), ("gloss-negative", GLOSS, {"specularFactor": [-1, 0, 0]}, "a list of 3 numbers from 0"),
        ("gloss-a-text", GLOSS, {"glossinessFactor": "2"}, "must be a number"), ("gloss-texture-missing", GLOSS, {**TWO_TEXTURES, "diffuseTexture": {}}, "needs the index of a texture"),
        ("unlit-of-another-kind", "KHR_materials_unlit", True, "must be an object"), ("absorption-negative", "KHR_materials_volume", {"attenuationDistance": -1}, '"attenuationDistance" must be a number from 0')):
    gltf(name, lambda g, e=extension, v=value: textured({"uri": "t.png"})(g) or put("materials", 0, "extensions", value={e: v})(g), message)
gltf("draco", lambda g: put("meshes", 0, "primitives", 0, "extensions", value={"KHR_draco_mesh_compression": {}})(g) or g.json["accessors"][0].pop("bufferView"), "KHR_draco_mesh_compression is not supported")
gltf("buffer-short", lambda g: g.text().replace(f'"byteLength": {len(g.binary)}, "uri"', '"byteLength": 1000000000, "uri"'), "but there are")
gltf("base64-broken", lambda g: g.text().replace("base64,AAAA", "base64,A!AA"), "not in base64")
gltf("buffer-missing", lambda g: g.text().replace('"data:', '"none.bin" , "x": "'), "does not exist")
gltf("buffer-a-device", lambda g: g.text().replace('"data:', '"/dev/zero", "x": "'), "must be a relative path")
gltf("image-beside-that-is-missing", textured({"uri": "../no-such-picture.png"}), "does not exist")
gltf("image-beside-by-backslashes", textured({"uri": "..\\no-such-picture.png"}), "does not exist")
gltf("image-of-the-root-by-backslashes", textured({"uri": "\\t.png"}), "must be a relative path")
gltf("image-of-another-kind", textured({"uri": "data:image/webp;base64,UklGRg=="}), "not a picture")
gltf("image-of-webp-cut-off", textured({"uri": "data:image/webp;base64,UklGRhoAAABXRUJQVlA4TA0AAAAv"}), "broken or truncated WebP file")
gltf("meshopt-of-nothing", lambda g: put("bufferViews", 0, "extensions", value={"EXT_meshopt_compression": {"buffer": 0, "byteLength": 36, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"}})(g), "the compressed data are broken")
gltf("meshopt-bomb", lambda g: put("bufferViews", 0, "extensions", value={"EXT_meshopt_compression": {"buffer": 0, "byteLength": 36, "byteStride": 256, "count": 10 ** 9, "mode": "ATTRIBUTES"}})(g), "the compressed data are broken")
gltf("meshopt-of-a-mode", lambda g: put("bufferViews", 0, "extensions", value={"EXT_meshopt_compression": {"buffer": 0, "byteLength": 36, "byteStride": 12, "count": 3, "mode": "FASTEST"}})(g), "the mode must be")
gltf("image-bomb", lambda g: textured({"uri": "bomb.png"})(g), "the budget is", 4, bomb_png=png(16000, 16000, bytes(16001 * 16000)))
gltf("light-missing", put("nodes", 0, "extensions", value={"KHR_lights_punctual": {"light": 2}}), "light 2 does not exist")
gltf("camera-flat", lambda g: put("cameras", value=[{"type": "perspective", "perspective": {"yfov": 4}}])(g) or put("nodes", 0, "camera", value=0)(g), "yfov")
GLB = triangle().container()
for name, data, message in (("cut-off", GLB[:-40], "announces"), ("header", GLB[:18], "ends early"), ("version", glb(b"{}  ", b"", version=1), "glTF 1"), ("no-json", GLB[:16] + b"BIN\0" + GLB[20:], "must be JSON"),
                            ("chunk-huge", GLB[:12] + b"\xff\xff\xff\x7f" + GLB[16:], "longer than the file"), ("no-data", glb(GLB[20:20 + struct.unpack("<I", GLB[12:16])[0]], b""), "no binary chunk")):
    case("glb-" + name, {"s.glb": data}, ["info", "s.glb"], 2, message)


# pbrt
PBRT = 'Camera "perspective" Film "rgb" "integer xresolution" 8 "integer yresolution" 8\nWorldBegin\nLightSource "infinite"\n'


def pbrt(name, world, text, code=2, arguments=(), **files):
    case("pbrt-" + name, {"s.pbrt": PBRT + world, **{key.replace("_", "."): value for key, value in files.items()}}, ["info", "s.pbrt", *arguments], code, text)


pbrt("word", "Sphere", "no directive of pbrt")
pbrt("zero-byte", 'Shape "sph\0ere"', "holds a byte 0")
pbrt("cut-off", 'Shape "sphere" "float radius" [ 1', "expected a value")
pbrt("quote-open", 'Shape "sphere', "not closed on its line")
pbrt("quote-long", f'Shape "{"s" * 5000}"', "more than 4096 bytes")
pbrt("name-long", f'Shape "sphere" "float {"r" * 300}" 1', "longer than 200 bytes")
pbrt("number-nan", 'Translate nan 0 0', "expected a number")
pbrt("number-infinite", 'Translate 1e999 0 0', "not a finite number")
pbrt("end-alone", "AttributeEnd", "without its beginning")
pbrt("shape-far-away", 'Translate 1e12 0 0 Shape "sphere"', "up to 1e9")
pbrt("shape-too-large", 'Scale 1e300 1e300 1e300 Shape "sphere"', "too large")
pbrt("index-beyond", 'Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ] "integer indices" [ 0 1 3 ]', "out of range")
pbrt("index-fraction", 'Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ] "integer indices" [ 0 1 .5 ]', "out of range")
pbrt("normals-two", 'Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ] "normal N" [ 0 0 1 0 0 1 ] "integer indices" [ 0 1 2 ]', "as many normals")
pbrt("curve-far-away", 'Shape "curve" "point3 P" [ 0 0 0 1 0 0 2 0 0 1e20 0 0 ]', "too large or too far")
pbrt("curve-of-three", 'Shape "curve" "point3 P" [ 0 0 0 1 0 0 2 0 0 ]', "do not make curves")
pbrt("levels-many", 'Shape "loopsubdiv" "integer levels" 10 "point3 P" [ 0 0 0 1 0 0 0 1 0 ] "integer indices" [ 0 1 2 0 2 1 ]', "more than 2 million triangles")
pbrt("mix-of-itself", 'MakeNamedMaterial "a" "string type" "mix" "string materials" [ "a" "a" ] NamedMaterial "a" Shape "sphere"', "mixed too deep")
pbrt("mix-of-many", 'MakeNamedMaterial "m0" "string type" "diffuse" ' + "".join(f'MakeNamedMaterial "m{i + 1}" "string type" "mix" "string materials" [ "m{i}" "m{i}" ] ' for i in range(4))
     + 'NamedMaterial "m4" Shape "sphere"', "a mix of more than 8 materials")
pbrt("name-never-defined", 'NamedMaterial "a" Shape "sphere" MakeNamedMaterial "b" "string type" "diffuse"', 'no material with the name "a"')
pbrt("mix-of-the-undefined", 'NamedMaterial "a" Shape "sphere" MakeNamedMaterial "a" "string type" "mix" "string materials" [ "b" "a" ]', 'no material with the name "b"')
pbrt("checkerboard-out-of-step", 'Texture "p" "spectrum" "imagemap" "string filename" "s.pbrt" Texture "c" "spectrum" "checkerboard" "texture tex1" "p" "float uscale" 1e9 Material "diffuse" "texture reflectance" "c" Shape "sphere"', "not in step")
pbrt("texture-of-itself", 'Texture "t" "spectrum" "scale" "texture tex" "t" "float scale" .5 Material "diffuse" "texture reflectance" "t" Shape "sphere"', "nested too deep")
pbrt("include-itself", 'Include "s.pbrt"', "16 deep")
pbrt("include-a-device", 'Include "/dev/zero"', "a device, not a file", 3)
pbrt("instance-of-nothing", 'ObjectInstance "o"', "no object with the name")
pbrt("instance-too-small", 'ObjectBegin "o" Shape "disk" ObjectEnd Scale 1e-20 1e-20 1e-20 ObjectInstance "o"', "too much or too little")
pbrt("object-in-object", 'ObjectBegin "o" ObjectBegin "p"', "cannot stand in another one")
pbrt("ply-of-text", 'Shape "plymesh" "string filename" "m.ply.gz"', "broken or cut off", m_ply_gz=b"\x1f\x8bnothing")
pbrt("ply-another-content", 'Shape "plymesh" "string filename" "m.ply.gz"', 'does not begin with "ply"', m_ply_gz=gzip.compress(bytes(10 ** 7), mtime=0))
pbrt("blackbody-cold", 'AreaLightSource "diffuse" "blackbody L" 2 Shape "sphere"', "from 200 to 1e6 kelvin")
pbrt("light-without-area", 'AreaLightSource "diffuse" "float power" 2 Shape "trianglemesh" "point3 P" [ 0 0 0 0 0 0 0 0 0 ]', "without an area")
pbrt("medium", 'MakeNamedMedium "m" "string type" "homogeneous" MediumInterface "m" ""', "a medium is not supported")
bad("lens-wide", scene('<sensor type="thinlens"><float name="aperture_radius" value="1e19"/></sensor>' + CUBE), "up to 1e9")
# Which took minutes or gigabytes.
pbrt("cost-attributes", 'Attribute "shape" ' + "".join(f'"float p{i}" 1 ' for i in range(30000)) + 'Shape "sphere" ' * 10000, "more than 100 parameters")
pbrt("cost-names", f'Attribute "shape" "float {"X" * 10 ** 6} alpha" 1 ' + 'Shape "sphere" ' * 1200, "1 things cannot be used", 2, ["--check", "--json"])
pbrt("cost-unused", 'AreaLightSource "diffuse" ' + "".join(f'"float p{i}" 1 ' for i in range(30000)) + 'Shape "sphere" ' * 3000, "", 0, ["--check"])
pbrt("cost-spectra", 'AreaLightSource "diffuse" "spectrum L" [ ' + "".join(f"{360 + i / 100} 1 " for i in range(40000)) + '] ' + 'Shape "sphere" ' * 4000, "", 0, ["--check"])
pbrt("cost-materials", 'Material "foo" Shape "sphere" ' * 30000, "1000 things cannot be used", 2, ["--check"])
pbrt("cost-comment", "#" + "WorldEnd" * 100000 + '\\nShape "sphere"', "", 0, ["--check"])
pbrt("cost-includes", 'Include "a.pbrt" ' * 1000, "1 things cannot be used", 2, ["--check"], a_pbrt="# " + "x" * 10 ** 6)


def pfm(*values, side=2):
    return f"PF\n{side} {side}\n-1.0\n".encode() + struct.pack(f"<{3 * side * side}f", *(list(values) * (3 * side * side))[:3 * side * side])


def bmp(width, height, depth=24, compression=0):
    return b"BM" + struct.pack("<IIIIiiHHIIIIII", 0, 0, 54, 40, width, height, 1, depth, compression, 0, 0, 0, 0, 0)


def webp_lossless(width, height, data=bytes(30)):
    content = b"\x2f" + struct.pack("<I", width - 1 | (height - 1) << 14) + data
    return b"RIFF" + struct.pack("<I", 12 + len(content)) + b"WEBPVP8L" + struct.pack("<I", len(content)) + content


def tga(kind, width, height, depth=24):
    return struct.pack("<BBBHHBHHHHBB", 0, 0, kind, 0, 0, 0, 0, 0, width, height, depth, 0)


def pictured(name, data, message, code):
    """A picture that is refused: alone, as a texture, and as a sky where a small file claims, or inflates to, more than the budget."""
    text = name if code == 2 else f"{name}: picture of "
    case(f"picture-{name}", {name: data}, ["info", name], code, message)
    body(f"texture-{name}", f'<bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="{name}"/></texture></bsdf>', text, code, **{name: data})
    if code == 4:
        body(f"envmap-{name}", f'<emitter type="envmap"><string name="filename" value="{name}"/></emitter>', text, code, **{name: data})


GOOD_PNG = png(2, 2, b"\0\x40\x80\0\x80\x40")
for name, data, message, code in (
        ("cut.bmp", bmp(2, 2), "truncated BMP", 2), ("huge.bmp", bmp(100000, 100000), "too large", 2), ("least.bmp", bmp(2, -2 ** 31), "too large", 2), ("short.bmp", b"BM", "truncated BMP", 2),
        ("packed.bmp", bmp(2, 2, 8, 1) + bytes(64), "without compression", 2), ("palette.bmp", bmp(1, 1, 8) + b"\xff\0\0\0", "truncated BMP", 2), ("cut.tga", tga(2, 2, 2), "truncated TGA", 2), ("huge.webp", webp_lossless(16384, 16384), "the budget is", 4), ("cut.webp", webp_lossless(16, 16)[:26], "truncated WebP", 2),
        ("tables.webp", webp_lossless(1024, 1024, bytes(300000)), "the budget is", 4), ("animated.webp", b"RIFF\x16\0\0\0WEBPVP8X\x0a\0\0\0\2\0\0\0\7\0\0\7\0\0", "animated WebP", 2),
        ("huge.tga", tga(10, 65535, 65535), "too large", 2), ("kind.tga", tga(7, 2, 2) + bytes(64), "TGA of type 7", 2), ("short.tga", b"\0", "truncated TGA", 2),
        ("0x0.png", png(0, 0), "broken picture", 2), ("100k.png", png(100000, 100000), "too large", 2), ("side.png", png(2000000, 1), "too large", 2), ("row.png", png(2 ** 31 - 1, 1, color=6, bits=16), "too large", 2),
        ("hollow.png", png(5000, 5000), "truncated", 2), ("cut.png", GOOD_PNG[:50], "broken picture", 2), ("crc.png", GOOD_PNG[:30] + b"\0" + GOOD_PNG[31:], "CRC", 2),
        ("text.png", b"hello", "not a picture", 2), ("empty.png", b"", "not a picture", 2), ("bomb.png", png(16000, 16000, bytes(16001 * 16000)), "the budget is", 4),
        ("16k.png", png(16000, 16000, bytes(100)), "the budget is", 4), ("16k.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16000 +X 16000\n", "the budget is", 4), ("16k.pfm", b"PF\n16000 16000\n-1\n", "the budget is", 4),
        ("16k.bmp", bmp(16000, 16000), "the budget is", 4), ("16k.tga", tga(10, 16000, 16000), "the budget is", 4),
        ("start.jpg", b"\xff\xd8\xff", "JPEG", 2), ("tables.jpg", b"\xff\xd8\xff\xc4\x01\x13\x00" + b"\xff" * 16 + bytes(256) + b"\xff\xd9", "Huffman", 2),
        ("100k.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 100000\n", "too large", 2), ("upside.hdr", b"#?RADIANCE\n\n+Y 2 +X 2\n", "not supported", 2),
        ("0x0.hdr", b"#?RADIANCE\n\n-Y 0 +X 0\n", "picture of 0 x 0", 2), ("cut.hdr", b"#?RADIANCE\n\n-Y 2 +X 2\n\1\2", "truncated", 2),
        ("line.hdr", b"#?RADIANCE\n" + b"x" * 5000, "more than 4096", 2), ("nan.pfm", b"PF\n2 2\nnan\n" + bytes(48), "broken PFM header", 2),
        ("cut.pfm", pfm(0.5)[:-1], "truncated PFM", 2), ("huge.pfm", b"PF\n99999999999 2\n-1\n", "too large", 2), ("magic.exr", b"\x76\x2f\x31\x01", "EXR", 2),
        ("attribute.exr", b"\x76\x2f\x31\x01\2\0\0\0channels\0chlist\0\xff\xff\xff\x7f", "broken EXR header", 2)):
    pictured(name, data, message, code)
for name, where, value, message in (
        ("reflectance-nan", '<bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="t.pfm"/></texture></bsdf>', float("nan"), "not finite"),
        ("opacity-2", '<bsdf type="mask"><texture name="opacity" type="bitmap"><string name="filename" value="t.pfm"/></texture><bsdf type="diffuse"/></bsdf>', 2, "an opacity must"),
        ("alpha-negative", '<bsdf type="roughconductor"><texture name="alpha" type="bitmap"><string name="filename" value="t.pfm"/></texture></bsdf>', -1, "a roughness must"),
        ("light-nan", '<shape type="cube"><emitter type="area"><texture name="radiance" type="bitmap"><string name="filename" value="t.pfm"/></texture></emitter></shape>', float("nan"), "not finite"),
        ("sky-inf", '<emitter type="envmap"><string name="filename" value="t.pfm"/></emitter>', float("inf"), "not finite")):
    body(f"bitmap-{name}", where, message, t_pfm=pfm(value))
for name, value, note in (("5", 5, "texels of reflectance above 1 (up to 5), read as 1"), ("negative", -1, "negative values, read as 0")):
    odd(f"bitmap-reflectance-{name}", scene(SENSOR + CUBE + '<bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="t.pfm"/></texture></bsdf>'),
        note, t_pfm=pfm(value))

BIG = png(2600, 2600, bytes(2600 * (2600 * 3 + 1)), 2)
case("compared", {"a.png": BIG}, ["compare", "a.png", "a.png"], 4, "a.png: comparing")
case("shown", {"a.png": BIG}, ["info", "a.png"], 0, "")
for name, inside in (("texture", '<bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="a.png"/></texture></bsdf>'),
                     ("envmap", '<emitter type="envmap"><string name="filename" value="a.png"/></emitter>')):
    odd(f"large-{name}", scene(SENSOR + CUBE + inside), a_png=BIG)
    # The picture alone is within the budget, its colours are not.
    body(f"{name}-grows", inside, "a.png needs", 4, a_png=png(4000, 4000, bytes(4000 * 4001)))
# The colours as well, the table of what to sample is not.
body("envmap-table-grows", '<emitter type="envmap"><string name="filename" value="a.png"/></emitter>', "the environment map's table", 4, a_png=png(3200, 3200, bytes(3200 * 3201)))

# JSON
DEEP = "[" * 200000 + "]" * 200000
for name, text, message in (
        ("empty", "", "not valid JSON"), ("deep", '{"a": ' + DEEP + "}", "nested more than 100"), ("open", "[" * 1000000, "nested more than 100"), ("1e999", '{"adam.rate": 1e999}', "too large"),
        ("list", "[]", "a configuration is a JSON object"), ("comma", '{"octree.levels": 3,}', "not valid JSON"), ("kind", '{"octree.levels": "many"}', "octree.levels"), ("range", '{"octree.levels": 99}', "octree.levels"),
        ("fraction", '{"octree.levels": 2.5}', "octree.levels"), ("unknown", '{"octre.levels": 3}', "octre.levels"), ("nan", '{"octree.levels": NaN}', "not valid JSON"), ("utf8", b'{"\xff": 1}', "not valid JSON"),
        ("preset", '{"preset": ' + "[" * 50 + "]" * 50 + "}", "preset")):
    case(f"config-{name}", {"c.json": text}, ["info", "--keys", "--config", "c.json"], 2, message)
LOOK = '"origin": [0, 0, 3], "target": [0, 0, 0]'
for name, text, message in (
        ("empty", "", "not valid JSON"), ("deep", DEEP, "nested more than 100"), ("no-list", "[]", "expected a camera"), ("number", "1", "expected a camera"), ("nothing", "{}", 'needs "origin"'),
        ("width", f'{{{LOOK}, "width": 1.5}}', "must be a whole number"), ("width-0", f'{{{LOOK}, "width": 0}}', "from 1 to 131072"), ("fov", f'{{{LOOK}, "fov": 180}}', "between"), ("key", f'{{{LOOK}, "fow": 1}}', 'did you mean "fov"'),
        ("far", '{"origin": [1e19, 0, 0], "target": [0, 0, 0]}', "too far away"), ("words", '{"origin": ["a", 0, 0], "target": [0, 0, 0]}', "3 finite numbers"), ("shear", '{"to_world": [1,1,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}', "must not scale or shear"),
        ("same", '{"origin": [0, 0, 0], "target": [0, 0, 0]}', "define no view"), ("two", f"[{{{LOOK}}}, {{{LOOK}}}]", "holds 2 cameras"), ("1e999", f'{{{LOOK}, "fov": 1e999}}', "too large")):
    case(f"camera-{name}", {"s.xml": ROOM, "c.json": text}, ["render", "s.xml", "-o", "a.exr", "--spp", "1", "--camera", "c.json"], 2, message)
for name, text, message in (
        ("one-key", f'{{"keys": [{{{LOOK}}}], "frames": 2}}', "two cameras or more"), ("frames-0", f'{{"keys": [{{{LOOK}}}, {{{LOOK}}}], "frames": 0}}', "from 1 to"), ("frames-half", f'{{"keys": [{{{LOOK}}}, {{{LOOK}}}], "frames": 2.5}}', "whole number"),
        ("frames-huge", f'{{"keys": [{{{LOOK}}}, {{{LOOK}}}], "duration": 1e9, "fps": 1e5}}', "more than 1000000 frames"), ("backwards", f'{{"keys": [{{{LOOK}, "time": 2}}, {{{LOOK}, "time": 1}}]}}', "later than"), ("deep", f'{{"keys": {DEEP}}}', "nested more than 100")):
    case(f"path-{name}", {"s.xml": ROOM, "p.json": text}, ["render", "s.xml", "-o", "a####.exr", "--spp", "1", "--path", "p.json"], 2, message)


# Models
def tensors(header, data=b""):
    text = header if isinstance(header, bytes) else json.dumps(header).encode() if not isinstance(header, str) else header.encode()
    return struct.pack("<Q", len(text)) + text + data


def model_header(**metadata):
    return {"__metadata__": {"format": "octrad", "version": "1", "config": "{}", "scene": '{"file": "s.xml", "fingerprint": "0"}', "program": "x", "step": "1", "seed": "0",
                             "state": '{"step": 1, "seconds": 1.0, "lhs_samples": 1, "rhs_queries": 1}', **metadata}}


POINTS = "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n"
for name, data, message in (
        ("empty", b"", "it is empty"), ("short", b"abc", "only a few bytes"), ("huge-header", struct.pack("<Q", 2 ** 62), "claims"), ("no-json", tensors("{x"), "not valid JSON"), ("deep", tensors("[" * 100000), "not a JSON object"),
        ("deep-object", tensors('{"a":' * 100000), "nested too deeply"), ("no-model", tensors({}), "not an octrad model"), ("another-format", tensors(model_header(format="x")), "not an octrad model"),
        ("another-version", tensors(model_header(version="9")), "format version 9"), ("deep-config", tensors(model_header(config=DEEP)), "nested more than 100"), ("config-1e999", tensors(model_header(config='{"adam.rate": 1e999}')), "too large"),
        ("deep-scene", tensors(model_header(scene=DEEP)), "nested more than 100"), ("no-state", tensors(model_header(state="{}")), "broken model header"), ("no-domain", tensors(model_header(config='{"target.scale": 1}')), "octree.origin"),
        ("negative-step", tensors(model_header(state='{"step": -1, "seconds": 1.0, "lhs_samples": 1, "rhs_queries": 1}')), "step must be a whole number"),
        ("huge-samples", tensors(model_header(state='{"step": 1, "seconds": 1.0, "lhs_samples": 1e300, "rhs_queries": 1}')), "lhs_samples must be a whole number"),
        ("negative-seconds", tensors(model_header(state='{"step": 1, "seconds": -1e9, "lhs_samples": 1, "rhs_queries": 1}')), "must not be negative"), ("scale-0", tensors(model_header(config='{"target.scale": 0}')), "target.scale"),
        ("field-unknown", tensors(model_header(config='{"field": "x"}')), "field"), ("tables-missing", tensors({**model_header(config='{"field": "nr", "nr.log2_table": 24, "nr.levels": 16, "nr.features": 8, "target.scale": 1}'),
         "octree.origin": {"dtype": "F32", "shape": [3], "data_offsets": [0, 12]}, "octree.size": {"dtype": "F32", "shape": [3], "data_offsets": [12, 24]}}, struct.pack("<6f", 0, 0, 0, 1, 1, 1)), "needs tables of"),
        ("box-nan", tensors({**model_header(config='{"target.scale": 1}'), "octree.origin": {"dtype": "F32", "shape": [3], "data_offsets": [0, 12]}, "octree.size": {"dtype": "F32", "shape": [3], "data_offsets": [12, 24]}},
         struct.pack("<6f", float("nan"), 0, 0, 1, 1, 1)), "not finite"),
        ("overlap", tensors({"a": {"dtype": "U8", "shape": [2], "data_offsets": [0, 2]}, "b": {"dtype": "U8", "shape": [2], "data_offsets": [1, 3]}}, b"abc"), "overlap"),
        ("shape-huge", tensors({"a": {"dtype": "F64", "shape": [2 ** 62, 2 ** 62], "data_offsets": [0, 1]}}, b"a"), "overflow"), ("outside", tensors({"a": {"dtype": "U8", "shape": [9], "data_offsets": [0, 9]}}, b"a"), "truncated or damaged")):
    case(f"model-{name}", {"m.octrad": data, "p.csv": POINTS}, ["query", "m.octrad", "--points", "p.csv"], 2, message)
case("model-info-deep", {"m.octrad": tensors(model_header(config=DEEP))}, ["info", "m.octrad"], 0, "")
case("model-a-device", {"p.csv": POINTS}, ["query", "/dev/zero", "--points", "p.csv"], 3, "a device, not a file")

# A few bytes that would take much time or memory: each took more than ten seconds, more than the budget, or the stack
def repeated(text, count):
    """`text` with the numbers 0, 1, ... for its {}"""
    return "".join(text.format(i) for i in range(count))


def cost(name, xml, code=0, text="", arguments=(), **files):
    bad("cost-" + name, xml, text, code, arguments, **files)


LONG_PATH = "./" * 1900 + "t.xml"  # in each message about what stands in the file
cost("parameters-at-each-dollar", scene(SENSOR + CUBE + repeated('<default name="a{:05}" value="1"/>', 20000) + '<integrator type="' + "$a00001" * 9000 + '"/>'))
cost("dollars-in-a-name", scene('<default name="a\\$b" value="1"/>'), 2, "has no $")
cost("long-name", scene('<default name="' + "a" * 201 + '" value="1"/>'), 2, "at most 200 characters")
MEASURED_ONE = '<bsdf type="measured"{}><string name="filename" value="m.bsdf"/></bsdf>'
cost("measured-names", scene(SENSOR + CUBE + '<shape type="sphere">' + MEASURED_ONE.format("") + "</shape>"), 2, 'no tensor "phi_i"',
     m_bsdf=MEASURED[:14] + struct.pack("<I", 600000) + b"".join(struct.pack("<H4sHBQ", 4, str(i).encode()[:4], 0, 1, 0) for i in range(600000)))
cost("measured-dimensions", scene(SENSOR + CUBE + '<shape type="sphere">' + MEASURED_ONE.format("") + "</shape>"), 2, 'no tensor "phi_i"',
     m_bsdf=MEASURED[:14] + struct.pack("<I", 20) + (struct.pack("<H1sHBQ", 1, b"a", 65535, 1, 0) + struct.pack("<Q", 1) * 65535) * 20)
cost("measured-often", scene(SENSOR + CUBE + repeated('<shape type="sphere"><float name="radius" value="1e-4"/>' + MEASURED_ONE.format(' id="m{}"') + "</shape>", 5000)), 0,
     m_bsdf=measured_file(0, ndf=((1000, 1000), bytes(1000000), False)))
case("cost-measured-rows", {"s.xml": scene(SENSOR + LIGHT + '<shape type="sphere">' + MEASURED_ONE.format("") + "</shape>"), "m.bsdf": measured_file(0, ndf=((1500000, 2), bytes(3000000), False))},
     ["render", "s.xml", "--integrator", "path", "--spp", "1", "-o", "a.exr", "-q"], 0, "")
cost("ids-not-there", scene(SENSOR + CUBE + repeated('<bsdf type="diffuse" id="material{:05}"/>', 20000) + repeated('<shape type="cube"><ref id="matexial{:05}"/></shape>', 20000)),
     2, "things cannot be used", ["--check"])
cost("aliases-of-nothing", scene(SENSOR + CUBE + repeated('<bsdf type="diffuse" id="material{:05}"/>', 20000) + repeated('<alias id="matexial{:05}" as="x"/>', 20000)), 2, "things cannot be used", ["--check"])
cost("parameters-not-there", scene(SENSOR + CUBE + repeated('<default name="a{:05}" value="1"/>', 20000) + '<bsdf type="$bbbbb"/>' * 20000), 2, "things cannot be used", ["--check"])
cost("many-folders", scene(SENSOR + CUBE + '<path value="."/>' * 101), 2, "more than 100 folders")
cost("defaults-not-used", scene(f'<include filename="{LONG_PATH}"/>' + SENSOR + CUBE), 0, "", t_xml=scene(repeated('<default name="b{}" value="1"/>', 60000)))
cost("axes-of-length-2", scene(f'<include filename="{LONG_PATH}"/>' + SENSOR), 0, "the axis was normalised",
     t_xml=scene('<shape type="cube"><transform name="to_world">' + '<rotate x="2" angle="0"/>' * 100000 + "</transform></shape>"))
cost("old-parameters-not-used", scene(SENSOR + CUBE + repeated('<integer name="' + "x" * 400 + '{}" value="1"/>', 60000), "0.6.0"))
cost("long-spectrum-used-often", scene('<spectrum id="s" type="irregular">' + "".join(f'<string name="{name}" value="{repeated("{} ", 60000)}"/>' for name in ("wavelengths", "values")) + "</spectrum>"
     + '<bsdf type="diffuse"><ref name="reflectance" id="s"/></bsdf>' * 5000 + SENSOR + CUBE), 0, "was clamped")
cost("spectrum-file-used-often", scene('<bsdf type="diffuse"><spectrum name="reflectance" filename="a.spd"/></bsdf>' * 5000 + SENSOR + CUBE), a_spd=repeated("{} 0.5\n", 100000))
cost("deep-mixture", scene('<bsdf type="mixturebsdf"><string name="weights" value="' + "0.000001 " * 100000 + '"/>' + '<bsdf type="diffuse"/>' * 100000 + "</bsdf>" + SENSOR + CUBE, "0.6.0"), 2, "at most 8")
for name, weights in (("weights", "1, 1"), ("no-weights", "none")):
    bad(f"old-mixture-{name}-listed", scene(SENSOR + f'<shape type="cube"><bsdf type="mixturebsdf"><string name="weights" value="{weights}"/><bsdf type="diffuse"/></bsdf></shape>', "0.6.0"), "things cannot be used", 2, ["--check"])

# Objects that hold themselves, or others again and again, through references
MANY = repeated('<float name="p{}" value="1"/>', 990)
cost("merge-of-itself", scene(SENSOR + CUBE + '<shape type="merge" id="m"><ref id="m"/></shape>'), 2, "nested more than 200 deep")
cost("merge-of-itself-twice", scene(SENSOR + CUBE + '<shape type="merge" id="m"><ref id="m"/><ref id="m"/></shape>'), 2, "things cannot be used", ["--check"])
cost("merges-of-merges", scene(SENSOR + CUBE + '<shape type="merge" id="m0"/>' + "".join(f'<shape type="merge" id="m{i}">' + f'<ref id="m{i - 1}"/>' * 30 + "</shape>" for i in range(1, 10))), 2, "referred to too often")
cost("integrator-of-itself", scene(SENSOR + CUBE + '<integrator type="aov" id="i"><ref id="i"/></integrator>'), 2, "nested more than 200 deep")
cost("sampler-used-often", scene('<sampler type="independent" id="s">' + MANY + "</sampler>" + '<sensor type="perspective"><ref id="s"/></sensor>' * 6000 + CUBE), 2, "referred to too often")
cost("emitter-used-often", scene(SENSOR + '<emitter type="area" id="e">' + MANY + "</emitter>" + CUBE + '<shape type="cube"><transform name="to_world"><scale value="0.01"/></transform><ref id="e"/></shape>' * 6000), 2, "things cannot be used", ["--check"])
cost("long-folders", scene(SENSOR + CUBE + ('<path value="' + "./" * 2000 + '"/>') * 99 + repeated('<bsdf type="diffuse"><spectrum name="reflectance" filename="a{}"/></bsdf>', 1000)), 2, "more than 8192 bytes")
cost("long-file-included-often", scene('<include filename="t.xml"/>' * 999 + SENSOR + CUBE), 2, "more than a gigabyte", t_xml="<!--" + "a" * 1010000 + "-->" + scene(""))
cost("ply-lines", scene(SENSOR + '<shape type="ply"><string name="filename" value="m.ply"/></shape>'), m_ply=b"ply\nformat ascii 1.0\n" + b"element a 0\n" * 100001, code=2, text="more than 100000 lines")
cost("serialized-name", scene(SENSOR + '<shape type="serialized"><string name="filename" value="m.serialized"/></shape>'), m_serialized=serialized(struct.pack("<I", 0x1000) + b"a" * 70000 + b"\0" + struct.pack("<QQ", 3, 1) + TRIANGLE + struct.pack("<3I", 0, 1, 2)), code=2, text="a name of more than 65536 bytes")

# One position with many texture coordinates.
cost("obj-vt", scene(SENSOR + CUBE + '<shape type="obj"><string name="filename" value="m.obj"/></shape>'), m_obj="v 0 0 0\nv 0.001 0 0\nv 0 0.001 0\n"
     + repeated("vt 0.{:06} 0\n", 200000) + "".join(f"f 1/{i} 2/1 3/1\n" for i in range(1, 200001)))


def soup(count, corner):
    """Triangles that share no vertex, corner() each of theirs."""
    return ply(vertices=3 * count, faces=count, form="binary_little_endian", rows=b"".join(struct.pack("<3f", *corner(i)) for i in range(3 * count))
               + b"".join(struct.pack("<B3i", 3, 3 * i, 3 * i + 1, 3 * i + 2) for i in range(count)))


# Triangles and instances as large as the scene: each meets very many cells of the octree, which takes up to half a millisecond.
SOUP = scene(SENSOR + '<shape type="ply"><string name="filename" value="m.ply"/></shape>')
NUMBERS = random.Random(1)
cost("soup", SOUP, m_ply=soup(10000, lambda i: [NUMBERS.uniform(-1, 1) for _ in range(3)]))
cost("soup-in-a-plane", SOUP, m_ply=soup(4000, lambda i: ((-1, -1, 0), (1, -1, 0.1), (0, 1, -0.1))[i % 3]))
cost("soup-9", SOUP, 4, "the octree's cells", ["-D", "octree.levels=9"], m_ply=soup(20, lambda i: [NUMBERS.uniform(-1, 1) for _ in range(3)]))
cost("soup-in-a-plane-9", SOUP, 0, "", ["-D", "octree.levels=9"], m_ply=soup(20, lambda i: ((-1, -1, 0), (1, -1, 0.1), (0, 1, -0.1))[i % 3]))
for name, members, count in (("large", 1, 3000), ("of-many-shapes", 15, 150)):
    cost(f"instances-{name}", scene(SENSOR + '<shape type="shapegroup" id="g">' + '<shape type="rectangle"/>' * members + "</shape>"
         + '<shape type="instance"><ref id="g"/><transform name="to_world"><scale value="2"/></transform></shape>' * count))

ONE_PIXEL = png(1, 1, b"\0\1")
TEXTS = b"".join(chunk(b"zTXt", b"k%d\0\0" % i + zlib.compress(bytes(7900000), 9)) for i in range(60))
case("cost-png-texts", {"a.png": ONE_PIXEL[:33] + TEXTS + ONE_PIXEL[33:]}, ["info", "a.png"], 0, "")


def flat_hdr(side, value):
    """A square of one colour, in runs."""
    runs = bytes([255, value]) * (side // 127) + bytes([128 + side % 127, value])
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (side, side) + (b"\2\2" + struct.pack(">H", side) + runs * 4) * side


case("cost-merge", {"a.hdr": flat_hdr(2300, 100), "b.hdr": flat_hdr(2300, 90)}, ["merge", "a.hdr:1", "b.hdr:2", "-o", "o.exr"], 4, "o.exr: merging")


def many_scans(side, count):
    """A grey JPEG, progressive with arithmetic coding: of each coefficient bit by bit, all of them 0."""
    data = b"\xff\xd8\xff\xdb" + struct.pack(">H", 67) + b"\0" + bytes([16] * 64) + b"\xff\xca" + struct.pack(">HBHHB", 11, 8, side, side, 1) + b"\1\x11\0" + b"\xff\xda\0\x08\1\1\0\0\0\0"
    for k, low in [(k, low) for k in range(1, 64) for low in range(13, -1, -1)][:count]:
        data += b"\xff\xda\0\x08\1\1\0" + bytes([k, k, ((low + 1) << 4 if low < 13 else 0) | low]) + b"\xa5\xe3"
    return data + b"\xff\xd9"


pictured("16k.jpg", many_scans(16000, 0), "the budget is", 4)
case("cost-jpeg-scans", {"a.jpg": many_scans(5500, 490)}, ["info", "a.jpg"], 2, "more than 283 scans")
case("cost-jpeg-small-scans", {"a.jpg": many_scans(16, 490)}, ["info", "a.jpg"], 0, "")
EXR_START = b"\x76\x2f\x31\x01\2\0\0\0"


def exr_attribute(name, kind, value):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(value)) + value


for name, attributes in (("channels", exr_attribute("channels", "chlist", b"".join(b"%d\0" % i + struct.pack("<6i", 2, 0, 1, 1, 0, 0)[:16] for i in range(200000)) + b"\0")),
                         ("attributes", b"".join(exr_attribute(str(i), "string", b"x") for i in range(400000))),
                         ("texts", exr_attribute("s", "stringvector", bytes(4 * 4000000)))):
    case(f"cost-exr-{name}", {"a.exr": EXR_START + attributes + b"\0"}, ["info", "a.exr"], 4, "its header")


def exr_window(name, width, height):
    return exr_attribute(name, "box2i", struct.pack("<4i", 0, 0, width - 1, height - 1))


def exr_of(width, height, channels, start=EXR_START, more=b""):
    """A file of float channels with zip blocks, up to its first block."""
    names = b"".join(b"c%03d\0" % i + struct.pack("<iBBBBii", 2, 0, 0, 0, 0, 1, 1) for i in range(channels))
    return (start + exr_attribute("channels", "chlist", names + b"\0") + exr_attribute("compression", "compression", b"\3") + exr_window("dataWindow", width, height)
            + exr_window("displayWindow", width, height) + exr_attribute("lineOrder", "lineOrder", b"\0") + exr_attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
            + exr_attribute("screenWindowCenter", "v2f", bytes(8)) + exr_attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + more + b"\0" + bytes(16))


# A picture of one line, whose block may inflate to 16; one whose only tile may inflate to more than the picture.
pictured("one-line.exr", exr_of(50000, 1, 100), "picture of 50000 x 1 pixels", 4)
pictured("one-tile.exr", exr_of(64, 64, 4, EXR_START[:5] + b"\2\0\0", exr_attribute("tiles", "tiledesc", struct.pack("<2IB", 4096, 4096, 0))), "picture of 64 x 64 pixels", 4)


def cost_gltf(name, change, code=0, text="", arguments=(), **files):
    gltf("cost-" + name, change, text, code, **files)
    case_name, inputs, said, code, text = CASES.pop()
    case(case_name, inputs, [*said, *arguments], code, text)


ZEROS = {"componentType": 5126, "type": "VEC3", "count": 2000000}  # no bytes of the file
cost_gltf("vertices-used-often", lambda g: (g.add("accessors", ZEROS), put("meshes", 0, "primitives", value=[
    {"attributes": {"POSITION": 1}, "indices": g.accessor("SCALAR", [0, 1, 2], 5123)}] * 3000)(g), None)[-1], 2, "used too often")
cost_gltf("targets-used-often", lambda g: (g.add("accessors", ZEROS), g.json["meshes"][0].update(weights=[1] * 3000), put("meshes", 0, "primitives", value=[
    {"attributes": {"POSITION": 1}, "indices": g.accessor("SCALAR", [0, 1, 2], 5123), "targets": [{"POSITION": 1}] * 3000}])(g), None)[-1], 2, "used too often")
cost_gltf("lights", lambda g: (g.json.update(extensions={"KHR_lights_punctual": {"lights": [{"type": "point"}] * 20000}}),
                               [g.node(extensions={"KHR_lights_punctual": {"light": i}}) for i in range(20000)], None)[-1])
cost_gltf("extensions", lambda g: g.json.update(extensionsRequired=["KHR_materials_ior"] * 200000, extensionsUsed=[f"E{i}" for i in range(200000)]))
cost_gltf("skins", lambda g: (g.json.update(skins=[{"joints": list(range(5000)) * 4}]), g.json["meshes"][0]["primitives"][0]["attributes"].update(
    JOINTS_0=g.accessor("VEC4", [0] * 12, 5121), WEIGHTS_0=g.accessor("VEC4", [1] * 12)), [g.node(mesh=0, skin=0) for i in range(5000)], None)[-1])
cost_gltf("broken-materials", lambda g: (g.json.update(materials=[{"alphaMode": "x"}] * 20000), put("meshes", 0, "primitives", value=[
    {"attributes": {"POSITION": 0}, "material": i} for i in range(20000)])(g), None)[-1], 2, "things cannot be used", ["--check"])
LONG_URI = "data:image/png;base64," + base64.b64encode(ONE_PIXEL[:33] + chunk(b"junk", bytes(1000000)) + ONE_PIXEL[33:]).decode()
cost_gltf("picture-of-many-materials", lambda g: (textured({"uri": LONG_URI})(g), g.json.update(materials=[
    {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [i / 1000, 1, 1, 1]}} for i in range(200)]), put("meshes", 0, "primitives", value=[
        {**g.json["meshes"][0]["primitives"][0], "material": i} for i in range(200)])(g), None)[-1])
cost_gltf("glossy-picture-of-many-materials", lambda g: (textured({"uri": LONG_URI})(g), g.json.update(materials=[
    {"extensions": {GLOSS: {**TWO_TEXTURES, "diffuseFactor": [i / 1000, 1, 1, 1]}}} for i in range(200)]), put("meshes", 0, "primitives", value=[
        {**g.json["meshes"][0]["primitives"][0], "material": i} for i in range(200)])(g), None)[-1])
def posed(more, count):
    """The triangle with a skin, in `count` places; `more` changes the list of its primitives."""
    def change(g):
        g.json["meshes"][0]["primitives"][0]["attributes"].update(JOINTS_0=g.accessor("VEC4", [0] * 12, 5121), WEIGHTS_0=g.accessor("VEC4", [1] * 12))
        g.json.update(skins=[{"joints": [0]}])
        more(g.json["meshes"][0]["primitives"])
        for _ in range(count):
            g.node(mesh=0, skin=0)
    return change


cost_gltf("primitives-in-many-poses", posed(lambda primitives: primitives.extend([{"mode": 0}] * 3000), 3000), 2, "used too often")
cost_gltf("targets-in-many-poses", posed(lambda primitives: primitives[0].update(targets=[{}] * 100000), 200), 2, "used too often")
# A list of many objects: of each that ended, all others were looked at.
cost_gltf("many-objects", lambda g: g.json.update(extras=[{}] * 300000))
case("cost-json-objects", {"s.xml": ROOM, "c.json": "[" + '{"a":0},' * 300000 + "{}]"}, ["render", "s.xml", "--camera", "c.json", "-o", "a.exr", "-q"], 2, "c.json")
case("cost-model-objects", {"m.octrad": tensors("{" + ",".join('"%d":{}' % i for i in range(150000)) + "}")}, ["info", "m.octrad"], 2, "lacks dtype")

# Control characters: in names of files, and in what files say of themselves. All but the line end is shown as \\xNN.
CONTROL = "\x1b]0;t\x07\x1b[31m\x9b2J\x7f\r\n"
SHOWN = r"\x1b]0;t\x07\x1b[31m\xc2\x9b2J\x7f\x0d" + "\n"
NAME, SHOWN_NAME = CONTROL + "\udc9b", SHOWN + r"\x9b"  # the last byte is no UTF-8


def spoken_exr(seed, value):
    """A picture of 4 x 4 pixels with such characters in names and values of its metadata and in a channel's name."""
    render = json.dumps({"spp": 1, "seed": seed, "integrator": CONTROL, "view": CONTROL}, ensure_ascii=False)
    with tempfile.TemporaryDirectory() as folder:
        made = write_exr(os.path.join(folder, "a.exr"), 4, 4, {name: [value] * 16 for name in ("R", "G", "B", CONTROL + ".Y")},
                         {"owner": CONTROL, "n" + CONTROL: "#", "octrad.scene": CONTROL, "octrad.render": render})
        with open(made, "rb") as file:
            return file.read().replace(b"#", b"\x9b")


TALKING_PNG = ONE_PIXEL[:33] + b"".join(chunk(b"tEXt", key + b"\0" + CONTROL.encode("latin-1")) for key in (b"Comment", b"a\x1b\x9b")) + ONE_PIXEL[33:]
TALKING_MODEL = tensors({**model_header(config=json.dumps({"x": CONTROL}), scene=json.dumps({"file": CONTROL}), program=CONTROL, **{CONTROL: CONTROL}),
                         CONTROL: {"dtype": "U8", "shape": [1], "data_offsets": [0, 1]}}, b"a")
A_EXR, B_EXR, C_EXR = spoken_exr(1, 1.0), spoken_exr(2, 0.5), spoken_exr(1, 0.25)
for name, files, arguments, code, text in (
        ("exr", {"a.exr": A_EXR}, ["info", "a.exr"], 0, "owner: " + SHOWN), ("exr-channel", {"a.exr": A_EXR}, ["info", "a.exr"], 0, SHOWN + ".Y"), ("exr-json", {"a.exr": A_EXR}, ["info", "a.exr", "--json"], 0, r"\u001b]0;t"),
        ("exr-name", {NAME + ".exr": A_EXR}, ["info", NAME + ".exr"], 0, SHOWN_NAME + ".exr: 4 x 4"), ("exr-broken", {NAME + ".exr": b""}, ["info", NAME + ".exr"], 2, SHOWN_NAME + ".exr: not a picture"),
        ("exr-header", {"a.exr": EXR_START + exr_attribute("channels", CONTROL, b"x") + bytes(99)}, ["info", "a.exr"], 2, "a.exr: cannot read EXR file"),
        ("png", {"a.png": TALKING_PNG}, ["info", "a.png"], 0, "a.png: 1 x 1"), ("png-name", {NAME + ".png": TALKING_PNG[:-20]}, ["info", NAME + ".png"], 2, SHOWN_NAME + ".png: "),
        ("png-chunk", {"a.png": ONE_PIXEL[:33] + chunk(b"\x1b[\x9bm", b"") + ONE_PIXEL[33:]}, ["info", "a.png"], 2, "a.png: "),
        ("model", {"m.octrad": TALKING_MODEL}, ["info", "m.octrad"], 0, "program: " + SHOWN), ("model-tensor", {"m.octrad": TALKING_MODEL}, ["info", "m.octrad"], 0, SHOWN + "    u8 "),
        ("model-json", {NAME + ".octrad": TALKING_MODEL}, ["info", NAME + ".octrad", "--json"], 0, r"\u001b]0;t"), ("model-no-octrad", {NAME + ".octrad": tensors(model_header(format=CONTROL))}, ["info", NAME + ".octrad"], 2, SHOWN_NAME + ".octrad is a"),
        ("model-version", {"m.octrad": tensors(model_header(version=CONTROL)), "p.csv": POINTS}, ["query", "m.octrad", "--points", "p.csv"], 2, "m.octrad: format version " + SHOWN),
        ("model-dtype", {"m.octrad": tensors({CONTROL: {"dtype": CONTROL, "shape": [1], "data_offsets": [0, 1]}}, b"a")}, ["info", "m.octrad"], 2, "m.octrad"),
        ("scene-name", {NAME + ".xml": scene(SENSOR + CUBE)}, ["info", NAME + ".xml"], 0, SHOWN_NAME + ".xml (fingerprint"), ("scene-name-broken", {NAME + ".xml": "x"}, ["info", NAME + ".xml"], 2, SHOWN_NAME + ".xml:1:2: not well-formed"),
        ("compare", {"a.exr": A_EXR, NAME + ".exr": B_EXR}, ["compare", "a.exr", NAME + ".exr"], 0, "\n" + SHOWN_NAME + ".exr  0.4"), ("compare-json", {NAME + ".exr": A_EXR, "b.exr": B_EXR}, ["compare", "b.exr", NAME + ".exr", "--json"], 0, r"\u001b]0;t"),
        ("compare-layer", {NAME + ".exr": A_EXR, "b.exr": B_EXR}, ["compare", NAME + ".exr", "b.exr", "--by-roughness"], 2, SHOWN_NAME + ".exr"),
        ("compare-png", {NAME + ".png": TALKING_PNG, "b.exr": B_EXR}, ["compare", "b.exr", NAME + ".png"], 2, SHOWN_NAME + ".png"), ("compare-broken", {NAME + ".exr": A_EXR[:-9], "b.exr": B_EXR}, ["compare", "b.exr", NAME + ".exr"], 2, SHOWN_NAME + ".exr: "),
        ("merge", {"a.exr": A_EXR, NAME + ".exr": B_EXR}, ["merge", "a.exr", NAME + ".exr", "-o", NAME + "o.exr"], 0, SHOWN_NAME + "o.exr: 2 spp of 2 pictures"),
        ("merge-one-seed", {"a.exr": A_EXR, NAME + ".exr": C_EXR}, ["merge", "a.exr", NAME + ".exr", "-o", "o.exr"], 2, SHOWN_NAME + ".exr have the same seed"),
        ("merge-png", {"a.exr": A_EXR, NAME + ".png": TALKING_PNG}, ["merge", "a.exr", NAME + ".png:1", "-o", "o.exr"], 2, SHOWN_NAME + ".png"),
        ("merge-model", {"a.exr": A_EXR, NAME + ".octrad": TALKING_MODEL}, ["merge", "a.exr", NAME + ".octrad:1", "-o", "o.exr"], 2, SHOWN_NAME + ".octrad")):
    case(f"control-{name}", files, arguments, code, text)

# What is odd and right
odd("camera-inside-a-shape", scene(SENSOR + CUBE + '<shape type="sphere"><point name="center" value="0 0 4"/><float name="radius" value="0.5"/></shape>' + LIGHT))
odd("camera-on-a-surface", scene(SENSOR + '<shape type="rectangle"><transform name="to_world"><translate z="4"/></transform></shape>' + LIGHT))
odd("no-light", scene(SENSOR + CUBE))
odd("light-of-radiance-0", scene(SENSOR + '<shape type="cube"><emitter type="area"><rgb name="radiance" value="0"/></emitter></shape>'))
odd("degenerate-mesh", scene(SENSOR + '<shape type="obj"><string name="filename" value="m.obj"/></shape>' + LIGHT), m_obj="v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n")
odd("light-without-area", scene(SENSOR + CUBE + '<shape type="obj"><string name="filename" value="m.obj"/><emitter type="area"/></shape>'), m_obj="v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
odd("light-of-a-point", scene(SENSOR + '<shape type="ply"><string name="filename" value="m.ply"/><emitter type="area"/></shape>'), m_ply=ply(rows="1 1 1\n1 1 1\n1 1 1\n3 0 1 2\n"))
odd("faces-of-two-corners", scene(SENSOR + '<shape type="ply"><string name="filename" value="m.ply"/></shape>' + LIGHT),
    m_ply=ply(faces=4, rows="0 0 0\n1 0 0\n0 1 0\n2 0 1\n0\n3 0 1 2\n1 0\n"))
odd("faces-before-vertices", scene(SENSOR + '<shape type="ply"><string name="filename" value="m.ply"/></shape>' + LIGHT),
    m_ply="ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n")
odd("obj-of-windows", scene(SENSOR + '<shape type="obj"><string name="filename" value="m.obj"/></shape>' + LIGHT), m_obj="# \r\nv 0 0 0\r\nv 1 0 0 1\r\nv 0 1 0 0.5 0.5 0.5\r\nusemtl x\r\nf -3 \\\r\n -2 -1\r\n")
odd("utf8-mark", b"\xef\xbb\xbf" + scene(SENSOR + CUBE + LIGHT).encode())
odd("utf16", scene(SENSOR + CUBE + LIGHT).encode("utf-16"))
odd("comments", "<!-- a --><?xml version='1.0'?>".replace("<!-- a -->", "") + scene("<!-- b -->" + SENSOR + CUBE + "<!-- c -->" + LIGHT))
odd("empty-include", scene(SENSOR + CUBE + LIGHT + '<include filename="t.xml"/>'), t_xml=scene(""))
odd("unused-textures", scene(SENSOR + CUBE + LIGHT + '<texture type="checkerboard" id="a"/>'))
odd("tiny", scene(SENSOR + '<shape type="sphere"><float name="radius" value="1e-20"/></shape>' + LIGHT))
odd("large", scene(SENSOR + '<shape type="cube"><transform name="to_world"><scale value="9e8"/></transform></shape>' + LIGHT))
odd("far-out-and-flat", scene(SENSOR + '<shape type="rectangle"><transform name="to_world"><translate z="-9e8"/></transform></shape>' + LIGHT))
odd("huge-texture-coordinates", scene(SENSOR + '<shape type="rectangle"><bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="t.png"/><transform name="to_uv"><scale value="1e30"/></transform></texture></bsdf></shape>' + LIGHT), t_png=GOOD_PNG)
odd("black-sky", scene(SENSOR + CUBE + '<emitter type="envmap"><string name="filename" value="t.pfm"/></emitter>'), t_pfm=pfm(0.0))
odd("sky-of-a-pixel", scene(SENSOR + CUBE + '<emitter type="envmap"><string name="filename" value="t.pfm"/></emitter>'), t_pfm=pfm(1.0, side=1))
odd("roughness-0", scene(SENSOR + '<shape type="cube"><bsdf type="roughconductor"><float name="alpha" value="0"/></bsdf></shape>' + LIGHT))
odd("glass-of-nothing", scene(SENSOR + '<shape type="cube"><bsdf type="dielectric"><float name="int_ior" value="1"/><float name="ext_ior" value="1"/></bsdf></shape>' + LIGHT))
case("one-pixel", {"s.xml": scene(SENSOR + CUBE + LIGHT)}, ["render", "s.xml", "-o", "a.exr", "--spp", "1", "--width", "1", "--height", "1", "-q"], 0, "")
case("points-none", {"s.xml": ROOM}, ["query", "none.octrad", "--points", "p.csv"], 3, "No such file")
