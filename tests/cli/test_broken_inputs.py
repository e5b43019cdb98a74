"""Broken, hostile and odd inputs (broken_inputs.py): message, exit code, memory, time; nothing is left behind."""
import concurrent.futures
import json
import os
import shutil
import unittest

from broken_inputs import CASES
from support import ROOM, SMALL, Case, measured, read_safetensors, write_safetensors

BUDGET_MB = 200
SECONDS = 10  # of a processor: other work on the machine does not count
# Cases whose message names another file than those that they are made of.
NAMED = {"include-outside": "etc/hostname", "include-a-device": "/dev/zero", "pbrt-include-a-device": "/dev/zero", "model-a-device": "/dev/zero", "points-none": "none.octrad", "cost-merge": "o.exr"}


def shown(text):
    """As a terminal is to see it: control characters, and bytes that are no UTF-8 (surrogates here), as \\xNN."""
    return "".join("".join(f"\\x{byte:02x}" for byte in c.encode("utf-8", "surrogateescape")) if is_control(c) else c for c in text)


def is_control(c):
    return (ord(c) < 32 and c not in "\n\t") or 127 <= ord(c) < 160 or 0xd800 <= ord(c) < 0xe000


def attempt(folder, files, arguments):
    """-> exit code (negative: a signal), error output, output, peak of resident memory in MB, processor seconds"""
    os.makedirs(folder)
    for name, content in files.items():
        with open(os.path.join(folder, name), "wb") as out:
            out.write(content if isinstance(content, bytes) else content.encode())
    environment = dict(os.environ, CUDA_VISIBLE_DEVICES="")
    texts = [os.path.join(folder, name) for name in (".stderr", ".stdout")]
    with open(texts[0], "wb") as err, open(texts[1], "wb") as out:
        code, peak, seconds = measured(*arguments, "--max-memory", f"{BUDGET_MB}M", cwd=folder, stdout=out, stderr=err, env=environment)
    for i, name in enumerate(texts):
        with open(name, "rb") as file:
            texts[i] = file.read().decode("utf-8", "surrogateescape")
    return code, *texts, peak / 2 ** 20, seconds


class BrokenInputs(Case):
    def test_names_differ(self):
        names = [case[0] for case in CASES]
        self.assertEqual(len(set(names)), len(names))
        self.assertGreaterEqual(len(names), 150)

    def test_every_case(self):
        with concurrent.futures.ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            results = list(pool.map(lambda case: attempt(self.path(case[0]), case[1], case[2]), CASES))
        for i, (name, files, arguments, _, _) in enumerate(CASES):
            if results[i][4] >= SECONDS:  # other work that shares the processor's caches may have doubled it: once more, alone
                shutil.rmtree(self.path(name))
                results[i] = attempt(self.path(name), files, arguments)
        peak, longest = (max(results, key=lambda result: result[i]) for i in (3, 4))
        print(f"\n{len(CASES)} inputs: largest peak {peak[3]:.0f} MB ({CASES[results.index(peak)][0]}), {peak[3] / BUDGET_MB:.2f} of --max-memory; "
              f"at most {longest[4]:.1f} s of a processor ({CASES[results.index(longest)][0]})")
        for (name, files, arguments, code, text), (got, err, out, megabytes, seconds) in zip(CASES, results):
            with self.subTest(case=name):
                self.assertEqual(got, code, err)
                if code != 0:
                    self.assertEqual(err.count("octrad: error: "), 1, err)
                    self.assertNotEqual(text, "", "the case does not say what is refused")
                if code in (2, 3, 4):
                    message = err[err.index("octrad: error: "):]
                    self.assertTrue(any(shown(file) in message for file in [*files, NAMED.get(name, "\0")]), "no file is named: " + message)
                self.assertIn(text, err if code else err + out)
                self.assertNotIn("internal error", err)
                self.assertEqual([c for c in err + out if is_control(c)], [], "control characters")
                if code == 0 and "--json" in arguments:
                    json.loads(out)
                self.assertLess(megabytes, 1.1 * BUDGET_MB + 100)
                self.assertLess(seconds, SECONDS)
                left = set(os.listdir(self.path(name))) - set(files) - {".stderr", ".stdout"}
                self.assertEqual(left, {arguments[arguments.index("-o") + 1]} if code == 0 and "-o" in arguments else set())


