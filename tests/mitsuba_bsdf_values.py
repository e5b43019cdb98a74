#!/usr/bin/env python3
"""Writes src/octrad/shading/mitsuba_values_test_data.h: what Mitsuba 3 (scalar_rgb) computes for a set of BSDFs and directions,
and for an environment map.

    python3 tests/mitsuba_bsdf_values.py > src/octrad/shading/mitsuba_values_test_data.h

Needs `pip install mitsuba`. The unit test shading/mitsuba_values_test.cc compares our models with these numbers.
"""
import math
import numpy as np
import mitsuba as mi

mi.set_variant("scalar_rgb")


def rgb(values):
    return {"type": "rgb", "value": list(values)}


def direction(theta_degrees, phi_degrees):
    t, p = math.radians(theta_degrees), math.radians(phi_degrees)
    return [math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)]


COPPER = dict(eta=[0.2004, 0.9240, 1.1022], k=[3.9129, 2.4528, 2.1421])
CASES = [
    dict(type="diffuse", reflectance=[0.7, 0.3, 0.1]),
    dict(type="plastic", reflectance=[0.5, 0.25, 0.1], int_ior=1.49, ext_ior=1.000277),
    dict(type="plastic", reflectance=[0.8, 0.25, 0.1], int_ior=1.9, ext_ior=1.0, nonlinear=True, specular=[0.7, 0.8, 0.9]),
    dict(type="conductor", **COPPER),
    dict(type="conductor", eta=[0, 0, 0], k=[1, 1, 1], specular=[0.9, 0.8, 0.7]),
    dict(type="dielectric", int_ior=1.5046, ext_ior=1.000277, specular=[0.9, 1, 1], transmittance=[0.5, 0.6, 0.7]),
    dict(type="thindielectric", int_ior=1.5046, ext_ior=1.000277, specular=[0.9, 1, 1], transmittance=[0.5, 0.6, 0.7]),
]
for distribution in ["beckmann", "ggx"]:
    for visible in [True, False]:
        CASES.append(dict(type="roughconductor", distribution=distribution, visible=visible, alpha_u=0.15, alpha_v=0.15, **COPPER))
        CASES.append(dict(type="roughconductor", distribution=distribution, visible=visible, alpha_u=0.4, alpha_v=0.1, specular=[0.5, 0.6, 0.7], **COPPER))
    for alpha in [0.05, 0.1, 0.4]:
        for nonlinear in [False, True]:
            CASES.append(dict(type="roughplastic", distribution=distribution, visible=True, alpha_u=alpha, alpha_v=alpha, nonlinear=nonlinear,
                              int_ior=1.5, ext_ior=1.0, reflectance=[0.6, 0.3, 0.1], specular=[1, 0.9, 0.8]))
CASES.append(dict(type="roughplastic", distribution="ggx", visible=False, alpha_u=0.2, alpha_v=0.2, int_ior=1.9, ext_ior=1.000277, reflectance=[0.6, 0.3, 0.1]))


def make(case):
    d = {"type": case["type"]}
    if "reflectance" in case:
        d["reflectance" if case["type"] == "diffuse" else "diffuse_reflectance"] = rgb(case["reflectance"])
    if "specular" in case:
        d["specular_reflectance"] = rgb(case["specular"])
    if "transmittance" in case:
        d["specular_transmittance"] = rgb(case["transmittance"])
    for key in ["int_ior", "ext_ior", "nonlinear", "distribution"]:
        if key in case:
            d[key] = case[key]
    if "eta" in case:
        d["eta"], d["k"] = rgb(case["eta"]), rgb(case["k"])
    if "visible" in case:
        d["sample_visible"] = case["visible"]
    if case["type"] == "roughplastic":
        d["alpha"] = case["alpha_u"]
    if case["type"] == "roughconductor":
        d["alpha_u"], d["alpha_v"] = case["alpha_u"], case["alpha_v"]
    return mi.load_dict(d)


def cpp(values):
    return "{" + ", ".join(("%.9gf" % v) if "." in "%.9g" % v or "e" in "%.9g" % v else "%.9g.0f" % v for v in values) + "}"


