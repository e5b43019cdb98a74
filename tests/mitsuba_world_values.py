#!/usr/bin/env python3
"""Writes src/octrad/scene/mitsuba_world_test_data.h: what Mitsuba 3 (scalar_rgb) computes for emitters, sensors, reconstruction
filters and shapes.

    python3 tests/mitsuba_world_values.py > src/octrad/scene/mitsuba_world_test_data.h

Needs `pip install mitsuba`. Unit tests of scene, geometry, shading and render compare ours with these numbers.
"""
import os
import tempfile

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

ROTATE = '<transform name="to_world"><rotate x="1" y="0" z="0" angle="20"/><rotate x="0" y="0" z="1" angle="30"/><translate x="0.2" y="-0.1" z="-0.3"/></transform>'
STRETCH = '<transform name="to_world"><scale x="1" y="1.5" z="0.8"/><rotate x="0" y="1" z="0" angle="10"/></transform>'
POWER = '<rgb name="{}" value="1 2 3"/>'
PICTURE = '<texture name="irradiance" type="bitmap"><string name="filename" value="p.exr"/><boolean name="raw" value="true"/></texture>'
EMITTERS = [
    f'<emitter type="point">{POWER.format("intensity")}<point name="position" x="0" y="1" z="0.5"/></emitter>',
    f'<emitter type="point">{POWER.format("intensity")}{ROTATE}</emitter>',
    f'<emitter type="spot">{POWER.format("intensity")}</emitter>',
    f'<emitter type="spot">{POWER.format("intensity")}<float name="cutoff_angle" value="40"/><float name="beam_width" value="10"/>{ROTATE}</emitter>',
    f'<emitter type="spot">{POWER.format("intensity")}<float name="cutoff_angle" value="50"/>{STRETCH}</emitter>',
    f'<emitter type="spot">{POWER.format("intensity")}<float name="cutoff_angle" value="50"/><texture name="texture" type="checkerboard">'
    f'<rgb name="color0" value="0.2"/><rgb name="color1" value="0.9 0.5 0.1"/><transform name="to_uv"><scale x="5" y="5"/></transform></texture>{ROTATE}</emitter>',
    f'<emitter type="directional">{POWER.format("irradiance")}<vector name="direction" x="1" y="2" z="3"/></emitter>',
    f'<emitter type="directional">{POWER.format("irradiance")}{ROTATE}</emitter>',
    f'<emitter type="projector">{PICTURE}<float name="fov" value="60"/></emitter>',
    f'<emitter type="projector">{PICTURE}<float name="fov" value="50"/><string name="fov_axis" value="y"/><float name="scale" value="2.5"/>{ROTATE}</emitter>',
    f'<emitter type="projector">{PICTURE}{STRETCH}</emitter>',
    f'<emitter type="projector">{POWER.format("irradiance")}<float name="fov" value="70"/></emitter>',
]
POINTS = [[0.2, 0.1, 2], [1, 0.3, 3], [0.4, -0.7, 1.5], [0, 0, -2], [0.05, 0.9, 2.9], [-0.6, 0.2, 1.1], [-0.9, -0.4, 1.7], [1.3, 1.1, 1.2]]

FILM = '<film type="hdrfilm"><integer name="width" value="30"/><integer name="height" value="20"/>{}</film>'
CROP = FILM.format("".join(f'<integer name="{name}" value="{value}"/>' for name, value in
                           (("crop_offset_x", 3), ("crop_offset_y", 4), ("crop_width", 20), ("crop_height", 10))))
