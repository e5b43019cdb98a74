"""bench/gpu.sh: every command that it would run on a GPU works on the CPU."""
import os
import pathlib
import subprocess
import sys
import unittest

from support import PROGRAM, Case

BENCH = pathlib.Path(__file__).resolve().parents[2] / "bench" / "gpu.py"


class Bench(Case):
    def bench(self, *options):
        environment = dict(os.environ, OCTRAD_SHARED=self.path("none"))  # small scenes only
        return subprocess.run([sys.executable, str(BENCH), "--octrad", PROGRAM, *options], capture_output=True, text=True, env=environment)

    def test_plan_and_rehearsal(self):
        plan = self.bench("--plan").stdout.splitlines()
        for wanted in ("selftest", "--preset paper", "--frames 200", "--field nr", "--spp 4096", "--max-depth 8", "--reference", "compare"):
            self.assertTrue(any(wanted in line for line in plan), wanted)
        done = self.bench("--rehearse")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual(len([line for line in done.stdout.splitlines() if line.startswith("  ")]), len(plan) - 1)
        self.assertIn("nothing was measured", done.stdout)


if __name__ == "__main__":
    unittest.main()
