#!/usr/bin/env python3
"""Compares octrad's materials with Mitsuba 3 on models with random parameters, in random directions.

    python3 tests/random_models.py [--tests build-test/test_shading] [--models 300] [--seed N] [--keep FILE]

Needs the mitsuba package (exit code 77 without it: skipped). Draws models as scene files give them, asks Mitsuba
(scalar_rgb) for their values and densities, and has the unit test MitsubaScattering.RandomModels compare. Without --seed
each run draws others; the seed is printed. tests/mitsuba_scattering_values.py has the fixed models, which need no Mitsuba.
"""
import argparse
import os
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
ROWS = 12
try:
    import numpy as np
    import mitsuba_scattering_values as base
    from mitsuba_scattering_values import FLAT, bsdf, checker, floats, mi, rgb, word
except ImportError as error:
    print("SKIPPED: %s (pip install mitsuba)" % error)
    sys.exit(77)

METALS = "Ag Al Au Cr Cu Ir Mo W none".split()
INSIDE = "water bk7 diamond amber pet polypropylene".split()


class Models:
    """Random models. All numbers have few digits, so that both programs read the same."""

    def __init__(self, random):
        self.random = random

    def number(self, low=0.0, high=1.0):
        return round(float(self.random.uniform(low, high)), 3)

    def chance(self, share):
        return self.random.random() < share

    def one_of(self, choices):
        return choices[self.random.integers(len(choices))]

    def color(self, name, low=0.0):
        values = [self.number(low) for _ in range(3)]
        return checker(name, *values) if self.chance(0.2) else rgb(name, *values)

    def maybe(self, *parts):
        return "".join(p() for p in parts if self.chance(0.5))

    def roughness(self):  # even in the logarithm; below .03 floats differ
        return round(0.03 * 40 ** self.random.random(), 3)

    def facets(self, uneven):
        text = word("distribution", self.one_of(["beckmann", "ggx"]))
        if uneven and self.chance(0.5):
            return text + floats(alpha_u=self.roughness(), alpha_v=self.roughness())
        return text + floats(alpha=self.roughness())

    def indices(self, above=False):
        if self.chance(0.3):
            return word("int_ior", self.one_of(INSIDE)) + self.maybe(lambda: floats(ext_ior=1.0))
        inside, outside = self.number(1.02, 2.5), self.number(1.0, 2.5)
        if above:
            inside = outside + self.number(0.1, 1.0)
        elif abs(inside / outside - 1) < 0.03:
            inside = outside + 0.2
        return floats(int_ior=round(inside, 3), ext_ior=outside)

    def nonlinear(self):
        return '<boolean name="nonlinear" value="%s"/>' % self.one_of(["true", "false"])

    def diffuse(self):
        return bsdf("diffuse", self.color("reflectance"))

    def plastic(self):
        return bsdf("plastic", self.color("diffuse_reflectance"), self.maybe(lambda: self.color("specular_reflectance")),
                    self.indices(True), self.nonlinear())

    def roughplastic(self):
        return bsdf("roughplastic", self.color("diffuse_reflectance"), self.maybe(lambda: self.color("specular_reflectance")),
                    self.indices(True), self.nonlinear(), self.facets(False), self.maybe(lambda: FLAT))

    def metal(self):
        if self.chance(0.5):
            return word("material", self.one_of(METALS))
        return rgb("eta", *(self.number(0, 3) for _ in range(3))) + rgb("k", *(self.number(0, 6) for _ in range(3)))

    def roughconductor(self):
        return bsdf("roughconductor", self.metal(), self.maybe(lambda: self.color("specular_reflectance")), self.facets(True),
                    self.maybe(lambda: FLAT))

    def roughdielectric(self):
        return bsdf("roughdielectric", self.indices(), self.maybe(lambda: rgb("specular_reflectance", self.number(), self.number(), self.number()),
                    lambda: rgb("specular_transmittance", self.number(), self.number(), self.number())), self.facets(True), self.maybe(lambda: FLAT))

    def some(self, *names, high=1.0):
        return "".join(checker(n, self.number()) if self.chance(0.2) else floats(**{n: self.number(0, high)}) for n in names if self.chance(0.5))

    def principled(self):
        return bsdf("principled", self.color("base_color"), floats(roughness=round(self.roughness() ** 0.5, 3)),
                    self.some("metallic", "anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness", "clearcoat", "clearcoat_gloss"),
                    self.maybe(lambda: floats(eta=self.number(1.05, 2.2)) if self.chance(0.5) else floats(specular=self.number())),
                    self.maybe(lambda: floats(main_specular_sampling_rate=self.number(0, 3)), lambda: floats(clearcoat_sampling_rate=self.number(0, 3)),
                               lambda: floats(diffuse_reflectance_sampling_rate=self.number(0.1, 3))))

    def principledthin(self):
        return bsdf("principledthin", self.color("base_color"), floats(roughness=round(self.roughness() ** 0.5, 3)),
                    self.some("anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness"), self.some("diff_trans", high=2.0),
                    self.maybe(lambda: floats(eta=self.number(1.05, 2.2))),
                    self.maybe(*(lambda n=n: floats(**{n: self.number(0.1, 3)})
                                 for n in ("specular_reflectance_sampling_rate", "specular_transmittance_sampling_rate",
                                           "diffuse_reflectance_sampling_rate", "diffuse_transmittance_sampling_rate"))))

    def hair(self):
        color = self.one_of([lambda: floats(eumelanin=self.number(0, 4), pheomelanin=self.number(0, 4)),
                             lambda: rgb("sigma_a", self.number(0, 2), self.number(0, 2), self.number(0, 2)), str])
        return bsdf("hair", color(), floats(longitudinal_roughness=self.number(0.15, 0.95), azimuthal_roughness=self.number(0.15, 0.95),
                                            scale_tilt=self.number(-8, 8)), self.maybe(lambda: floats(int_ior=self.number(1.2, 1.9))))

    def opaque(self):
        return self.one_of([self.diffuse, self.plastic, self.roughplastic, self.roughconductor])()

    def scattering(self):
        return self.one_of([self.opaque, self.roughdielectric, self.principled, self.principledthin])()

    def tilted(self, inside):
        return bsdf("normalmap", base.TILT, self.maybe(lambda: '<boolean name="flip_invalid_normals" value="false"/>',
                                                       lambda: '<boolean name="use_shadowing_function" value="false"/>'), inside)

    def blend(self):
        weight = floats(weight=self.number()) if self.chance(0.7) else checker("weight", self.number())
        part = lambda: self.one_of([self.scattering, self.scattering, self.two_sides, lambda: self.tilted(self.opaque())])()
        return bsdf("blendbsdf", weight, part(), part())

    def two_sides(self):
        return bsdf("twosided", self.opaque(), self.maybe(self.opaque))

    def model(self):
        plain = self.one_of([self.opaque, self.plastic, self.roughplastic, self.roughconductor, self.roughdielectric, self.principled,
                             self.principled, self.principledthin, self.hair, self.blend, self.two_sides,
                             lambda: self.tilted(self.scattering()), lambda: self.tilted(self.two_sides())])()
        if "hair" not in plain and self.chance(0.15):
            return bsdf("mask", floats(opacity=self.number()), plain)
        return plain


