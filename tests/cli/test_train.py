"""octrad train, render from a model, query."""
import json
import os
import random
import signal
import unittest

from support import ROOM, SMALL, Case, read_safetensors, run, start, wait_for

FIELDS = {"steps", "seconds", "lhs_samples", "rhs_queries", "rhs_queries_per_s", "loss", "validation_mape", "model"}


class Train(Case):
    def setUp(self):
        super().setUp()
        self.scene = self.write("room.xml", ROOM)
        self.model = self.path("m.octrad")

    def train(self, *options, model=None):
        return self.ok("train", self.scene, "-o", model or self.model, *SMALL, "--json", *options).json()

    def render(self, integrator, out, *options):
        return self.ok("render", self.scene, "--model", self.model, "--integrator", integrator, "-o", out, "--json", "-q", *options).json()

    def assert_same_tensors(self, a, b):
        (_, first), (_, second) = read_safetensors(a), read_safetensors(b)
        self.assertEqual(first.keys(), second.keys())
        self.assertEqual([n for n in first if first[n] != second[n]], [])

    def test_report(self):
        reference = self.path("ref.exr")
        self.ok("render", self.scene, "-o", reference, "--spp", 16, "-q")
        log = self.path("log.jsonl")
        report = self.train("--steps", 20, "--reference", reference, "--log-json", log)
        self.assertTrue(FIELDS <= set(report), report)
        self.assertEqual((report["steps"], report["lhs_samples"], report["model"]), (20, 20 * 256, self.model))
        self.assertGreater(report["rhs_queries"], 0)
        self.assertGreater(report["validation_mape"], 0)
        self.assertGreater(report["loss"], 0)
        events = [json.loads(line) for line in open(log)]
        self.assertEqual(events[0]["event"], "start")
        self.assertEqual(events[0]["config"]["octree"]["levels"], 3)
        self.assertEqual(events[-1]["event"], "done")
        self.assertIn("saved", [e["event"] for e in events])
        self.assertIsNone(self.train("--steps", 2)["validation_mape"])

    def test_time_and_both_budgets(self):
        report = self.train("--time", "1s")
        self.assertGreater(report["steps"], 1)
        self.assertLess(report["seconds"], 10)
        report = self.train("--time", "1s", "--steps", 10000000)
        self.assertLess(report["steps"], 10000000)
        self.assertFalse(report["interrupted"])
        self.assertEqual(self.train("--time", "10m", "--steps", 3)["steps"], 3)

    def test_every_integrator_uses_the_model(self):
        self.train("--steps", 5)
        out = self.path("out.exr")
        for integrator in ("lhs", "rhs", "deferred", "disparity", "traced", "features1", "features3", "occupancy2"):
            with self.subTest(integrator=integrator):
                report = self.render(integrator, out, "--spp", 1)
                self.assertEqual((report["width"], report["height"]), (32, 24))
        self.assertGreater(self.render("lhs", out, "--spp", 2)["queries_per_s"], 0)
        metadata = self.ok("info", out, "--json").json()["metadata"]
        self.assertEqual(json.loads(metadata["octrad.config"])["octree"]["levels"], 3)
        self.fails(1, "features3", "render", self.scene, "--model", self.model, "--integrator", "features4", "-o", out)
        self.fails(1, "the model fixes this key", "render", self.scene, "--model", self.model, "-D", "octree.levels=4", "-o", out)
        self.fails(1, 'did you mean "render.delta"', "render", self.scene, "--model", self.model, "-D", "render.detla=trace", "-o", out)
        self.ok("render", self.scene, "--model", self.model, "-D", "render.delta=trace", "-o", out, "--spp", 1)

    def test_thread_count_changes_no_bit(self):
        other = self.path("other.octrad")
        self.train("--steps", 15, "--threads", 1)
        self.train("--steps", 15, "--threads", 3, model=other)
        self.assert_same_tensors(self.model, other)
        self.train("--steps", 15, "--seed", 5, model=other)
        self.assertNotEqual(read_safetensors(self.model)[1], read_safetensors(other)[1])

    def test_resume_after_kill_ends_with_the_same_bits(self):
        whole, log = self.path("whole.octrad"), self.path("log.jsonl")
        steps = 150
        self.train("--steps", steps, model=whole)
        process = start("train", self.scene, "-o", self.model, *SMALL, "--steps", steps, "-D", "checkpoint.every=100ms", "--log-json", log)
        self.assertTrue(wait_for(lambda: os.path.exists(log) and '"saved"' in open(log).read()))
        process.kill()
        process.communicate()
        step = self.ok("info", self.model, "--json").json()["metadata"]["step"]
        self.assertGreater(step, 0)
        self.assertLess(step, steps, "the run was over before it was killed; make it longer")
        report = self.train("--steps", steps, "-D", "checkpoint.every=100ms", "--resume", "--log-json", log)
        self.assertEqual((report["steps"], report["lhs_samples"]), (steps, steps * 256))
        self.assert_same_tensors(whole, self.model)

    def test_a_second_training_of_a_file_is_told_at_once(self):
        first = start("train", self.scene, "-o", self.model, *SMALL, "--steps", 1000000, "-q")
        wait_for(lambda: os.path.exists(self.model + ".lock"))
        self.fails(3, "another process is writing it", "train", self.scene, "-o", self.model, *SMALL, "--steps", 3)
        first.send_signal(signal.SIGINT)
        self.assertEqual(first.wait(timeout=60), 130)
        self.assertFalse(os.path.exists(self.model + ".lock"))
        self.train("--resume", "--steps", 1)

    def test_interrupt_saves_and_resume_continues(self):
        for sent in (signal.SIGINT, signal.SIGTERM):
            log = self.path("log%d.jsonl" % sent)
            process = start("train", self.scene, "-o", self.model, *SMALL, "--time", "10m", "--log-json", log, "--json")
            self.assertTrue(wait_for(lambda: os.path.exists(log) and "progress" in open(log).read()))
            process.send_signal(sent)
            out, err = process.communicate(timeout=60)
            self.assertEqual(process.returncode, 130, err)
            report = json.loads(out)
            self.assertTrue(report["interrupted"])
            self.assertGreater(report["steps"], 0)
        steps = report["steps"] + 5
        self.assertEqual(self.train("--resume", "--steps", steps)["steps"], steps)

    def test_resume_refusals(self):
        self.assertEqual(self.train("--resume", "--steps", 3)["steps"], 3, "nothing to resume is a start")
        self.fails(1, "octree.features was 4", "train", self.scene, "-o", self.model, *SMALL, "--resume", "-D", "octree.features=2")
        other = self.write("other.xml", ROOM.replace("8, 8, 8", "9, 8, 8"))
        self.fails(2, "another scene", "train", other, "-o", self.model, *SMALL, "--resume", "--steps", 9)
        self.train("--steps", 3, "--no-optimizer")
        self.fails(2, "--no-optimizer", "train", self.scene, "-o", self.model, *SMALL, "--resume", "--steps", 9)

    def test_no_optimizer_is_smaller_and_renders_the_same(self):
        self.train("--steps", 5)
        a, b = self.path("a.exr"), self.path("b.exr")
        self.render("lhs", a, "--spp", 1)
        large = os.path.getsize(self.model)
        self.train("--steps", 5, "--no-optimizer")
        self.assertLess(os.path.getsize(self.model), 0.6 * large)
        self.render("lhs", b, "--spp", 1)
        self.assertEqual(self.ok("compare", a, b, "--json").json()["images"][0]["mse"], 0)

    def test_nr(self):
        report = self.train("--field", "nr", "--steps", 5, "-D", "nr.log2_table=12", "-D", "nr.width=32")
        self.assertEqual(report["field"], "nr")
        self.render("lhs", self.path("out.exr"), "--spp", 1)
        self.assertEqual(self.ok("info", self.model, "--json").json()["metadata"]["config"]["field"], "nr")

    def test_other_scene_needs_force(self):
        self.train("--steps", 2)
        other = self.write("other.xml", ROOM.replace('value="0.2"', 'value="0.3"'))
        arguments = ("render", other, "--model", self.model, "-o", self.path("out.exr"), "--spp", 1)
        self.fails(2, "--force", *arguments)
        self.ok(*arguments, "--force")

    def test_over_budget_names_the_knobs(self):
        result = self.fails(4, "octree.levels=", "train", self.scene, "-o", self.model, "--max-memory", "8M")
        self.assertIn("octree.features=", result.err)
        self.assertFalse(os.path.exists(self.model))
        self.train("--steps", 2)
        self.fails(4, "the budget is", "train", self.scene, "-o", self.model, *SMALL, "--resume", "--steps", 4, "--max-memory", "8M")

    def test_refusals(self):
        t = ("train", self.scene, "-o", self.model)
        self.fails(1, 'did you mean "octree.levels"', *t, "-D", "octree.level=3")
        self.fails(1, 'did you mean "octaoctree"', *t, "--field", "octoctree")
        self.fails(1, "--steps", *t, "--steps", "0")
        self.fails(1, "duration", *t, "--time", "never")
        self.fails(1, "train.time", *t, "--time", "0")
        self.fails(3, "ref.exr", *t, "--reference", self.path("ref.exr"))
        self.fails(2, "ref.exr", *t, "--reference", self.write("ref.exr", "no picture"))
        self.fails(3, "does not exist", "train", self.scene, "-o", self.path("none/m.octrad"))
        self.fails(2, "has no parameter", *t, "-D", "walls=3", "--steps", "1")
        self.assertFalse(os.path.exists(self.model))
        self.fails(3, "No space left", "train", self.scene, "-o", "/dev/full", *SMALL, "--steps", "1")

    def test_broken_models_are_refused(self):
        self.train("--steps", 2)
        with open(self.model, "rb") as file:
            sound = file.read()
        out = self.path("out.exr")
        rng = random.Random(1)
        broken = {"empty": b"", "text": b"not a model at all", "truncated": sound[:-1000], "half": sound[:len(sound) // 2], "header": sound[:200],
                  "longer": sound + b"x", "noise": bytes(rng.randrange(256) for _ in range(5000))}
        for name, content in broken.items():
            with self.subTest(name=name):
                with open(self.model, "wb") as file:
                    file.write(content)
                self.fails(2, "m.octrad", "render", self.scene, "--model", self.model, "-o", out)
                self.fails(2, "m.octrad", "train", self.scene, "-o", self.model, *SMALL, "--resume", "--steps", 3)
        self.assertFalse(os.path.exists(out))
        # Damage anywhere in the header is an error with a message, or harmless; never a crash.
        size = int.from_bytes(sound[:8], "little")
        for _ in range(60):
            damaged = bytearray(sound)
            damaged[rng.randrange(8, 8 + size)] ^= 1 << rng.randrange(8)
            with open(self.model, "wb") as file:
                file.write(damaged)
            result = run("render", self.scene, "--model", self.model, "-o", out, "--spp", 1, "--width", 8, "-q")
            self.assertIn(result.code, (0, 1, 2, 4), result.err)


class Query(Case):
    HEADER = "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha"

    def setUp(self):
        super().setUp()
        self.model = self.path("m.octrad")
        self.ok("train", self.write("room.xml", ROOM), "-o", self.model, *SMALL, "--steps", 3)

    def points(self, *rows, header=HEADER):
        return self.write("in.csv", "\n".join((header, *rows)) + "\n")

    def test_points(self):
        rows = ["0.1,-1,%g,0,1,0,0,1,0,0.5,0.5,0.4,1" % (i / 3000 - 0.5) for i in range(3000)]
        points, out = self.points(*rows), self.path("out.csv")
        report = self.ok("query", self.model, "--points", points, "-o", out, "--json").json()
        self.assertEqual((report["points"], report["features"]), (3000, 12))
        lines = open(out).read().splitlines()
        self.assertEqual(lines[0].split(","), ["disparity"] + ["f%d" % i for i in range(12)] + ["r", "g", "b"])
        self.assertEqual(len(lines), 3001)
        self.assertEqual(len(set(len(line.split(",")) for line in lines)), 1)
        self.assertGreater(float(lines[1].split(",")[-1]), 0)
        printed = self.ok("query", self.model, "--points", points, "--threads", 1).out
        self.assertEqual(printed.splitlines(), lines, "the same at any thread count, on standard output too")

    def test_columns_in_any_order(self):
        a = self.ok("query", self.model, "--points", self.points("0.1,-1,0.2,0,1,0,0,1,0,0.5,0.6,0.4,1")).out
        shuffled = self.points("keep, 1,0.5,0.6,0.4,0,1,0,0,1,0,0.1,-1,0.2", "", header="note,alpha,ar,ag,ab,nx,ny,nz,wox,woy,woz,x,y,z")
        self.assertEqual(self.ok("query", self.model, "--points", shuffled).out, a)

    def test_refusals(self):
        q = ("query", self.model, "--points")
        self.fails(2, 'lacks the column "alpha"', *q, self.points(header=self.HEADER[:-6]))
        self.fails(2, "in.csv:2: 3 cells", *q, self.points("1,2,3"))
        self.fails(2, 'in.csv:3: column y: "x"', *q, self.points("0,0,0,0,1,0,0,1,0,1,1,1,1", "0,x,0,0,1,0,0,1,0,1,1,1,1"))
        self.fails(2, "not a finite number", *q, self.points("nan,0,0,0,1,0,0,1,0,1,1,1,1"))
        self.fails(2, "unit vector", *q, self.points("0,0,0,0,2,0,0,1,0,1,1,1,1"))
        self.fails(2, "is empty", *q, self.write("in.csv", ""))
        self.fails(3, "none.csv", *q, self.path("none.csv"))
        self.fails(3, "does not exist", *q, self.points(), "-o", self.path("none/out.csv"))
        self.fails(3, "none.octrad", "query", self.path("none.octrad"), "--points", self.points())
        self.fails(1, "needs -o", *q, self.points(), "--json")


if __name__ == "__main__":
    unittest.main()
