"""octrad compare, merge and tonemap."""
import csv as csv_module
import json
import math
import os
import struct
import subprocess
import unittest
import zlib

from exr import write_exr
from support import ROOM, Case, write_hdr, write_pfm


def read_png(path):
    """8-bit RGB PNG whose rows use any filter -> width, height, rows of bytes."""
    with open(path, "rb") as file:
        raw = file.read()
    assert raw[:8] == b"\x89PNG\r\n\x1a\n"
    position, data = 8, b""
    while position < len(raw):
        size, kind = struct.unpack(">I4s", raw[position:position + 8])
        body = raw[position + 8:position + 8 + size]
        if kind == b"IHDR":
            width, height, depth, color = struct.unpack(">IIBB", body[:10])
            assert (depth, color) == (8, 2)
        if kind == b"IDAT":
            data += body
        position += 12 + size
    flat, rows, previous, stride = zlib.decompress(data), [], bytes(width * 3), width * 3
    for y in range(height):
        kind, line = flat[y * (stride + 1)], bytearray(flat[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride):
            a, b, c = line[i - 3] if i >= 3 else 0, previous[i], previous[i - 3] if i >= 3 else 0
            p = a + b - c
            paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            line[i] = (line[i] + (0, a, b, (a + b) // 2, paeth)[kind]) & 255
        rows.append(bytes(line))
        previous = rows[-1]
    return width, height, rows


class Compare(Case):
    def setUp(self):
        super().setUp()
        self.ref, self.same, self.double, self.small = (self.path(n) for n in ("ref.hdr", "same.hdr", "double.hdr", "small.hdr"))
        write_hdr(self.ref, 8, 8, lambda x, y: (1.0, 0.5, 0.25))
        write_hdr(self.same, 8, 8, lambda x, y: (1.0, 0.5, 0.25))
        write_hdr(self.double, 8, 8, lambda x, y: (2.0, 1.0, 0.5) if x == 0 else (1.0, 0.5, 0.25))
        write_hdr(self.small, 4, 8, lambda x, y: (1.0, 0.5, 0.25))

    def test_json_is_complete_and_right(self):
        result = self.ok("compare", self.ref, self.same, self.double, "--json").json()
        same, double = result["images"]
        fields = {"image", "mape", "mape_trimmed", "mse", "relmse", "psnr", "mean_ratio", "pixels", "ssim", "flip", "lpips", "lpips_net"}
        self.assertTrue(fields <= set(same))
        self.assertEqual((same["flip"], same["lpips"], same["lpips_net"], same["flip_range"]), (0, None, "alex", "hdr"))
        self.assertIsNone(same["ssim"], "no window of SSIM fits into 8 x 8 pixels")
        self.assertGreater(double["flip"], 0)
        self.assertEqual(same["image"], self.same)
        self.assertEqual((same["mape"], same["mse"], same["pixels"], same["mean_ratio"]), (0, 0, 64, 1))
        expected = sum(v / (v + 0.01) for v in (1.0, 0.5, 0.25)) / 3 / 8
        self.assertAlmostEqual(double["mape"], expected, places=6)
        self.assertAlmostEqual(double["mean_ratio"], 1 + 1 / 8, places=6)
        self.assertAlmostEqual(double["mse"], (1 + 0.25 + 0.0625) / 3 / 8, places=6)
        self.assertTrue(math.isfinite(double["psnr"]))

    def test_table(self):
        lines = self.ok("compare", self.ref, self.same, self.double).out.splitlines()
        self.assertEqual(len(lines), 3)
        self.assertIn("MAPE", lines[0])
        self.assertIn("mean ratio", lines[0])

    def test_error_images(self):
        self.ok("compare", self.ref, self.same, self.double, "--errors", self.path("e/f"), "--error-max", "0.25")
        self.assertEqual(sorted(os.listdir(self.path("e/f"))), ["double.error.exr", "double.error.png", "same.error.exr", "same.error.png"])
        width, height, rows = read_png(self.path("e/f/double.error.png"))
        self.assertEqual((width, height), (8, 8))
        self.assertGreater(min(rows[0][0:3]), 220, "error above the maximum is white")
        self.assertEqual(rows[0][3:6], b"\0\0\0", "no error is black")

    def test_flip_map(self):
        flip = self.ok("compare", self.ref, self.double, "--errors", self.path("e"), "--error-kind", "flip", "--json").json()["images"][0]["flip"]
        channels = self.ok("info", self.path("e/double.error.exr"), "--json").json()["channels"]
        self.assertAlmostEqual(channels[0]["mean"], flip, places=5)

    def test_signed_errors(self):
        self.ok("compare", self.ref, self.double, "--errors", self.path("e"), "--signed", "--error-max", "1")
        self.assertEqual(len(os.listdir(self.path("e"))), 4)
        row = read_png(self.path("e/double.signed.png"))[2][0]
        self.assertTrue(row[0] > 2 * row[2] and row[3:6] == b"\xff\xff\xff", "too bright is red, equal is white")
        self.fails(1, "--errors", "compare", self.ref, self.double, "--signed")

    def test_pictures_for_the_screen(self):
        """A picture and its own PNG differ by rounding, whatever the picture's range."""
        bright, other, png, other_png = (self.path(n) for n in ("bright.pfm", "other.pfm", "a.png", "b.png"))
        write_pfm(bright, 32, 24, lambda x, y: (x / 16, y / 24, 0.2))
        write_pfm(other, 32, 24, lambda x, y: (x / 16, y / 24, 0.3))
        self.ok("tonemap", bright, "-o", png)
        self.ok("tonemap", other, "-o", other_png)
        for pair in ((bright, png), (png, bright)):
            result = self.ok("compare", *pair, "--json")
            (entry,) = result.json()["images"]
            self.assertAlmostEqual(entry["mean_ratio"], 1, delta=0.003)
            self.assertLess(entry["mape"], 0.02)
            self.assertEqual(entry["flip_range"], "ldr")
            self.assertIn("limited to [0, 1]", result.err)
        both = self.ok("compare", png, other_png, "--json")
        (entry,) = both.json()["images"]
        self.assertNotIn("limited", both.err)
        self.assertAlmostEqual(entry["mape"], 0.1 / 0.21 / 3, delta=0.01)  # of linear values
        self.assertAlmostEqual(entry["flip"], self.ok("compare", bright, other_png, "--json").json()["images"][0]["flip"], delta=0.02)  # 8 bits
        self.fails(2, "linear radiance", "compare", bright, other, "--reference-b", png)

    def test_tables(self):
        name = self.path("a_&,\"b.hdr")
        os.rename(self.double, name)
        csv, latex = self.path("t.csv"), self.path("t.tex")
        images = self.ok("compare", self.ref, self.same, name, "--csv", csv, "--latex", latex, "--json").json()["images"]
        with open(csv, newline="") as file:
            rows = list(csv_module.DictReader(file))
        self.assertEqual([row["image"] for row in rows], [self.same, name])
        for row, image in zip(rows, images):
            for key in ("mape", "mse", "flip", "mean_ratio", "pixels"):
                self.assertEqual(float(row[key]), image[key])
            self.assertEqual((row["lpips"], row["ssim"]), ("", ""))
        self.assertEqual(rows[0]["psnr"], "inf")
        with open(latex) as file:
            text = file.read()
        self.assertIn("a\\_\\&,", text)
        self.assertIn("\\textbf{0}", text)
        self.assertIn("\\textbf{$\\infty$}", text)
        self.assertEqual(text.count("\\\\"), 3)
        for option in ("--csv", "--latex", "--html"):
            self.fails(3, "none", "compare", self.ref, self.same, option, self.path("none/t"))

    def test_temporal(self):
        """Frames that keep a wrong value have no temporal error, frames that flicker around the right one have."""
        frames = {"ref": lambda t: 0.25 + 0.125 * t, "wrong": lambda t: 0.5 + 0.125 * t, "flicker": lambda t: 0.25 + 0.125 * t + (0.0625 if t % 2 else 0)}
        for folder, value in frames.items():
            os.mkdir(self.path(folder))
            for t in range(4):
                write_pfm(self.path("%s/frame%03d.pfm" % (folder, t)), 4, 4, lambda x, y: (value(t),) * 3)
        ref, wrong, flicker = map(self.path, frames)
        self.write("ref/notes.csv", "not a frame")
        still, moving = self.ok("compare", ref, wrong, flicker, "--temporal", "--json").json()["images"]
        self.assertEqual((still["temporal"], still["frames"]), (0, 4))
        self.assertAlmostEqual(moving["temporal"], 0.0625, places=6)
        self.assertEqual(len(moving["by_change"]), 3)
        self.assertGreater(still["mape"], moving["mape"])
        listed = self.write("list.txt", "".join("flicker/frame%03d.pfm\n" % t for t in range(4)))
        self.assertEqual(self.ok("compare", ref, listed, "--temporal", "--json").json()["images"][0]["temporal"], moving["temporal"])
        self.assertEqual(len(self.ok("compare", ref, wrong, "--temporal").out.splitlines()), 2)
        os.remove(self.path("wrong/frame003.pfm"))
        self.fails(2, "3 frames", "compare", ref, wrong, "--temporal")
        self.fails(2, "folders of frames", "compare", ref, self.same, "--temporal")
        self.fails(3, "none", "compare", ref, self.path("none"), "--temporal")
        for options in (("--csv", "a.csv"), ("--flip-ppd", 5), ("--lpips-net", "squeeze"), ("--lpips-weights", "none")):
            self.fails(1, "has no meaning", "compare", ref, flicker, "--temporal", *options)

    def test_errors_by_roughness(self):
        a, b = self.rooms(1, 2)
        entry = self.ok("compare", a, b, "--json").json()["images"][0]
        bins = entry["by_roughness"]
        self.assertEqual([bin["from"] for bin in bins], [0, 0.05, 0.2, 0.5])
        glossy = self.ok("compare", a, b, "--alpha-below", 0.5, "--json").json()["images"][0]
        self.assertEqual(entry["mape_glossy"], glossy["mape"])
        self.assertEqual(sum(bin["pixels"] for bin in bins[:3]), glossy["pixels"])
        self.assertEqual(sum(bin["pixels"] for bin in bins), entry["pixels"])
        self.assertIsNone(bins[0]["mape"])
        lines = self.ok("compare", a, b, "--by-roughness").out.splitlines()
        self.assertEqual(len(lines), 2 + 1 + 5)
        plain = self.path("plain.pfm")
        write_pfm(plain, 32, 24, lambda x, y: (1, 1, 1))
        self.assertIsNone(self.ok("compare", plain, b, "--json").json()["images"][0]["mape_glossy"])
        self.assertEqual(self.ok("compare", plain, b, "--aux", a, "--json").json()["images"][0]["by_roughness"][3]["pixels"], bins[3]["pixels"])
        self.fails(2, "--aux FILE", "compare", plain, b, "--by-roughness")

    def test_demo_takes_the_figures_of_all_pixels(self):
        """scripts/demo.sh reads JSON with sed: the picture's own figures, not those of a roughness."""
        a, b = self.rooms(1, 2)
        with open(self.path("e.json"), "w", encoding="utf-8") as out:
            out.write(self.ok("compare", a, b, "--json").out)
        with open(os.path.join(os.path.dirname(__file__), "..", "..", "scripts", "demo.sh"), encoding="utf-8") as script:
            function = next(line for line in script if line.startswith("field()"))
        entry = self.ok("compare", a, b, "--json").json()["images"][0]
        for name in ("mape", "mean_ratio", "pixels"):
            shown = subprocess.run(["bash", "-c", function + 'field "$1" "$2"', "-", self.path("e.json"), name], capture_output=True, text=True, check=True).stdout
            self.assertEqual(float(shown), entry[name], name)

    def test_two_references(self):
        a, b, c = self.rooms(1, 2, 3, spp=64)
        entry = self.ok("compare", a, c, "--reference-b", b, "--errors", self.path("e"), "--zscores", "--json").json()["images"][0]
        self.assertIn("seed3.zscores.png", os.listdir(self.path("e")))
        self.assertEqual((entry["blocks"]["size"], entry["blocks"]["count"]), (8, 12))
        self.assertLess(entry["blocks"]["z_rms"], 1.8)  # another picture of the same scene has no bias
        same = self.ok("compare", a, a, "--reference-b", b, "--json").json()["images"][0]
        self.assertEqual(same["relmse_noise_free"], 0)  # (I - R1)(I - R2) with I = R1
        self.assertGreater(entry["relmse_noise_free"], 0)
        self.fails(1, "--reference-b", "compare", a, c, "--errors", self.path("e"), "--zscores")
        self.fails(1, "--errors", "compare", a, c, "--reference-b", b, "--zscores")

    def test_refusals(self):
        self.fails(2, "roughness.Y", "compare", self.ref, self.same, "--alpha-below", "0.5")
        self.fails(2, self.small, "compare", self.ref, self.small)
        self.fails(3, "none.exr", "compare", self.path("none.exr"), self.same)
        self.fails(3, "none.exr", "compare", self.ref, self.path("none.exr"))
        self.fails(2, "bad.exr", "compare", self.write("bad.exr", "not a picture"), self.same)
        self.fails(1, "--alpha-below", "compare", self.ref, self.same, "--alpha-below", "half")
        self.fails(1, "--errors", "compare", self.ref, self.same, "--error-max", "2")
        self.fails(1, "--errors", "compare", self.ref, self.same, "--error-kind", "mape")
        self.fails(3, "folder", "compare", self.ref, self.same, "--errors", "/dev/null/x")

    def rooms(self, *seeds, spp=8):
        """Pictures of the small room."""
        scene, files = self.write("room.xml", ROOM), []
        for seed in seeds:
            files.append(self.path("seed%d.exr" % seed))
            self.ok("render", scene, "-o", files[-1], "--spp", spp, "--seed", seed, "-q")
        return files

    def test_noise_of_the_reference(self):
        a, b, c = self.rooms(1, 2, 3)
        report = self.ok("compare", a, c, "--reference-b", b, "--json").json()
        plain = self.ok("compare", a, b, "--json").json()["images"][0]
        noise = report["reference_noise"]
        self.assertEqual(noise["image"], b)
        self.assertAlmostEqual(noise["mape"], plain["mape"] / math.sqrt(2), places=9)  # as many samples in both
        self.assertAlmostEqual(noise["mse"], plain["mse"] / 2, places=9)
        # Another picture of as many samples differs by both pictures' noise.
        self.assertGreater(report["images"][0]["mape"], noise["mape"])
        self.assertNotIn("own noise", self.ok("compare", a, c, "--reference-b", b).err)
        # Itself is nearer than its noise: that says nothing about the truth.
        hint = self.ok("compare", a, a, "--reference-b", b)
        self.assertIn("is not above the reference's own noise", hint.err)
        self.assertEqual(len(hint.out.splitlines()), 3)
        self.assertIn("(own noise)", hint.out)
        # Samples are counted: 4 times as many have half the noise.
        many = self.path("many.exr")
        self.ok("render", self.path("room.xml"), "-o", many, "--spp", 32, "--seed", 4, "-q")
        few = self.ok("compare", a, a, "--reference-b", many, "--json").json()["reference_noise"]
        lot = self.ok("compare", many, many, "--reference-b", a, "--json").json()["reference_noise"]
        self.assertAlmostEqual(few["mse"] / lot["mse"], 4, places=6)
        self.fails(2, "same seed", "compare", a, c, "--reference-b", a)
        self.fails(2, "16 x 12", "compare", a, c, "--reference-b", self.small_picture())
        self.fails(3, "none.exr", "compare", a, c, "--reference-b", self.path("none.exr"))

    def test_merge(self):
        files, out = self.rooms(1, 2, 3), self.path("joined.exr")
        report = self.ok("merge", *files, "-o", out, "--json").json()
        self.assertEqual((report["spp"], report["width"], report["height"]), (24, 32, 24))
        # The mean of three has a third of the noise's variance: the estimate from two of them agrees roughly.
        self.ok("render", self.path("room.xml"), "-o", self.path("truth.exr"), "--spp", 1000, "--seed", 9, "-q")
        error = lambda file: self.ok("compare", self.path("truth.exr"), file, "--json").json()["images"][0]["mape"]
        self.assertLess(error(out), 0.75 * error(files[0]))
        self.assertTrue(0.6 < report["noise"]["mape"] / error(out) < 1.6, (report, error(out)))
        info = self.ok("info", out, "--json").json()
        self.assertIn("roughness.Y", [c["name"] for c in info["channels"]])
        self.assertEqual(json.loads(info["metadata"]["octrad.render"])["seeds"], [1, 2, 3])
        self.assertEqual(json.loads(info["metadata"]["octrad.render"])["max_depth"], 6)
        # Of another renderer: no metadata, weights by hand, layers from one of ours.
        a, b, joined = (self.path(n) for n in ("a.pfm", "b.pfm", "joined.pfm"))
        write_pfm(a, 32, 24, lambda x, y: (1, 2, 4))
        write_pfm(b, 32, 24, lambda x, y: (3, 2, 0))
        self.ok("merge", a + ":30", b + ":10", "-o", joined)
        means = {c["name"]: c["mean"] for c in self.ok("info", joined, "--json").json()["channels"]}
        self.assertEqual(means, {"R": 1.5, "G": 2, "B": 3})
        self.ok("merge", a + ":30", b + ":10", "-o", out, "--aux", files[0])
        layers = {c["name"]: c["min"] for c in self.ok("info", out, "--json").json()["channels"]}
        self.assertAlmostEqual(layers["roughness.Y"], 0.2, places=5)
        self.assertEqual(layers["R"], 1.5)

    def test_pictures_of_other_views(self):
        """As their metadata says: a warning, or a refusal where the result would mean nothing."""
        scene = self.write("room.xml", ROOM)
        a, b, other = (self.path(n) for n in ("a.exr", "b.exr", "other.exr"))
        for file, options in ((a, ("--seed", 1)), (b, ("--seed", 2)), (other, ("--seed", 3, "--origin", "0,0,0.5", "--target", "0,0,0"))):
            self.ok("render", scene, "--spp", 4, "-o", file, "-q", *options)
        self.assertNotIn("differ", self.ok("compare", a, b).err)
        self.assertIn("differ in their camera", self.ok("compare", a, other).err)
        self.assertIn("differ in their camera", self.ok("compare", a, b, "--json", "--aux", other).err)
        self.fails(2, "differ in their camera", "compare", a, b, "--reference-b", other)
        self.fails(2, "differ in their camera", "merge", a, other, "-o", self.path("m.exr"))

    def test_merge_refusals(self):
        (a, b), out = self.rooms(1, 2, spp=1), self.path("out.exr")
        plain, other = self.path("plain.pfm"), self.path("other.exr")
        write_pfm(plain, 32, 24, lambda x, y: (1, 2, 4))
        self.fails(1, "two pictures", "merge", a, "-o", out)
        self.fails(2, "same seed", "merge", a, b, a, "-o", out)
        self.ok("tonemap", a, "-o", self.path("a.png"))
        self.fails(2, "linear radiance", "merge", self.path("a.png") + ":2", b, "-o", out)
        self.fails(2, "same seed", "merge", plain + ":2", plain + ":2", "-o", out)
        self.fails(2, "plain.pfm:SPP", "merge", a, plain, "-o", out)
        self.fails(1, "FILE:SPP", "merge", a, plain + ":0", "-o", out)
        for count in ("1.5", "1e300", "-1e300", "18446744073709551617", "true"):  # no number of samples
            write_exr(other, 32, 24, {c: [1.0] * (32 * 24) for c in "RGB"}, {"octrad.render": '{"spp": %s}' % count})
            self.fails(2, "other.exr:SPP", "merge", a, other, "-o", out)
        self.fails(2, "differ in size", "merge", a, self.small_picture() + ":1", "-o", out)
        for options, what in ((("-D", "wall=0.3"), "their scene"), (("--max-depth", 3), "max_depth"), (("--origin", "0,0,0.5", "--target", "0,0,0"), "their camera")):
            self.ok("render", self.path("room.xml"), "-o", other, "--spp", 1, "--seed", 5, *options)
            self.fails(2, "differ in " + what, "merge", a, other, "-o", out)
        crops = [self.path("left.exr"), self.path("right.exr")]
        for file, crop, seed in zip(crops, ("0,0,16,24", "16,0,16,24"), (6, 7)):
            self.ok("render", self.path("room.xml"), "-o", file, "--spp", 1, "--seed", seed, "--crop", crop)
        self.fails(2, "differ in their crop", "merge", *crops, "-o", out)
        both = self.path("both.exr")  # knows the seeds of both
        self.ok("merge", a, b, "-o", both)
        self.fails(2, "same seed", "merge", both, b, "-o", out)
        self.fails(2, "same seed", "compare", both, a, "--reference-b", b)
        self.fails(2, "16 x 12", "merge", a, b, "-o", out, "--aux", self.small_picture())
        self.fails(1, ".exr, .hdr or .pfm", "merge", a, b, "-o", self.path("out.tif"))
        self.fails(3, "none.exr", "merge", a, self.path("none.exr"), "-o", out)
        self.assertFalse(os.path.exists(out))

    def small_picture(self):
        file = self.path("16x12.pfm")
        write_pfm(file, 16, 12, lambda x, y: (1, 1, 1))
        return file

    def test_mask_file(self):
        mask = self.path("mask.pfm")
        write_pfm(mask, 8, 8, lambda x, y: (1, 1, 1) if x == 0 else (0.2, 0.5, 0.7))
        pixels = lambda *options: self.ok("compare", self.ref, self.double, "--json", *options).json()["images"][0]
        inside, everything = pixels("--mask", mask), pixels()
        self.assertEqual((inside["pixels"], everything["pixels"]), (8, 64))
        self.assertAlmostEqual(inside["mape"], 8 * everything["mape"], places=9)
        write_pfm(mask, 8, 8, lambda x, y: (float("nan"), 1, 1))
        nothing = self.ok("compare", self.ref, self.double, "--json", "--mask", mask)
        self.assertEqual(nothing.json()["images"][0]["mape"], None)
        self.assertIn("no pixel is selected", nothing.err)
        self.fails(2, "16 x 12", "compare", self.ref, self.double, "--mask", self.small_picture())
        self.fails(3, "none.png", "compare", self.ref, self.double, "--mask", self.path("none.png"))
        self.fails(2, "bad.exr", "compare", self.ref, self.double, "--mask", self.write("bad.exr", "no picture"))

    def test_roughness_of_another_picture(self):
        (layers,) = self.rooms(1)
        plain, mask = self.path("plain.pfm"), self.path("mask.pfm")  # as another renderer would write it
        write_pfm(plain, 32, 24, lambda x, y: (1, 1, 1))
        write_pfm(mask, 32, 24, lambda x, y: (x % 2, x % 2, x % 2))
        pixels = lambda *options: self.ok("compare", *options, "--json").json()["images"][0]["pixels"]
        own = pixels(layers, layers, "--alpha-below", 0.5)
        self.assertGreater(own, 10)
        self.assertEqual(pixels(plain, layers, "--alpha-below", 0.5, "--aux", layers), own)
        both = pixels(plain, layers, "--alpha-below", 0.5, "--aux", layers, "--mask", mask)
        self.assertTrue(0 < both < own)
        self.fails(2, "--aux FILE", "compare", plain, layers, "--alpha-below", "0.5")
        self.fails(2, "mask.pfm: no layer", "compare", plain, layers, "--alpha-below", "0.5", "--aux", mask)
        self.fails(2, "16 x 12", "compare", plain, layers, "--alpha-below", "0.5", "--aux", self.small_picture())
        self.fails(1, "--aux belongs to", "compare", plain, layers, "--aux", layers)

    def test_tonemap(self):
        out = self.path("a.png")
        self.ok("tonemap", self.ref, "-o", out)
        self.assertEqual(read_png(out)[2][0][0:3], bytes([255, 188, 137]))  # sRGB of 1, 0.5, 0.25
        self.ok("tonemap", out, "-o", self.path("again.png"))  # what is for the screen stays as it is
        self.assertEqual(read_png(self.path("again.png"))[2][0][0:3], bytes([255, 188, 137]))
        self.ok("tonemap", self.ref, "-o", out, "--exposure", "-1")
        self.assertEqual(read_png(out)[2][0][0:2], bytes([188, 137]))
        self.ok("tonemap", self.ref, "-o", out, "--gamma", "2")
        self.assertEqual(read_png(out)[2][0][0:3], bytes([255, 180, 128]))
        result = self.ok("tonemap", self.ref, "-o", out, "--curve", "log1p", "--encoding", "linear", "--json").json()
        self.assertEqual(read_png(out)[2][0][0:3], bytes(round(255 * math.log1p(v)) for v in (1.0, 0.5, 0.25)))
        self.assertEqual((result["width"], result["height"]), (8, 8))
        self.ok("tonemap", self.double, "-o", out, "--channel", "R", "--range", "1,2")
        row = read_png(out)[2][0]
        self.assertGreater(min(row[0:3]), 220)
        self.assertEqual(row[3:6], b"\0\0\0")
        self.ok("tonemap", self.ref, "-o", out, "--curve", "filmic", "--encoding", "linear")
        filmic = lambda x: x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
        self.assertEqual(read_png(out)[2][0][0:3], bytes(round(255 * filmic(v)) for v in (1.0, 0.5, 0.25)))

    def test_tonemap_writes_what_the_ending_says(self):
        for name, magic in (("a.png", b"\x89PNG"), ("a.JPG", b"\xff\xd8\xff"), ("a.jpeg", b"\xff\xd8\xff")):
            out = self.path(name)
            self.ok("tonemap", self.ref, "-o", out)
            with open(out, "rb") as file:
                self.assertEqual(file.read(len(magic)), magic)
        for name, why in (("a.exr", "for the screen"), ("a.hdr", "for the screen"), ("a.tif", ".png or .jpg"), ("a", ".png or .jpg")):
            self.fails(1, why, "tonemap", self.ref, "-o", self.path(name))
            self.assertFalse(os.path.exists(self.path(name)))

    def test_tonemap_shows_vectors(self):
        (room,) = self.rooms(1, spp=64)
        out = self.path("a.png")
        self.ok("tonemap", room, "-o", out, "--layer", "normal")
        rows = read_png(out)[2]
        self.assertEqual(rows[23][48:51], bytes([128, 255, 128]), "the floor's normal is +y")
        self.ok("tonemap", room, "-o", out, "--layer", "normal", "--range", "-2,2")
        self.assertEqual(read_png(out)[2][23][48:51], bytes([128, 191, 128]))
        self.fails(1, "--curve", "tonemap", room, "-o", out, "--layer", "normal", "--curve", "filmic")
        self.ok("tonemap", room, "-o", out, "--layer", "albedo", "--curve", "filmic")

    def test_contact_sheet(self):
        out = self.path("sheet.png")
        report = self.ok("tonemap", self.ref, self.double, self.small, "-o", out, "--columns", 3, "--json").json()
        width, height, rows = read_png(out)
        self.assertEqual((width, height), (report["width"], report["height"]))
        self.assertTrue(3 * 8 < width < 60 and 8 < height < 60)
        flat = b"".join(rows)
        color = bytes([255, 188, 137])
        self.assertEqual(sum(flat[i:i + 3] == color for i in range(0, len(flat), 3)), 64 + 56 + 32)
        labelled = lambda *options: self.ok("tonemap", self.ref, self.ref, "-o", out, *options) and read_png(out)
        self.assertGreater(labelled("--columns", 1)[1], labelled("--columns", 2)[1])
        wide = self.path("wide.hdr")
        write_hdr(wide, 64, 8, lambda x, y: (0.25, 0.25, 0.25))
        white = lambda label: sum(row.count(b"\xff\xff\xff") for row in (self.ok("tonemap", wide, "-o", out, "--labels", label) and read_png(out))[2])
        self.assertGreater(white("label"), white("i"))
        two = ("tonemap", wide, wide, "-o", out, "--labels")
        self.assertGreater(self.ok(*two, "one,two") and sum(row.count(b"\xff") for row in read_png(out)[2]),
                           self.ok(*two, "one,") and sum(row.count(b"\xff") for row in read_png(out)[2]))
        self.assertGreater(white("i"), 0)
        self.fails(1, "--labels", "tonemap", self.ref, self.double, "-o", out, "--labels", "one")
        self.fails(1, "3 for 2 pictures", "tonemap", self.ref, self.double, "-o", out, "--labels", "one,two,three")
        self.fails(1, "--columns", "tonemap", self.ref, "-o", out, "--columns", "2")
        self.fails(1, "--columns", "tonemap", self.ref, self.ref, "-o", out, "--columns", "0")
        self.fails(3, "none.exr", "tonemap", self.ref, self.path("none.exr"), "-o", out)

    def test_tonemap_refusals(self):
        out = self.path("a.png")
        self.fails(3, "does not exist", "tonemap", self.ref, "-o", self.path("none/a.png"))
        self.fails(2, "it has", "tonemap", self.ref, "-o", out, "--channel", "depth.Z")
        self.fails(1, "--range", "tonemap", self.ref, "-o", out, "--channel", "R", "--range", "1")
        self.fails(1, "below the second", "tonemap", self.ref, "-o", out, "--channel", "R", "--range", "1,1")
        self.fails(1, "--curve", "tonemap", self.ref, "-o", out, "--curve", "acid")
        self.fails(1, "--range belongs to", "tonemap", self.ref, "-o", out, "--range", "0,2")
        self.fails(1, "--exposure is for colours", "tonemap", self.ref, "-o", out, "--channel", "R", "--exposure", "1")
        self.fails(1, "--gamma belongs to", "tonemap", self.ref, "-o", out, "--gamma", "2", "--encoding", "srgb")
        self.fails(2, 'did you mean "R"', "tonemap", self.ref, "-o", out, "--channel", "r")
        (room,) = self.rooms(1, spp=1)
        self.fails(2, 'did you mean "depth.Z"', "tonemap", room, "-o", out, "--channel", "Z")
        self.fails(2, "needs normals.R", "tonemap", room, "-o", out, "--layer", "normals")
        self.assertFalse(os.path.exists(out))


if __name__ == "__main__":
    unittest.main()
