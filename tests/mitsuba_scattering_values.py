#!/usr/bin/env python3
"""Prints scattering values and densities of Mitsuba 3 for models given as scene files give them, as a C++ header.

    python3 tests/mitsuba_scattering_values.py > src/octrad/shading/mitsuba_scattering_test_data.h
    python3 tests/mitsuba_scattering_values.py --samples > src/octrad/shading/mitsuba_sampling_test_data.h

Needs the mitsuba package. Directions: uniform over the sphere on both sides of the surface, grazing, and drawn from the model.
With --samples, in a few minutes: means over what Mitsuba samples for random numbers, of these models and of plastics and metals.
"""
import math
import os
import sys
import tempfile

import mitsuba as mi
import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "cli"))

from measured_file import measured_file  # noqa: E402

mi.set_variant("scalar_rgb")

ROWS = 18
UV = (0.3, 0.6)  # of every evaluation


def rgb(name, *v):
    return '<rgb name="%s" value="%s"/>' % (name, " ".join(map(str, v)))


def floats(**parameters):
    return "".join('<float name="%s" value="%s"/>' % p for p in parameters.items())


def word(name, value):
    return '<string name="%s" value="%s"/>' % (name, value)


def checker(name, *v):
    """A texture of one value: Mitsuba 3.9.1 exchanges the two of a checkerboard where it serves as a number."""
    value = " ".join(map(str, v * (3 // len(v))))
    return '<texture name="%s" type="checkerboard"><rgb name="color0" value="%s"/><rgb name="color1" value="%s"/></texture>' % (name, value, value)


def bsdf(kind, *inside):
    return '<bsdf type="%s">%s</bsdf>' % (kind, "".join(inside))


GLASS = rgb("specular_reflectance", 0.9, 1, 0.8) + rgb("specular_transmittance", 0.5, 0.6, 0.7)
COLOR = rgb("base_color", 0.7, 0.3, 0.1)
FLAT = '<boolean name="sample_visible" value="false"/>'
RED = bsdf("diffuse", rgb("reflectance", 0.8, 0.2, 0.1))
METAL = bsdf("roughconductor", floats(alpha=0.3), word("material", "Au"), word("distribution", "ggx"))
# A map of one direction; the test writes the same file.
TILT_COLOR = (0.75, 0.625, 0.875)
TILT = '<texture name="normalmap" type="bitmap"><string name="filename" value="tilt.exr"/><boolean name="raw" value="true"/></texture>'
PARTS = (0, 1, 2, 4, 8)
CASES = [
    bsdf("roughdielectric", floats(alpha=0.3), word("distribution", "beckmann"), GLASS),
    bsdf("roughdielectric", floats(alpha=0.3), word("distribution", "ggx"), GLASS),
    bsdf("roughdielectric", floats(alpha_u=0.5, alpha_v=0.15), word("distribution", "ggx")),
    bsdf("roughdielectric", floats(alpha_u=0.1, alpha_v=0.4), word("distribution", "beckmann"), word("int_ior", "water")),
    bsdf("roughdielectric", floats(alpha=0.2), word("distribution", "ggx"), FLAT),
    bsdf("roughdielectric", floats(alpha=0.25, int_ior=1.2, ext_ior=1.7), word("distribution", "beckmann"), FLAT),
    bsdf("roughdielectric", checker("alpha", 0.6)),
    bsdf("principled"),
    bsdf("principled", COLOR, floats(roughness=0.2, metallic=1)),
    bsdf("principled", COLOR, floats(roughness=0.4, metallic=0.6, anisotropic=0.8, spec_tint=0.5, specular=0.9)),
    bsdf("principled", COLOR, floats(roughness=0.3, spec_trans=1, eta=1.5)),
    bsdf("principled", COLOR, floats(roughness=0.5, spec_trans=0.6, metallic=0.2, eta=1.33, anisotropic=0.5, spec_tint=0.7)),
    bsdf("principled", COLOR, floats(roughness=0.7, clearcoat=1, clearcoat_gloss=0.3, sheen=0.8, sheen_tint=0.6, flatness=0.5)),
    bsdf("principled", COLOR, floats(roughness=0.6, metallic=0.1, specular=0.6, spec_tint=0.4, anisotropic=0.5, sheen=0.3, sheen_tint=0.2, flatness=0.3,
                                     clearcoat=0.6, clearcoat_gloss=0.9, spec_trans=0.4, main_specular_sampling_rate=2, clearcoat_sampling_rate=0.5,
                                     diffuse_reflectance_sampling_rate=0.7)),
    bsdf("principled", checker("base_color", 0.2, 0.5, 0.9), checker("roughness", 0.35), checker("metallic", 0.3),
         checker("spec_trans", 0.5), checker("clearcoat", 0.8), checker("sheen", 0.5)),
    bsdf("principledthin"),
    bsdf("principledthin", COLOR, floats(roughness=0.3, spec_trans=0.8, eta=1.33, diff_trans=0.3, anisotropic=0.5, spec_tint=0.1)),
    bsdf("principledthin", COLOR, floats(roughness=0.6, spec_trans=0.3, diff_trans=1.2, spec_tint=0.9, sheen=0.7, sheen_tint=0.5, flatness=0.6,
                                         specular_reflectance_sampling_rate=2, specular_transmittance_sampling_rate=0.5,
                                         diffuse_reflectance_sampling_rate=0.3, diffuse_transmittance_sampling_rate=3)),
    bsdf("principledthin", COLOR, checker("eta", 0.9), checker("diff_trans", 0.9), floats(roughness=0.4, spec_trans=0.5)),
    bsdf("blendbsdf", floats(weight=0.3), RED, METAL),
    bsdf("blendbsdf", checker("weight", 0.6), bsdf("roughdielectric", floats(alpha=0.3)), bsdf("blendbsdf", floats(weight=0.25), METAL, bsdf("twosided", RED))),
    bsdf("blendbsdf", floats(weight=0.5), bsdf("normalmap", TILT, METAL), bsdf("principled", COLOR)),
    bsdf("mask", floats(opacity=0.4), bsdf("roughdielectric", floats(alpha=0.2))),
    bsdf("normalmap", TILT, RED),
    bsdf("normalmap", TILT, bsdf("roughdielectric", floats(alpha_u=0.4, alpha_v=0.2))),
    bsdf("normalmap", TILT, '<boolean name="flip_invalid_normals" value="false"/><boolean name="use_shadowing_function" value="false"/>', METAL),
    bsdf("twosided", bsdf("normalmap", TILT, METAL)),
    bsdf("normalmap", TILT, bsdf("twosided", METAL)),
    bsdf("hair"),
    bsdf("hair", rgb("sigma_a", 0.02, 0.1, 0.4), floats(scale=2, longitudinal_roughness=0.1, azimuthal_roughness=0.6, scale_tilt=6), word("int_ior", "water")),
    bsdf("hair", floats(eumelanin=0, pheomelanin=0.4, longitudinal_roughness=0.9, azimuthal_roughness=0.2, scale_tilt=-3, int_ior=1.9, ext_ior=1.3)),
    *(bsdf("measured", word("filename", "part%d.bsdf" % part)) for part in PARTS),  # the test writes the same files
]
# Perfect lobes and light that passes: what is drawn for a number.
DELTAS = [
    bsdf("null"),
    bsdf("blendbsdf", floats(weight=0.3), bsdf("dielectric"), bsdf("conductor", word("material", "Cu"))),
    bsdf("blendbsdf", floats(weight=0.4), RED, bsdf("null")),
]

# Models of mitsuba_bsdf_values.py with other lobes than perfect ones: what is sampled is compared of them as well.
COPPER = rgb("eta", 0.2004, 0.9240, 1.1022) + rgb("k", 3.9129, 2.4528, 2.1421)
OTHERS = [
    bsdf("diffuse", rgb("reflectance", 0.7, 0.3, 0.1)),
    bsdf("plastic", rgb("diffuse_reflectance", 0.5, 0.25, 0.1)),
    bsdf("plastic", rgb("diffuse_reflectance", 0.8, 0.25, 0.1), rgb("specular_reflectance", 0.7, 0.8, 0.9), floats(int_ior=1.9, ext_ior=1),
         '<boolean name="nonlinear" value="true"/>'),
    *(bsdf("roughconductor", word("distribution", distribution), COPPER, inside, visible)
      for distribution in ("beckmann", "ggx") for visible in ("", FLAT)
      for inside in (floats(alpha=0.15), floats(alpha_u=0.4, alpha_v=0.1) + rgb("specular_reflectance", 0.5, 0.6, 0.7))),
    *(bsdf("roughplastic", word("distribution", distribution), floats(alpha=alpha, int_ior=1.5, ext_ior=1), rgb("diffuse_reflectance", 0.6, 0.3, 0.1),
           rgb("specular_reflectance", 1, 0.9, 0.8), '<boolean name="nonlinear" value="%s"/>' % nonlinear)
      for distribution in ("beckmann", "ggx") for alpha in (0.05, 0.1, 0.4) for nonlinear in ("false", "true")),
    bsdf("roughplastic", word("distribution", "ggx"), floats(alpha=0.2, int_ior=1.9), rgb("diffuse_reflectance", 0.6, 0.3, 0.1), FLAT),
]
SHIFTS, POINTS = 32, 4096  # random numbers of --samples: a lattice (Roberts 2018, "R3"), shifted at random


def cpp(values):
    return "{" + ", ".join(("%.7gf" % v) if set(".en") & set("%.7g" % v) else "%.7g.0f" % v for v in values) + "}"


def short(values):
    return cpp(float("%.5g" % v) for v in values)


def interaction(wi):
    si = mi.SurfaceInteraction3f()
    si.sh_frame = mi.Frame3f([0, 0, 1])
    si.n = [0, 0, 1]
    si.dp_du, si.dp_dv = [1, 0, 0], [0, 1, 0]
    si.uv = UV
    si.wi = wi
    return si


def unit(random):
    v = random.normal(size=3)
    return v / np.linalg.norm(v)


def view(random, row, outside):
    v = unit(random)
    if row % 3 or outside:
        v[2] = abs(v[2])
    if row % 6 == 5:  # grazing
        v[2] *= 0.05
    return v / np.linalg.norm(v)


def load(case):
    with tempfile.TemporaryDirectory() as folder:
        path = folder + "/tilt.exr"
        mi.Bitmap(np.full((2, 2, 3), TILT_COLOR, np.float32)).write(path)
        for part in PARTS:
            with open(os.path.join(folder, "part%d.bsdf" % part), "wb") as out:
                out.write(measured_file(part))
        return mi.load_string(case.replace("<bsdf ", '<bsdf version="3.0.0" ', 1).replace("tilt.exr", path).replace("part", folder + "/part"))


ctx = mi.BSDFContext()


def print_values():
    print("""// Written by tests/mitsuba_scattering_values.py with Mitsuba %s. Not to be edited.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

struct MitsubaScattering {
  int material;
  Vec3f wo, wi, value;
  float pdf;
};
struct MitsubaDelta {
  int material;
  Vec3f wo;
  float u_lobe;
  Vec3f wi, weight;
  float pdf;
};
inline constexpr Vec2f kMitsubaUv{%s};
inline constexpr Vec3f kMitsubaTilt{%s};  // every pixel of tilt.exr

inline const char* const kMitsubaBsdfs[] = {""" % (mi.__version__, cpp(UV)[1:-1], cpp(TILT_COLOR)[1:-1]))
    for case in CASES + DELTAS:
        print("    R\"(%s)\"," % case)
    print("};\n\ninline const MitsubaScattering kMitsubaScattering[] = {")
    for index, case in enumerate(CASES):
        model = load(case)
        random = np.random.default_rng(index)
        row = 0
        while row < ROWS:
            si = interaction(view(random, row, "hair" in case))  # what hair does inside is not asked for
            wi = unit(random)
            if row % 2:
                sample, weight = model.sample(ctx, si, random.random(), random.random(2))
                if not max(weight) > 0 or mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta):
                    row += 1 if random.random() < 0.02 else 0  # a model that is black from here
                    continue
                wi = np.array(sample.wo) + random.normal(size=3) * 0.02
                wi /= np.linalg.norm(wi)
            value, pdf = model.eval(ctx, si, wi), model.pdf(ctx, si, wi)
            # Floats break down where facets are many orders of magnitude off the mirror direction.
            if 0 < pdf < 1e-6:
                continue
            print("    {%d, %s, %s, %s, %s}," % (index, cpp(si.wi), cpp(wi), cpp(value), cpp([pdf])[1:-1]))
            row += 1
    print("};\n\ninline const MitsubaDelta kMitsubaDeltas[] = {")
    for index, case in enumerate(DELTAS, len(CASES)):
        model = load(case)
        for wi in ([0.6, 0, 0.8], [0.1, -0.2, math.sqrt(0.95)], [0.3, 0.4, -math.sqrt(0.75)]):
            for u in (0.05, 0.29, 0.35, 0.7, 0.99):
                sample, weight = model.sample(ctx, interaction(wi), u, [0.3, 0.7])
                if max(weight) > 0 and mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta):
                    print("    {%d, %s, %s, %s, %s, %s}," % (index, cpp(wi), cpp([u])[1:-1], cpp(sample.wo), cpp(weight), cpp([sample.pdf])[1:-1]))
    print("};\n\n}  // namespace octrad")


def row_of(weight, wi, share=1):
    """What --samples takes means of: a sample's weight, whether it carries light, whether this goes below, and its direction: plain, and times the
    mean weight of the channels."""
    mean = sum(weight) / 3
    return [*weight, share, share * (wi[2] < 0), *(share * x for x in wi), *(mean * x for x in wi)]


def sampled(model, view, numbers, by_eval):
    si = interaction(view)
    rows = []
    for u, v, w in numbers.tolist():
        sample, weight = model.sample(ctx, si, u, [v, w])
        if not max(weight) > 0:
            rows.append([0] * 11)
            continue
        if by_eval:
            weight = model.eval(ctx, si, sample.wo) / model.pdf(ctx, si, sample.wo)
        rows.append(row_of([*weight], [*sample.wo]))
    return np.array(rows, float)


def integrated(model, view, numbers):
    """The same means as integrals of eval and pdf over the sphere; y, along hair, is stratified."""
    si = interaction(view)
    rows = []
    for u, v, _ in numbers.tolist():
        y, phi = 1 - 2 * u, 2 * math.pi * v
        wi = [math.sqrt(1 - y * y) * math.cos(phi), y, math.sqrt(1 - y * y) * math.sin(phi)]
        rows.append(row_of([*model.eval(ctx, si, wi)], wi, model.pdf(ctx, si, wi)))
    return 4 * math.pi * np.array(rows, float)


def print_samples():
    print("""// Written by tests/mitsuba_scattering_values.py --samples with Mitsuba %s. Not to be edited.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

// Means over samples, those that carry no light counted as 0: weight; share that carries light, and share that does so
// below the surface; direction; direction times the mean of the weight's channels. And their standard errors.
struct MitsubaSampling {
  int material;  // of kMitsubaBsdfs, then of kMitsubaOtherBsdfs
  Vec3f wo;
  float mean[11], error[11];
};

inline const char* const kMitsubaOtherBsdfs[] = {""" % mi.__version__)
    for case in OTHERS:
        print("    R\"(%s)\"," % case)
    print("};\n\ninline const MitsubaSampling kMitsubaSampling[] = {")
    root = 1.2207440846057596
    lattice = np.outer(np.arange(POINTS), [1 / root, 1 / root**2, 1 / root**3])
    for index, case in enumerate(CASES + DELTAS + OTHERS):
        if case == DELTAS[0]:
            continue
        model = load(case)
        random = np.random.default_rng([index, 1])
        above, slant, below, grazing = ([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)]
                                        for t, p in np.radians([(20, 40), (65, 200), (130, 310), (84, 310)]))
        # Mitsuba's rough glass that samples all normals draws them from a wider distribution, which its weights leave out.
        by_eval = "roughdielectric" in case and FLAT in case
        black = "hair" in case or not sampled(model, below, random.random((200, 3)), by_eval).any()
        for wo in (above, slant, grazing if black else below):
            numbers = np.minimum((lattice + random.random((SHIFTS, 1, 3))) % 1, 0.9999999)
            # Its hair samples what is reflected inside more than once in the plane y = 0 only, which its pdf does not say.
            means = np.array([(integrated(model, wo, u) if "hair" in case else sampled(model, wo, u, by_eval)).mean(0) for u in numbers])
            print("    {%d, %s, %s, %s}," % (index, cpp(wo), short(means.mean(0)), short(means.std(0, ddof=1) / math.sqrt(SHIFTS))))
    print("};\n\n}  // namespace octrad")


if __name__ == "__main__":
    if sys.argv[1:] == ["--samples"]:
        print_samples()
    else:
        print_values()