PLACE = '<transform name="to_world">{}<lookat origin="1 2 3" target="0 0.5 -1" up="0 1 0.2"/></transform>'
CLIP = '<float name="near_clip" value="0.5"/><float name="far_clip" value="20"/>'
LENS = '<float name="aperture_radius" value="0.2"/><float name="focus_distance" value="3"/>'
SENSORS = [
    f'<sensor type="perspective">{CLIP}{PLACE.format("")}{CROP}</sensor>',
    f'<sensor type="perspective">{CLIP}{PLACE.format("")}{CROP}<float name="fov" value="40"/><string name="fov_axis" value="larger"/>'
    '<float name="principal_point_offset_x" value="0.1"/><float name="principal_point_offset_y" value="-0.05"/></sensor>',
    f'<sensor type="thinlens">{CLIP}{LENS}<float name="fov" value="40"/>{PLACE.format("")}{FILM.format("")}</sensor>',
    f'<sensor type="thinlens">{CLIP}{LENS}<float name="fov" value="40"/>{PLACE.format("")}{CROP}</sensor>',
    f'<sensor type="orthographic">{CLIP}{PLACE.format("")}{FILM.format("")}</sensor>',
    f'<sensor type="orthographic">{CLIP}{PLACE.format(chr(60) + "scale x=" + chr(34) + "2" + chr(34) + " y=" + chr(34) + "1.5" + chr(34) + " z=" + chr(34) + "3" + chr(34) + "/>")}{CROP}</sensor>',
    f'<sensor type="orthographic">{CLIP}{PLACE.format(chr(60) + "scale x=" + chr(34) + "-0.5" + chr(34) + "/>")}{CROP}</sensor>',
]
FILTERS = ["box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"]
MOVE = '<transform name="to_world"><scale x="1.2" y="0.7" z="1.2"/><rotate x="1" y="0" z="0" angle="50"/><translate x="0.2" y="0.1" z="-0.3"/></transform>'
EVEN = '<transform name="to_world"><scale x="-0.8" y="0.8" z="0.9"/><rotate x="1" y="0" z="0" angle="50"/><translate x="0.2" y="0.1" z="-0.3"/></transform>'
FLIP = '<boolean name="flip_normals" value="true"/>'
GROUP = '<shape type="shapegroup" id="g"><shape type="rectangle"><transform name="to_world"><scale value="0.6"/><rotate x="0" y="1" z="0" angle="40"/></transform></shape>' \
        '<shape type="cube"><transform name="to_world"><scale value="0.4"/><translate x="0.5" y="-0.4" z="0.3"/></transform></shape></shape>'
INSTANCE = GROUP + '<shape type="instance"><ref id="g"/>{}</shape>'
CURVES = """-1 -0.8 0.2 0.15
-0.4 0.3 0.3 0.3
0.4 -0.2 -0.1 0.2
1 0.5 -0.2 0.35
1.1 0.9 0.6 0.1

-0.9 0.8 0.3 0.2
-0.5 0.9 0.1 0.2
0.1 0.7 -0.4 0.1
0.2 0.4 -0.7 0.3
"""
CURVE = '<shape type="{}"><string name="filename" value="c.txt"/>{}</shape>'
SHAPES = [
    '<shape type="disk"/>', f'<shape type="disk">{FLIP}{MOVE}</shape>', f'<shape type="disk">{EVEN}</shape>',
    '<shape type="cylinder"/>', f'<shape type="cylinder">{FLIP}{EVEN}</shape>',
    '<shape type="cylinder"><point name="p0" x="0.2" y="-0.8" z="-1"/><point name="p1" x="0" y="1" z="0.7"/><float name="radius" value="0.6"/></shape>',
    INSTANCE.format(""), INSTANCE.format(MOVE), INSTANCE.format(EVEN),
    CURVE.format("linearcurve", ""), CURVE.format("linearcurve", MOVE),
    CURVE.format("bsplinecurve", ""), CURVE.format("bsplinecurve", MOVE),
]


def number(x):
    text = "%.9g" % float(x)
    return text + ("" if any(c in text for c in ".en") else ".0") + "f"


def vector(v):
    return "{" + ", ".join(number(x) for x in v) + "}"


def rows(name, type_name, lines):
    print(f"inline const {type_name} {name}[] = {{")
    for line in lines:
        print("    " + (line if type_name == "char* const" else "{" + line + "}") + ",")
    print("};\n")


def text(xml):
    return 'R"(' + xml + ')"'


