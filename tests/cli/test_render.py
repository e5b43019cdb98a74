"""octrad render --integrator path, and what every integrator shares."""
import array
import json
import os
import re
import resource
import signal
import unittest

from exr import read_exr
from support import PATIENCE, ROOM, Case, holds, start, wait_for, write_pfm

LAYERS = ["R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z", "depth.Z", "roughness.Y"]


class Render(Case):
    def setUp(self):
        super().setUp()
        self.scene = self.write("room.xml", ROOM)
        self.out = self.path("out.exr")

    def render(self, *options, out=None):
        return self.ok("render", self.scene, "-o", out or self.out, "--json", "-q", *options).json()

    def channels(self, file=None):
        return {c["name"]: c for c in self.ok("info", file or self.out, "--json").json()["channels"]}

    def assert_same_picture(self, a, b):
        """Every channel, bit by bit."""
        self.assertEqual(read_exr(a)[:3], read_exr(b)[:3])

    def assert_other_picture(self, a, b):
        self.assertGreater(self.ok("compare", a, b, "--json").json()["images"][0]["mse"], 0)

    def test_a_disk_that_fills_keeps_the_old_picture(self):
        self.render("--spp", "1")
        with open(self.out, "rb") as file:
            before = file.read()
        limit = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024, limit[1]))   # inherited by the program
        try:
            self.fails(3, "cannot write", "render", self.scene, "-o", self.out, "--spp", "4")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        with open(self.out, "rb") as file:
            self.assertEqual(file.read(), before)

    def test_report_and_layers(self):
        report = self.render("--integrator", "path", "--spp", "4")
        self.assertEqual((report["width"], report["height"], report["spp"]), (32, 24, 4))
        for key in ("seconds", "samples_per_s", "rays_per_s"):
            self.assertGreater(report[key], 0)
        self.assertEqual(report["queries_per_s"], 0)
        info = self.ok("info", self.out, "--json").json()
        self.assertEqual(sorted(c["name"] for c in info["channels"]), sorted(LAYERS))
        channels = self.channels()
        self.assertAlmostEqual(channels["roughness.Y"]["min"], 0.2, places=5)
        self.assertAlmostEqual(channels["albedo.B"]["min"], 0.4, places=5)
        self.assertEqual(sum(c["non_finite"] for c in channels.values()), 0)
        self.assertEqual(json.loads(info["metadata"]["octrad.render"])["integrator"], "path")
        self.assertEqual(json.loads(info["metadata"]["octrad.scene"])["file"], self.scene)

    def test_the_ending_says_what_is_written(self):
        self.render("--spp", 2)
        radiance = {c: v["mean"] for c, v in self.channels().items() if c in "RGB"}
        for name, magic in (("a.hdr", b"#?RADIANCE"), ("a.pfm", b"PF"), ("a.PNG", b"\x89PNG"), ("a.jpg", b"\xff\xd8\xff")):
            out = self.path(name)
            self.assertEqual(self.render("--spp", 2, out=out)["output"], out)
            with open(out, "rb") as file:
                self.assertEqual(file.read(len(magic)), magic)
            self.assertEqual(set(self.channels(out)), {"R", "G", "B"})
        for channel, mean in radiance.items():
            self.assertAlmostEqual(self.channels(self.path("a.pfm"))[channel]["mean"], mean, places=6)
            self.assertAlmostEqual(self.channels(self.path("a.hdr"))[channel]["mean"], mean, delta=0.005 * mean)
        # For the screen: the bytes of tonemap.
        shown = self.path("b.png")
        self.ok("tonemap", self.out, "-o", shown)
        with open(self.path("a.PNG"), "rb") as a, open(shown, "rb") as b:
            self.assertEqual(a.read(), b.read())
        for name in ("a.tif", "a", "exr"):
            self.fails(1, ".exr, .hdr or .pfm", "render", self.scene, "-o", self.path(name), "--spp", 1)
            self.assertFalse(os.path.exists(self.path(name)))

    def test_log(self):
        log = self.path("log.jsonl")
        self.render("--spp", 2, "--log-json", log)
        with open(log) as lines:
            events = [json.loads(line) for line in lines]
        self.assertEqual([e["event"] for e in events][:2], ["start", "progress"])
        self.assertEqual(events[-1]["event"], "done")
        self.assertEqual({k: events[0][k] for k in ("scene", "integrator", "width", "height", "device")},
                         {"scene": self.scene, "integrator": "path", "width": 32, "height": 24, "device": "cpu"})

    def test_parameters_that_change_nothing_are_told(self):
        result = self.ok("render", self.scene, "-o", self.out, "--spp", 1, "-q", "-D", "spp=32")
        self.assertIn("-D spp=32 changes nothing", result.err)
        self.assertEqual(self.ok("render", self.scene, "-o", self.out, "--spp", 1, "-q", "-D", "wall=0.3").err, "")

    def test_size(self):
        for options, size in (((), (32, 24)), (("--width", 16), (16, 12)), (("--height", 48), (64, 48)), (("--width", 10, "--height", 10), (10, 10))):
            report = self.render("--spp", 1, *options)
            self.assertEqual((report["width"], report["height"]), size)

    def test_crop_is_part_of_the_picture(self):
        whole, crop = self.path("whole.exr"), self.path("crop.exr")
        self.render("--spp", 2, out=whole)
        report = self.render("--spp", 2, "--crop", "0,0,32,24", out=crop)
        self.assert_same_picture(whole, crop)
        report = self.render("--spp", 2, "--crop", "4,5,6,7", out=crop)
        self.assertEqual((report["width"], report["height"]), (6, 7))
        (width, _, all_of, _), (_, _, part_of, _) = read_exr(whole), read_exr(crop)
        floats = lambda raw: array.array("f", raw)
        for channel in "RGB":
            pixels = floats(all_of[channel])
            self.assertEqual(floats(part_of[channel]), array.array("f", (pixels[y * width + x] for y in range(5, 12) for x in range(4, 10))), channel)

    def test_mask_renders_those_pixels_and_no_others(self):
        # The sensor's filter is a box; the other reaches over a pixel's rim.
        wide = self.path("wide.xml")
        with open(self.scene) as file, open(wide, "w") as out:
            out.write(file.read().replace('<rfilter type="box"/>', '<rfilter type="tent"/>'))
        white = lambda x, y: (x // 4 + y // 4) % 3 == 0
        mask, whole, some = self.path("mask.pfm"), self.path("whole.exr"), self.path("some.exr")
        write_pfm(mask, 32, 24, lambda x, y: (1, 1, 1) if white(x, y) else (0.9, 0.5, 0))
        for scene in (self.scene, wide):
            for options in ((), ("--crop", "3,2,20,13")):
                with self.subTest(scene=scene, options=options):
                    self.ok("render", scene, "-o", whole, "--spp", 5, *options)
                    report = self.ok("render", scene, "-o", some, "--spp", 5, "--mask", mask, "--json", *options).json()
                    x0, y0 = (3, 2) if options else (0, 0)
                    width, height, a, _ = read_exr(whole)
                    b = read_exr(some)
                    floats = lambda raw: list(array.array("f", raw))
                    self.assertEqual((report["width"], report["height"]), (width, height))
                    for channel in a:
                        expected = [v if white(x0 + p % width, y0 + p // width) else 0 for p, v in enumerate(floats(a[channel]))]
                        self.assertEqual(floats(b[2][channel]), expected, channel)
                    self.assertIn("mask", json.loads(b[3]["octrad.render"]))
                    if scene == self.scene and not options:
                        pixels = sum(white(x, y) for x in range(32) for y in range(24))
                        self.assertAlmostEqual(report["samples_per_s"] * report["seconds"], 5 * pixels, places=3)

    def test_wrong_masks(self):
        r = ("render", self.scene, "-o", self.out, "--spp", 1)
        mask, small, black = self.path("mask.pfm"), self.path("small.pfm"), self.path("black.pfm")
        write_pfm(mask, 32, 24, lambda x, y: (1, 1, 1) if x < 4 else (0, 0, 0))
        write_pfm(small, 16, 12, lambda x, y: (1, 1, 1))
        write_pfm(black, 32, 24, lambda x, y: (0, 0, 0))
        self.fails(2, "small.pfm: a mask of 16 x 12 pixels for a picture of 32 x 24", *r, "--mask", small)
        self.fails(1, "leaves out every pixel", *r, "--mask", black)
        self.fails(1, "leaves out every pixel", *r, "--mask", mask, "--crop", "4,0,8,8")
        self.fails(3, "none.pfm", *r, "--mask", self.path("none.pfm"))
        self.fails(1, "--mask", *r, "--mask", mask, "--denoise")
        self.fails(1, "--mask", *r, "--mask", mask, "--frames", 2)
        self.fails(1, "--crop", *r, "--crop", "1e10,0,1,1")
        self.fails(1, "overwrite", "render", self.scene, "-o", mask, "--spp", 1, "--mask", mask)
        self.assertFalse(os.path.exists(self.out))
        self.ok(*r, "--mask", mask)
        self.assertIn("rendered with --mask", self.ok("compare", self.out, self.out).err)
        self.assertNotIn("rendered with --mask", self.ok("compare", self.out, self.out, "--mask", mask).err)
        self.fails(2, "--mask", "train", self.scene, "-o", self.path("m.octrad"), "--steps", 1, "--reference", self.out)
        whole, other = self.path("whole.exr"), self.path("other.exr")
        self.ok("render", self.scene, "-o", whole, "--spp", 1, "--seed", 1)
        self.fails(2, "differ in their mask", "merge", self.out, whole, "-o", other)
        self.ok("render", self.scene, "-o", self.path("whole.pfm"), "--spp", 1, "--seed", 1)
        self.fails(2, "differ in their mask", "merge", self.out, self.path("whole.pfm") + ":1", "-o", other)
        self.fails(2, "rendered with --mask", "denoise", self.out, "-o", other)
        masked = self.ok("compare", whole, self.out, "--mask", mask, "--json").json()["images"][0]
        self.assertEqual((masked["ssim"], masked["flip"]), (None, None))
        self.assertGreater(masked["mape"], 0)
        # The noise of a mean is that of the pixels that were rendered.
        self.ok("render", self.scene, "-o", whole, "--spp", 1, "--seed", 1, "--mask", mask)
        merged = self.ok("merge", self.out, whole, "-o", other, "--json").json()
        noise = self.ok("compare", self.out, whole, "--mask", mask, "--json").json()["images"][0]
        self.assertGreater(merged["noise"]["mape"], 0.2 * noise["mape"])
        self.assertEqual(json.loads(read_exr(other)[3]["octrad.render"])["mask"], json.loads(read_exr(whole)[3]["octrad.render"])["mask"])

    def test_same_bits_at_any_thread_count_and_other_bits_for_another_seed(self):
        a, b, c = (self.path(n) for n in ("a.exr", "b.exr", "c.exr"))
        self.render("--spp", 3, "--threads", 1, out=a)
        self.render("--spp", 3, "--threads", 4, out=b)
        self.render("--spp", 3, "--seed", 7, out=c)
        self.assert_same_picture(a, b)
        self.assert_other_picture(a, c)

    def test_depth_and_scene_parameters(self):
        self.render("--max-depth", 1, "--spp", 1)
        emission_only = self.channels()
        self.assertIn(emission_only["R"]["max"], (0, 8))
        a, b = self.path("a.exr"), self.path("b.exr")
        self.render(out=a)  # the scene's depth is 6
        self.render("--max-depth", 6, out=b)
        self.assert_same_picture(a, b)
        self.render("-D", "wall=0.25", "--spp", 1, out=b)
        self.assertAlmostEqual(self.channels(b)["albedo.R"]["min"], 0.25, places=5)

    def test_cameras(self):
        a, b, c = (self.path(n) for n in ("a.exr", "b.exr", "c.exr"))
        self.render("--spp", 1, out=a)
        self.render("--spp", 1, "--origin", "0,0,0.9", "--target", "0,-0.2,0", out=b)
        self.assert_same_picture(a, b)
        camera = self.write("camera.json", json.dumps({"origin": [0, 0, 0.9], "target": [0, -0.2, 0], "fov": 60}))
        self.render("--spp", 1, "--camera", camera, out=c)
        self.assert_same_picture(a, c)
        self.render("--spp", 1, "--sensor", 0, "--fov", 30, out=c)
        self.assert_other_picture(a, c)
        # The camera in the file's metadata is one for --camera.
        metadata = self.ok("info", c, "--json").json()["metadata"]
        self.render("--spp", 1, "--camera", self.write("again.json", metadata["octrad.camera"]), out=b)
        self.assertLess(self.ok("compare", b, c, "--json").json()["images"][0]["mape"], 1e-3)

    def test_time(self):
        report = self.render("--time", "300ms", "--spp", 1000000)
        self.assertLess(report["spp"], 1000000)
        self.assertGreater(report["spp"], 0)
        self.assertFalse(report["interrupted"])

    def test_masks_share_no_pixel_and_miss_none(self):
        self.render("--spp", 4)
        pixels = lambda *o: self.ok("compare", self.out, self.out, "--json", *o).json()["images"][0]["pixels"]
        below, above = pixels("--alpha-below", 0.5), pixels("--alpha-above", 0.5)
        self.assertGreater(below, 10)
        self.assertGreater(above, 10)
        self.assertEqual(below + above, 32 * 24)
        self.assertEqual(pixels("--alpha-above", 0.2, "--alpha-below", 0.9), pixels("--alpha-below", 0.9))
        nothing = self.ok("compare", self.out, self.out, "--json", "--alpha-below", 0.1).json()["images"][0]
        self.assertEqual((nothing["pixels"], nothing["mape"]), (0, None))

    def test_interrupt_saves_what_is_done(self):
        log = self.path("log.jsonl")
        process = start("render", self.scene, "-o", self.out, "--spp", 100000000, "--log-json", log)
        self.assertTrue(wait_for(lambda: holds(log, "progress")))
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 130, err)
        self.assertIn(self.out, err.decode())
        self.assertGreater(self.channels()["G"]["mean"], 0)

    def test_refusals(self):
        r = ("render", self.scene, "-o", self.out)
        self.fails(1, 'did you mean "path"', *r, "--integrator", "paht")
        self.fails(1, "--model", *r, "--integrator", "lhs")
        self.fails(1, "--spp", *r, "--spp", "0")
        self.fails(1, "duration", *r, "--time", "soon")
        self.fails(1, "--crop", *r, "--crop", "1,2,3")
        self.fails(1, "crop", *r, "--crop", "30,0,10,10")
        self.fails(1, "--sensor 3", *r, "--sensor", "3")
        self.fails(1, "exclude each other", *r, "--sensor", "0", "--origin", "0,0,0", "--target", "0,0,1")
        self.fails(1, "belong together", *r, "--origin", "0,0,0")
        self.fails(1, "expected 3 numbers", *r, "--origin", "0,0", "--target", "0,0,1")
        self.fails(1, "--model", *r, "--force")
        good = self.write("good.json", json.dumps({"origin": [0, 0, 0.9], "target": [0, -0.2, 0]}))
        self.fails(1, "says the field of view", *r, "--camera", good, "--fov", 30)
        self.fails(2, "camera.json", *r, "--camera", self.write("camera.json", "{}"))
        self.fails(3, "none.json", *r, "--camera", self.path("none.json"))
        self.fails(3, "does not exist", "render", self.scene, "-o", self.path("none/out.exr"))
        self.fails(3, "none.xml", "render", self.path("none.xml"), "-o", self.out)
        self.fails(1, '"few" is not a whole number', *r, "--spp", "few")
        result = self.fails(4, "--crop", *r, "--width", "100000", "--max-memory", "1G")
        self.assertIn("the budget is 1.00 GiB", result.err)
        # Not the picture alone, which has room.
        result = self.fails(4, "the budget is 50.0 MiB", *r, "--width", "512", "--max-memory", "50M")
        picture, held = (float(re.search(r"([\d.]+) MiB  " + what, result.err).group(1)) for what in ("picture", "the program, the scene and the model, in memory already"))
        self.fails(4, "the budget is", *r, "--width", "512", "--max-memory", int((picture + held / 2) * 2 ** 20))
        self.fails(1, "octree.levels", *r, "-D", "octree.levels=3")
        result = self.fails(2, "wal", *r, "-D", "wal=0.1")
        self.assertIn("wall", result.err)
        self.assertFalse(os.path.exists(self.out))
        # Told before the first sample.
        wide = self.path("wide.jpg")
        self.fails(1, "JPEG has at most 65500 pixels a side", "render", self.scene, "-o", wide, "--width", "65501", "--height", "1")
        self.assertFalse(os.path.exists(wide))

    def test_broken_scenes_say_where(self):
        for text, where in ((ROOM.replace("</scene>", ""), "room.xml:"), (ROOM.replace('type="roughconductor"', 'type="roughcondutcor"'), "room.xml:12:"),
                            (ROOM.replace('type="cube"', 'type="cub"'), "room.xml:13:"), (ROOM.replace('<ref id="metal"/>', '<ref id="meta"/>'), "room.xml:16:"),
                            (ROOM.replace('value="60"', 'value="wide"'), "room.xml:6:"), ("", "room.xml")):
            scene = self.write("room.xml", text)
            self.fails(2, where, "render", scene, "-o", self.out)
            self.fails(2, where, "info", scene)

    def test_info_of_a_scene(self):
        info = self.ok("info", self.scene, "--json", "-D", "octree.levels=3").json()
        self.assertEqual((info["triangles"], info["lights"]), (12 + 2 + 2, 1))
        self.assertEqual(info["bounds"], {"lower": [-1, -1, -1], "upper": [1, 1, 1]})
        self.assertEqual([l["level"] for l in info["levels"]], [1, 2, 3])
        for level in info["levels"]:
            self.assertEqual(level["spatial_resolution"], 2 ** (level["level"] + 1))
            self.assertEqual(level["octahedral_resolution"], 2 ** (4 - level["level"]))
            self.assertEqual(level["entries"], level["cells"] * (level["octahedral_resolution"] + 1) ** 2)
            self.assertEqual(level["bytes"], level["entries"] * 16)
            self.assertLessEqual(level["cells"], level["spatial_resolution"] ** 3)
        self.assertEqual(info["entries"], sum(level["entries"] for level in info["levels"]))
        domain = info["domain"]
        self.assertEqual((domain["outside"], domain["size"]), (0, [domain["scene_size"]] * 3))
        self.assertAlmostEqual(domain["finest_cell"], domain["scene_size"] / 16, 5)
        self.assertGreater(domain["seen_distance"], 20 * domain["seen_pixel"])
        half = self.ok("info", self.scene, "--json", "-D", "octree.bounds=-1,-1,-1,0,1,1", "-D", "octree.box=axis").json()["domain"]
        for found, expected in zip(half["origin"] + half["size"], [-1.01, -1.01, -1.01, 1.02, 2.02, 2.02]):
            self.assertAlmostEqual(found, expected, 5)
        self.assertGreater(half["outside"], 0.2)
        self.fails(1, "octree.bounds", "info", self.scene, "-D", "octree.bounds=-1,-1,-1,0,1,-1")
        text = self.ok("info", self.scene).out
        self.assertRegex(text, r"box 2\.02 wide, finest cell 0\.0158 \([\d.]+ pixels at [\d.]+, the median distance of what the sensors see\)")
        self.assertIn("octahedral", text)
        self.assertRegex(text, r"model file about [\d.]+ MiB with what --resume needs, about [\d.]+ MiB with --no-optimizer")
        self.assertEqual(info["model_file"]["without_optimizer"] > info["bytes"], True)
        camera = info["cameras"][0]
        self.assertEqual((camera["type"], camera["fov_axis"], camera["crop_size"]), ("perspective", "x", [1, 1]))
        self.assertIn("type", camera["filter"])
        # Another field has no octree to show.
        other = self.ok("info", self.scene, "-D", "field=nr")
        self.assertIn("Neural Radiosity", other.out)
        self.assertNotIn("OctaOctree", other.out)
        self.assertNotIn("octahedral", other.out)
        self.assertIn("octree.levels: the field nr does not use it", self.ok("info", self.scene, "-D", "field=nr", "-D", "octree.levels=3").err)
        self.fails(1, "no octree", "info", self.scene, "-D", "field=nr", "--sampled")
        self.assertEqual(self.ok("info", self.scene, "-D", "field=nr", "--json").json()["levels"], [])


if __name__ == "__main__":
    unittest.main()
