#!/usr/bin/env python3
"""A scene that Blender exports as glTF, rendered by its Cycles and by octrad's path tracer.

    python3 tests/compare_blender.py [--octrad build/octrad] [--spp 256] [-o folder]

Needs `pip install bpy numpy` (Blender as a module; bpy 5.0 takes Python 3.11). Rectangles that face the camera have a material, texture or kind
of coordinates each; point, spot and directional lights and an emissive rectangle light them. The scene is exported in several ways
(.glb, .gltf with files, tangents, instances, JPEG and WebP textures). Printed: for each rectangle the mean colour over its middle in Cycles, and
octrad's in shares of it (about 1.05 where diffuse: Mitsuba's principled has Disney's lobe, and Cycles filters textures before it decodes
them). Fails (exit 1) where one is off by more than 10 %, or where one way of exporting makes another picture than the others.
"""
import argparse
import math
import os
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "cli"))
import bpy  # noqa: E402
import numpy as np  # noqa: E402
from bpy_extras.object_utils import world_to_camera_view  # noqa: E402
from exr import read_pfm  # noqa: E402
from mathutils import Vector  # noqa: E402

WIDTH, HEIGHT = 320, 200
WAYS = {  # how the file is written, and how far its picture may be from that of the first (mean of |difference| / mean)
    "glb": ({}, 0.0), "gltf": ({"export_format": "GLTF_SEPARATE"}, 0.0), "tangents": ({"export_tangents": True}, 0.0),
    "instances": ({"export_gpu_instances": True}, 0.0), "jpeg": ({"export_image_format": "JPEG"}, 0.05),
    "webp": ({"export_image_format": "WEBP"}, 0.05)}


def picture(name, side, color, linear=False):
    image = bpy.data.images.new(name, side, side, alpha=True, float_buffer=False)
    image.colorspace_settings.name = "Non-Color" if linear else "sRGB"
    at = (np.arange(side) + 0.5) / side
    v, u = np.meshgrid(at, at, indexing="ij")  # row 0 at the bottom
    image.pixels = np.stack([np.broadcast_to(c, u.shape) for c in color(u, v)], -1).ravel().tolist()
    image.pack()
    return image


def principled(name, **values):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    bsdf = material.node_tree.nodes["Principled BSDF"]
    for key, value in {"Roughness": 0.5, **values}.items():
        bsdf.inputs[key.replace("_", " ")].default_value = value
    return material, bsdf.inputs, material.node_tree


def texture(tree, image, nearest=False, scale=None, turn=0.0, uv=None):
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    node.interpolation = "Closest" if nearest else "Linear"
    if uv or scale:
        source = tree.nodes.new("ShaderNodeUVMap")
        source.uv_map = uv or ""
        socket = source.outputs[0]
        if scale:
            mapping = tree.nodes.new("ShaderNodeMapping")
            mapping.inputs["Scale"].default_value = (*scale, 1)
            mapping.inputs["Rotation"].default_value = (0, 0, turn)
            tree.links.new(socket, mapping.inputs[0])
            socket = mapping.outputs[0]
        tree.links.new(socket, node.inputs[0])
    return node


