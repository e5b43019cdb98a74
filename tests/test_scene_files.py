#!/usr/bin/env python3
"""The meshes and textures under scenes/ are what scenes/generate.py makes. Needs numpy.

They are made in a scratch folder; the work tree is only read. Coordinates may differ by a rounding of sin and cos, which
differ between processors, and shades by one level; anything else is a change that was not committed.
"""
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

import numpy as np

SCENES = pathlib.Path(__file__).resolve().parent.parent / "scenes"


def ply(data):
    """Header and faces, and the numbers of the vertices, [vertices, 8], of a file of generate.py."""
    header, body = data.split(b"end_header\n", 1)
    count = int(header.split(b"element vertex ")[1].split()[0])
    return (header, body[count * 32:]), np.frombuffer(body[:count * 32], "<f4").reshape(count, 8)


def png(data):
    """Header and shades of a file of generate.py: three channels of eight bits, every row with the Sub filter."""
    width, height = struct.unpack(">II", data[16:24])
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        packed += data[at + 8:at + 8 + length] if kind == b"IDAT" else b""
        at += 12 + length
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + width * 3)
    assert (rows[:, 0] == 1).all(), "another filter than Sub"
    return data[:33], np.cumsum(rows[:, 1:].reshape(height, width, 3), axis=1) & 255


class SceneFiles(unittest.TestCase):
    def test_files_are_what_generate_py_makes(self):
        with tempfile.TemporaryDirectory() as folder:
            made_in = pathlib.Path(folder)
            subprocess.run([sys.executable, str(SCENES / "generate.py"), "--output", folder], check=True)
            made = {p.relative_to(made_in): p.read_bytes() for p in made_in.rglob("*") if p.is_file()}
        kept = {p.relative_to(SCENES): p.read_bytes() for p in SCENES.rglob("*") if p.suffix in (".ply", ".png")}
        self.assertEqual(sorted(made), sorted(kept))
        for name, data in made.items():
            with self.subTest(str(name)):
                read, tolerance = (ply, 1e-6) if name.suffix == ".ply" else (png, 1)
                (frame, values), (kept_frame, kept_values) = read(data), read(kept[name])
                self.assertEqual(frame, kept_frame)
                difference = np.abs(values.astype(float) - kept_values)
                self.assertLessEqual(difference.max(), tolerance)
                # What stands for 0 is some 1e-16, another one on every kind of processor.
                self.assertLess((difference > 1e-14).mean(), 1e-3)


if __name__ == "__main__":
    unittest.main()
