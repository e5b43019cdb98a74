#!/usr/bin/env python3
"""Writes src/octrad/scene/mitsuba_spectra_test_data.h: the linear RGB that Mitsuba 3 (scalar_rgb) makes of spectra.

    python3 tests/mitsuba_spectra.py > src/octrad/scene/mitsuba_spectra_test_data.h

Needs `pip install mitsuba`. The unit test scene/spectrum_test.cc compares ours with these numbers.
"""
import mitsuba as mi

mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)

SPECTRA = [
    "400:0.1, 500:0.5, 600:0.9, 700:0.3",
    "360:0.5 830:0.5",
    "400:0.78, 500:0.78, 600:0.78, 700:0.78",
    "400:2 700:2",
    "500:0.5 500.5:1 600:0.4",
    "300:0.2, 450:0.9, 900:0.1",
    "400:0, 400.0001:12.5, 550:3, 700:8",
]


def emission(text):
    scene = mi.load_string('<scene version="3.0.0"><shape type="rectangle"><emitter type="area"><spectrum name="radiance" value="%s"/></emitter></shape></scene>' % text)
    si = mi.SurfaceInteraction3f()
    si.wi = [0, 0, 1]
    return scene.emitters()[0].eval(si)


def reflectance(text):
    parameters = mi.traverse(mi.load_string('<bsdf version="3.0.0" type="diffuse"><spectrum name="reflectance" value="%s"/></bsdf>' % text))
    return parameters["reflectance.value"]


def index(text):
    parameters = mi.traverse(mi.load_string('<bsdf version="3.0.0" type="conductor"><spectrum name="eta" value="%s"/><float name="k" value="1"/></bsdf>' % text))
    return parameters["eta.value"]


def row(rgb):
    return "{%s}" % ", ".join("%.9gf" % float(v) if float(v) != int(float(v)) else "%d.0f" % float(v) for v in rgb)


print("""// Written by tests/mitsuba_spectra.py with Mitsuba %s; do not edit.
#pragma once

#include "octrad/base/vec.h"

namespace octrad::testing {

struct MitsubaSpectrum {
  const char* text;
  Vec3f emission, reflectance, index;
};
inline const MitsubaSpectrum kMitsubaSpectra[] = {""" % mi.__version__)
for text in SPECTRA:
    print('    {"%s", %s, %s, %s},' % (text, row(emission(text)), row(reflectance(text)), row(index(text))))
print("};\n\n}  // namespace octrad::testing")
