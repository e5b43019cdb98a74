#!/usr/bin/env python3
"""Small valid files from which fuzzing starts. Usage: make_seeds.py PATH-TO-OCTRAD FOLDER

FOLDER/TARGET/... for every target of tests/fuzz/targets.cc, made here or by the program; words of each format as
FOLDER/TARGET.dict for libFuzzer.
"""
import os
import struct
import subprocess
import sys
import zlib

program, folder = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
here = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(here, "..", "cli"))
os.environ["OCTRAD"] = program
from broken_inputs import CASES, OBJ_BOX, TRIANGLE, chunk, pfm, ply, png, serialized  # noqa: E402
from gltf import triangle  # noqa: E402
from measured_file import measured_file  # noqa: E402
from support import ROOM  # noqa: E402
from test_gltf import scene as gltf_scene  # noqa: E402

FORMATS = {"obj": "obj", "ply": "ply", "serialized": "serialized", "png": "png", "jpg": "jpeg", "exr": "exr", "hdr": "hdr", "pfm": "pfm", "octrad": "model", "xml": "scene", "gltf": "gltf", "glb": "gltf", "pbrt": "pbrt"}


def put(target, name, data):
    os.makedirs(os.path.join(folder, target), exist_ok=True)
    with open(os.path.join(folder, target, name), "wb") as out:
        out.write(data if isinstance(data, bytes) else data.encode())


def run(*arguments):
    subprocess.run([program, *arguments, "-q"], cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


# The hand-made broken inputs, where they are small.
for name, files, arguments, _, _ in CASES:
    for file, data in files.items():
        target = FORMATS.get(file.rsplit(".", 1)[-1])
        if file.endswith(".json"):
            target = "config" if "--config" in arguments else "path" if "--path" in arguments else "camera"
        if target and len(data) < 5000:
            put(target, name, data)

put("scene", "room", ROOM)
MATERIALS = "".join(f'<shape type="{shape}"><bsdf type="{bsdf}"/></shape>' for shape, bsdf in (
    ("cube", "plastic"), ("sphere", "roughplastic"), ("rectangle", "conductor"), ("cube", "roughconductor"), ("sphere", "dielectric"), ("cube", "thindielectric")))
put("scene", "materials", '<scene version="3.0.0"><sensor type="perspective"/>' + MATERIALS + '<shape type="obj"><string name="filename" value="t.obj"/><bsdf type="mask">'
    '<texture name="opacity" type="bitmap"><string name="filename" value="t.png"/></texture><bsdf type="twosided"><bsdf type="bumpmap"><texture type="bitmap">'
    '<string name="filename" value="t.png"/></texture><bsdf type="diffuse"/></bsdf></bsdf></bsdf></shape><emitter type="envmap"><string name="filename" value="t.png"/></emitter></scene>')
put("obj", "all", "# o\n" + OBJ_BOX + "vt 0 0\nvt 1 0 0\nvn 0 0 1\ng a\nf 1/1/1 2/2/1 3//1\nf -1 -2 \\\n -3\n")
put("ply", "ascii", ply())
put("ply", "binary", ply(form="binary_little_endian", rows=TRIANGLE + b"\3" + struct.pack("<3i", 0, 1, 2)))
put("ply", "big", ply(form="binary_big_endian", properties=("x", "y", "z"), rows=struct.pack(">9f", 0, 0, 0, 1, 0, 0, 0, 1, 0) + b"\3" + struct.pack(">3i", 0, 1, 2)))
put("ply", "strips", ply(rows="0 0 0\n1 0 0\n0 1 0\n5 0 1 -1 2 0\n").replace(b"element face", b"element tristrips").replace(b"list uchar", b"list int"))
put("ply", "normals", ply(properties=("x", "y", "z", "nx", "ny", "nz", "u", "v"), rows="0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 1\n3 0 1 2\n"))
put("ply", "attributes", ply(properties=("x", "y", "z", "r", "g", "b", "w_0"), rows="0 0 0 1 1 1 1\n1 0 0 0 0 0 0\n0 1 0 1 0 1 0\n3 0 1 2\n"))
put("bmp", "24", b"BM" + struct.pack("<IIIIiiHHIIIIII", 0, 0, 54, 40, 2, 2, 1, 24, 0, 0, 0, 0, 0, 0) + bytes(16))
put("bmp", "8", b"BM" + struct.pack("<IIIIiiHHIIIIII", 0, 0, 62, 40, 2, -1, 1, 8, 0, 0, 0, 0, 0, 0) + bytes(12))
put("tga", "24", struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, 2, 2, 24, 0) + bytes(12))
put("tga", "runs", struct.pack("<BBBHHBHHHHBB", 0, 0, 11, 0, 0, 0, 0, 0, 3, 1, 8, 0) + b"\x82\xff")
# libwebp's encoder made these, of 4 x 4 pixels.
for name, digits in (
        ("lossy", "524946464c000000574542505650382040000000d001009d012a0400040002804225b00274010ef6a8180000fd9d4ece3b97f3c6ff3aa4d0be787c1c6382359e3b1e4e401959eec3bcdafaa66be94271a3dd0000"),
        ("alpha", "524946466c00000057454250565038580a00000010000000030000030000414c504811000000000f1f2f3f4f5f6f7f8f9fafbfcfdfefff005650382034000000d001009d012a0400040002804225880274010ef8a7a80000fbf9a02848e0cdff31998cceb5692ba25e5c6798898e8dafde000000"),
        ("lossless", "5249464662000000574542505650384c560000002f03c000107fa0a66d03e6ae3401943fd28250c8360224b07b00ce9fec4014b28d00c704760fc0311c41b68dda4cae50b4239601ff08da4640d036826d27d8f67b042012808836f9e48b0d2ed8e2824f11fd8f1e9433")):
    put("webp", name, bytes.fromhex(digits))
