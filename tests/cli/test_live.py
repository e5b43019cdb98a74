"""octrad train --view, octrad view --train: a training that is watched and steered, and lights and materials that are edited while it goes
on. By a plain client; tests/test_view_page.py opens the page."""
import array
import json
import os
import signal
import subprocess
import tempfile
import unittest

import support
from exr import read_exr
from support import PATIENCE, ROOM, SMALL, Case, read_safetensors, start, wait_for
from test_view import SERVER, jpeg_size
from web_client import Viewer

# Two lamps instead of one, of which the second lights the left wall.
TWO_LAMPS = ROOM.replace("</scene>", """  <shape type="sphere" id="globe"><point name="center" x="-0.7" y="0" z="0.3"/><float name="radius" value="0.12"/>
    <emitter type="area"><rgb name="radiance" value="12, 9, 6"/></emitter></shape>
</scene>""")
LONG = ("-D", "train.steps=1000000", "-D", "checkpoint.every=1h", *SMALL)


def training(message):
    return isinstance(message, dict) and message["type"] == "training"


class Live(Case):
    def serve(self, verb, *arguments):
        process = start(verb, self.write("room.xml", getattr(self, "room", ROOM)), *arguments, "--json", program=SERVER if verb == "view" else None)
        self.addCleanup(self.finish, process)
        line = process.stdout.readline()
        self.assertTrue(line, process.stderr.read().decode() if process.poll() is not None else "")
        self.process = process
        return json.loads(line)["url"]

    def train(self, *arguments):
        return self.serve("train", "-o", self.path("m.octrad"), "--view", *(arguments or LONG))

    def finish(self, process):
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=PATIENCE)

    def viewer(self, url):
        viewer = Viewer(url)
        self.addCleanup(viewer.close)
        viewer.answer("state")
        return viewer

    def status(self, viewer, what=lambda status: True):
        """The last one that has come, or the first from now on; none comes where nothing changes any more."""
        known = [m for m in viewer.others if training(m)][-1:]
        return known[0] if known and what(known[0]) else viewer.until(lambda m: training(m) and what(m))

    def picture(self, viewer, side="a"):
        """The picture at rest as {channel: floats}."""
        status, _, body = viewer.get("/picture-%s.exr" % side)
        self.assertEqual(status, 200, body)
        with open(self.path("picture.exr"), "wb") as out:
            out.write(body)
        width, height, channels, attributes = read_exr(self.path("picture.exr"))
        return {c: array.array("f", channels[c]) for c in "RGB"}, attributes


