"""octrad selftest: its report, on the host stream and on a GPU where there is one."""
import errno
import json
import os
import unittest
import unittest.mock

from support import FAULTS, NO_FAULTS, ROOM, Case, run

SEED = ("--seed", "7")  # each run has another seed unless it is told one, and statistics differ with it


class Selftest(Case):
    sees_gpus = True

    def test_checks_pass_and_are_reported(self):
        report = self.ok("selftest", "--quick", "--json", *SEED).json()  # all of it, once
        self.assertTrue(report["passed"])
        self.assertGreaterEqual(len(report["benchmarks"]), 10)
        self.assertTrue(all(b["rate"] > 0 for b in report["benchmarks"]))
        self.assertEqual(report["seed"], 7)
        self.assertEqual(report["emulated"], report["device"]["device"] == "host")
        names = [c["name"] for c in report["checks"]]
        self.assertGreaterEqual(len(names), 25)
        for wanted in ("left-hand-side points", "right-hand sides", "first hits", "paths", "film", "optimiser, dense table"):
            self.assertIn(wanted, names)
        self.assertEqual(len(names), len(set(names)))
        for check in report["checks"]:
            with self.subTest(check["name"]):
                self.assertTrue(check["passed"])
                self.assertGreater(check["items"], 0)
                self.assertLessEqual(check["p50"], check["p99"])
                self.assertLessEqual(check["above"], check["allowed_above"])

    def test_what_has_no_meaning_is_refused(self):
        self.fails(1, "octree.levels", "selftest", "--only", "sort", "-D", "octree.levels=5")
        self.fails(1, "none is given", "selftest", "--only", "sort", "-D", "foo=3")
        self.fails(1, "none is given", "selftest", "--only", "sort", "--permissive")

    def test_the_seed_is_fresh_and_repeats(self):
        def run(*options):
            return self.ok("selftest", "--device", "cpu", "--no-benchmarks", "--only", "sum", "--json", *options).json()

        first, second = run(), run()
        self.assertNotEqual(first["seed"], second["seed"])
        again = run("--seed", str(first["seed"]))
        self.assertEqual(again["checks"], first["checks"])

    def test_host_figures_are_marked(self):
        file = self.path("out.json")
        result = self.ok("selftest", "--device", "cpu", "--only", "random 32-byte reads, small", *SEED, "-o", file)
        self.assertIn("no figure of a GPU", result.out)
        with open(file, encoding="utf-8") as out:
            report = json.load(out)
        self.assertTrue(report["emulated"])
        self.assertEqual([b["name"] for b in report["benchmarks"]], ["random 32-byte reads, small table"])
        for entry in report["benchmarks"] + report["checks"]:
            self.assertEqual(entry["on"], "host")
        self.assertGreater(report["benchmarks"][0]["rate"], 0)

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_an_error_fails_its_entry_alone(self):
        file = self.path("out.json")
        with unittest.mock.patch.dict(os.environ, LD_PRELOAD=FAULTS, OCTRAD_FAULTS=f"/:map:{errno.ENOMEM}:1:0"):
            result = run("selftest", "--device", "cpu", "--no-benchmarks", "--only", "optimiser", *SEED, "-o", file)
        self.assertEqual(result.code, 5, result.err)
        self.assertIn("3 of 4 checks and stages failed", result.err)
        self.assertIn("1 passed, 3 failed, 0 skipped", result.out)
        with open(file, encoding="utf-8") as out:
            report = json.load(out)
        self.assertFalse(report["passed"])
        self.assertEqual([check["passed"] for check in report["checks"]], [True, False, False, False])
        self.assertTrue(all("cannot map" in check["failure"] for check in report["checks"][1:]))

    def test_every_check_runs_without_a_scene(self):
        report = self.ok("selftest", "--device", "cpu", "--only", "materials", *SEED, "--json").json()
        self.assertEqual([c["name"] for c in report["checks"]], ["materials and lights"])
        self.assertEqual(report["skipped"], [])

    def test_stages_train_and_render_beside_the_cpu(self):
        scene = self.write("room.xml", ROOM)
        for words in ((), (scene,)):
            with self.subTest(words):
                report = self.ok("selftest", *words, "--device", "cpu", "--only", "short training", *SEED, "--json").json()
                self.assertEqual([training["field"] for training in report["stages"]], ["octaoctree", "ncr"])
                for training in report["stages"]:
                    self.assertTrue(training["passed"])
                    self.assertEqual(training["on"], "host")
                    self.assertEqual(training["scene"], scene if words else "(built-in room)")
                    self.assertGreater(training["steps"], 10)
                    self.assertLess(training["difference"], training["tolerance"])
                    self.assertGreater(training["difference_of_seeds"], training["tolerance"])
                    self.assertAlmostEqual(training["loss"], training["cpu_loss"], delta=training["tolerance"] * training["cpu_loss"])
        frames = self.ok("selftest", "--device", "cpu", "--only", "frame", *SEED, "--json").json()["stages"]
        self.assertEqual([frame["field"] for frame in frames], ["octaoctree", "ncr"])
        for frame in frames:
            self.assertTrue(frame["passed"])
            self.assertGreater(frame["mape"], 0)
            self.assertLessEqual(frame["mape"], frame["tolerance"])
            self.assertLessEqual(frame["median_ms"], frame["p95_ms"])
            self.assertLessEqual({"first rays", "first hits", "inputs of queries", "look-up", "decoder", "tone mapping"}, set(frame["stages_ms"]))
        self.assertIn("on the host", self.ok("selftest", scene, "--device", "cpu", "--only", "frame", *SEED).out)

    def test_a_scene(self):
        scene = self.write("room.xml", ROOM)
        report = self.ok("selftest", scene, "--quick", "--only", "embree", *SEED, "--json").json()
        self.assertEqual(report["scene"]["triangles"], 16)
        self.assertEqual(len(report["checks"]), 2)
        report = self.ok("selftest", scene, "--device", "cpu", "--only", "paths", *SEED, "--json").json()
        self.assertEqual([c["max"] for c in report["checks"]], [0, 0])    # the host runs the CPU's own code
        self.fails(3, "none.xml", "selftest", self.path("none.xml"))
        self.fails(1, "has this in its name", "selftest", "--only", "nonsense")
        self.fails(3, "none", "selftest", "--only", "sort", "-o", self.path("none/out.json"))


if __name__ == "__main__":
    unittest.main()