put("tga", "palette", struct.pack("<BBBHHBHHHHBB", 0, 1, 9, 0, 2, 24, 0, 0, 2, 1, 8, 32) + bytes(6) + b"\x81\0")
put("old_scene", "all", '<scene version="0.6.0"><sensor type="perspective"><transform name="toWorld"><lookAt origin="0 0 1" target="0 0 0" up="0 1 0"/></transform></sensor><shape type="sphere">'
    '<bsdf type="mixturebsdf"><string name="weights" value="0.2, 0.3"/><bsdf type="phong"/><bsdf type="coating"><bsdf type="diffuse"/></bsdf></bsdf><emitter type="area"><blackbody name="radiance" temperature="3000K"/>'
    '</emitter></shape><bsdf type="difftrans"/><bsdf type="ward"/><bsdf type="bumpmap"><texture type="scale"><texture type="bitmap"/></texture></bsdf><bsdf type="diffuse"><spectrum name="reflectance" value="400:1,700:2"/></bsdf>'
    '<bsdf type="diffuse"><texture name="reflectance" type="bitmap"><float name="uscale" value="2"/><string name="filterType" value="ewa"/></texture></bsdf></scene>')
put("gltf", "triangle", triangle().text())
put("gltf", "container", triangle().container())
put("gltf", "scene", gltf_scene().container())
ALL = gltf_scene()
ALL.json["materials"] += [{"alphaMode": "MASK", "normalTexture": {"index": 0, "scale": 0.5}, "pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0, "extensions": {
    "KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1, "scale": [2, 2]}}}, "baseColorTexture": {"index": 0}}}, {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1},
    "KHR_materials_volume": {"thicknessFactor": 1}, "KHR_materials_ior": {"ior": 1.3}, "KHR_materials_clearcoat": {"clearcoatFactor": 1}, "KHR_materials_sheen": {"sheenColorFactor": [1, 0, 0]},
    "KHR_materials_specular": {"specularFactor": 0.5}}}]
for number, material in enumerate((3, 4)):
    ALL.json["meshes"][number]["primitives"][0]["material"] = material
ALL.json["meshes"][2]["primitives"][0].update(mode=5, attributes={**ALL.json["meshes"][2]["primitives"][0]["attributes"], "COLOR_0": ALL.accessor("VEC4", [255] * 16, 5121, normalized=True)})
ALL.json["accessors"][0]["sparse"] = {"count": 1, "indices": {"bufferView": ALL.view(b"\1"), "componentType": 5121}, "values": {"bufferView": ALL.view(bytes(12))}}
ALL.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}, {"type": "spot", "spot": {"outerConeAngle": 0.5}}, {"type": "directional", "color": [1, 0, 1]}]}}
for light in range(3):
    ALL.node(extensions={"KHR_lights_punctual": {"light": light}})
