#!/usr/bin/env python3
"""bench/gpu.sh without a GPU: it says so; a run that is killed, fails or has too little time keeps what it measured. What a GPU
would run is rehearsed by tests/test_bundle.py."""
import argparse
import contextlib
import io
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))
sys.path.insert(0, str(ROOT / "bench"))
import gpu  # noqa: E402
import gpu_plans  # noqa: E402

BENCH = str(ROOT / "bench" / "gpu.sh")

# A program that answers like octrad on a GPU, and badly: checks that fail, trainings that break.
STUB = """#!/usr/bin/env python3
import json, sys
verb = sys.argv[1]
if verb == "info":
    print(json.dumps({"auto": {"device": "cuda:0", "why": "made up"}, "devices": [{"name": "Stub 9000"}], "cpu": "none"}))
elif verb == "selftest":
    print(json.dumps({"checks": [{"name": "rays", "passed": False}], "stages": [], "benchmarks": []}))
    sys.exit("1 of 1 checks failed")
elif verb == "train":
    print("the table does not fit", file=sys.stderr)
    sys.exit(3)
else:
    print(json.dumps({"integrator": "path", "seconds": 2.0, "rays_per_s": 1e9, "samples_per_s": 1e8}))
"""
# One whose frames have no end; the shell starts at once, also on a busy machine.
ENDLESS = """#!/bin/sh
if [ "$2" = path ]; then echo '{"integrator": "path", "seconds": 2.0, "rays_per_s": 1e9}'; exit; fi
echo waiting >&2
exec sleep 1000
"""


class GpuBench(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="octrad-bench-")
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.file = os.path.join(self.folder, "out.json")

    def bench(self, *options, program=PROGRAM):
        return subprocess.run([BENCH, "--octrad", program, *options], capture_output=True, text=True, timeout=600)

    def report(self):
        with open(self.file, encoding="utf-8") as text:
            return json.load(text)

    def stub(self, text=STUB):
        path = os.path.join(self.folder, "octrad")
        with open(path, "w", encoding="utf-8") as out:
            out.write(text)
        os.chmod(path, 0o755)
        return path

    def test_without_a_gpu(self):
        info = json.loads(subprocess.run([PROGRAM, "info", "--json"], check=True, capture_output=True, text=True).stdout)
        if info["auto"]["device"] != "cpu":
            self.skipTest("SKIPPED: there is a GPU")
        results = ROOT / "bench" / "results"
        before = sorted(p.name for p in results.iterdir())
        refused = self.bench("--require-gpu", "-o", self.file)
        self.assertEqual(refused.returncode, 5)
        self.assertEqual(refused.stderr, "no GPU: %s.\n" % info["auto"]["why"])
        self.assertFalse(os.path.exists(self.file))
        done = self.bench("-o", self.file)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("no GPU: " + info["auto"]["why"], done.stdout)
        report = self.report()
        self.assertIsNone(report["gpu"])
        self.assertEqual(len(report["steps"]), 1)
        selftest = report["steps"][0]["result"]
        self.assertTrue(selftest["emulated"] and selftest["passed"])
        self.assertEqual(sorted(p.name for p in results.iterdir()), before)

    def steps(self):
        return {entry["name"]: entry for entry in self.report()["steps"]}

    def test_failures_are_entries_and_the_run_goes_on(self):
        done = self.bench("--plan", "first", "--only", "checks", "--only", "1,200 steps of", "--only", "frame: 1024", "--only", "path", "-o", self.file, program=self.stub())
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual(self.report()["gpu"], "Stub 9000")
        self.assertFalse(self.report()["complete"])
        steps = self.steps()
        self.assertEqual(steps["checks"]["failed"], "exit status 1")
        self.assertEqual(steps["checks"]["result"]["checks"][0]["name"], "rays")  # what it printed before it failed
        self.assertIn("1 of 1 checks failed", steps["checks"]["output"])
        self.assertIn("the table does not fit", steps["train: 1,200 steps of the paper schedule"]["output"])
        self.assertEqual(steps["frame: 1024 x 1024"]["skipped"], "needs: train: 1,200 steps of the paper schedule")
        self.assertEqual(steps["path: 64 spp, depth 8"]["result"]["rays_per_s"], 1e9)
        self.assertEqual(len(steps), 4)

    def test_a_budget_leaves_out_what_no_longer_fits(self):
        self.bench("--plan", "third", "--budget", "9", "--only", "octaoctree: frame, 1280", "--only", "path: 256", "-o", self.file, program=self.stub())
        steps = self.steps()
        self.assertIn("left of the budget", steps["octaoctree: paper schedule"]["skipped"])  # not asked for, but needed by what is
        self.assertEqual(steps["octaoctree: frame, 1280 x 720"]["skipped"], "needs: octaoctree: paper schedule")
        self.assertIn("left of the budget", steps["path: 256 spp, depth 8"]["skipped"])
        self.assertEqual(len(steps), 3)

    def test_a_step_is_stopped_at_its_limit(self):
        args = argparse.Namespace(budget=None, rehearse=False, device="cuda")
        run = gpu.Run(args, gpu.Programs(self.stub(ENDLESS)), self.folder, self.file)
        self.addCleanup(run.log.close)
        with contextlib.redirect_stdout(io.StringIO()):
            run.run([gpu_plans.Step("slow", ["render"], 1, limit=5), gpu_plans.Step("quick", ["render", "path"], 1)])
        slow, quick = self.report()["steps"]
        self.assertRegex(slow["failed"], "stopped after")
        self.assertIn("waiting", slow["output"])
        self.assertEqual(quick["result"]["seconds"], 2.0)

    def killed(self, number):
        """The report of a rehearsal that got this signal after two steps, and the children that are left."""
        process = subprocess.Popen([BENCH, "--octrad", PROGRAM, "--plan", "second", "--rehearse", "-o", self.file], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            end = time.monotonic() + 600
            while time.monotonic() < end and not (os.path.exists(self.file) and len(self.report().get("steps", [])) >= 2):
                self.assertIsNone(process.poll(), "it ended before it could be killed")
                time.sleep(0.02)
            process.send_signal(number)
            process.wait(timeout=600)
        finally:
            process.kill()
        return self.report()

    def test_killed_in_the_middle(self):
        report = self.killed(signal.SIGKILL)
        self.assertGreaterEqual(len(report["steps"]), 2)
        self.assertGreater(report["steps"][0]["result"]["seconds"], 0)
        self.assertNotIn("complete", report)
        self.assertTrue(os.path.getsize(self.file + ".log") > 0)
        os.remove(self.file)
        report = self.killed(signal.SIGTERM)
        self.assertEqual(report["interrupted"], "SIGTERM")
        self.assertGreaterEqual(len(report["steps"]), 2)

    def test_lists(self):
        for plan in ("first", "second", "third"):
            done = self.bench("--plan", plan, "--list")
            self.assertEqual(done.returncode, 0, done.stderr)
            priorities = [int(line[0]) for line in done.stdout.splitlines() if line[:1].isdigit()]
            self.assertEqual(priorities, sorted(priorities))
            self.assertGreater(len(priorities), 5)
            for line in done.stdout.splitlines():
                if " train " in line and "parity" not in line:
                    self.assertIn("--no-optimizer", line, "an expensive extra that nobody asked for")
        done = self.bench("--plan", "third", "--only", "nothing like that", "--list")
        self.assertEqual(done.returncode, 1)
        self.assertIn("no step is left", done.stderr)


if __name__ == "__main__":
    unittest.main()
