"""octrad train, render from a model, query."""
import glob
import json
import os
import random
import re
import signal
import sys
import time
import unittest

from exr import read_exr
from support import FIXED, PATIENCE, ROOM, SMALL, Case, edit_metadata, holds, measured, on_terminal, read_safetensors, run, start, wait_for, write_pfm

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
FIELDS = {"steps", "seconds", "lhs_samples", "rhs_queries", "rhs_queries_per_s", "loss", "validation_mape", "model", "memory_estimate_bytes", "memory_peak_bytes"}


class Train(Case):
    def setUp(self):
        super().setUp()
        self.scene = self.write("room.xml", ROOM)
        self.model = self.path("m.octrad")

    def train(self, *options, model=None):
        again = () if "--resume" in options else ("--overwrite",)
        return self.ok("train", self.scene, "-o", model or self.model, *SMALL, "--json", *again, *options).json()

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

    def test_log_has_each_validation_once(self):
        reference, log = self.path("ref.exr"), self.path("log.jsonl")
        self.ok("render", self.scene, "-o", reference, "--spp", 4, "-q")
        self.train("--steps", 20, "--reference", reference, "--validate-every", "0.001ms", "--log-json", log)
        events = [json.loads(line) for line in open(log)]
        validations = [e for e in events if e["event"] == "validation"]
        self.assertEqual([event["step"] for event in validations], list(range(1, 21)))  # after each step, the last one too
        for event in validations:
            self.assertEqual(set(event), {"event", "step", "seconds", "mape"})
            self.assertGreater(event["mape"], 0)
        progress = [e for e in events if e["event"] == "progress"]
        self.assertTrue(0 < len(progress) < 20, progress)  # with times of its own
        for event in progress:
            self.assertFalse([key for key in event if "validation" in key])

    def test_reference_of_another_kind_is_told(self):
        good, cut, other, part = (self.path(n) for n in ("good.exr", "cut.exr", "other.exr", "part.exr"))
        self.ok("render", self.scene, "-o", good, "--spp", 1, "--max-depth", -1, "-q")
        self.ok("render", self.scene, "-o", cut, "--spp", 1, "-q")
        self.ok("render", self.write("other.xml", ROOM.replace("8, 8, 8", "9, 8, 8")), "-o", other, "--spp", 1, "--max-depth", -1, "-q")
        self.ok("render", self.scene, "-o", part, "--spp", 1, "--crop", "1,1,8,8", "-q")
        errors = lambda reference: self.ok("train", self.scene, "-o", self.model, "--overwrite", *SMALL, "--steps", 1, "--reference", reference).err
        self.assertEqual(errors(good), "")
        self.assertIn("cut.exr has paths of at most 6 (max_depth)", errors(cut))
        self.assertIn("other.exr shows another scene", errors(other))
        self.fails(2, "part of a picture", "train", self.scene, "-o", self.model, "--overwrite", *SMALL, "--steps", 1, "--reference", part)
        self.ok("tonemap", good, "-o", self.path("good.png"))
        self.fails(2, "linear radiance", "train", self.scene, "-o", self.model, "--overwrite", *SMALL, "--steps", 1, "--reference", self.path("good.png"))
        # What a stranger's metadata holds is no reason to fail.
        foreign = self.path("foreign.pfm")
        write_pfm(foreign, 32, 24, lambda x, y: (1, 1, 1))
        self.assertEqual(errors(foreign), "")

    def test_a_model_is_overwritten_on_demand_only(self):
        self.train("--steps", 2)
        with open(self.model, "rb") as file:
            before = file.read()
        words = ("train", self.scene, "-o", self.model, *SMALL, "--steps", 1)
        result = self.fails(1, "--overwrite replaces it", *words)
        self.assertIn("--resume continues it", result.err)
        self.fails(1, "--overwrite", *words, "--overwrite", "--resume")
        with open(self.model, "rb") as file:
            self.assertEqual(file.read(), before)
        self.ok(*words, "--overwrite")
        self.assertEqual(self.ok("info", self.model, "--json").json()["metadata"]["step"], 1)

    def test_nothing_left_to_resume(self):
        self.train("--steps", 3)
        words = ("train", self.scene, "-o", self.model, *SMALL, "--resume", "--json")
        result = self.ok(*words, "--steps", 3)
        self.assertIn("has trained 3 of 3 steps already: nothing is left to do; --steps is the total", result.err)
        self.assertEqual(result.json()["steps"], 3)
        self.assertGreater(result.json()["loss"], 0, "of the steps before")
        self.assertIn("--time is the total", self.ok(*words, "--time", "1ms").err)
        self.assertEqual(self.ok(*words, "--steps", 4).err, "")

    def test_the_loss_continues_over_resume(self):
        loss = self.train("--steps", 8, *FIXED, model=self.path("whole.octrad"))["loss"]
        self.assertNotEqual(self.train("--steps", 5, *FIXED)["loss"], loss)
        self.assertEqual(self.train("--resume", "--steps", 8)["loss"], loss)
        self.assertEqual(json.loads(self.ok("info", self.model, "--json").json()["metadata"]["state"])["loss"], loss)

    def test_one_line_of_configuration(self):
        options = [word for word in SMALL if word != "-q"]
        short = self.ok("train", self.scene, "-o", self.model, *options, "--steps", 1).err.splitlines()
        line = [l for l in short if "octree.levels=3" in l]
        self.assertEqual(len(line), 1, short)
        self.assertTrue(line[0].startswith("preset cpu, "), line)
        self.assertNotIn("adam.beta1", line[0])
        self.assertLess(len(short), 5, short)
        self.assertIn("adam.beta1=0.9", self.ok("train", self.scene, "-o", self.model, "--overwrite", *options, "--steps", 1, "-v").err)

    def test_the_status_line_fits_80_columns(self):
        reference = self.path("ref.exr")
        self.ok("render", self.scene, "-o", reference, "--spp", 1, "-q")
        options = [word for word in SMALL if word != "-q"]
        text = on_terminal(80, "train", self.scene, "-o", self.model, *options, "--time", "10m", "--reference", reference, "--validate-every", "1ms",
                           enough=lambda text: text.count("MAPE") > 6)
        lines = [line.split("\x1b")[0] for line in text.split("\r") if " %  " in line]
        self.assertGreater(len(lines), 5, text)
        self.assertLess(max(map(len, lines)), 80)
        complete = [line for line in lines[1:] if "MAPE" in line]  # nothing is estimated in the first
        self.assertGreater(len(complete), 0, text)
        for line in complete:
            # The last field is left out where it does not fit: a fast machine has longer numbers.
            self.assertRegex(line, r"^train +\d+ %  ETA .*  step [\d,]+  loss [\d.]+  MAPE [\d.]+(  [\d.]+ [kM]? ?queries/s)?$")

    def test_time_and_both_budgets(self):
        report = self.train("--time", "1s")
        self.assertGreater(report["steps"], 1)
        self.assertLess(report["seconds"], 100)  # without an end it would be more
        report = self.train("--time", "1s", "--steps", 10000000)
        self.assertLess(report["steps"], 10000000)
        self.assertFalse(report["interrupted"])
        # The limit is of all runs together, like the budgets; reached, it ends a run as they do.
        again = self.ok("train", self.scene, "-o", self.model, *SMALL, "--resume", "--json", "--time", "1s", "--steps", 10000000)
        self.assertIn("nothing is left to do; --time is the total", again.err)
        self.assertEqual(again.json()["steps"], report["steps"])
        self.assertEqual(self.train("--time", "1s", "--steps", 10000000, "--no-optimizer")["optimizer_bytes"], 0)
        self.assertEqual(self.train("--time", "10m", "--steps", 3)["steps"], 3)

    def test_every_integrator_uses_the_model(self):
        self.train("--steps", 5)
        out = self.path("out.exr")
        for integrator in ("lhs", "rhs", "deferred", "disparity", "traced", "features1", "features3", "occupancy2"):
            with self.subTest(integrator=integrator):
                report = self.render(integrator, out, "--spp", 1)
                self.assertEqual((report["width"], report["height"]), (32, 24))
        report = self.render("lhs", out, "--spp", 2)
        self.assertGreater(report["queries_per_s"], 0)
        self.assertEqual((report["empty_lookups"], report["bounce_below"]), (0, 0))
        bounced = self.render("lhs", out, "--spp", 2, "-D", "render.highlights=bounce", "-D", "render.bounce_below=0.4")
        self.assertAlmostEqual(bounced["bounce_below"], 0.4, 6)
        metadata = self.ok("info", out, "--json").json()["metadata"]
        self.assertEqual(json.loads(metadata["octrad.config"])["octree"]["levels"], 3)
        self.fails(1, "features3", "render", self.scene, "--model", self.model, "--integrator", "features4", "-o", out)
        r = ("render", self.scene, "--model", self.model, "-o", self.path("refused.exr"), "--integrator")
        for integrator in ("lhs", "rhs", "deferred", "disparity", "features1"):
            self.fails(1, "--max-depth", *r, integrator, "--max-depth", 4)
            self.fails(1, "--rr-depth", *r, integrator, "--rr-depth", 4)
        self.fails(1, "one sample a pixel", *r, "features1", "--spp", 4)
        self.fails(1, "one sample a pixel", *r, "features1", "--time", "1s")
        self.assertFalse(os.path.exists(self.path("refused.exr")))
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

    def saved_step(self):
        return json.loads(read_safetensors(self.model)[0]["state"])["step"] if os.path.exists(self.model) else 0

    def endless(self, *options):
        return start("train", self.scene, "-o", self.model, *SMALL, *FIXED, "--steps", 100000000, *options)

    def assert_continues(self, *options):
        """The model, saved by a run that was killed, continues to the bits of a run that was not."""
        whole, steps = self.path("whole.octrad"), self.saved_step() + 50
        self.train("--steps", steps, *FIXED, model=whole)
        report = self.train("--steps", steps, *FIXED, "--resume", *options)
        self.assertEqual((report["steps"], report["lhs_samples"]), (steps, steps * 256))
        self.assert_same_tensors(whole, self.model)

    def test_resume_after_kill_ends_with_the_same_bits(self):
        log = self.path("log.jsonl")
        process = self.endless("-D", "checkpoint.every=100ms", "--log-json", log)
        self.assertTrue(wait_for(lambda: holds(log, '"saved"')))
        process.kill()
        process.communicate()
        self.assertGreater(self.saved_step(), 0)
        self.assert_continues("--log-json", log)

    def test_kills_at_random_moments(self):
        """Whatever there is loads and continues, to the same bits: kills while it starts or later, and after it has saved."""
        chance, saved = random.Random(1), 0
        for i in range(int(os.environ.get("OCTRAD_KILLS", "4"))):
            process = self.endless("-D", "checkpoint.every=10ms", "--resume")
            try:
                if i % 2 == 1:
                    self.assertTrue(wait_for(lambda: self.saved_step() > saved))
                time.sleep(chance.uniform(0, 0.2))
                self.assertIsNone(process.poll())
            finally:
                process.kill()
                process.communicate()
            self.assertGreaterEqual(self.saved_step(), saved + i % 2)
            saved = self.saved_step()
        with open(self.path(".octrad-0123456789ab.tmp"), "w"):  # as a kill between naming and renaming leaves it
            pass
        for name in os.listdir(self.folder):
            if name.endswith(".tmp"):
                os.utime(self.path(name), (0, 0))  # an hour is waited
        self.assert_continues()
        self.assertEqual([name for name in os.listdir(self.folder) if name.endswith(".tmp")], [])

    def test_a_second_training_of_a_file_is_told_at_once(self):
        log = self.path("log.jsonl")
        first = start("train", self.scene, "-o", self.model, *SMALL, "--steps", 1000000, "-q", "--log-json", log)
        self.assertTrue(wait_for(lambda: holds(log, "start")))
        self.assertTrue(os.path.exists(self.model + ".lock"))
        self.fails(3, "another process is writing it", "train", self.scene, "-o", self.model, *SMALL, "--steps", 3)
        self.assertTrue(wait_for(lambda: holds(log, "progress")))  # while it loads it ends at once
        first.send_signal(signal.SIGINT)
        self.assertEqual(first.wait(timeout=PATIENCE), 130)
        self.assertFalse(os.path.exists(self.model + ".lock"))
        self.train("--resume", "--steps", 1)

    def test_interrupt_saves_and_resume_continues(self):
        for sent in (signal.SIGINT, signal.SIGTERM):
            log = self.path("log%d.jsonl" % sent)
            process = start("train", self.scene, "-o", self.model, "--overwrite", *SMALL, "--time", "10m", "--log-json", log, "--json")
            self.assertTrue(wait_for(lambda: holds(log, "progress")))
            process.send_signal(sent)
            out, err = process.communicate(timeout=PATIENCE)
            self.assertEqual(process.returncode, 130, err)
            report = json.loads(out)
            self.assertTrue(report["interrupted"])
            self.assertGreater(report["steps"], 0)
        steps = report["steps"] + 5
        self.assertEqual(self.train("--resume", "--steps", steps)["steps"], steps)

    def test_resume_refusals(self):
        self.assertEqual(self.train("--resume", "--steps", 3)["steps"], 3, "nothing to resume is a start")
        self.fails(1, "octree.features was 4", "train", self.scene, "-o", self.model, *SMALL, "--resume", "-D", "octree.features=2")
        self.fails(1, "render.delta was trace", "train", self.scene, "-o", self.model, *SMALL, "--resume", "-D", "render.delta=cache")
        self.assertEqual(self.train("--resume", "--steps", 4, "-D", "render.bounce_below=0.2")["steps"], 4)
        other = self.write("other.xml", ROOM.replace("8, 8, 8", "9, 8, 8"))
        self.fails(2, "another scene", "train", other, "-o", self.model, *SMALL, "--resume", "--steps", 9)
        other_view = ROOM.replace('target="0, ', 'target="0.01, ')
        self.assertNotEqual(other_view, ROOM)
        turned = self.write("turned.xml", other_view)
        self.fails(2, "sensors", "train", turned, "-o", self.model, *SMALL, "--resume", "--steps", 9)
        self.train("--steps", 3, "--no-optimizer")
        self.fails(2, "--no-optimizer", "train", self.scene, "-o", self.model, *SMALL, "--resume", "--steps", 9)

    def test_resume_of_a_model_that_is_older_than_a_key(self):
        """Naming the preset again, which has learnt the key since, changes nothing: the run goes on as it was."""
        self.train("--steps", 3, "-D", "train.area_falls=false", "-D", "train.average=0")

        def forget(metadata):
            config = json.loads(metadata["config"])
            del config["train"]["area_falls"], config["train"]["average"]
            metadata["config"] = json.dumps(config)

        edit_metadata(self.model, forget)
        words = ("train", self.scene, "-o", self.model, *SMALL[:-1], "--resume", "--steps", 4, "--preset", "cpu")
        self.fails(1, "train.area_falls was false", *words, "-D", "train.area_falls=true")
        for _ in range(2):
            self.assertIn("goes on as before them: train.area_falls=false train.average=0", self.ok(*words).err)
            config = self.ok("info", self.model, "--json").json()["metadata"]["config"]["train"]
            self.assertEqual((config["area_falls"], config["average"]), (False, 0))
        self.train("--steps", 3, "-D", "train.area_falls=false")
        self.fails(1, "train.area_falls was false", *words)

    def test_no_optimizer_is_smaller_and_renders_the_same(self):
        self.train("--steps", 5)
        a, b = self.path("a.exr"), self.path("b.exr")
        self.render("lhs", a, "--spp", 1)
        large = os.path.getsize(self.model)
        self.train("--steps", 5, "--no-optimizer")
        self.assertLess(os.path.getsize(self.model), 0.6 * large)
        self.render("lhs", b, "--spp", 1)
        self.assertEqual(read_exr(a)[:3], read_exr(b)[:3])

    def test_nr(self):
        report = self.train("--field", "nr", "--steps", 5, "-D", "nr.log2_table=12", "-D", "nr.width=32")
        self.assertEqual(report["field"], "nr")
        self.render("lhs", self.path("out.exr"), "--spp", 1)
        self.assertEqual(self.ok("info", self.model, "--json").json()["metadata"]["config"]["field"], "nr")
        r = ("render", self.scene, "--model", self.model, "-o", self.path("view.exr"), "--integrator")
        self.fails(1, "predicts none", *r, "disparity")
        self.fails(1, "unknown integrator", *r, "occupancy9")
        self.assertFalse(os.path.exists(self.path("view.exr")))

    def test_ncr(self):
        small = ("--field", "ncr", "-D", "ncr.log2_table=10", "-D", "ncr.cone.log2_table=10", "-D", "ncr.width=16")
        self.assertEqual(self.train(*small, "--steps", 2)["field"], "ncr")
        self.assertEqual(self.train(*small, "--resume", "--steps", 4)["steps"], 4)
        for integrator, rays in (("lhs", 1), ("rhs", 2), ("deferred", 1)):
            report = self.render(integrator, self.path(integrator + ".exr"), "--spp", 1, "--width", 24)
            self.assertGreater(report["rays_per_s"], rays * report["samples_per_s"])
        r = ("render", self.scene, "--model", self.model, "-o", self.path("view.exr"), "--integrator")
        self.ok(*r, "features2", "-q")
        self.fails(1, "predicts none", *r, "disparity")

    def test_model_sizes_are_announced(self):
        for keys in (("octree.levels=4", "decoder.width=32"), ("octree.levels=4", "lookup.offset=predicted", "disparity.log2_table=14", "decoder.width=32"), ("field=nr", "nr.log2_table=14", "nr.width=32"),
                     ("field=ncr", "ncr.log2_table=14", "ncr.cone.log2_table=12", "ncr.width=32")):
            options = [word for key in ("train.points=64", "train.directions=2", *keys) for word in ("-D", key)]
            scene = self.ok("info", self.scene, "--json", *options).json()
            announced, memory = scene["model_file"], scene["memory"]
            self.assertTrue(announced["features"] <= memory["rendering"] < memory["training"], scene)
            train = ("train", self.scene, "-o", self.model, "--overwrite", "--steps", 2, *options)
            self.assertIn("with what --resume needs", self.ok(*train).err)
            info = self.ok("info", self.model, "--json").json()
            self.assertEqual(info["feature_bytes"], announced["features"])
            # The networks are not announced: less than 60,000 weights of 4 bytes, and their two moments.
            self.assertTrue(0 < info["bytes"] - info["optimizer_bytes"] - announced["without_optimizer"] < 240000, (info["bytes"], announced))
            self.assertTrue(0 < info["bytes"] - announced["with_optimizer"] < 3 * 240000, (info["bytes"], announced))
            self.assertLess(abs(os.path.getsize(self.model) - info["bytes"]), 20000)
            self.ok(*train, "--no-optimizer")
            small = self.ok("info", self.model, "--json").json()
            self.assertEqual((small["bytes"], small["optimizer_bytes"]), (info["bytes"] - info["optimizer_bytes"], 0))

    def test_other_scene_needs_force(self):
        self.train("--steps", 2)
        other = self.write("other.xml", ROOM.replace('value="0.2"', 'value="0.3"'))
        arguments = ("render", other, "--model", self.model, "-o", self.path("out.exr"), "--spp", 1)
        self.fails(2, "--force", *arguments)
        self.ok(*arguments, "--force")

    def test_over_budget_names_the_knobs(self):
        result = self.fails(4, "octree.levels=", "train", self.scene, "-o", self.model, "--max-memory", "100M")  # of 180
        self.assertIn("octree.features=", result.err)
        self.assertFalse(os.path.exists(self.model))
        # Numbers that can be checked: all that is needed against the whole budget.
        self.assertIn("the budget is 100.0 MiB", result.err)
        self.assertIn("MiB  the program and the scene, in memory already", result.err)
        number = lambda text: float(text.split()[-2]) * {"KiB": 1 / 1024, "MiB": 1, "GiB": 1024}[text.split()[-1]]
        needs = number(re.search(r"training needs (\S+ \S+)", result.err).group(1))
        parts = [number(" ".join(line.split()[:2])) for line in result.err.splitlines()[1:] if line.startswith("    ")]
        self.assertAlmostEqual(needs, sum(parts), delta=0.5)
        self.train("--steps", 2)
        self.fails(4, "the budget is", "train", self.scene, "-o", self.model, *SMALL, "--resume", "--steps", 4, "--max-memory", "8M")

    def test_refusals(self):
        t = ("train", self.scene, "-o", self.model)
        self.fails(1, "not a whole number", *t, "--steps", "many")
        self.fails(1, 'did you mean "octree.levels"', *t, "-D", "octree.level=3")
        self.fails(1, 'did you mean "octaoctree"', *t, "--field", "octoctree")
        self.fails(1, "--steps", *t, "--steps", "0")
        self.fails(1, "duration", *t, "--time", "never")
        self.fails(1, "train.time", *t, "--time", "0")
        self.fails(1, "--validate-every must be above 0", *t, "--reference", self.path("ref.exr"), "--validate-every", "0")
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
        resume = ("train", self.scene, "-o", self.model, *SMALL, "--resume", "--steps", 3)
        for name, content in broken.items():
            with self.subTest(name=name):
                self.damage(content)
                self.fails(2, "m.octrad", "render", self.scene, "--model", self.model, "-o", out)
                self.fails(2, "m.octrad", *resume)
                self.assert_untouched(content)
        self.assertFalse(os.path.exists(out))
        # Damage anywhere in the header is an error with a message. A model that is not usable is not written.
        size = int.from_bytes(sound[:8], "little")
        key = sound.index(b"octrad.checksums")  # under another name nothing is checked
        places = [place for place in range(8, 8 + size) if sound[place] != 32 and not key <= place < key + 16]
        for i in range(60):
            damaged = bytearray(sound)
            damaged[rng.choice(places)] ^= 1 << rng.randrange(8)
            self.damage(damaged)
            if i % 2 == 0:
                self.assertIn(self.model, self.fails(2, "", *resume).err)
            else:  # which does not read the optimiser's state, nor look at the checksums of that
                result = run("render", self.scene, "--model", self.model, "-o", out, "--spp", 1, "--width", 8, "-q")
                self.assertIn(result.code, (0, 2), result.err)
            self.assert_untouched(damaged)
        for bytes_left in [0, 1, 7, 8, 9, 8 + size - 1, 8 + size, 8 + size + 1, len(sound) - 1, *(rng.randrange(len(sound)) for _ in range(12))]:
            with self.subTest(bytes_left=bytes_left):
                self.damage(sound[:bytes_left])
                self.assertIn(self.model, self.fails(2, "", *resume).err)
                self.assert_untouched(sound[:bytes_left])

    def damage(self, content):
        with open(self.model, "wb") as file:
            file.write(content)

    def assert_untouched(self, content):
        with open(self.model, "rb") as file:
            self.assertTrue(file.read() == content)
        self.assertEqual([name for name in os.listdir(self.folder) if name.startswith(("m.octrad.", ".octrad"))], [])

    def test_a_flipped_bit_of_a_tensor_is_told(self):
        """In what is trained and in what only --resume needs, the first and the last byte included."""
        self.train("--steps", 2)
        with open(self.model, "rb") as file:
            sound = file.read()
        size = int.from_bytes(sound[:8], "little")
        tensors = {name: entry["data_offsets"] for name, entry in json.loads(sound[8:8 + size]).items() if name != "__metadata__"}
        rng = random.Random(1)
        for position in [8 + size, len(sound) - 1, *(rng.randrange(8 + size, len(sound)) for _ in range(18))]:
            name = next(name for name, (begin, end) in tensors.items() if begin <= position - 8 - size < end)
            with self.subTest(name, position=position):
                damaged = bytearray(sound)
                damaged[position] ^= 1 << rng.randrange(8)
                self.damage(damaged)
                for command in (("train", self.scene, "-o", self.model, *SMALL, "--resume", "--steps", 3),
                                ("render", self.scene, "--model", self.model, "-o", self.path("out.exr"), "--spp", 1, "-q")):
                    if command[0] == "train" or not name.startswith("optimizer."):
                        result = self.fails(2, "damaged", *command)
                        self.assertIn(self.model, result.err)
                        self.assertIn(name, result.err)
                self.assert_untouched(damaged)