def rows_of(xml, random):
    """Rows of ten numbers: directions wo and wi, value, density."""
    model, rows, tries = base.load(xml), [], 0
    while len(rows) < ROWS and tries < 20 * ROWS:
        tries += 1
        # In a blend seen from behind, Mitsuba's principled has a density where it draws nothing.
        above = "hair" in xml or ("blendbsdf" in xml and '"principled"' in xml)
        si = base.interaction(base.view(random, tries, above))
        wi = base.unit(random)
        if tries % 2:
            sample, weight = model.sample(base.ctx, si, random.random(), random.random(2))
            if not max(weight) > 0 or mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta) or mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null):
                continue
            wi = np.array(sample.wo) + random.normal(size=3) * 0.02
            wi /= np.linalg.norm(wi)
        value, density = model.eval(base.ctx, si, wi), model.pdf(base.ctx, si, wi)
        if 0 < density < 1e-3:  # floats break down far off the mirror direction
            continue
        rows.append([*map(float, [*si.wi, *wi, *value]), float(density)])
    return rows


def main():
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("--tests", default=os.path.join(ROOT, "build-test", "test_shading"), help="the program of the module's unit tests")
    p.add_argument("--models", type=int, default=300)
    p.add_argument("--seed", type=int, default=int.from_bytes(os.urandom(4), "little"))
    p.add_argument("--keep", help="the file of values, kept")
    args = p.parse_args()
    print("seed %d" % args.seed)
    random = np.random.default_rng(args.seed)
    drawn = Models(random)
    models = [drawn.model() for _ in range(args.models)]
    rows = [rows_of(xml, random) for xml in models]
    with tempfile.TemporaryDirectory() as folder:
        path = args.keep or os.path.join(folder, "models.txt")
        with open(path, "w") as out:
            for xml, of_model in zip(models, rows):
                out.write("\n".join([xml, str(len(of_model)), *(" ".join("%.9g" % x for x in row) for row in of_model)]) + "\n")
        print("%d models, %d rows" % (len(models), sum(map(len, rows))), flush=True)
        run = subprocess.run([args.tests, "--gtest_filter=MitsubaScattering.RandomModels"], env={**os.environ, "OCTRAD_MITSUBA_VALUES": path},
                             stdout=subprocess.PIPE, text=True)
    print(run.stdout, end="")
    return run.returncode or "[       OK ] MitsubaScattering.RandomModels" not in run.stdout


if __name__ == "__main__":
    sys.exit(main())