class World:
    """Rectangles in two rows on a floor, before a wall."""

    def __init__(self, spp):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = scene = bpy.context.scene
        self.places = {}
        scene.render.engine = "CYCLES"
        cycles = scene.cycles
        cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = spp, False, False
        cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transparent_max_bounces = 12
        cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
        cycles.pixel_filter_type = "BOX"
        scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        self.fill()
        self.light()

    def place(self, name, material):
        column, row = len(self.places) % 6, len(self.places) // 6
        bpy.ops.mesh.primitive_plane_add(size=2, location=(2.4 * column - 6, 2.8 * row, 1.1 + 2.2 * row), rotation=(math.radians(75), 0, 0))
        bpy.context.object.data.materials.append(material)
        self.places[name] = bpy.context.object
        return bpy.context.object

    def fill(self):
        checks = picture("checks", 64, lambda u, v: (u, v, np.where((np.floor(u * 8) + np.floor(v * 8)) % 2 > 0, 0.3, 0.8), 1.0))
        hole = picture("hole", 64, lambda u, v: (0.8, 0.4, 0.1, np.where((u - 0.5) ** 2 + (v - 0.5) ** 2 < 0.15, 1.0, 0.0)))
        fade = picture("fade", 64, lambda u, v: (0.2, 0.4, 0.9, u))
        metal = picture("metal", 64, lambda u, v: (0.0, 0.3 + 0.4 * u, np.where(v > 0.5, 1.0, 0.0), 1.0), True)
        slope = lambda u: 0.5 * np.sin(u * 12 * math.pi)  # noqa: E731
        bumps = picture("bumps", 128, lambda u, v: (0.5 - 0.5 * slope(u) / np.hypot(1, slope(u)), 0.5, 0.5 + 0.5 / np.hypot(1, slope(u)), 1.0), True)
        grey = principled("floor and wall", Base_Color=(0.5, 0.5, 0.5, 1))[0]
        for place, turn in (((0, 0, 0), 0), ((0, 8, 10), 90)):  # half-transparent surfaces have something behind them
            bpy.ops.mesh.primitive_plane_add(size=24, location=place, rotation=(math.radians(turn), 0, 0))
            bpy.context.object.data.materials.append(grey)
        self.place("diffuse", principled("diffuse", Base_Color=(0.8, 0.4, 0.2, 1))[0])
        self.place("metal", principled("rough metal", Base_Color=(0.9, 0.6, 0.3, 1), Metallic=1.0, Roughness=0.4)[0])
        self.place("half metal", principled("half metal", Base_Color=(0.9, 0.6, 0.3, 1), Metallic=0.5, Roughness=0.4)[0])
        for name, options in (("texture", {}), ("nearest, turned, scaled", {"nearest": True, "scale": (2, 3), "turn": 0.3}), ("second set", {"uv": "second"})):
            material, inputs, tree = principled(name)
            tree.links.new(texture(tree, checks, **options).outputs[0], inputs["Base Color"])
            place = self.place(name, material)
            if "uv" in options:
                first, second = place.data.uv_layers[0].data, place.data.uv_layers.new(name="second").data
                for one, other in zip(first, second):
                    other.uv = (2 * one.uv[1], 2 * one.uv[0])
        material, inputs, tree = principled("mask")
        node, test = texture(tree, hole), tree.nodes.new("ShaderNodeMath")
        test.operation, test.inputs[1].default_value = "GREATER_THAN", 0.5
        tree.links.new(node.outputs[0], inputs["Base Color"])
        tree.links.new(node.outputs[1], test.inputs[0])
        tree.links.new(test.outputs[0], inputs["Alpha"])
        self.place("mask", material)
        material, inputs, tree = principled("blend")
        node = texture(tree, fade)
        tree.links.new(node.outputs[0], inputs["Base Color"])
        tree.links.new(node.outputs[1], inputs["Alpha"])
        self.place("blend", material)
        material, inputs, tree = principled("channels", Base_Color=(0.9, 0.6, 0.3, 1))
        parts = tree.nodes.new("ShaderNodeSeparateColor")
        tree.links.new(texture(tree, metal).outputs[0], parts.inputs[0])
        tree.links.new(parts.outputs[1], inputs["Roughness"])
        tree.links.new(parts.outputs[2], inputs["Metallic"])
        self.place("metallic and roughness", material)
        material, inputs, tree = principled("bumps", Base_Color=(0.7, 0.7, 0.7, 1))
        normal = tree.nodes.new("ShaderNodeNormalMap")
        tree.links.new(texture(tree, bumps).outputs[0], normal.inputs["Color"])
        tree.links.new(normal.outputs[0], inputs["Normal"])
        self.place("normal map", material)
        self.place("normal map, mirrored", material).scale = (-1, 1, 1)
        material, inputs, tree = principled("colours")
        node = tree.nodes.new("ShaderNodeVertexColor")
        node.layer_name = "colours"
        tree.links.new(node.outputs[0], inputs["Base Color"])
        colors = self.place("colours of vertices", material).data.color_attributes.new("colours", "FLOAT_COLOR", "CORNER").data
        for i, color in enumerate(((1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1), (1, 1, 1, 1))):
            colors[i].color = color

    def light(self):
        lamp = principled("lamp", Base_Color=(0, 0, 0, 1), Emission_Color=(1, 0.9, 0.8, 1), Emission_Strength=6.0)[0]
        bpy.ops.mesh.primitive_plane_add(size=4, location=(0, -5, 8), rotation=(math.radians(160), 0, 0))
        bpy.context.object.data.materials.append(lamp)
        for kind, place, energy, target in (("POINT", (-5, -8, 8), 1500, None), ("SPOT", (5, -8, 6), 1500, (2, 0, 1)), ("SUN", (0, 0, 9), 0.5, (2, 5, 0))):
            light = bpy.data.lights.new(kind, kind)
            light.energy = energy
            if kind == "SUN":
                light.angle = 0.0
            else:
                light.shadow_soft_size = 0.0
            if kind == "SPOT":
                light.spot_size, light.spot_blend = math.radians(60), 0.0
            self.put(bpy.data.objects.new(kind, light), place, target)
        camera = bpy.data.cameras.new("camera")
        camera.angle = math.radians(50)
        self.scene.camera = self.put(bpy.data.objects.new("camera", camera), (0, -14, 6), (0, 1, 1.9))

    def put(self, thing, place, target):
        thing.location = place
        if target:
            thing.rotation_euler = (Vector(target) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
        bpy.context.collection.objects.link(thing)
        return thing

    def middles(self):
        """Name -> pixels of the middle of its rectangle: rows and columns, row 0 at the top."""
        bpy.context.view_layer.update()
        found = {}
        for name, place in self.places.items():
            corners = [world_to_camera_view(self.scene, self.scene.camera, place.matrix_world @ Vector((x, y, 0))) for x in (-0.7, 0.7) for y in (-0.7, 0.7)]
            x, y = sorted(c.x * WIDTH for c in corners), sorted((1 - c.y) * HEIGHT for c in corners)
            found[name] = (slice(math.ceil(y[1]), math.floor(y[2])), slice(math.ceil(x[1]), math.floor(x[2])))
        return found

    def cycles(self, file):
        self.scene.render.filepath = file
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(file)
        image.colorspace_settings.name = "Non-Color"
        return np.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)[::-1, :, :3]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--octrad", default="build/octrad")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("-o", "--output")
    args = parser.parse_args()
    folder = args.output or tempfile.mkdtemp()
    os.makedirs(folder, exist_ok=True)
    world = World(args.spp)
    pictures = {}
    for way, (options, _) in WAYS.items():
        file = os.path.join(folder, way + (".gltf" if way == "gltf" else ".glb"))
        bpy.ops.export_scene.gltf(filepath=file, export_cameras=True, export_lights=True, export_import_convert_lighting_mode="COMPAT", **options)
        out = os.path.join(folder, way + ".pfm")
        subprocess.run([args.octrad, "render", file, "--integrator", "path", "--spp", str(args.spp), "--width", str(WIDTH), "-o", out, "-q"], check=True)
        pictures[way] = np.array(read_pfm(out)).reshape(HEIGHT, WIDTH, 3)
    reference = world.cycles(os.path.join(folder, "cycles.exr"))
    failed = 0
    print(f"{'':26}{'Cycles':^24}{'octrad, shares of it':^24}")
    for name, (rows, columns) in world.middles().items():
        expected, found = (image[rows, columns].mean((0, 1)) for image in (reference, pictures["glb"]))
        off = np.abs(found - expected).max() > 0.1 * expected.max()
        failed += off
        print(f"{name:26}" + " ".join(f"{v:7.4f}" for v in expected) + "  " + " ".join(f"{v:7.3f}" for v in found / np.maximum(expected, 1e-9)) + ("  OFF" if off else ""))
    for way, (_, most) in WAYS.items():
        difference = np.abs(pictures[way] - pictures["glb"]).mean() / pictures["glb"].mean()
        failed += difference > most
        print(f"{way:26}differs from glb by {difference:.4f}" + (" OFF" if difference > most else ""))
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