ALL.json["cameras"].append({"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 1, "zfar": 10, "znear": 1}})
ALL.node(camera=1)
OLD = gltf_scene()  # extensions that stand for the whole material; here one each
OLD.json["materials"][0]["extensions"] = {"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 0}, "specularFactor": [1, 0.5, 0.5], "glossinessFactor": 0.5}}
OLD.json["materials"][1].update(alphaMode="MASK", extensions={"KHR_materials_unlit": {}})
OLD.json["materials"][2]["doubleSided"] = True
OLD.json["materials"].append({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.5, "attenuationColor": [1, 0.5, 0]}}})
OLD.json["meshes"][1]["primitives"].append({**OLD.json["meshes"][1]["primitives"][0], "material": 3})
OLD.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = OLD.accessor("VEC3", [1, 0, 1] * 4)
put("gltf", "old", OLD.text())
put("gltf", "all", ALL.text())
put("gltf", "all-container", ALL.container())


def meshopt_vertices(data, stride):
    """Codec of attributes of EXT_meshopt_compression, for at most 16 vertices: differences of bytes as they are."""
    rows = [data[at:at + stride] for at in range(0, len(data), stride)]
    out = b"\xa0"
    for column in range(stride):
        steps = [(b[column] - a[column]) & 0xff for a, b in zip([rows[0]] + rows, rows)]
        out += b"\3" + bytes((2 * step ^ (0xff if step & 0x80 else 0)) & 0xff for step in steps) + bytes(16 - len(steps))
    return out + bytes(max(32 - stride, 0)) + rows[0]


PACKED = triangle()
PACKED_AT = PACKED.view(meshopt_vertices(PACKED.binary[:36], 12))
PACKED.json["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {**PACKED.json["bufferViews"][PACKED_AT], "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"}}
put("gltf", "packed", PACKED.text())
put("obj", "faces-first", "f 1/1/1 2/2/1 3/3/1\n" + OBJ_BOX + "vt 0 0\nf -1//-1 1 2\nvt 1 0\nvt 1 1\nvn 0 0 1\n")
put("curves", "two", "0 0 0 .1\n1 0 0 .2\n1 1 0 .1 7\n\t2 1 0 0\r\n3 1 1 +.5\n \n0 0 0 .1\n0 0 1 .1\n0 0 2 .1\n0 0 2 .1\n")
put("curves", "back", "0 0 0 .1\n0 0 1 .1\n0 0 0 .1\n0 0 .5 1e3\n0 0 1e9 0")
for part in (0, 4):
    put("measured", "part%d" % part, measured_file(part))
put("pbrt", "new", """LookAt 0 1 5 0 0 0 0 1 0
Camera "perspective" "float fov" 40 "float screenwindow" [ -1 1 -.5 .5 ] Film "rgb" "integer xresolution" 8 "integer yresolution" 4 "float cropwindow" [ 0 .5 0 1 ] "float iso" 200
PixelFilter "triangle" "float xradius" 1 Sampler "halton" Integrator "path" "integer maxdepth" 3 Option "seed" 4 ColorSpace "srgb"
WorldBegin # a comment
Attribute "shape" "float radius" .5
LightSource "infinite" "string filename" "t.png" "float scale" 2 LightSource "spot" "point3 from" [ 0 4 0 ] "blackbody I" 3000 "float power" 9
Texture "a" "spectrum" "imagemap" "string filename" "t.png" "float uscale" 2 "bool invert" true "string encoding" "gamma 2.2" Texture "b" "float" "imagemap" "string filename" "t.png" "float uscale" 2
Texture "c" "spectrum" "checkerboard" "rgb tex1" [ .1 .2 .3 ] "rgb tex2" [ 1 1 1 ] Texture "d" "spectrum" "mix" "texture tex1" "a" "rgb tex2" [ 0 0 1 ] "texture amount" "b"
Texture "e" "spectrum" "scale" "texture tex" "a" "texture scale" "b"
MakeNamedMaterial "m" "string type" "coateddiffuse" "texture reflectance" "d" "texture roughness" "b" MakeNamedMaterial "n" "string type" "diffuse" "texture reflectance" "c" "texture displacement" "b"
MakeNamedMaterial "o" "string type" "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" [ 400 1 700 3 ] "float uroughness" .1 "float vroughness" .2 "string normalmap" "t.png"
MakeNamedMaterial "p" "string type" "mix" "string materials" [ "n" "o" ] "float amount" .3
AttributeBegin NamedMaterial "m" AreaLightSource "diffuse" "rgb L" [ 3 2 1 ] "bool twosided" true Translate 0 2 0 Rotate 90 1 0 0 Shape "disk" "float innerradius" .1 AttributeEnd
NamedMaterial "p" Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 1 1 0 0 1 0 ] "integer indices" [ 0 1 2 0 2 3 ] "point2 uv" [ 0 0 1 0 1 1 0 1 ] "texture alpha" "b"
Material "dielectric" "spectrum eta" "glass-BK7" "float roughness" .1 Shape "sphere" Scale 1 2 1 Shape "sphere" ReverseOrientation Shape "cylinder" "float phimax" 90
ObjectBegin "g" Shape "bilinearmesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 1 1 0 ] Shape "loopsubdiv" "integer levels" 1 "point3 P" [ 0 0 0 1 0 0 0 1 0 0 0 1 ] "integer indices" [ 0 2 1 0 1 3 1 2 3 2 0 3 ] ObjectEnd
ObjectInstance "g" ConcatTransform [ 0 1 0 0 1 0 0 0 0 0 1 0 2 0 0 1 ] ObjectInstance "g" Import "t.pbrt" Shape "plymesh" "string filename" "t.ply"
Material "hair" "rgb reflectance" [ .5 .4 .3 ] Shape "curve" "string type" "cylinder" "point3 P" [ 0 0 0 1 0 0 1 1 0 2 1 1 ] "float width0" .2 "float width1" .1
""")
put("pbrt", "old", """Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 0 0 5 1 ] Camera "orthographic" "float screenwindow" [ -2 2 -2 2 ] Film "image" "float scale" 2 PixelFilter "gaussian" "float alpha" 2
SurfaceIntegrator "directlighting" WorldBegin
TransformBegin CoordinateSystem "c" LightSource "point" "color I" [ 1 2 3 ] "point from" [ 0 2 0 ] TransformEnd LightSource "distant" "rgb scale" [ 1 1 1 ] "spectrum L" "t.spd"
Texture "t" "color" "constant" "color value" [ .5 .5 .5 ] Material "matte" "texture Kd" "t" "float sigma" 20 Shape "cone" Shape "paraboloid" Shape "hyperboloid" "point p1" [ 1 0 0 ] "point p2" [ 0 1 1 ]
MakeNamedMaterial "a" "string type" "plastic" "rgb Ks" [ 0 0 0 ] MakeNamedMaterial "b" "string type" "uber" "rgb opacity" [ .5 .5 .5 ] "xyz Kd" [ .2 .2 .2 ]
Material "mix" "string namedmaterial1" "a" "string namedmaterial2" "b" "rgb amount" [ .2 .2 .2 ] Shape "sphere" "float zmin" -.5 "float phimax" 180 ActiveTransform EndTime Translate 1 0 0 ActiveTransform All
Material "glass" "float index" 1.4 "float uroughness" .1 Shape "sphere" Material "metal" Shape "disk" Material "mirror" Shape "disk" Material "disney" "float metallic" .5 Shape "disk" Material "translucent" Shape "disk" Material "substrate" "float uroughness" .2 Shape "disk"
AttributeBegin CoordSysTransform "c" AreaLightSource "area" "blackbody L" [ 4000 2 ] Shape "sphere" AttributeEnd Include "t.pbrt"
WorldEnd
""")
put("serialized", "old", serialized(version=3))
put("serialized", "two", serialized(count=2))
put("serialized", "all", serialized(flags=0x100b, positions=TRIANGLE + struct.pack("<24f", *[0, 0, 1] * 3, 0, 0, 1, 0, 1, 1, *[0.5] * 9)))
put("serialized", "double", serialized(flags=0x2003, positions=struct.pack("<24d", 0, 0, 0, 1, 0, 0, 0, 1, 0, *[0, 0, 1] * 3, 0, 0, 1, 0, 1, 1)))
put("scene", "world", '<scene version="3.0.0"><sensor type="thinlens"><float name="aperture_radius" value="0.1"/><float name="focus_distance" value="3"/><film type="hdrfilm"><integer name="crop_width" value="5"/>'
    '<rfilter type="lanczos"/></film></sensor><sensor type="orthographic"/><shape type="disk"/><shape type="cylinder"/><shape type="shapegroup" id="g"><shape type="cube"/><shape type="sphere"/></shape>'
    '<shape type="instance"><ref id="g"/><transform name="to_world"><scale value="2"/></transform></shape><emitter type="point"/><emitter type="spot"><float name="cutoff_angle" value="30"/></emitter>'
    '<emitter type="directional"/><emitter type="projector"><texture name="irradiance" type="bitmap"><string name="filename" value="t.png"/></texture></emitter></scene>')
# Every type of each kind of object, with what it takes.
TEXTURE = '<texture name="{}" type="bitmap"><string name="filename" value="t.png"/><string name="filter_type" value="nearest"/><string name="wrap_mode" value="{}"/><boolean name="raw" value="true"/>' \
          '<transform name="to_uv"><scale x="2" y="2"/><translate x="0.5"/></transform></texture>'
BSDFS = {
    "diffuse": TEXTURE.format("reflectance", "mirror"), "roughdiffuse": '<float name="alpha" value="0.3"/><boolean name="use_fast_approx" value="true"/>',
    "plastic": '<rgb name="diffuse_reflectance" value="#ff8000"/><boolean name="nonlinear" value="true"/><float name="int_ior" value="1.9"/>',
    "roughplastic": '<string name="distribution" value="ggx"/><float name="alpha" value="0.2"/>', "conductor": '<string name="material" value="Au"/>',
    "roughconductor": '<spectrum name="eta" value="400:1.5, 700:2"/><rgb name="k" value="3 2 1"/><float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.3"/>',
    "dielectric": '<string name="int_ior" value="water"/>', "thindielectric": '<float name="specular_reflectance" value="0.5"/>', "roughdielectric": TEXTURE.format("alpha", "clamp"), "null": "",
    "blendbsdf": '<float name="weight" value="0.3"/><bsdf type="diffuse"/><bsdf type="conductor"/>',
    "principled": '<rgb name="base_color" value="1 0.5 0"/>' + "".join(f'<float name="{name}" value="0.5"/>' for name in (
        "roughness", "anisotropic", "metallic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness", "clearcoat", "clearcoat_gloss", "specular", "main_specular_sampling_rate")),
    "hair": '<rgb name="sigma_a" value="0.1 0.2 0.4"/><float name="scale" value="2"/><float name="scale_tilt" value="3"/><float name="longitudinal_roughness" value="0.2"/>',
    "measured": '<string name="filename" value="t.bsdf"/>',
    "principledthin": '<float name="diff_trans" value="1"/><float name="eta" value="1.4"/><float name="spec_trans" value="0.5"/>',
    "normalmap": TEXTURE.format("normalmap", "repeat") + '<bsdf type="roughplastic"/>', "bumpmap": TEXTURE.format("a", "repeat") + '<float name="scale" value="2"/><bsdf type="diffuse"/>',
    "mask": '<float name="opacity" value="0.3"/><bsdf type="diffuse"/>', "twosided": '<bsdf type="diffuse"/><bsdf type="plastic"/>'}
EYE = '<transform name="to_world"><lookat origin="0 0 4" target="0 0 0" up="0 1 0"/></transform>'
for number, (kind, inside) in enumerate(BSDFS.items()):
    put("scene", "bsdf-" + kind, f'<scene version="{("2.1.0", "3.5.0")[number % 2]}"><sensor type="perspective">{EYE}</sensor><shape type="cube"><bsdf type="{kind}">{inside}</bsdf></shape></scene>')
FILTERS = {"box": "", "tent": '<float name="radius" value="1.5"/>', "gaussian": '<float name="stddev" value="0.4"/>', "mitchell": '<float name="B" value="0.3"/>', "catmullrom": "", "lanczos": '<integer name="lobes" value="2"/>'}
SENSORS = {"perspective": '<string name="focal_length" value="50mm"/><float name="principal_point_offset_y" value="0.1"/>',
           "thinlens": '<float name="aperture_radius" value="0.1"/><float name="fov" value="30"/><string name="fov_axis" value="larger"/>', "orthographic": '<float name="near_clip" value="0.1"/>'}
for number, (kind, inside) in enumerate(FILTERS.items()):
    put("scene", "filter-" + kind, f'<scene version="3.0.0"><sensor type="{list(SENSORS)[number % 3]}">{EYE}{list(SENSORS.values())[number % 3]}<sampler type="independent"/>'
        f'<film type="hdrfilm"><integer name="width" value="8"/><integer name="crop_offset_x" value="2"/><integer name="crop_width" value="4"/><rfilter type="{kind}">{inside}</rfilter></film></sensor>'
        '<integrator type="aov"><string name="aovs" value="d:depth"/><integrator type="path"><integer name="max_depth" value="5"/></integrator></integrator><shape type="sphere"/></scene>')
put("scene", "spectra", f'<scene version="3.0.0"><default name="x" value="0.5"/><sensor type="perspective">{EYE}</sensor>' + "".join(
    f'<shape type="{shape}"><emitter type="area"><spectrum name="radiance" type="{kind}">{inside}</spectrum></emitter></shape>' for shape, kind, inside in (
        ("cube", "uniform", '<float name="value" value="$x"/>'), ("sphere", "d65", '<float name="scale" value="2"/>'), ("disk", "srgb", '<rgb name="color" value="1 0 0"/>'),
        ("cylinder", "rawconstant", '<vector name="value" value="1 2 3"/>'), ("rectangle", "regular", '<string name="range" value="400, 700"/><string name="values" value="1 2 3"/>'),
        ("cube", "irregular", '<string name="wavelengths" value="400 500"/><string name="values" value="1 2"/>'), ("cube", "blackbody", '<float name="temperature" value="3000"/>')))
    + '<shape type="merge"><shape type="cube"><bsdf type="diffuse"><spectrum name="reflectance" filename="t.spd"/></bsdf></shape></shape></scene>')
put("scene", "attributes", f'<scene version="3.0.0"><sensor type="perspective">{EYE}</sensor><shape type="ply"><string name="filename" value="t.ply"/><boolean name="face_normals" value="true"/><bsdf type="diffuse">'
    '<texture name="reflectance" type="mesh_attribute"><string name="name" value="vertex_color"/><float name="scale" value="0.5"/></texture></bsdf></shape><shape type="ply"><string name="filename" value="t.ply"/>'
    '<bsdf type="principled"><texture name="roughness" type="mesh_attribute"><string name="name" value="face_color"/></texture></bsdf></shape></scene>')
put("scene", "parts", f'<scene version="3.0.0"><include filename="t.xml"/><path value="."/><bsdf type="diffuse" id="a"/><alias id="a" as="b"/><texture type="checkerboard" id="t"><rgb name="color0" value="1 0 0"/></texture>'
    f'<sensor type="perspective">{EYE}<float name="principal_point_offset_x" value="0.1"/></sensor><shape type="cube"><ref id="b"/></shape><shape type="obj"><string name="filename" value="t.obj"/><bsdf type="diffuse">'
    '<ref id="t" name="reflectance"/></bsdf><transform name="to_world"><matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/><rotate x="1" angle="30"/><scale x="2"/></transform></shape></scene>')
OLD_BSDFS = ("phong", "ward", "coating", "roughcoating", "difftrans", "mixturebsdf", "bumpmap", "mask", "blendbsdf", "conductor", "roughconductor")
for version, bsdfs in (("0.5.0", OLD_BSDFS[:5]), ("0.6.0", OLD_BSDFS[5:])):
    put("old_scene", version, f'<scene version="{version}"><sensor type="thinlens"><film type="ldrfilm"><float name="gamma" value="2.2"/></film></sensor><emitter type="sunsky"/><emitter type="envmap"><float name="gamma" value="1"/></emitter>'
        + "".join(f'<shape type="cube"><bsdf type="{kind}"><srgb name="diffuseReflectance" value="#808080"/><float name="exponent" value="20"/><texture type="scale"><float name="scale" value="0.5"/><texture type="bitmap">'
                  '<string name="filename" value="t.png"/><string name="wrapModeU" value="zero"/><string name="filterType" value="ewa"/></texture></texture><bsdf type="diffuse"/><string name="weights" value="1"/>'
                  '<string name="distribution" value="phong"/><float name="extEta" value="1.3"/></bsdf></shape>' for kind in bsdfs) + "</scene>")
put("spectrum", "pairs", "# nm value\n400 0.5\n500.5\t1e-3\r\n700 2\n")
for name in ("main", "flicker"):
    with open(os.path.join(here, "..", "..", "configs", "paper", name + ".json"), "rb") as matrix:
        put("matrix", name, matrix.read())
put("matrix", "all", '{"title": "a", "about": "b", "scenes": ["c"], "views": {"c": [0, {"name": "v", "origin": [0, 0, 1], "target": [0, 0, 0]}], "*": [1]}, "methods": ["nr", "path"], "switches": [{"name": "s", "keys": '
    '{"octree.levels": 3}}], "seeds": [1, 2], "equal": ["seconds", "bytes"], "preset": "cpu", "keys": {"adam.rate": 0.01}, "time": "5min", "steps": 9, "spp": {"nr": 2}, "width": 64, "reference_spp": 4, "learned": true, '
    '"path_spp": [1, 4], "temporal_frames": 4, "temporal_spp": 2, "paths": {"c": {"keys": []}}}')
put("message", "all", '{"type": "set", "camera": {"origin": [0,1,4], "target": [0,1,0], "fov": 40}, "input": 7, "width": 64, "height": 32, "a": {"integrator": "lhs", "model": 1}, "b": {"integrator": "stored"}, "errors": true, '
    '"most_error": 0.5, "full": true, "layer": "normal", "exposure": -1.5, "curve": "filmic", "white": [1, 0.9, 1.1]}')
put("message", "no-b", '{"type": "set", "b": null, "layer": ""}')
put("png", "grey", png(2, 2, b"\0\x40\x80\0\x80\x40"))
put("png", "all-chunks", b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 3, 3, 4, 3, 0, 0, 1)) + chunk(b"PLTE", bytes(range(12))) + chunk(b"tRNS", b"\0\x80") + chunk(b"sRGB", b"\0")
    + chunk(b"cHRM", bytes(32)) + chunk(b"iCCP", b"p\0\0" + zlib.compress(bytes(140))) + chunk(b"sBIT", b"\4\4\4") + chunk(b"bKGD", b"\1") + chunk(b"hIST", bytes(8)) + chunk(b"pHYs", bytes(9)) + chunk(b"tIME", bytes(7))
    + chunk(b"tEXt", b"a\0b") + chunk(b"zTXt", b"a\0\0" + zlib.compress(b"b")) + chunk(b"iTXt", b"a\0\0\0\0\0b") + chunk(b"eXIf", b"II*\0" + bytes(8)) + chunk(b"IDAT", zlib.compress(b"\0\x10" * 5 + b"\0\x12\x10")[:9])
    + chunk(b"IDAT", zlib.compress(b"\0\x10" * 5 + b"\0\x12\x10")[9:]) + chunk(b"IEND", b""))
