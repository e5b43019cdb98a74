#!/usr/bin/env python3
"""bench/sparse_reference.py: blocks of a view have the pixels of a whole picture's size; bench/quality.py measures at them."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "cli"))
import exr  # noqa: E402

try:
    import numpy as np
except ImportError:
    np = None

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))
SCENE = str(ROOT / "scenes" / "cornell-box" / "scene.xml")
VIEW = ("--origin", "0,1,2.5", "--target", "0,1,0", "--fov", "60")


def bench(script, *words):
    return subprocess.run([sys.executable, str(ROOT / "bench" / script), *map(str, words)], capture_output=True, text=True)


def read_pfm(path):
    return np.array(exr.read_pfm(path)).reshape(-1, 48, 3)


@unittest.skipIf(np is None, "SKIPPED: no numpy")
class SparseReference(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="octrad-sparse-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def make(self, name, *words):
        done = bench("sparse_reference.py", SCENE, "--octrad", PROGRAM, "--width", 48, "--height", 32, "--blocks", 6, "-o", self.folder / name, *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads((self.folder / name / "about.json").read_text())

    def test_blocks_are_what_a_whole_picture_shows(self):
        about = self.make("few", "--spp", 64, *VIEW)
        reference, mask = (read_pfm(self.folder / "few" / f"{name}.pfm") for name in ("reference", "mask"))
        halves = [read_pfm(self.folder / "few" / f"half_{h}.pfm") for h in "ab"]
        self.assertEqual(reference.shape, (32, 48, 3))
        self.assertEqual(about["pixels"], 6 * 64)
        self.assertEqual(np.count_nonzero(mask[..., 0]), 6 * 64)
        self.assertFalse(reference[mask == 0].any())
        self.assertTrue(np.allclose(reference, (halves[0] + halves[1]) / 2, atol=1e-6))
        self.assertFalse((halves[0] == halves[1])[mask > 0].all())
        whole = self.folder / "whole.pfm"
        subprocess.run([PROGRAM, "render", SCENE, "--integrator", "path", "--max-depth", "-1", "--device", "cpu", "--width", "48", "--height", "32",
                        "--spp", "256", *VIEW, "-q", "-o", str(whole)], check=True)
        seen, there = mask > 0, read_pfm(whole)
        self.assertLess(abs(reference[seen].mean() / there[seen].mean() - 1), 0.08)
        # Independent errors of both add in squares; the whole picture has half of the reference's.
        off = np.mean(np.abs(reference - there)[seen] / (there[seen] + 0.01))
        self.assertGreater(off, 0.6 * about["noise"])
        self.assertLess(off, 2.0 * about["noise"])

        before = (self.folder / "few" / "about.json").stat().st_mtime_ns
        self.make("few", "--spp", 4)  # there already
        self.assertEqual((self.folder / "few" / "about.json").stat().st_mtime_ns, before)

    def test_fields_are_measured_there(self):
        self.make("few", "--spp", 16, *VIEW)
        pictures, rows = self.folder / "pictures", self.folder / "rows.json"

        def measure(*words):
            done = bench("quality.py", SCENE, "--octrad", PROGRAM, "--fields", "octaoctree", "--steps", 3, "--spp", 4, "--block-spp", 8,
                         "--view", f"own={self.folder / 'few'}", "--pictures", pictures, "-o", rows, *words)
            self.assertEqual(done.returncode, 0, done.stderr)
            row, = json.loads(rows.read_text())["rows"]
            return row

        row = measure()
        blocks, mask = read_pfm(pictures / "octaoctree_own_blocks.pfm"), read_pfm(self.folder / "few" / "mask.pfm")
        self.assertTrue(blocks[mask > 0].all())
        self.assertFalse(blocks[mask == 0].any())
        compared = json.loads(subprocess.run([PROGRAM, "compare", self.folder / "few" / "reference.pfm", pictures / "octaoctree_own_blocks.pfm",
                                              "--mask", self.folder / "few" / "mask.pfm", "--json", "-q"], check=True, stdout=subprocess.PIPE).stdout)["images"][0]
        self.assertEqual(compared["pixels"], 6 * 64)
        self.assertEqual(row["mape"], compared["mape"])
        self.assertGreater(row["noise"], 0)

        trained = (pictures / "octaoctree.octrad").stat().st_mtime_ns
        self.assertEqual(measure()["mape"], row["mape"])
        self.assertEqual((pictures / "octaoctree.octrad").stat().st_mtime_ns, trained)  # not again
        measure("-D", "adam.beta2=0.9")
        self.assertNotEqual((pictures / "octaoctree.octrad").stat().st_mtime_ns, trained)  # another training

        # After a training that failed nothing says what the model is.
        refused = bench("quality.py", SCENE, "--octrad", PROGRAM, "--fields", "octaoctree", "--steps", 3, "-D", "adam.beta2=7",
                        "--view", f"own={self.folder / 'few'}", "--pictures", pictures)
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("adam.beta2", refused.stderr)
        self.assertFalse((pictures / "octaoctree.json").exists())
        measure()
        (pictures / "octaoctree.octrad").unlink()
        self.assertEqual(measure()["mape"], row["mape"])

    def test_what_octrad_refuses(self):
        done = bench("sparse_reference.py", SCENE, "--octrad", PROGRAM, "--blocks", 1, "--spp", 1, "-o", self.folder / "bad", "--camera", "nowhere.json")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("nowhere.json", done.stderr)
        self.assertFalse((self.folder / "bad" / "about.json").exists())


if __name__ == "__main__":
    unittest.main()