class BrokenModels(Case):
    """A model as it is trained, with one thing wrong."""

    def test_tensors(self):
        scene = self.write("room.xml", ROOM)
        predicted = ("-D", "lookup.offset=predicted", "-D", "disparity.log2_table=12")
        self.ok("train", scene, "-o", self.path("m.octrad"), "--steps", "2", *SMALL, *predicted)
        metadata, _ = read_safetensors(self.path("m.octrad"))
        metadata.pop("octrad.checksums")
        with open(self.path("m.octrad"), "rb") as file:
            raw = file.read()
        size = int.from_bytes(raw[:8], "little")
        header = json.loads(raw[8:8 + size])
        header.pop("__metadata__")
        tensors = {name: (t["dtype"], t["shape"], raw[8 + size + t["data_offsets"][0]:8 + size + t["data_offsets"][1]]) for name, t in header.items()}
        points = self.write("p.csv", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n0,-1,0,0,1,0,0,1,0,0.5,0.5,0.5,1\n")
        broken = self.path("broken.octrad")

        def change(name, make):
            dtype, shape, data = tensors[name]
            write_safetensors(broken, {**tensors, name: (dtype, shape, make(data))}, metadata)

        write_safetensors(broken, tensors, metadata)
        self.ok("query", broken, "--points", points)
        nan = b"\0\0\xc0\x7f"
        for name in ("octree.level2.features", "decoder.mlp.0.weight", "disparity.grid.table", "octree.origin"):
            change(name, lambda data: data[:-4] + nan)
            message = self.fails(2, "not finite", "query", broken, "--points", points).err
            self.assertIn("broken.octrad", message)
            self.assertIn(name, message)
        change("octree.level2.cells", lambda data: data[12:24] + data[:12] + data[24:])
        self.assertIn("Morton order", self.fails(2, "broken.octrad", "query", broken, "--points", points).err)
        resume = ("train", scene, "-o", broken, "--resume", "--steps", "3", "-q")
        for name in sorted(n for n in tensors if n.startswith("optimizer.") and "far_ends" not in n):
            write_safetensors(broken, {n: t for n, t in tensors.items() if n != name}, metadata)
            self.fails(2, f'"{name}" is missing', *resume)
        for name in sorted(n for n in tensors if n.startswith("optimizer.") and n.endswith(".count")):
            change(name, lambda data: b"\xff" * 8)
            self.fails(2, "is negative", *resume)
        change("optimizer.octree.moments", lambda data: nan + data[4:])
        self.fails(2, "not finite", *resume)
        # A picture of features keeps those of its crop only, and asks before it keeps many.
        view = ("render", scene, "--model", self.path("m.octrad"), "--integrator", "features1", "-o", self.path("a.exr"), "--width", "8000", "--height", "8000", "-q",
                "--max-memory", "200M")
        self.ok(*view, "--crop", "0,0,16,16")
        self.fails(4, "--max-memory", *view)
        for row, text in (("0,-1,0,0,1,0,0,1,0,-0.5,0.5,0.5,1", "at least 0"), ("0,-1,0,0,1,0,0,1,0,0.5,0.5,0.5,-1", "at least 0"), ("0,-1,0\0,0,1,0,0,1,0,0.5,0.5,0.5,1", "not a finite number"),
                          ("1e30,-1,0,0,1,0,0,1,0,0.5,0.5,0.5,1", "up to 1e12"), ("0,-1,0,0,9,0,0,1,0,0.5,0.5,0.5,1", "a unit vector is needed"), ("0,-1", "2 cells where the header has 13"),
                          ("\x1b[31m,-1,0,0,1,0,0,1,0,0.5,0.5,0.5,1", r"\x1b[31m")):
            self.write("p.csv", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n" + row + "\n")
            self.fails(2, text, "query", self.path("m.octrad"), "--points", points)
        self.write("p.csv", "," * 10000000)  # a column each
        self.fails(4, "p.csv needs", "query", self.path("m.octrad"), "--points", points, "--max-memory", "200M")
        # A file with holes states more than there is disk.
        kept = {"dtype": "I32", "shape": [10 ** 9, 3], "data_offsets": [0, 12 * 10 ** 9]}
        fixed = {name: {"dtype": "F32", "shape": [3], "data_offsets": [12 * 10 ** 9 + 12 * i, 12 * 10 ** 9 + 12 * i + 12]} for i, name in enumerate(("octree.origin", "octree.size"))}
        text = json.dumps({"__metadata__": metadata, "octree.level1.cells": kept, **fixed}).encode()
        with open(broken, "wb") as out:
            out.write(len(text).to_bytes(8, "little") + text)
            out.seek(12 * 10 ** 9, os.SEEK_CUR)
            out.write(tensors["octree.origin"][2] + tensors["octree.size"][2])
        self.fails(4, "broken.octrad needs 11.2 GiB", "query", broken, "--points", self.write("p.csv", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n0,-1,0,0,1,0,0,1,0,0.5,0.5,0.5,1\n"), "--max-memory", "200M")


if __name__ == "__main__":
    unittest.main()
