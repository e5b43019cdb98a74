#!/usr/bin/env python3
"""The model file, read by tests/numpy_query.py, says what `octrad query` says. Usage: OCTRAD=path/to/octrad test_numpy_query.py"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import numpy_query  # noqa: E402

PROGRAM = os.environ.get("OCTRAD", str(HERE.parent / "build" / "octrad"))
SCENE = str(HERE.parent / "scenes" / "cornell-box" / "scene.xml")
SMALL = ["--steps", "30", "-D", "train.points=256", "-D", "train.directions=2", "-D", "octree.levels=4", "-D", "decoder.width=32",
         "-D", "adam.warmup=0"]


class OctahedralMap(unittest.TestCase):
    """The independent reader has to be right itself."""

    def setUp(self):
        self.directions = np.random.default_rng(1).normal(size=(4000, 3))

    def test_weights(self):
        for resolution in (2, 4, 16):
            rows, weights = numpy_query.triangle(numpy_query.octahedral(self.directions), resolution)
            self.assertGreaterEqual(weights.min(), -1e-12)
            np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
            self.assertEqual(len(np.unique(rows[weights > 1e-9])), resolution ** 2 + 2)

    def test_continuous_across_seams(self):
        values = np.random.default_rng(2).normal(size=17 * 17)
        at = lambda v: (values[numpy_query.triangle(numpy_query.octahedral(v), 16)[0]] * numpy_query.triangle(numpy_query.octahedral(v), 16)[1]).sum(axis=1)
        for axis in range(3):
            a, b = self.directions.copy(), self.directions.copy()
            a[:, axis], b[:, axis] = 1e-9, -1e-9
            np.testing.assert_allclose(at(a), at(b), atol=1e-6)


def sample_points(model, count):
    """Points in occupied cells of the finest level, with directions and materials of every kind."""
    rng = np.random.default_rng(3)
    origin, size = model.tensors["octree.origin"], model.tensors["octree.size"]
    levels = model.config["octree"]["levels"]
    name = "octree.level%d.cells" % levels
    if name in model.tensors:
        cells = model.tensors[name]
        p = (cells[rng.integers(len(cells), size=count)] + rng.random((count, 3))) / 2 ** (levels + 1)
    else:
        p = rng.random((count, 3))
    p[::50] = 5 * p[::50] - 2                         # some beside the domain
    unit = lambda v: v / np.linalg.norm(v, axis=1, keepdims=True)
    n, wo = unit(rng.normal(size=(count, 3))), unit(rng.normal(size=(count, 3)))
    wo *= np.where((wo * n).sum(axis=1, keepdims=True) < 0, -1, 1)
    n[0], wo[0] = (0, 0, 1), (0, 0, 1)                # axis-aligned: on the seams of the map
    n[1], wo[1] = (0, 0, -1), (0, 0, -1)
    n[2], wo[2] = (-1, 0, 0), (-1, 0, 0)
    alpha = rng.choice([0.0, 0.02, 0.2, 0.49, 0.5, 1.0], size=(count, 1))
    traced = "disparity" in numpy_query.columns(model.config)
    reflected = numpy_query.looks_up_reflected(model.config)
    clusters = 0 if traced else (len(numpy_query.columns(model.config)) - 13) // 3
    hits = rng.random((count, clusters, 3)) * (size.max(), 0.2 * size.max(), 0.3) * (rng.random((count, clusters, 1)) < 0.7)
    more = 3 * rng.random((count, 1)) / size.max() if traced else hits.reshape(count, -1)
    if reflected:                                     # some rays meet nothing
        met, far = rng.choice([0.0, 1.0, 1.0], size=(count, 1)), rng.choice([0.1, 1.0], size=(count, 1))
        more = np.column_stack([more, met, far, unit(rng.normal(size=(count, 3))), rng.random((count, 3)), 3 * rng.random((count, 3))])
    points = np.column_stack([origin + p * size, wo, n, rng.random((count, 3)), alpha, more])
    return points.astype(np.float32)


class Query(unittest.TestCase):
    def compare(self, *options):
        with tempfile.TemporaryDirectory() as folder:
            path = lambda name: os.path.join(folder, name)
            run = lambda *words: subprocess.run([PROGRAM, *words], check=True, capture_output=True, timeout=600)
            run("train", SCENE, "-o", path("m.octrad"), "-q", *SMALL, *options)
            model = numpy_query.Model(path("m.octrad"))
            points = sample_points(model, 600)
            np.savetxt(path("points.csv"), points, fmt="%.9g", delimiter=",", header=",".join(numpy_query.columns(model.config)), comments="")
            run("query", path("m.octrad"), "--device", "cpu", "--points", path("points.csv"), "-o", path("out.csv"))
            disparity, features, radiance = model.query(numpy_query.read_points(path("points.csv"), numpy_query.columns(model.config)))
            with open(path("out.csv")) as file:
                header = file.readline().strip().split(",")
                rows = np.array([[float(v) for v in line.split(",")] for line in file])
        self.assertEqual(header, ["disparity"] + ["f%d" % i for i in range(features.shape[1])] + ["r", "g", "b"])
        # Something was learned: an untrained table of zeros would agree with anything.
        self.assertGreater(np.abs(features).max(), 1e-3)
        for name, ours, theirs in (("disparity", disparity, rows[:, 0]), ("features", features, rows[:, 1:-3]), ("radiance", radiance, rows[:, -3:])):
            with self.subTest(name):
                np.testing.assert_allclose(theirs, ours, atol=1e-4, rtol=1e-4)

    def test_cpu_preset(self):
        self.compare("--preset", "cpu")

    def test_fine_levels(self):
        self.compare("--preset", "cpu", "-D", "octree.fine=2")

    def test_nothing_reflected(self):
        self.compare("--preset", "cpu", "-D", "lookup.reflected=none")

    def test_reflected_along_outgoing_directions(self):
        self.compare("--preset", "cpu", "-D", "lookup.direction=outgoing", "-D", "lookup.rough_threshold=0.3",
                     "-D", "lookup.rough_direction=mirror")

    def test_predicted_offset(self):
        self.compare("-D", "lookup.offset=predicted")

    def test_paper_preset(self):
        self.compare("--preset", "paper", "-D", "train.quarters=false", "-D", "disparity.log2_table=14")

    def test_nearest_and_two_features(self):
        self.compare("-D", "octree.interpolation=nearest", "-D", "octa.interpolation=nearest", "-D", "octree.features=2",
                     "-D", "lookup.rough_direction=mirror")

    def test_outgoing_without_offset(self):
        self.compare("-D", "lookup.direction=outgoing", "-D", "lookup.offset=none", "-D", "octree.features=8", "-D", "target.demodulate=none")

    def test_emission_inside(self):
        """Not demodulated and not by lobes, whatever the keys say, which stay as they were given."""
        keys = ["-D", "target.emission=inside", "-D", "target.demodulate=albedo"]
        self.compare(*keys)
        self.compare(*keys, "-D", "lookup.coats=joined")
        self.compare(*keys, "--field", "nr", "-D", "nr.width=32", "-D", "nr.log2_table=14")
        self.compare(*keys, "--field", "ncr", "-D", "ncr.log2_table=14", "-D", "ncr.cone.log2_table=14")

    def test_neural_radiosity(self):
        self.compare("--field", "nr", "-D", "nr.width=32", "-D", "nr.log2_table=14", "-D", "nr.scale=1.7")

    def test_neural_cone_radiosity(self):
        small = ["--field", "ncr", "-D", "ncr.log2_table=14", "-D", "ncr.cone.log2_table=14"]
        self.compare(*small)
        self.compare(*small, "--preset", "paper", "-D", "train.quarters=false", "-D", "ncr.clusters=2", "-D", "ncr.cone.scale=1.5",
                     "-D", "ncr.rays.train=16")

    def test_cones_need_their_columns(self):
        with tempfile.TemporaryDirectory() as folder:
            path = lambda name: os.path.join(folder, name)
            subprocess.run([PROGRAM, "train", SCENE, "-o", path("m.octrad"), "-q", *SMALL, "--field", "ncr",
                            "-D", "ncr.log2_table=10", "-D", "ncr.cone.log2_table=10"], check=True, timeout=600)
            np.savetxt(path("points.csv"), np.zeros((1, 13)), delimiter=",", header=",".join(numpy_query.COLUMNS), comments="")
            done = subprocess.run([PROGRAM, "query", path("m.octrad"), "--points", path("points.csv")], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn('lacks the column "t0"', done.stderr)
        self.assertIn("share n of each cluster", done.stderr)


if __name__ == "__main__":
    unittest.main()
