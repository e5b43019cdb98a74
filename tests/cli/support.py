"""Runs the program and writes small inputs. Standard library only."""
import json
import os
import shutil
import struct
import subprocess
import tempfile
import unittest

PROGRAM = os.environ.get("OCTRAD", "octrad")


class Result:
    def __init__(self, done):
        self.code = done.returncode
        self.out = done.stdout.decode("utf-8", "replace")
        self.err = done.stderr.decode("utf-8", "replace")

    def json(self):
        return json.loads(self.out)


def run(*arguments, timeout=120, cwd=None, stdout=subprocess.PIPE):
    done = subprocess.run([PROGRAM, *map(str, arguments)], stdout=stdout, stderr=subprocess.PIPE, timeout=timeout, cwd=cwd)
    if done.stdout is None:
        done.stdout = b""
    return Result(done)


def write_hdr(path, width, height, pixel):
    """Radiance HDR without run lengths; pixel(x, y) -> (r, g, b), each 0 or a power of two to be exact."""
    with open(path, "wb") as out:
        out.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {height} +X {width}\n".encode())
        for y in range(height):
            for x in range(width):
                rgb = pixel(x, y)
                peak = max(rgb)
                if peak <= 0:
                    out.write(bytes(4))
                    continue
                exponent = 0
                while peak >= 1.0:
                    peak, exponent = peak / 2, exponent + 1
                while peak < 0.5:
                    peak, exponent = peak * 2, exponent - 1
                out.write(bytes(int(v * 2.0 ** (8 - exponent)) for v in rgb) + bytes([exponent + 128]))


def write_safetensors(path, tensors, metadata):
    """tensors: name -> (dtype, shape, bytes)."""
    header, data = {"__metadata__": metadata}, b""
    for name, (dtype, shape, raw) in tensors.items():
        header[name] = {"dtype": dtype, "shape": shape, "data_offsets": [len(data), len(data) + len(raw)]}
        data += raw
    text = json.dumps(header).encode()
    with open(path, "wb") as out:
        out.write(struct.pack("<Q", len(text)) + text + data)


class Case(unittest.TestCase):
    """A test with a folder of its own."""

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="octrad-cli-")
        self.addCleanup(shutil.rmtree, self.folder, True)

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, text):
        with open(self.path(name), "w", encoding="utf-8") as out:
            out.write(text)
        return self.path(name)

    def ok(self, *arguments, **keywords):
        result = run(*arguments, **keywords)
        self.assertEqual(result.code, 0, f"{arguments}\n{result.err}")
        return result

    def fails(self, code, text, *arguments, **keywords):
        """The exit code, one message that contains `text`, and nothing on standard output."""
        result = run(*arguments, **keywords)
        self.assertEqual(result.code, code, f"{arguments}\n{result.out}\n{result.err}")
        self.assertIn("octrad: error: ", result.err)
        self.assertIn(text, result.err)
        self.assertEqual(result.out, "")
        return result
