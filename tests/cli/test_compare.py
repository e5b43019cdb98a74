"""octrad compare and octrad tonemap."""
import math
import os
import struct
import unittest
import zlib

from support import Case, write_hdr


def read_png(path):
    """8-bit RGB PNG whose rows use any filter -> width, height, rows of bytes."""
    raw = open(path, "rb").read()
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
        fields = {"image", "mape", "mape_trimmed", "mse", "relmse", "psnr", "mean_ratio", "pixels"}
        self.assertTrue(fields <= set(same))
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

    def test_refusals(self):
        self.fails(2, "roughness.Y", "compare", self.ref, self.same, "--alpha-below", "0.5")
        self.fails(2, self.small, "compare", self.ref, self.small)
        self.fails(3, "none.exr", "compare", self.path("none.exr"), self.same)
        self.fails(3, "none.exr", "compare", self.ref, self.path("none.exr"))
        self.fails(2, "bad.exr", "compare", self.write("bad.exr", "not a picture"), self.same)
        self.fails(1, "--alpha-below", "compare", self.ref, self.same, "--alpha-below", "half")
        self.fails(3, "folder", "compare", self.ref, self.same, "--errors", "/dev/null/x")

    def test_tonemap(self):
        out = self.path("a.png")
        self.ok("tonemap", self.ref, "-o", out)
        self.assertEqual(read_png(out)[2][0][0:3], bytes([255, 188, 137]))  # sRGB of 1, 0.5, 0.25
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

    def test_tonemap_refusals(self):
        out = self.path("a.png")
        self.fails(3, "does not exist", "tonemap", self.ref, "-o", self.path("none/a.png"))
        self.fails(2, "it has", "tonemap", self.ref, "-o", out, "--channel", "depth.Z")
        self.fails(1, "--range", "tonemap", self.ref, "-o", out, "--channel", "R", "--range", "1")
        self.fails(1, "below the second", "tonemap", self.ref, "-o", out, "--channel", "R", "--range", "1,1")
        self.fails(1, "--curve", "tonemap", self.ref, "-o", out, "--curve", "acid")
        self.assertFalse(os.path.exists(out))


if __name__ == "__main__":
    unittest.main()