class Watching(Live):
    def test_watched_and_steered(self):
        viewer = self.viewer(self.train())
        self.assertEqual(set(viewer.hello["training"]["curves"]), {"seconds", "loss", "rate", "mape"})
        self.assertIn("training points", viewer.hello["layers"])
        first = self.status(viewer, lambda s: s["step"] > 0)
        self.assertEqual((first["state"], first["saved"], first["steps"]), ("running", None, 1000000))
        self.assertGreater(first["loss"], 0)
        frames = [viewer.frame(lambda h: not h["moving"]) for _ in range(3)]
        self.assertEqual(frames[0].header["a"]["integrator"], "lhs")
        self.assertNotEqual(frames[0].pictures["a"], frames[2].pictures["a"], "the picture shows what is learnt")
        viewer.send("set", camera=dict(viewer.state["camera"], origin=[0.3, 0, 0.8]), input=5)
        viewer.frame(lambda h: h["input"] == 5)
        viewer.send("set", layer="training points")
        plain = viewer.frame(lambda h: not h["moving"])
        self.assertTrue(jpeg_size(plain.pictures["a"]))
        viewer.send("set", layer="")
        # Between steps a point of the field can be asked for.
        viewer.send("pick", x=0.5, y=0.5, id=3)
        self.assertEqual(len(viewer.answer("pick")["queries"]), 1)
        # While it is paused nothing changes, and the picture is taken at full size.
        viewer.send("train", do="pause")
        paused = self.status(viewer, lambda s: s["state"] == "paused")
        still = viewer.frames[-1] if viewer.frames[-1].header["a"]["samples"] >= 4 else viewer.frame(lambda h: h["a"]["samples"] >= 4)
        self.assertEqual((still.header["width"], still.header["height"]), (32, 24))
        viewer.send("train", do="save")
        saved = self.status(viewer, lambda s: s["saved"] is not None)
        self.assertEqual(saved["saved"], paused["step"])
        self.assertEqual(json.loads(read_safetensors(self.path("m.octrad"))[0]["state"])["step"], saved["saved"])
        viewer.send("train", do="start")
        later = self.status(viewer, lambda s: s["step"] > paused["step"] + 20)
        # Who does not have the controls only watches.
        other = Viewer("http://%s:%d/#token=%s" % (*viewer.address, viewer.token))
        self.addCleanup(other.close)
        self.assertGreater(len(other.answer("hello")["training"]["curves"]["loss"]), 0)
        for message in ({"do": "stop"}, {"lights": [{"light": 0, "factor": [0, 0, 0]}]}):
            other.send("train" if "do" in message else "edit", **message)
            other.answer("error")
            self.assertIn("another viewer has the controls", other.errors[-1])
        # Training goes on without anybody; stopping ends it once nobody watches.
        viewer.close()
        other.until(lambda m: isinstance(m, dict) and m.get("controller") == other.hello["you"])
        self.status(other, lambda s: s["step"] > later["step"] + 20)
        other.send("train", do="stop")
        stopped = self.status(other, lambda s: s["state"] == "stopped")
        self.assertIsNone(self.process.poll())
        other.close()
        self.process.send_signal(signal.SIGINT)  # rather than to wait for the last page to come back
        out, _ = self.process.communicate(timeout=PATIENCE)
        self.assertEqual(json.loads(out)["steps"], stopped["step"])

    def test_closed_pages_do_not_stop_it_and_it_ends_alone(self):
        url = self.train("-D", "train.steps=400", *SMALL)
        viewer = self.viewer(url)
        self.status(viewer, lambda s: s["step"] > 0)
        viewer.close()
        self.assertTrue(wait_for(lambda: os.path.exists(self.path("m.octrad"))))
        unwatched = subprocess.Popen([os.environ["OCTRAD"], "train", self.path("room.xml"), "-o", self.path("n.octrad"), "--view", "-D", "train.steps=20", *SMALL],
                                     stdout=subprocess.PIPE)
        out, _ = unwatched.communicate(timeout=PATIENCE)
        self.assertEqual(unwatched.returncode, 0)
        self.assertIn(b"http://127.0.0.1:", out)
        out, _ = self.process.communicate(timeout=PATIENCE)  # ten seconds after the last page was closed
        self.assertEqual((self.process.returncode, json.loads(out)["steps"]), (0, 400))

    def test_watching_does_not_change_the_bits(self):
        options = ("-D", "train.steps=300", *SMALL)
        viewer = self.viewer(self.train(*options))
        for i in range(4):
            viewer.send("set", camera=dict(viewer.state["camera"], origin=[0.1 * i, 0, 0.8]), input=i, a={"integrator": ("lhs", "rhs", "deferred", "path")[i]})
            viewer.send("pick", x=0.5, y=0.6)
            viewer.frame(lambda h: h["input"] == i)
        self.status(viewer, lambda s: s["finished"])
        viewer.frame(lambda h: h["a"]["samples"] >= 4)
        self.process.send_signal(signal.SIGINT)
        self.process.communicate(timeout=PATIENCE)
        self.ok("train", self.path("room.xml"), "-o", self.path("alone.octrad"), *options)
        self.assertEqual(read_safetensors(self.path("m.octrad"))[1], read_safetensors(self.path("alone.octrad"))[1])

    def test_a_finished_model_that_is_trained_on(self):
        """Checkpoints are written after the end, too, and edits are learnt after a stop."""
        model, output = self.path("m.octrad"), self.path("n.octrad")
        self.ok("train", self.write("room.xml", ROOM), "-o", model, "-D", "train.steps=20", "-D", "checkpoint.every=50ms", *SMALL)
        viewer = self.viewer(self.serve("view", "--model", model, "--train", "-o", output))
        self.assertIsNone(self.status(viewer)["saved"])
        viewer.send("train", do="start")
        self.status(viewer, lambda s: s["saved"] is not None and s["saved"] > 20)
        self.assertTrue(os.path.exists(output))
        viewer.send("train", do="stop")
        stopped = self.status(viewer, lambda s: s["state"] == "stopped")
        self.assertEqual((stopped["change"], stopped["ends"]), (0, False))
        viewer.send("edit", lights=[{"light": 0, "factor": [1, 0.5, 1]}])
        self.status(viewer, lambda s: s["state"] == "idle" and 0 < s["change"] < 0.9)
        self.assertEqual(self.status(viewer, lambda s: s["change"] == 0)["state"], "idle")
        # What has not been saved is, at the end.
        viewer.send("train", do="start")
        last = self.status(viewer, lambda s: s["state"] == "running" and s["step"] > s["saved"])
        self.process.send_signal(signal.SIGINT)
        self.process.communicate(timeout=PATIENCE)
        self.assertEqual(self.process.returncode, 130)
        self.assertGreaterEqual(json.loads(read_safetensors(output)[0]["state"])["step"], last["step"])

    def test_a_model_of_an_edited_scene_says_so(self):
        process = start("train", self.write("room.xml", ROOM), "-o", self.path("m.octrad"), "--view", *(word for word in LONG if word != "-q"))
        self.addCleanup(self.finish, process)
        viewer = self.viewer(process.stdout.readline().decode().strip())
        self.status(viewer, lambda s: s["step"] > 0)
        viewer.send("edit", lights=[{"light": 0, "factor": [1, 0.5, 1]}])
        viewer.answer("scene")
        self.status(viewer, lambda s: 0 < s["change"])
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 130)
        self.assertIn(b"it belongs to the edited scene", err)
        self.assertNotIn(b"--resume continues it", err)
        refused = self.fails(2, "lights or materials were edited", "train", self.path("room.xml"), "-o", self.path("m.octrad"), "--resume", *LONG)
        self.assertNotIn("--force", refused.err)

    def test_options(self):
        scene = self.write("room.xml", ROOM)
        self.fails(1, "--port", "train", scene, "-o", self.path("m.octrad"), "--port", "0")
        self.fails(1, "--train", "view", scene, "--train")
        self.fails(1, "--token", "train", scene, "-o", self.path("m.octrad"), "--view", "--token", "short")