def main():
    os.chdir(tempfile.mkdtemp())
    picture = np.zeros((4, 6, 3), np.float32)
    for y in range(4):
        for x in range(6):
            picture[y, x] = [((7 * x + 13 * y + 5 * c + x * y) % 11) / 8 for c in range(3)]
    mi.Bitmap(picture).write("p.exr")
    with open("c.txt", "w") as f:
        f.write(CURVES)
    print("""// Written by tests/mitsuba_world_values.py with Mitsuba %s. Not to be edited.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

struct MitsubaEmitterValue {  // of emitter `emitter` as seen from x; radiance is per density 1
  int emitter;
  Vec3f x, direction;
  float distance;
  Vec3f radiance;
};
struct MitsubaRay {  // of sensor `sensor` through the centre of its lens, at a position in [0, 1]^2 of its picture
  int sensor;
  Vec2f position;
  Vec3f origin, direction;
  float t_max;
};
struct MitsubaFilter {
  const char* type;
  float radius;
  float values[24];  // at 0, 1/8, 2/8 ...
};
struct MitsubaHit {  // t < 0: nothing
  int shape;
  Vec3f origin, direction;
  float t;
  Vec3f normal, shading_normal;
  Vec2f uv;
};

// clang-format off
""" % mi.__version__)
    rows("kMitsubaEmitters", "char* const", [text(e) for e in EMITTERS])
    lines = []
    for i, xml in enumerate(EMITTERS):
        scene = mi.load_string(f'<scene version="3.0.0">{xml}<shape type="sphere"><float name="radius" value="3"/></shape></scene>')
        for p in POINTS:
            at = mi.Interaction3f()
            at.p = p
            sample, weight = scene.emitters()[0].sample_direction(at, [0.3, 0.6])
            lines.append(f"{i}, {vector(p)}, {vector(sample.d)}, {number(sample.dist)}, {vector(weight)}")
    rows("kMitsubaEmitterValues", "MitsubaEmitterValue", lines)
    rows("kMitsubaSensors", "char* const", [text(s) for s in SENSORS])
    lines = []
    for i, xml in enumerate(SENSORS):
        sensor = mi.load_string(f'<scene version="3.0.0">{xml}</scene>').sensors()[0]
        for position in ([0.1, 0.3], [0.9, 0.6], [0.5, 0.5]):
            ray, _ = sensor.sample_ray(0.0, 0.5, position, [0.5, 0.5])
            lines.append(f"{i}, {vector(position)}, {vector(ray.o)}, {vector(ray.d)}, {number(ray.maxt)}")
    rows("kMitsubaRays", "MitsubaRay", lines)
    lines = []
    for name in FILTERS:
        f = mi.load_dict({"type": name})
        # At 1/2 a box depends on rounding.
        values = [f.eval(k / 8) if not (name == "box" and k == 4) else 1.0 for k in range(24)]
        lines.append(f'"{name}", {number(f.radius())}, {vector(values)}')
    rows("kMitsubaFilters", "MitsubaFilter", lines)
    print(f"inline const char* const kMitsubaCurves = {text(CURVES)};  // c.txt of the shapes\n")
    rows("kMitsubaShapes", "char* const", [text(s) for s in SHAPES])
    lines = []
    random = np.random.default_rng(1)
    for i, xml in enumerate(SHAPES):
        scene = mi.load_string(f'<scene version="3.0.0">{xml}</scene>')
        for _ in range(24):
            o, towards = random.normal(size=3), random.uniform(-0.7, 0.7, size=3)
            o *= 4 / np.linalg.norm(o)
            d = (towards - o) / np.linalg.norm(towards - o)
            o, d = o.astype(np.float32), d.astype(np.float32)
            hit = scene.ray_intersect(mi.Ray3f(o, d))
            if hit.is_valid():
                lines.append(f"{i}, {vector(o)}, {vector(d)}, {number(hit.t)}, {vector(hit.n)}, {vector(hit.sh_frame.n)}, {vector(hit.uv)}")
            else:
                lines.append(f"{i}, {vector(o)}, {vector(d)}, -1.0f, {{0.0f, 0.0f, 0.0f}}, {{0.0f, 0.0f, 0.0f}}, {{0.0f, 0.0f}}")
    rows("kMitsubaHits", "MitsubaHit", lines)
    print("// clang-format on\n\n}  // namespace octrad")


main()
