#!/usr/bin/env python3
"""bench/picks.py: what it prints of a scene with several emitters and of one with one; a scene without any is refused."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))
FAST = ("--octrad", PROGRAM, "--width", "24", "--spp", "16")


def picks(*words):
    return subprocess.run([sys.executable, str(ROOT / "bench" / "picks.py"), *map(str, words)], capture_output=True, text=True)


class Picks(unittest.TestCase):
    def test_several_emitters(self):
        done = picks(*FAST, "--train", 3, "--reference-spp", 4, ROOT / "scenes" / "lamps")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"^lamps: 5 emitters; MAPE [\d.]+, relative squared error [\d.]+, processor seconds [\d.]+; trained: MAPE [\d.]+ alike, [\d.]+\n$")
        self.assertNotIn("MAPE 1.000,", done.stdout)

    def test_one_emitter_is_picked_always(self):
        done = picks(*FAST, ROOT / "scenes" / "cornell-box")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"^cornell-box: 1 emitters; MAPE 1\.000, relative squared error 1\.000, processor seconds [\d.]+\n$")

    def test_no_emitter(self):
        with tempfile.TemporaryDirectory(prefix="octrad-picks-") as folder:
            (pathlib.Path(folder) / "scene.xml").write_text('<scene version="3.0.0"><shape type="sphere"/></scene>')
            done = picks(*FAST, folder)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("has no emitter", done.stderr)


if __name__ == "__main__":
    unittest.main()