print("""// Written by tests/mitsuba_bsdf_values.py with Mitsuba %s. Not to be edited.
#pragma once

#include "shading/bsdf_types.h"

namespace octrad {

struct MitsubaEvaluation {
  int material;
  Vec3f wo, wi;
  Vec3f value;
  float pdf;
};
struct MitsubaSample {  // delta lobes: what is drawn for u_lobe
  int material;
  Vec3f wo;
  float u_lobe;
  Vec3f wi, weight;
  float pdf, eta;
};
struct MitsubaMaterial {
  BsdfType type;
  MicrofacetDistribution distribution;
  bool visible, nonlinear;
  float int_ior, ext_ior, alpha_u, alpha_v;
  Vec3f reflectance, specular, transmittance, eta, k;
};
""" % mi.__version__)
print("inline const MitsubaMaterial kMitsubaMaterials[] = {")
for c in CASES:
    print("    {BsdfType::%s, MicrofacetDistribution::%s, %s, %s, %s, %s, %s, %s, %s, %s}," % (
        c["type"], c.get("distribution", "ggx"), str(c.get("visible", True)).lower(), str(c.get("nonlinear", False)).lower(),
        cpp([c.get("int_ior", 1.5046), c.get("ext_ior", 1.000277), c.get("alpha_u", 0.1), c.get("alpha_v", 0.1)])[1:-1],
        cpp(c.get("reflectance", [0.5] * 3)), cpp(c.get("specular", [1] * 3)), cpp(c.get("transmittance", [1] * 3)),
        cpp(c.get("eta", [0] * 3)), cpp(c.get("k", [1] * 3))))
print("};\n")

VIEWS = [(5, 0), (35, 20), (60, 200), (82, 310)]
LIGHTS = [(0, 0), (6, 178), (30, 190), (36, 205), (58, 30), (75, 100), (83, 128)]
evaluations, samples = [], []
for index, c in enumerate(CASES):
    bsdf = make(c)
    si = mi.SurfaceInteraction3f()
    si.sh_frame = mi.Frame3f([0, 0, 1])
    si.n = [0, 0, 1]
    ctx = mi.BSDFContext()
    delta = c["type"] in ("conductor", "dielectric", "thindielectric", "plastic")
    views = VIEWS + ([(150, 40), (115, 10)] if c["type"] in ("dielectric", "thindielectric") else [])
    for view in views:
        si.wi = direction(*view)
        if c["type"] not in ("conductor", "dielectric", "thindielectric"):
            for light in LIGHTS:
                wo = direction(*light)
                v, p = bsdf.eval(ctx, si, wo), bsdf.pdf(ctx, si, wo)
                evaluations.append("    {%d, %s, %s, %s, %s}," % (index, cpp(si.wi), cpp(wo), cpp(v), cpp([p])[1:-1]))
        if delta:
            for u in [0.01, 0.5, 0.99]:
                bs, w = bsdf.sample(ctx, si, u, [0.3, 0.7])
                if not mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta):
                    continue
                samples.append("    {%d, %s, %s, %s, %s, %s}," % (index, cpp(si.wi), cpp([u])[1:-1], cpp(bs.wo), cpp(w), cpp([bs.pdf, bs.eta])[1:-1]))
print("inline const MitsubaEvaluation kMitsubaEvaluations[] = {")
print("\n".join(evaluations))
print("};\n\ninline const MitsubaSample kMitsubaSamples[] = {")
print("\n".join(samples))
print("};\n")

# An environment of 12 x 7 pixels with values 0.25 + (7 x + 13 y + 5 c + x y) mod 11, turned about an oblique axis.
width, height = 12, 7
pixels = np.array([[[0.25 + (7 * x + 13 * y + 5 * c + x * y) % 11 for c in range(3)] for x in range(width)] for y in range(height)], dtype=np.float32)
to_world = mi.ScalarTransform4f().rotate([2 / 3, 1 / 3, 2 / 3], 50)
environment = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(pixels), "to_world": to_world})
matrix = np.array(to_world.matrix)[:3, :3]
print("struct MitsubaEnvironmentValue {\n  Vec3f direction, radiance;\n  float pdf;\n};")
print("inline const float kMitsubaEnvironmentToWorld[9] = %s;" % cpp(matrix.flatten()))
print("inline const MitsubaEnvironmentValue kMitsubaEnvironment[] = {")
for theta in [1, 12, 47, 88, 91, 133, 172, 179]:
    for phi in [0.5, 44, 90, 179, 181, 266, 300, 359]:
        d = direction(theta, phi)
        si = mi.SurfaceInteraction3f()
        si.wi = [-v for v in d]
        ds = mi.DirectionSample3f()
        ds.d = d
        print("    {%s, %s, %s}," % (cpp(d), cpp(environment.eval(si)), cpp([environment.pdf_direction(mi.Interaction3f(), ds)])[1:-1]))
print("};\n\n}  // namespace octrad")