class Query(Case):
    HEADER = "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha"

    def setUp(self):
        super().setUp()
        self.model = self.path("m.octrad")
        self.scene = self.write("room.xml", ROOM)
        self.ok("train", self.scene, "-o", self.model, *SMALL, "--steps", 3)

    def points(self, *rows, header=HEADER):
        return self.write("in.csv", "\n".join((header, *rows)) + "\n")

    def test_headers_of_other_programs(self):
        row = "0.1,-1,0,0,1,0,0,1,0,0.5,0.5,0.4,1"
        plain = self.ok("query", self.model, "--points", self.points(row)).out
        self.assertEqual(self.ok("query", self.model, "--points", self.points(row, header="\ufeff" + self.HEADER)).out, plain)
        self.fails(2, 'the header has the column "x" twice', "query", self.model, "--points", self.points(row + ",0", header=self.HEADER + ",x"))

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

    def test_traced_offsets(self):
        """Distances of glossy points come from the model's scene, a given one, or the file of points."""
        rough, glossy = "0.1,-1,0.2,0,1,0,0,1,0,0.5,0.6,0.4,1", "0.1,-1,0.2,0,1,0,0,1,0,0.5,0.6,0.4,0.2"
        points = self.points(glossy, rough)
        answer = self.ok("query", self.model, "--points", points)
        self.assertEqual(answer.err, "")
        d = [float(line.split(",")[0]) for line in answer.out.splitlines()[1:]]
        self.assertAlmostEqual(d[0], 1 / 1.95, 3)  # from the floor to the lamp under the ceiling
        self.assertEqual(d[1], 0)
        self.assertEqual(self.ok("query", self.model, "--points", points, "--scene", self.scene).out, answer.out)
        columns = ",disparity,met,ralpha,rnx,rny,rnz,rar,rag,rab,rer,reg,reb"
        lamp, nothing = ",1,1,0,-1,0,0.5,0.5,0.4,8,8,8", ",7,0,1,0,0,0,0,0,0,0,0,0"
        given = self.points(glossy + ",%.9g" % d[0] + lamp, rough + nothing, header=self.HEADER + columns)
        moved = self.path("moved.xml")
        os.rename(self.scene, moved)
        self.assertEqual(self.ok("query", self.model, "--points", given).out, answer.out)
        self.assertEqual(self.ok("query", self.model, "--points", self.points(rough)).err, "", "no scene is needed")
        points = self.points(glossy, rough)
        without = self.ok("query", self.model, "--points", points)
        self.assertIn("--scene says where", without.err)
        self.assertEqual(without.out.splitlines()[1].split(",")[0], "0")
        self.assertEqual(without.out.splitlines()[2], answer.out.splitlines()[2])
        self.assertEqual(self.ok("query", self.model, "--points", points, "--scene", moved).out, answer.out)
        with open(moved) as file:
            other = self.write("other.xml", file.read().replace('value="0.5"/>', 'value="0.25"/>'))
        self.fails(2, "another scene", "query", self.model, "--points", points, "--scene", other)
        self.fails(3, "none.xml", "query", self.model, "--points", points, "--scene", self.path("none.xml"))
        self.ok("query", self.model, "--points", points, "--scene", other, "--force")
        q = ("query", self.model, "--points")
        self.fails(2, "disparity: expected", *q, self.points(glossy + ",-1" + lamp, header=self.HEADER + columns))
        self.fails(2, "rnx,rny,rnz has length", *q, self.points(glossy + ",1" + lamp.replace("-1", "-2"), header=self.HEADER + columns))
        self.fails(2, "expected 0 or 1", *q, self.points(glossy + ",1,2" + lamp[2:], header=self.HEADER + columns))
        self.fails(2, "at least 0", *q, self.points(glossy + ",1" + lamp[:-1] + "-8", header=self.HEADER + columns))
        self.fails(2, 'lacks the column "met"', *q, self.points(glossy + ",1", header=self.HEADER + ",disparity"))
        self.ok("train", moved, "-o", self.model, *SMALL, "--steps", 3, "--overwrite", "-D", "lookup.reflected=none")
        answers = [self.ok(*q, p).out.splitlines()[1] for p in (points, self.points(glossy + ",%.9g" % d[0], header=self.HEADER + ",disparity"))]
        self.assertEqual(answers[0], answers[1])

    def test_geometric_normals(self):
        """Where rays start is decided by the geometric normal: this shading normal mirrors the view into the floor."""
        row, header = "0.1,-1,0.2,0,1,0,0.8,0.6,0,0.5,0.6,0.4,0.2", self.HEADER + ",ngx,ngy,ngz"
        disparity = lambda *points, **more: [float(line.split(",")[0]) for line in
                                             self.ok("query", self.model, "--points", self.points(*points, **more)).out.splitlines()[1:]]
        self.assertGreater(disparity(row)[0], 100, "started above the floor, it ends there")
        self.assertEqual(disparity(row + ",0,1,0", row + ",0,-1,0", header=header), [0, 0], "started below, nothing is met")
        self.assertEqual(disparity(row + ",0.8,0.6,0", header=header), disparity(row))
        straight = row.replace("0.8,0.6,0", "0,1,0")
        self.assertEqual(disparity(straight + ",0,1,0", header=header), disparity(straight))
        q = ("query", self.model, "--points")
        self.fails(2, "ng has length", *q, self.points(row + ",0,2,0", header=header))
        self.fails(2, "a normal needs all", *q, self.points(row + ",0", header=self.HEADER + ",ngy"))
        given = row + ",3,none,0" + 10 * ",0"
        header = self.HEADER + ",disparity,ngx,met,ralpha,rnx,rny,rnz,rar,rag,rab,rer,reg,reb"
        self.assertEqual(disparity(given, header=header), [3], "a given disparity needs no normal")

    def test_scene_options(self):
        """The scene of traced offsets is loaded as by other verbs."""
        points = self.points("0.1,-1,0.2,0,1,0,0,1,0,0.5,0.6,0.4,0.2")
        self.ok("train", self.scene, "-o", self.model, *SMALL, "--steps", 3, "--overwrite", "-D", "wall=0.3")
        q = ("query", self.model, "--points", points)
        self.assertIn("trained on another scene", self.ok(*q).err)
        self.fails(2, "--force uses it all the same", *q, "--scene", self.scene)
        answer = self.ok(*q, "-D", "wall=0.3")
        self.assertEqual(answer.err, "")
        self.assertGreater(float(answer.out.splitlines()[1].split(",")[0]), 0)
        forced = self.ok(*q, "--force").out  # another colour of the wall is reflected, as far away
        self.assertEqual(*[text.splitlines()[1].split(",")[:13] for text in (forced, answer.out)])
        self.assertNotEqual(forced, answer.out)
        self.assertEqual(self.ok(*q, "--scene", self.scene, "--force").err, "")
        self.fails(2, "trained on another scene", *q, "-D", "wall=0.2")
        self.fails(1, "the model fixes them", *q, "-D", "octree.levels=3")
        self.fails(1, "would overwrite", *q, "-D", "wall=0.3", "-o", self.scene)
        with open(self.scene) as file:
            velvet = self.write("velvet.xml", file.read().replace('type="roughconductor"', 'type="velvet"'))
        self.fails(2, "velvet", *q, "--scene", velvet, "--force")
        self.assertEqual(self.ok(*q, "--scene", velvet, "--force", "--permissive").out.splitlines()[1].split(",")[0], answer.out.splitlines()[1].split(",")[0])

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


