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
from support import ROOM  # noqa: E402
from test_gltf import scene as gltf_scene  # noqa: E402

FORMATS = {"obj": "obj", "ply": "ply", "serialized": "serialized", "png": "png", "jpg": "jpeg", "exr": "exr", "hdr": "hdr", "pfm": "pfm", "octrad": "model", "xml": "scene", "gltf": "gltf", "glb": "gltf"}


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
put("ply", "normals", ply(properties=("x", "y", "z", "nx", "ny", "nz", "u", "v"), rows="0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 1\n3 0 1 2\n"))
put("ply", "attributes", ply(properties=("x", "y", "z", "r", "g", "b", "w_0"), rows="0 0 0 1 1 1 1\n1 0 0 0 0 0 0\n0 1 0 1 0 1 0\n3 0 1 2\n"))
put("bmp", "24", b"BM" + struct.pack("<IIIIiiHHIIIIII", 0, 0, 54, 40, 2, 2, 1, 24, 0, 0, 0, 0, 0, 0) + bytes(16))
put("bmp", "8", b"BM" + struct.pack("<IIIIiiHHIIIIII", 0, 0, 62, 40, 2, -1, 1, 8, 0, 0, 0, 0, 0, 0) + bytes(12))
put("tga", "24", struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, 2, 2, 24, 0) + bytes(12))
put("tga", "runs", struct.pack("<BBBHHBHHHHBB", 0, 0, 11, 0, 0, 0, 0, 0, 3, 1, 8, 0) + b"\x82\xff")
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
put("gltf", "all", ALL.text())
put("gltf", "all-container", ALL.container())
put("serialized", "old", serialized(version=3))
put("serialized", "two", serialized(count=2))
put("serialized", "all", serialized(flags=0x100b, positions=TRIANGLE + struct.pack("<24f", *[0, 0, 1] * 3, 0, 0, 1, 0, 1, 1, *[0.5] * 9)))
put("serialized", "double", serialized(flags=0x2003, positions=struct.pack("<24d", 0, 0, 0, 1, 0, 0, 0, 1, 0, *[0, 0, 1] * 3, 0, 0, 1, 0, 1, 1)))
put("scene", "world", '<scene version="3.0.0"><sensor type="thinlens"><float name="aperture_radius" value="0.1"/><float name="focus_distance" value="3"/><film type="hdrfilm"><integer name="crop_width" value="5"/>'
    '<rfilter type="lanczos"/></film></sensor><sensor type="orthographic"/><shape type="disk"/><shape type="cylinder"/><shape type="shapegroup" id="g"><shape type="cube"/><shape type="sphere"/></shape>'
    '<shape type="instance"><ref id="g"/><transform name="to_world"><scale value="2"/></transform></shape><emitter type="point"/><emitter type="spot"><float name="cutoff_angle" value="30"/></emitter>'
    '<emitter type="directional"/><emitter type="projector"><texture name="irradiance" type="bitmap"><string name="filename" value="t.png"/></texture></emitter></scene>')
put("png", "grey", png(2, 2, b"\0\x40\x80\0\x80\x40"))
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
# What the program writes.
put(".", "room.xml", ROOM)
for ending, target in (("exr", "exr"), ("jpg", "jpeg"), ("hdr", "hdr"), ("png", "png")):
    os.makedirs(os.path.join(folder, target), exist_ok=True)
    run("render", "room.xml", "-o", f"{target}/render.{ending}", "--spp", "1", "--width", "4", "--height", "4")
TINY = "-D train.points=64 -D train.directions=1 -D decoder.width=16 -D decoder.hidden=1 -D train.poses=2 -D ncr.rays.train=4 -D octree.levels=1 -D octree.features=2 " \
       "-D disparity.log2_table=10 -D disparity.levels=1 -D disparity.features=2 -D disparity.width=16 -D disparity.hidden=1 -D nr.levels=1 -D nr.features=2 -D nr.log2_table=10 " \
       "-D nr.width=16 -D nr.hidden=1 -D ncr.levels=1 -D ncr.features=2 -D ncr.log2_table=10 -D ncr.cone.levels=1 -D ncr.cone.log2_table=10 -D ncr.cone.features=2 -D ncr.width=16 " \
       "-D ncr.hidden=1 -D ncr.cone.width=16 -D ncr.cone.hidden=1 -D ncr.merge.width=16 -D ncr.merge.hidden=1"
os.makedirs(os.path.join(folder, "model"), exist_ok=True)
for field in ("octaoctree", "nr", "ncr"):
    run("train", "room.xml", "-o", f"model/{field}.octrad", "--field", field, "--steps", "2", "--overwrite", *TINY.split())
os.remove(os.path.join(folder, "room.xml"))

WORDS = {
    "scene": "<scene <sensor <film <rfilter <shape <bsdf <emitter <texture <transform <lookat <matrix <scale <rotate <translate <rgb <float <integer <boolean <string <point <ref <default "
             "<include <alias <path type= name= value= id= version=\\\"3.0.0\\\" perspective thinlens orthographic cube sphere disk cylinder shapegroup instance rectangle obj ply serialized diffuse plastic conductor dielectric twosided mask bumpmap area "
             "constant envmap point spot directional projector bitmap checkerboard to_world reflectance radius filename t.obj t.png radiance $ /> </scene>".split(),
    "ply": "ply format ascii binary_little_endian binary_big_endian element vertex face property list uchar int float double char uint vertex_indices end_header 4294967295 -1 nan inf".split(),
    "obj": "v vt vn f / // \\x5c\\x0a 1e39 nan inf -1 2147483647".split(),
    "serialized": ["\\x1c\\x04\\x03\\x00", "\\x1c\\x04\\x04\\x00", "\\x78\\x9c"],
    "gltf": "glTF JSON BIN\\x00 asset version 2.0 scene scenes nodes children mesh meshes primitives attributes POSITION NORMAL TEXCOORD_0 TEXCOORD_1 COLOR_0 indices mode material materials accessors bufferView "
            "byteOffset byteStride byteLength buffers uri data:;base64, componentType 5120 5121 5122 5123 5125 5126 count type SCALAR VEC2 VEC3 VEC4 normalized sparse values images textures source samplers "
            "pbrMetallicRoughness baseColorTexture metallicRoughnessTexture normalTexture emissiveFactor emissiveTexture alphaMode MASK BLEND doubleSided extensions KHR_lights_punctual KHR_texture_transform "
            "KHR_materials_transmission KHR_materials_volume EXT_mesh_gpu_instancing cameras perspective orthographic yfov xmag matrix rotation scale translation 1e30 -1 null".split(),
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
    "old_scene": "<scene <bsdf <spectrum <srgb <blackbody <texture <lookAt version=\\\"0.6.0\\\" mixturebsdf weights phong ward coating roughcoating difftrans irawan 400:1 toWorld uscale filterType intent= $ />".split(),
    "path": "keys frames duration fps time origin target 1e9 1e30".split(),
    "points": "nan inf 1e39 -1 , \\x0a".split(),
}
for target, words in WORDS.items():
    with open(os.path.join(folder, target + ".dict"), "w", encoding="utf-8") as out:
        out.writelines(f'"{word}"\n' for word in words)
