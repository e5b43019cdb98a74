#!/usr/bin/env python3
"""bench/gpu.sh on a machine without a GPU: it says so, and keeps host figures out of bench/results."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))


class GpuBench(unittest.TestCase):
    def test_without_a_gpu(self):
        info = json.loads(subprocess.run([PROGRAM, "info", "--json"], check=True, capture_output=True, text=True).stdout)
        if info["auto"]["device"] != "cpu":
            self.skipTest("there is a GPU")
        results = ROOT / "bench" / "results"
        before = sorted(p.name for p in results.iterdir())
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "out.json")
            done = subprocess.run([str(ROOT / "bench" / "gpu.sh"), "--octrad", PROGRAM, "-o", file], capture_output=True, text=True, timeout=600)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("no GPU: " + info["auto"]["why"], done.stdout)
            with open(file, encoding="utf-8") as text:
                report = json.load(text)
        self.assertTrue(report["selftest"]["emulated"])
        self.assertTrue(report["selftest"]["passed"])
        self.assertNotIn("timings", report)
        self.assertEqual(sorted(p.name for p in results.iterdir()), before)


if __name__ == "__main__":
    unittest.main()