class Memory(Case):
    """What --max-memory is held against is what training takes; the largest ratio is printed."""

    def check(self, scenes):
        ratios = []
        for scene, field in scenes:
            with self.subTest(scene, field=field):
                # The same threads in both, each of which holds memory as its turn comes.
                train = ("train", scene, "--field", field, "-o", self.path("m.octrad"), "--overwrite", "--steps", 3, "--threads", 2, "--json", "-q")
                report = self.ok(*train).json()
                estimate, peak = report["memory_estimate_bytes"], report["memory_peak_bytes"]
                self.assertLess(peak, 1.1 * estimate + 100e6)
                ratios.append((peak / estimate, os.path.basename(os.path.dirname(scene)), field))
                # With just that the same training is begun, ends, and is saved.
                tight = self.ok(*train, "--max-memory", int(max(1.05 * estimate, 1.02 * peak))).json()
                self.assertEqual(tight["steps"], 3)
        print(f"peak over estimate: at most {max(ratios)}", file=sys.stderr)

    def check_pictures(self, scenes):
        """A budget that the peak of a picture would break is refused before."""
        peaks = []
        with open(os.devnull, "w") as nowhere:
            for scene in scenes:
                with self.subTest(scene):
                    render = ("render", scene, "--integrator", "path", "--spp", 1, "--width", 1024, "-o", self.path("a.exr"), "--threads", 2, "-q")
                    code, peak, _ = measured(*render, stderr=nowhere)
                    self.assertEqual(code, 0)
                    peaks.append((round(peak / 1e6), os.path.basename(os.path.dirname(scene))))
                    budget = 0.97 * (peak - 100e6) / 1.1
                    if budget > 40e6:  # the program itself has half of that
                        code, peak, _ = measured(*render, "--max-memory", int(budget), stderr=nowhere)
                        self.assertEqual(code, 4)
                        self.assertLess(peak, 1.1 * budget + 100e6)
        print(f"pictures of 1024 pixels: largest peak {max(peaks)} MB", file=sys.stderr)

    def test_own_scenes(self):
        self.check_pictures(os.path.join(ROOT, "scenes", name, "scene.xml") for name in ("cornell-box", "glossy-room", "courtyard"))
        self.check((os.path.join(ROOT, "scenes", name, "scene.xml"), field)
                   for name, field in (("cornell-box", "octaoctree"), ("glossy-room", "nr"), ("courtyard", "octaoctree")))

    def test_shared_scenes(self):
        shared = os.environ.get("OCTRAD_SHARED", os.path.join(ROOT, "..", "shared"))
        scenes = sorted(glob.glob(os.path.join(shared, "scenes", "*", "scene.xml")))
        if not scenes:
            self.skipTest("SKIPPED: no scenes in OCTRAD_SHARED")
        self.check_pictures(scenes)
        self.check((scene, "octaoctree") for scene in scenes)


if __name__ == "__main__":
    unittest.main()