for color, depth in ((0, 2), (0, 16), (4, 16), (6, 16), (3, 2), (2, 8)):
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[color]
    palette = chunk(b"PLTE", bytes(range(12))) if color == 3 else chunk(b"tRNS", bytes(2 * channels)) if color < 4 else b""
    for filtered in range(5):
        put("png", f"filter{filtered}-{depth}-{color}", b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 3, 2, depth, color, 0, 0, 0)) + palette
            + chunk(b"IDAT", zlib.compress((bytes([filtered]) + bytes(range(1, (3 * depth * channels + 7) // 8 + 1))) * 2)) + chunk(b"IEND", b""))
put("png", "rgba", png(1, 2, b"\0\1\2\3\4\1\5\6\7\x08", 6))
for depth, color, interlace, rows in ((1, 3, 0, b"\0\x40\0\x80"), (16, 2, 0, b"\0" + bytes(12) + b"\2" + bytes(12)), (8, 0, 1, b"\0\1\0\2\0\3\4"), (8, 4, 0, b"\0\1\2\3\4\4\1\2\3\4")):
    palette = chunk(b"PLTE", b"\1\2\3\4\5\6") + chunk(b"tRNS", b"\7") if color == 3 else b""
    put("png", f"{depth}-{color}-{interlace}", b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 2, depth, color, 0, 0, interlace)) + palette
        + chunk(b"gAMA", b"\0\1\x86\xa0") + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
put("hdr", "flat", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 3\n\x80\x40\x20\x81\1\1\1\1\0\0\0\0")
put("hdr", "runs", b"#?RGBE\n\n-Y 1 +X 8\n\2\2\0\x08\x88\x80\4\x10\x20\x30\x40\x84\x50\x88\0\x88\x82")
put("pfm", "colour", pfm(1.0, 2.0))
put("pfm", "grey", b"Pf\n1 1\n1.0\n" + struct.pack(">f", 1.0))
put("points", "points", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha,t0,s0,n0,t1,s1,n1\n0,0,0,0,0,1,0,0,1,0.5,0.5,0.5,1,1,0,0.5,2,0,0.5\n")
put("config", "some", '{"preset": "cpu", "octree": {"levels": 3}, "octree.features": 4, "train.time": "30s", "seed": 1, "field": "nr"} // comment\n')
put("camera", "two", '[{"origin": [0,1,4], "target": [0,1,0], "up": [0,1,0], "fov": 40, "fov_axis": "x", "near_clip": 0.1, "far_clip": 9, "width": 3, "height": 2, "name": "a"},'
    ' {"to_world": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}]')
put("path", "timed", '{"keys": [{"origin": [0,0,4], "target": [0,0,0], "time": 0}, {"origin": [1,0,4], "target": [0,0,0], "time": 1.5}], "fps": 12}')
put("path", "frames", '{"keys": [{"origin": [0,0,4], "target": [0,0,0]}, {"origin": [1,0,4], "target": [0,0,0]}, {"origin": [1,1,4], "target": [0,0,0]}], "frames": 5}')


def jpeg(side, sampling, scans, frame=0xc0, restart=0, adobe=None, components=None):
    """Tables of one code each (0: a difference of 0; the end of a block), so that bits 0 are blocks of grey."""
    components = components or len(sampling)
    data = b"\xff\xd8" + (b"\xff\xee\0\x0eAdobe\0\x64\0\0\0\0" + bytes([adobe]) if adobe is not None else b"")
    data += b"\xff\xdb" + struct.pack(">H", 67) + b"\0" + bytes([16] * 64) + bytes([255, frame]) + struct.pack(">HBHHB", 8 + 3 * components, 8, side, side, components)
    data += b"".join(bytes([c + 1, s, 0]) for c, s in enumerate(sampling))
    if frame < 0xc9:
        for table in (0, 0x10):
            data += b"\xff\xc4" + struct.pack(">H", 20) + bytes([table, 1]) + bytes(15) + b"\0"
    data += b"\xff\xdd\0\4" + struct.pack(">H", restart) if restart else b""
    for of, first, last, bits, coded in scans:
        data += b"\xff\xda" + struct.pack(">HB", 6 + 2 * len(of), len(of)) + b"".join(bytes([c + 1, 0]) for c in of) + bytes([first, last, bits]) + coded
    return data + b"\xff\xd9"


GREY = ((0,), 0, 63, 0, b"\x3f")
put("jpeg", "grey", jpeg(8, [0x11], [GREY]))
put("jpeg", "restart", jpeg(16, [0x11], [((0,), 0, 63, 0, b"\x3f\xff\xd0\x3f\xff\xd1\x3f\xff\xd2\x3f")], restart=1))
for name, sampling in (("420", [0x22, 0x11, 0x11]), ("422", [0x21, 0x11, 0x11]), ("440", [0x12, 0x11, 0x11]), ("411", [0x41, 0x11, 0x11])):
    put("jpeg", name, jpeg(16, sampling, [((0, 1, 2), 0, 63, 0, bytes(5))]))
put("jpeg", "rgb", jpeg(8, [0x11] * 3, [((0, 1, 2), 0, 63, 0, b"\3")], adobe=0))
for adobe in (None, 0, 2):
    put("jpeg", f"inks-{adobe}", jpeg(8, [0x11] * 4, [((0, 1, 2, 3), 0, 63, 0, b"\0")], adobe=adobe))
put("jpeg", "scans", jpeg(8, [0x11] * 3, [((c,), 0, 63, 0, b"\x3f") for c in range(3)]))
for frame, dc, ac in ((0xc2, b"\x7f", b"\x7f"), (0xca, b"", b"\xa5\xe3")):
    put("jpeg", f"progressive-{frame:x}", jpeg(8, [0x11], [((0,), 0, 0, 1, dc), ((0,), 1, 5, 2, ac), ((0,), 6, 63, 2, ac), ((0,), 1, 63, 0x21, ac), ((0,), 0, 0, 0x10, dc), ((0,), 1, 63, 0x10, ac)], frame))
put("jpeg", "arithmetic", jpeg(8, [0x11], [((0,), 0, 63, 0, b"")], 0xc9))


def exr_attribute(name, kind, value):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(value)) + value


def exr_header(width, height, channels, compression=0, more=b"", sampling=1, order=0):
    """channels: name -> 0 (whole numbers), 1 (half), 2 (float)"""
    listed = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", kind, 0, sampling, sampling) for name, kind in sorted(channels.items())) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    return (exr_attribute("channels", "chlist", listed) + exr_attribute("compression", "compression", bytes([compression])) + exr_attribute("dataWindow", "box2i", window)
            + exr_attribute("displayWindow", "box2i", window) + exr_attribute("lineOrder", "lineOrder", bytes([order])) + exr_attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
            + exr_attribute("screenWindowCenter", "v2f", bytes(8)) + exr_attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + more + b"\0")


def exr(headers, chunks, flags=0):
    """chunks: for each header those of its part, in order."""
    data = b"\x76\x2f\x31\1" + struct.pack("<I", 2 | flags) + b"".join(headers) + (b"\0" if flags & 0x1000 else b"")
    offset = len(data) + 8 * sum(len(part) for part in chunks)
    for part in chunks:
        for block in part:
            data += struct.pack("<Q", offset)
            offset += len(block)
    return data + b"".join(block for part in chunks for block in part)


def lines(*blocks, part=b""):
    return [part + struct.pack("<ii", y, len(block)) + block for y, block in enumerate(blocks)]


ROW = struct.pack("<2f", 1, 2)
put("exr", "float", exr([exr_header(2, 2, {"Y": 2})], [lines(ROW, ROW)]))
put("exr", "half", exr([exr_header(2, 1, {"R": 1, "G": 1, "B": 1})], [lines(bytes(12))]))
put("exr", "whole", exr([exr_header(2, 1, {"Y": 0})], [lines(bytes(8))]))
put("exr", "downwards", exr([exr_header(2, 2, {"Y": 2}, order=1)], [lines(ROW, ROW)]))
put("exr", "chroma", exr([exr_header(2, 2, {"Y": 1, "RY": 1, "BY": 1}, sampling=2)], [lines(bytes(6), b"")]))
put("exr", "layers", exr([exr_header(1, 1, {"ViewLayer.Combined.R": 2, "ViewLayer.Combined.G": 2, "ViewLayer.Combined.B": 2, "Z": 1, "id": 0})], [lines(bytes(18))]))
KINDS = b"".join(exr_attribute(kind, kind, bytes(size)) for kind, size in (("box2f", 16), ("chromaticities", 32), ("double", 8), ("envmap", 1), ("int", 4), ("m33f", 36), ("m44f", 64), ("rational", 8), ("timecode", 8),
                                                                         ("v2i", 8), ("v3f", 12), ("m33d", 72), ("m44d", 128), ("v2d", 16), ("v3d", 24), ("v3i", 12), ("deepImageState", 1)))
KINDS += exr_attribute("keycode", "keycode", struct.pack("<7i", 1, 1, 1, 0, 0, 4, 64)) + exr_attribute("words", "stringvector", struct.pack("<I", 1) + b"a" + struct.pack("<I", 0)) + exr_attribute("preview", "preview", struct.pack("<II", 1, 1) + bytes(4)) + exr_attribute("floats", "floatvector", bytes(8))
put("exr", "attributes", exr([exr_header(1, 1, {"Y": 2}, more=KINDS + exr_attribute("owner", "string", b"me"))], [lines(bytes(4))]))
# Of 4 x 2 pixels: one level, mipmaps, ripmaps; column and level of each tile, and its bytes.
TILES = ([(0, 0, 0, 16), (1, 0, 0, 16)], [(0, 0, 0, 16), (1, 0, 0, 16), (0, 1, 1, 8), (0, 2, 2, 4)],
         [(0, 0, 0, 16), (1, 0, 0, 16), (0, 1, 0, 16), (0, 2, 0, 8), (0, 0, 1, 8), (1, 0, 1, 8), (0, 1, 1, 8), (0, 2, 1, 4)])
for mode, tiles in enumerate(TILES):
    put("exr", f"tiles-{mode}", exr([exr_header(4, 2, {"Y": 2}, more=exr_attribute("tiles", "tiledesc", struct.pack("<IIB", 2, 2, mode)))],
                                    [[struct.pack("<5i", x, 0, across, down, size) + bytes(size) for x, across, down, size in tiles]], 0x200))
PARTS = [exr_attribute("name", "string", name) + exr_attribute("type", "string", kind) + exr_attribute("chunkCount", "int", struct.pack("<i", count)) + more for name, kind, count, more in (
    (b"a", b"scanlineimage", 2, b""), (b"b", b"tiledimage", 1, exr_attribute("tiles", "tiledesc", struct.pack("<IIB", 2, 2, 0))), (b"c", b"scanlineimage", 2, exr_attribute("view", "string", b"left")))]
put("exr", "parts", exr([exr_header(2, 2, {"R": 2, "G": 2, "B": 2}, more=PARTS[0]), exr_header(2, 2, {"Z": 2}, more=PARTS[1]), exr_header(2, 2, {"X": 1}, more=PARTS[2])],
                        [lines(bytes(24), bytes(24), part=struct.pack("<i", 0)), [struct.pack("<6i", 1, 0, 0, 0, 0, 16) + bytes(16)], lines(bytes(4), bytes(4), part=struct.pack("<i", 2))], 0x1000))
put("exr", "deep", exr([exr_header(1, 1, {"Y": 2}, more=exr_attribute("type", "string", b"deepscanline") + exr_attribute("name", "string", b"a") + exr_attribute("version", "int", b"\1\0\0\0")
                                   + exr_attribute("chunkCount", "int", b"\1\0\0\0"))], [[struct.pack("<iQQQ", 0, 4, 4, 4) + bytes(8)]], 0x800))
# What the program writes.
put(".", "room.xml", ROOM)
for ending, target in (("exr", "exr"), ("jpg", "jpeg"), ("hdr", "hdr"), ("png", "png")):
    os.makedirs(os.path.join(folder, target), exist_ok=True)
    run("render", "room.xml", "-o", f"{target}/render.{ending}", "--spp", "1", "--width", "4", "--height", "4")
for compression in ("none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"):
    for numbers in ("float", "half"):
        run("render", "room.xml", "-o", f"exr/{compression}-{numbers}.exr", "--spp", "1", "--width", "9", "--height", "7", "--exr-compression", compression, "--exr-type", numbers)
os.makedirs(os.path.join(folder, "state"), exist_ok=True)
run("render", "room.xml", "-o", "r.exr", "--spp", "1", "--width", "2", "--height", "2", "--resume")
os.rename(os.path.join(folder, "r.exr.state"), os.path.join(folder, "state", "room"))
TINY = "-D train.guide=0 -D train.points=64 -D train.directions=1 -D decoder.width=16 -D decoder.hidden=1 -D train.poses=2 -D ncr.rays.train=4 -D octree.levels=1 -D octree.features=2 " \
       "-D lookup.offset=predicted -D disparity.log2_table=10 -D disparity.levels=1 -D disparity.features=2 -D disparity.width=16 -D disparity.hidden=1 -D nr.levels=1 -D nr.features=2 -D nr.log2_table=10 " \
       "-D nr.width=16 -D nr.hidden=1 -D ncr.levels=1 -D ncr.features=2 -D ncr.log2_table=10 -D ncr.cone.levels=1 -D ncr.cone.log2_table=10 -D ncr.cone.features=2 -D ncr.width=16 " \
       "-D ncr.hidden=1 -D ncr.cone.width=16 -D ncr.cone.hidden=1 -D ncr.merge.width=16 -D ncr.merge.hidden=1"
os.makedirs(os.path.join(folder, "model"), exist_ok=True)
for field in ("octaoctree", "nr", "ncr"):  # below the 60,000 bytes of scripts/fuzz.sh
    run("train", "room.xml", "-o", f"model/{field}.octrad", "--field", field, "--steps", "2", "--overwrite", *TINY.split(),
        *(("-D", "train.average=0") if field == "octaoctree" else ()))
# The same without checksums, which refuse nearly every change.
for name in ("model/octaoctree.octrad", "model/nr.octrad", "model/ncr.octrad", "state/room"):
    with open(os.path.join(folder, name), "rb") as file:
        put(*(name + "-unchecked").split("/"), file.read().replace(b"checksums", b"unchecked"))
for name in ("room.xml", "r.exr"):
    os.remove(os.path.join(folder, name))

WORDS = {
    "scene": "<scene <sensor <film <rfilter <shape <bsdf <emitter <texture <transform <lookat <matrix <scale <rotate <translate <rgb <float <integer <boolean <string <point <ref <default "
             "<include <alias <path type= name= value= id= version=\\\"3.0.0\\\" perspective thinlens orthographic cube sphere disk cylinder shapegroup instance rectangle obj ply serialized diffuse plastic conductor dielectric twosided mask bumpmap area "
             "constant envmap point spot directional projector bitmap checkerboard to_world reflectance radius filename t.obj t.png radiance $ /> </scene>".split(),
    "ply": "ply format ascii binary_little_endian binary_big_endian element vertex face property list uchar int float double char uint vertex_indices tristrips end_header 4294967295 -1 nan inf".split(),
    "obj": "v vt vn f / // \\x5c\\x0a 1e39 nan inf -1 2147483647".split(),
    "pbrt": "[ ] \\x22float \\x22rgb \\x22spectrum \\x22point3 \\x22integer \\x22string \\x22texture \\x22bool \\x22blackbody roughness\\x22 radius\\x22 P\\x22 indices\\x22 L\\x22 scale\\x22 alpha\\x22 type\\x22 "
            "filename\\x22 t.png t.ply Shape Material Texture NamedMaterial MakeNamedMaterial AreaLightSource LightSource AttributeBegin AttributeEnd ObjectBegin ObjectEnd ObjectInstance Include Import "
            "Translate Rotate Scale LookAt Transform ConcatTransform Camera Film Integrator PixelFilter WorldBegin WorldEnd Attribute 1e30 1e-30 -1 0 true false".split(),
    "curves": "0 1 -1 .5 1e9 1e-9 \\x0a\\x0a nan inf".split(),
    "measured": "tensor_file rgb vndf luminance ndf sigma phi_i theta_i jacobian wavelengths".split(),
    "serialized": ["\\x1c\\x04\\x03\\x00", "\\x1c\\x04\\x04\\x00", "\\x78\\x9c"],
    "gltf": "glTF JSON BIN\\x00 asset version 2.0 scene scenes nodes children mesh meshes primitives attributes POSITION NORMAL TEXCOORD_0 TEXCOORD_1 COLOR_0 indices mode material materials accessors bufferView "
            "byteOffset byteStride byteLength buffers uri data:;base64, componentType 5120 5121 5122 5123 5125 5126 count type SCALAR VEC2 VEC3 VEC4 normalized sparse values images textures source samplers "
            "pbrMetallicRoughness baseColorTexture metallicRoughnessTexture normalTexture emissiveFactor emissiveTexture alphaMode MASK BLEND doubleSided extensions KHR_lights_punctual KHR_texture_transform "
            "KHR_materials_transmission KHR_materials_volume KHR_materials_pbrSpecularGlossiness KHR_materials_unlit diffuseTexture specularGlossinessTexture specularFactor glossinessFactor attenuationColor attenuationDistance doubleSided EXT_mesh_gpu_instancing EXT_meshopt_compression EXT_texture_webp ATTRIBUTES TRIANGLES INDICES OCTAHEDRAL QUATERNION EXPONENTIAL filter cameras perspective orthographic yfov xmag matrix rotation scale translation 1e30 -1 null".split(),
    "hdr": "#?RADIANCE #?RGBE FORMAT=32-bit_rle_rgbe -Y +X \\x02\\x02 \\x01\\x01\\x01".split(),
    "pfm": "PF Pf -1.0 nan inf 131072".split(),
    "png": "IHDR PLTE tRNS IDAT IEND gAMA iCCP sBIT \\x89PNG\\x0d\\x0a\\x1a\\x0a".split(),
    "jpeg": "\\xff\\xd8 \\xff\\xd9 \\xff\\xc0 \\xff\\xc2 \\xff\\xc4 \\xff\\xda \\xff\\xdb \\xff\\xdd \\xff\\xee Adobe JFIF".split(),
    "exr": "channels chlist compression dataWindow displayWindow box2i lineOrder pixelAspectRatio screenWindowCenter screenWindowWidth tiles tiledesc type string chunkCount name".split(),
    "model": "__metadata__ dtype shape data_offsets F32 F16 I32 I64 U16 format octrad config scene state octree.level1.cells".split(),
    "config": "octree.levels preset paper default cpu field octaoctree nr ncr train.time 1e999 null true [[[[ {".split(),
    "camera": "origin target up fov to_world width height near_clip far_clip 1e30 1e999 null".split(),
    "bmp": "BM \\x28\\x00\\x00\\x00 \\x7c\\x00\\x00\\x00".split(),
    "tga": ["TRUEVISION-XFILE."],
    "webp": "RIFF WEBP VP8\\x20 VP8L VP8X ALPH ANIM ANMF \\x9d\\x01\\x2a \\x2f".split(),
    "old_scene": "<scene <bsdf <spectrum <srgb <blackbody <texture <lookAt version=\\\"0.6.0\\\" mixturebsdf weights phong ward coating roughcoating difftrans irawan 400:1 toWorld uscale filterType intent= $ />".split(),
    "path": "keys frames duration fps time origin target 1e9 1e30".split(),
    "spectrum": "# 400 1e-3 nan".split(),
    "matrix": "title about scenes views methods switches seeds equal preset keys time steps spp width reference_spp learned path_spp temporal_frames temporal_spp paths name * octaoctree nr ncr path seconds bytes cpu".split(),
    "message": "type set camera input width height a b errors most_error full layer exposure curve white integrator model lhs path stored filmic log1p origin target null true".split(),
    "state": "__metadata__ film.sums F64 dtype shape data_offsets octrad-film identity state samples largest_pass seconds rays queries non_finite".split(),
    "points": "nan inf 1e39 -1 , \\x0a".split(),
}
for target, words in WORDS.items():
    with open(os.path.join(folder, target + ".dict"), "w", encoding="utf-8") as out:
        out.writelines(f'"{word}"\n' for word in words)