class Edits(Live):
    room = TWO_LAMPS

    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.TemporaryDirectory(prefix="octrad-live-")
        cls.model = os.path.join(cls.shared.name, "learnt.octrad")
        scene = os.path.join(cls.shared.name, "room.xml")
        with open(scene, "w") as out:
            out.write(TWO_LAMPS)
        done = support.run("train", scene, "-o", cls.model, "-D", "train.steps=600", *SMALL)
        assert done.code == 0, done.err

    @classmethod
    def tearDownClass(cls):
        cls.shared.cleanup()

    def setUp(self):
        super().setUp()
        self.viewed = self.viewer(self.serve("view", "--model", self.model, "--train", "--width", "32", "--height", "24"))

    def settled(self, learnt=False):
        """The picture, or what it is once a change is learnt."""
        if learnt:
            self.status(self.viewed, lambda s: s["change"] > 0)
            self.status(self.viewed, lambda s: s["change"] == 0 and s["state"] == "idle")
        self.viewed.send("set", a={"integrator": "path"})
        self.viewed.frame(lambda h: h["a"]["integrator"] == "path" and not h["moving"])
        self.viewed.send("set", a={"integrator": "lhs"})
        self.viewed.frame(lambda h: h["a"]["integrator"] == "lhs" and not h["moving"] and h["a"]["samples"] >= 16)
        return self.picture(self.viewed)[0]

    def test_lights(self):
        viewer = self.viewed
        scene = next(m for m in viewer.others if m["type"] == "scene")
        self.assertEqual([light["name"] for light in scene["lights"]], ["lamp", "globe"])
        self.assertEqual(scene["lights"][1]["emission"], [12, 9, 6])
        status = next(m for m in viewer.others if m["type"] == "training")
        self.assertEqual((status["state"], status["step"], status["saves"]), ("idle", 600, False))
        before = self.settled()
        # All of the light at half power is half the picture, at once and without a step.
        viewer.send("edit", lights=[{"light": i, "factor": [0.5, 0.5, 0.5]} for i in range(2)])
        viewer.answer("scene")
        half = self.settled()
        self.assertEqual([m["step"] for m in viewer.others if training(m)][-1], 600)
        for channel in "RGB":
            self.assertAlmostEqual(sum(half[channel]), 0.5 * sum(before[channel]), delta=0.005 * sum(before[channel]))
        # One lamp off: the cache learns it, and is what paths say then.
        viewer.send("edit", lights=[{"light": 0, "factor": [1, 1, 1]}, {"light": 1, "factor": [0, 0, 0]}])
        off = self.settled(True)
        viewer.send("set", a={"integrator": "path"})
        viewer.frame(lambda h: h["a"]["integrator"] == "path" and h["a"]["samples"] >= 1024)
        truth, attributes = self.picture(viewer)
        self.assertNotEqual(json.loads(attributes["octrad.scene"])["fingerprint"], json.loads(read_safetensors(self.model)[0]["scene"])["fingerprint"])
        mean = lambda picture: sum(sum(picture[c]) for c in "RGB")
        self.assertGreater(mean(before), 1.15 * mean(truth), "the lamp did something")
        self.assertAlmostEqual(mean(off), mean(truth), delta=0.05 * mean(truth))
        self.assertEqual(viewer.errors, [])

    def test_materials(self):
        viewer = self.viewed
        scene = next(m for m in viewer.others if m["type"] == "scene")
        white, metal = (next(m for m in scene["materials"] if m["name"] == name) for name in ("white", "metal"))
        self.assertEqual((white["model"], "roughness" in white, round(metal["roughness"], 6)), ("diffuse", False, 0.2))
        before = self.settled()
        viewer.send("edit", material=white["material"], color=[0.8, 0.1, 0.1])
        changed = viewer.answer("scene")
        self.assertEqual(next(m for m in changed["materials"] if m["name"] == "white")["edit"], {"color": [0.8, 0.1, 0.1]})
        after = self.settled(True)
        self.assertGreater(sum(after["R"]), 1.2 * sum(before["R"]))
        self.assertLess(sum(after["G"]), 0.4 * sum(before["G"]))
        viewer.send("edit", material=metal["material"], roughness=0.6)
        self.status(viewer, lambda s: s["change"] > 0)
        viewer.send("edit", material=white["material"])
        viewer.send("edit", material=metal["material"])
        viewer.until(lambda m: isinstance(m, dict) and m["type"] == "scene" and not any(material["edit"] for material in m["materials"]))

    def test_what_is_refused(self):
        viewer = self.viewed
        bad = [("train", {}), ("train", {"do": "fly"}), ("train", {"do": 3}), ("train", {"do": "start", "now": True}), ("train", {"do": "save"}), ("edit", {}),
               ("edit", {"lights": []}), ("edit", {"lights": 3}), ("edit", {"lights": [3]}), ("edit", {"lights": [{"light": 2, "factor": [1, 1, 1]}]}),
               ("edit", {"lights": [{"light": 0}]}), ("edit", {"lights": [{"light": 0, "factor": [1, 1]}]}), ("edit", {"lights": [{"light": 0, "factor": [1, -1, 1]}]}),
               ("edit", {"lights": [{"light": 0, "factor": [1, 1e5, 1]}]}), ("edit", {"lights": [{"light": 0, "factor": [1, 1, 1], "x": 1}]}),
               ("edit", {"lights": [{"light": 0, "factor": [1, 1, 1]}] * 3}), ("edit", {"lights": [{"light": 0, "factor": [1, 1, 1]}], "material": 0}),
               ("edit", {"material": 99}), ("edit", {"material": 1.5}), ("edit", {"material": 0, "colour": [1, 1, 1]}), ("edit", {"material": 1, "color": [1, 1, 2]}),
               ("edit", {"material": 1, "roughness": 0.5, "color": 3}), ("edit", {"material": 1, "roughness": 2})]
        for kind, members in bad:
            viewer.send(kind, **members)
            viewer.answer("error")
        self.assertEqual(len(viewer.errors), len(bad))
        self.assertIn('"factor" must be a list of 3 finite numbers', viewer.errors)
        # A page shows an edit before it is answered: a refusal comes with the scene as it is.
        scenes = [m for m in viewer.others if m["type"] == "scene"]
        self.assertEqual(len(scenes), 1 + sum(kind == "edit" for kind, _ in bad))
        self.assertTrue(all(scene == scenes[0] for scene in scenes))
        viewer.send("train", do="pause")  # something that is answered
        status = self.status(viewer, lambda s: s["state"] == "paused")
        self.assertEqual((status["step"], status["change"]), (600, 0))
        self.assertEqual(self.viewer("http://%s:%d/#token=%s" % (*viewer.address, viewer.token)).others[0], next(m for m in viewer.others if m["type"] == "scene"))


if __name__ == "__main__":
    unittest.main()
