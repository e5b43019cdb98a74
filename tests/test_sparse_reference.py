#!/usr/bin/env python3
"""bench/sparse_reference.py: its pixels are those of a whole picture; bench/quality.py measures at them."""
import array
import csv
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "cli"))
import exr  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))
SCENE = str(ROOT / "scenes" / "cornell-box" / "scene.xml")
VIEW = ("--origin", "0,1,2.5", "--target", "0,1,0", "--fov", "60")
PIXELS = 24 * 16  # cells of 2 x 2 pixels


def bench(script, *words):
    return subprocess.run([sys.executable, str(ROOT / "bench" / script), *map(str, words)], capture_output=True, text=True)


def octrad(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, stdout=subprocess.PIPE).stdout


def red(path):
    """The red channel of a picture of 48 x 32 pixels, row by row."""
    width, height, channels, _ = exr.read_exr(str(path))
    assert (width, height) == (48, 32)
    return array.array("f", channels["R"])


class SparseReference(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="octrad-sparse-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.few = self.folder / "few"

    def make(self, *words):
        done = bench("sparse_reference.py", SCENE, "--octrad", PROGRAM, "--width", 48, "--height", 32, "--pixels", PIXELS, "-o", self.few, *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads((self.few / "about.json").read_text())

    def mask(self):
        """One flag a pixel, row by row from the top."""
        return [v > 0 for v in exr.read_pfm(str(self.few / "mask.pfm"))[::3]]

    def test_pixels_are_those_of_a_whole_picture(self):
        about = self.make("--spp", 64, *VIEW)
        mask, reference = self.mask(), red(self.few / "reference.exr")
        a, b = red(self.few / "half_a.exr"), red(self.few / "half_b.exr")
        self.assertEqual((about["pixels"], sum(mask)), (PIXELS, PIXELS))
        for y in range(0, 32, 2):  # one in each cell
            for x in range(0, 48, 2):
                self.assertEqual(sum(mask[(y + dy) * 48 + x + dx] for dy in (0, 1) for dx in (0, 1)), 1)
        self.assertFalse(any(v for v, m in zip(reference, mask) if not m))
        for p in range(48 * 32):
            self.assertAlmostEqual(reference[p], (a[p] + b[p]) / 2, delta=1e-5 * (1 + reference[p]))
        self.assertGreater(sum(x != y for x, y in zip(a, b)), 0.9 * PIXELS)
        whole = self.folder / "whole.exr"
        octrad("render", SCENE, "--integrator", "path", "--max-depth", -1, "--device", "cpu", "--width", 48, "--height", 32, "--spp", 256, *VIEW, "-q", "-o", whole)
        octrad("render", SCENE, "--integrator", "path", "--max-depth", -1, "--device", "cpu", "--width", 48, "--height", 32, "--spp", 32, "--seed", 900001, *VIEW, "-q",
               "-o", self.folder / "half.exr")
        same = red(self.folder / "half.exr")
        self.assertEqual([v for v, m in zip(a, mask) if m], [v for v, m in zip(same, mask) if m])
        # Independent errors of both add in squares; the whole picture has half of the reference's.
        compared = json.loads(octrad("compare", whole, self.few / "reference.exr", "--mask", self.few / "mask.pfm", "--json", "-q"))["images"][0]
        self.assertEqual(compared["pixels"], PIXELS)
        self.assertLess(abs(compared["mean_ratio"] - 1), 0.08)
        self.assertGreater(compared["mape"], 0.6 * about["noise"])
        self.assertLess(compared["mape"], 2.0 * about["noise"])

        self.assertEqual(self.make("--spp", 64, *VIEW)["noise"], about["noise"])  # there already
        self.assertEqual(red(self.few / "half_a.exr"), a)
        self.assertLess(self.make("--spp", 256, *VIEW)["noise"], 0.75 * about["noise"])  # adds samples
        before = (self.few / "mask.pfm").read_bytes()
        done = bench("sparse_reference.py", SCENE, "--octrad", PROGRAM, "--width", 48, "--height", 32, "--pixels", 6, "-o", self.few, *VIEW)
        self.assertIn("other pixels", done.stderr)
        self.assertEqual((self.few / "mask.pfm").read_bytes(), before)

    def test_fields_are_measured_there(self):
        self.make("--spp", 16, *VIEW)
        pictures, rows = self.folder / "pictures", self.folder / "rows.json"

        def measure(*words):
            done = bench("quality.py", SCENE, "--octrad", PROGRAM, "--fields", "octaoctree", "--steps", 3, "--spp", 4, "--sparse-spp", 8,
                         "--view", f"own={self.few}", "--pictures", pictures, "-o", rows, *words)
            self.assertEqual(done.returncode, 0, done.stderr)
            row, = json.loads(rows.read_text())["rows"]
            return row

        row = measure()
        sparse, mask = red(pictures / "octaoctree_own_sparse.exr"), self.mask()
        self.assertTrue(all(v > 0 for v, m in zip(sparse, mask) if m))
        self.assertFalse(any(v for v, m in zip(sparse, mask) if not m))
        compared = json.loads(octrad("compare", self.few / "reference.exr", pictures / "octaoctree_own_sparse.exr", "--mask", self.few / "mask.pfm", "--json", "-q"))["images"][0]
        self.assertEqual(compared["pixels"], PIXELS)
        self.assertEqual(row["mape"], compared["mape"])
        self.assertGreater(row["noise"], 0)

        trained = (pictures / "octaoctree.octrad").stat().st_mtime_ns
        self.assertEqual(measure()["mape"], row["mape"])
        self.assertEqual((pictures / "octaoctree.octrad").stat().st_mtime_ns, trained)  # not again
        measure("-D", "adam.beta2=0.9")
        self.assertNotEqual((pictures / "octaoctree.octrad").stat().st_mtime_ns, trained)  # another training

        # After a training that failed nothing says what the model is.
        refused = bench("quality.py", SCENE, "--octrad", PROGRAM, "--fields", "octaoctree", "--steps", 3, "-D", "adam.beta2=7",
                        "--view", f"own={self.few}", "--pictures", pictures)
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("adam.beta2", refused.stderr)
        self.assertFalse((pictures / "octaoctree.json").exists())
        measure()
        (pictures / "octaoctree.octrad").unlink()
        self.assertEqual(measure()["mape"], row["mape"])

    def test_a_plan_makes_every_row_and_goes_on(self):
        plan, work = self.folder / "plan.json", self.folder / "work"
        plan.write_text(json.dumps({
            "seeds": [0], "spp": 1, "sparse_spp": 4, "watch": 2, "watch_every": "0.05s", "keys": {"*": ["checkpoint.every=0.05", "octree.levels=4"], "nr": ["nr.log2_table=12"]},
            "scenes": [{"name": "cornell-box", "width": 48, "height": 32, "steps": {"octaoctree": 150, "nr": 3},
                        "views": {"own": {"spp": 4}, "side": {"spp": 4, "camera": list(VIEW)}}}]}))
        command = [sys.executable, str(ROOT / "bench" / "quality.py"), str(plan), "--octrad", PROGRAM, "--scenes", str(ROOT / "scenes"), "--folder", str(work)]
        model, done, log = (work / f"cornell-box-octaoctree-0.{end}" for end in ("octrad", "json", "log"))
        killed = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
        while killed.poll() is None and not (log.exists() and all(f'"{event}"' in log.read_text() for event in ("saved", "validation"))):
            time.sleep(0.02)
        if killed.poll() is None:
            os.killpg(killed.pid, signal.SIGKILL)
        killed.communicate()
        self.assertIsNone(json.loads(done.read_text())["result"])
        first = next(json.loads(line)["step"] for line in log.read_text().splitlines() if '"validation"' in line)

        def table(name):
            with (work / name).open() as file:
                return list(csv.DictReader(file))

        def finish():
            ended = subprocess.run(command, capture_output=True, text=True)
            self.assertEqual(ended.returncode, 0, ended.stderr)
            rows = table("rows.csv")
            self.assertEqual([(r["view"], r["field"], r["steps"]) for r in rows],
                             [("own", "octaoctree", "150"), ("own", "nr", "3"), ("side", "octaoctree", "150"), ("side", "nr", "3")])
            self.assertIn("| cornell-box, side |", ended.stdout)
            return rows

        rows = finish()
        starts = [line["step"] for line in map(json.loads, log.read_text().splitlines()) if line["event"] == "start"]
        self.assertEqual(len(starts), 2)
        self.assertGreater(starts[1], 0)  # went on
        curves = table("curves.csv")
        steps = [int(c["step"]) for c in curves if c["field"] == "octaoctree"]
        self.assertIn(first, steps)  # what was measured before the kill is there too
        self.assertGreater(steps[-1], 100)
        self.assertEqual(steps, sorted(set(steps)))
        files = {p: p.stat().st_mtime_ns for p in work.glob("*.octrad")} | {p: p.stat().st_mtime_ns for p in work.glob("*.row.json")}
        self.assertEqual(len(files), 2 + 4)
        self.assertEqual(finish(), rows)
        self.assertEqual({p: p.stat().st_mtime_ns for p in files}, files)  # nothing again
        for part in (model, done, work / "cornell-box-octaoctree-0-own.row.json"):
            part.unlink()
        self.assertEqual(finish(), rows)  # the same when it was never interrupted

        missing = subprocess.run([*command, "--scenes", str(self.folder)], capture_output=True, text=True)
        self.assertIn("no cornell-box/scene.xml", missing.stderr)

    def test_what_octrad_refuses(self):
        done = bench("sparse_reference.py", SCENE, "--octrad", PROGRAM, "--pixels", 1, "--spp", 1, "-o", self.folder / "bad", "--camera", "nowhere.json")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("nowhere.json", done.stderr)
        self.assertFalse((self.folder / "bad" / "about.json").exists())


if __name__ == "__main__":
    unittest.main()
