"""octrad info of the program, the configuration, models and pictures."""
import json
import os
import struct
import unittest

from support import ROOM, Case, write_hdr, write_safetensors


class Info(Case):
    def test_program(self):
        info = self.ok("info", "--json", "--threads", "1").json()
        self.assertEqual(info["threads"], 1)
        self.assertRegex(info["version"], r"^\d+\.\d+\.\d+(-[a-z]+)?$")
        self.assertTrue(info["isa"])
        self.assertRegex(info["simd"], r"^[A-Z][A-Z0-9_]+$")
        text = self.ok("info").out
        self.assertIn(info["version"], text)
        self.assertRegex(text, r"SIMD +" + info["simd"] + " ")

    def test_keys(self):
        info = self.ok("info", "--keys", "--json").json()
        self.assertEqual(info["preset"], "cpu")
        keys = {k["key"]: k["value"] for k in info["keys"]}
        for key in ("octree.levels", "octree.features", "checkpoint.every", "disparity.base"):
            self.assertIn(key, keys)
        self.assertEqual(keys["octree.levels"], "6")
        paper = self.ok("info", "--keys", "--json", "--preset", "paper", "-D", "checkpoint.every=3s", "-D", "octree.levels=6").json()["config"]
        self.assertEqual((paper["octree"]["levels"], paper["checkpoint"]["every"], paper["train"]["steps"]), (6, 3.0, 20000))
        self.assertIn("octree.levels = 6", self.ok("info", "--keys").out)

    def test_resolved_config_reads_back(self):
        for preset in ("paper", "default", "cpu"):
            first = self.ok("info", "--keys", "--json", "--preset", preset, "-D", "adam.rate.features=0.0123").json()["config"]
            file = self.write("c.json", json.dumps(first))
            self.assertEqual(self.ok("info", "--keys", "--json", "--config", file).json()["config"], first)

    def test_broken_configuration(self):
        self.fails(1, 'did you mean "octree.levels"', "info", "--keys", "-D", "octree.level=5")
        self.fails(1, "expected key=value", "info", "--keys", "-D", "octree.levels")
        self.fails(1, "1 … 9", "info", "--keys", "-D", "octree.levels=10")
        self.fails(1, 'did you mean "paper"', "info", "--keys", "--preset", "papre")
        self.fails(1, "levels", "info", "--keys", "-D", "levels=5")
        self.fails(1, "belongs to a scene", "info", "--keys", "--check")
        self.assertEqual(self.ok("info", "--keys", "--json", "--seed", 7).json()["config"]["seed"], 7)
        scene = self.write("room.xml", ROOM)
        for options in (("--preset", "paper"), ("--sampled",), ("-D", "octree.levels=5")):
            self.fails(1, "looks at the scene alone", "info", scene, "--check", *options)
        self.assertIn("train.walks has no effect here: it needs train.sampler = mixture",
                      self.ok("info", scene, "--preset", "paper", "-D", "train.walks=0.5").err)
        self.assertIn("target.demodulate has no effect", self.ok("info", scene, "--preset", "paper", "-D", "target.demodulate=albedo").err)
        self.assertEqual(self.ok("info", scene, "-D", "train.walks=0.5").err, "")
        for key, needed in (("disparity.levels=8", "lookup.offset = predicted"), ("render.bounce_below=0.2", "render.highlights = auto or bounce"),
                            ("lookup.reflected=features", "lookup.offset = traced")):
            others = ("-D", "render.highlights=cache", "-D", "lookup.offset=none")
            self.assertIn(f"has no effect here: it needs {needed}", self.ok("info", scene, *others, "-D", key).err)
        for off in ("lookup.reflected=none", "render.metal_samples=0"):  # what is off has no effect to miss
            self.assertEqual(self.ok("info", scene, "-D", "lookup.offset=predicted", "-D", "render.delta=cache", "-D", off).err, "")
        self.assertIn("render.metal_samples has no effect", self.ok("info", scene, "-D", "render.delta=cache", "-D", "render.metal_samples=100").err)
        self.assertEqual(self.ok("info", scene, "--preset", "paper", "-D", "disparity.levels=8").err, "")
        self.fails(3, "none.json", "info", "--keys", "--config", self.path("none.json"))
        file = self.write("c.json", '{\n  "octree": {"levels": 5,}\n}')
        self.fails(2, "c.json:2:26: not valid JSON", "info", "--keys", "--config", file)
        file = self.write("c.json", '{"octree": {"level": 5}}')
        self.fails(2, 'c.json: unknown configuration key "octree.level"', "info", "--keys", "--config", file)
        file = self.write("c.json", '{"preset": "paper"}')
        self.fails(1, "contradict", "info", "--keys", "--config", file, "--preset", "cpu")

    def test_model(self):
        file = self.path("m.octrad")
        write_safetensors(file, {"octree.origin": ("F32", [3], struct.pack("<3f", 1, 2, 3)), "optimizer.x": ("F32", [1], bytes(4))},
                          {"format": "octrad", "version": "1", "config": json.dumps({"octree": {"levels": 5}}), "step": "12"})
        info = self.ok("info", file, "--json").json()
        self.assertEqual(info["metadata"]["config"], {"octree": {"levels": 5}})
        self.assertEqual(info["metadata"]["step"], 12)
        self.assertEqual((info["bytes"], info["optimizer_bytes"]), (16, 4))
        self.assertEqual({t["name"]: t["shape"] for t in info["tensors"]}, {"octree.origin": [3], "optimizer.x": [1]})
        self.assertIn("octree.origin", self.ok("info", file).out)

    def test_garbage_models(self):
        file = self.path("m.octrad")
        for content, text in ((b"", "empty"), (b"abc", "few bytes"), (os.urandom(4096), "header"), (struct.pack("<Q", 2) + b"[]", "JSON object"),
                              (struct.pack("<Q", 1 << 60) + b"{}", "claims")):
            with open(file, "wb") as out:
                out.write(content)
            self.fails(2, text, "info", file)
        write_safetensors(file, {}, {"format": "other"})
        self.fails(2, "no octrad model", "info", file)
        self.fails(3, "none.octrad", "info", self.path("none.octrad"))

    def test_picture(self):
        file = self.path("a.hdr")
        write_hdr(file, 4, 2, lambda x, y: (0.5, x, 0.0))
        info = self.ok("info", file, "--json").json()
        self.assertEqual((info["width"], info["height"]), (4, 2))
        channels = {c["name"]: c for c in info["channels"]}
        self.assertEqual((channels["G"]["min"], channels["G"]["mean"], channels["G"]["max"]), (0, 1.5, 3))
        self.assertIn("4 x 2", self.ok("info", file).out)

    def test_options_that_would_be_ignored_are_refused(self):
        picture = self.path("a.hdr")
        write_hdr(picture, 4, 2, lambda x, y: (0.5, x, 0.0))
        for words in ((picture, "-D", "octree.levels=3"), (picture, "--preset", "paper"), ("--preset", "paper"), ("-D", "octree.levels=3")):
            self.fails(1, "belong to a scene or to --keys", "info", *words)
        self.fails(1, "takes no FILE", "info", "--keys", picture)
        for words in ((picture,), ("--keys",), ("none.xml",), ("none.xml", "--check")):
            self.fails(1, "-D device.block: nothing runs on a device here", "info", *words, "-D", "device.block=64")
        self.fails(1, "nothing runs on a device here", "convert", "none.xml", "-o", self.path("a.xml"), "-D", "device.block=64")
        for words in ((picture,), (), ("--keys",)):
            self.fails(1, "--sampled belongs to a scene", "info", *words, "--sampled")

    def test_unknown_kind(self):
        self.fails(1, "cannot tell", "info", self.write("a.txt", ""))
        self.fails(3, "No such file", "info", self.path("none.txt"))

    def test_too_many_levels(self):
        scene = self.write("room.xml", ROOM)
        self.fails(1, "octree.levels = 9 and octree.fine = 1 are 10 levels", "info", scene, "-D", "octree.levels=9", "-D", "octree.fine=1")


if __name__ == "__main__":
    unittest.main()
