#!/usr/bin/env python3
"""Runs every octrad command that README.md, docs/*.md and the --help texts show. Usage: OCTRAD=path/to/octrad test_examples.py

Commands run in a scratch folder, made small: short times, few samples, little pictures. A file that a command reads and
that nothing before it made is put there first.
"""
import itertools
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))
SMALL = {"--time": "1s", "--spp": "2", "--steps": "5", "--width": "32", "--height": "18", "--crop": "2,2,8,8", "--max-memory": "2G"}
TINY_MODEL = ["-D", "octree.levels=3", "-D", "train.points=64", "-D", "train.directions=2", "-D", "decoder.width=32", "-D", "nr.log2_table=12"]


def octrad(*words, cwd):
    if words[0] == "view" and "--help" not in words:  # runs until it is interrupted
        words = [word for word in words if word != "--open"]
        with subprocess.Popen([PROGRAM, *words], cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            line = process.stdout.readline()
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=600)
        return subprocess.CompletedProcess(words, 0 if process.returncode == 130 and "http://" in line else 1, line, errors)
    return subprocess.run([PROGRAM, *words], cwd=cwd, capture_output=True, text=True, timeout=600, stdin=subprocess.DEVNULL)


def shell_lines(text):
    """Commands of the sh blocks of a Markdown text, continued lines joined."""
    for block in re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S):
        for line in block.replace("\\\n", " ").splitlines():
            line = line.strip().removeprefix("$ ")
            if line and not line.startswith("#"):
                yield line


def help_lines():
    verbs = re.findall(r"^  (\w+)  ", octrad("--help", cwd=ROOT).stdout.split("Subcommands:")[1], re.M)
    for verb in verbs:
        text = octrad(verb, "--help", cwd=ROOT).stdout
        for line in text.split("Example:\n", 1)[1].strip().splitlines():
            yield line.strip()


def replaced(definition):
    return definition.startswith(("octree.levels", "train."))


def made_small(words):
    out = []
    for word in words:
        previous = out[-1] if out else ""
        out.append(SMALL.get(previous, word))
        if previous == "-D" and replaced(word):
            out[-1] = "checkpoint.every=1m"
    if out[1] == "train":
        if "--steps" not in out and "--time" not in out:
            out += ["--steps", "5"]
        if "--resume" not in out:
            out += TINY_MODEL
    if out[1] == "render":  # one size for all, so that any two can be compared
        for option in ("--width", "--height"):
            if option not in out:
                out += [option, SMALL[option]]
    if out[1] == "render" and "--spp" not in out and "--time" not in out:
        out += ["--spp", "2"]
    if out[1] == "selftest":  # tests/cli/test_selftest.py runs all of it
        out += ["--only", "sum"]
    if out[1] == "paper":  # a matrix of one method without training instead of those that take hours
        # ... which also need the paper's scenes.
        out = ["scenes" if word == "all-scenes" else word for word in out if not (ROOT / "configs" / "paper" / (word + ".json")).exists()]
        if "mine.json" not in out:
            out.insert(2, "mine.json")
    return out[1:]


class Examples(unittest.TestCase):
    """Tests are added below, one for each source of commands."""

    without_denoiser = 0

    @classmethod
    def setUpClass(cls):
        cls.store = tempfile.mkdtemp()
        box = str(ROOT / "scenes" / "cornell-box" / "scene.xml")
        for words in (["train", box, "-o", "model.octrad", "--steps", "5", *TINY_MODEL],
                      ["render", box, "--integrator", "path", "--spp", "2", "--width", "32", "--height", "18", "-o", "picture.exr"],
                      ["render", box, "--integrator", "path", "--spp", "2", "--width", "32", "--height", "18", "--seed", "1", "-o", "other.exr"]):
            done = octrad(*words, cwd=cls.store)
            if done.returncode != 0:
                raise AssertionError("octrad %s: %s" % (shlex.join(words), done.stderr))
        pathlib.Path(cls.store, "points.csv").write_text(
            "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n0.1,0,0.2,0,1,0,0,1,0,0.7,0.7,0.7,1\n")
        pathlib.Path(cls.store, "camera.json").write_text('{"origin": [0, 1, 3.9], "target": [0, 1, 0], "up": [0, 1, 0], "fov": 40}\n')
        pathlib.Path(cls.store, "camera_path.json").write_text(
            '{"frames": 2, "keys": [{"origin": [0, 1, 3.9], "target": [0, 1, 0]}, {"origin": [0.1, 1, 3.9], "target": [0, 1, 0]}]}\n')
        pathlib.Path(cls.store, "config.json").write_text('{"octree": {"levels": 3}}\n')

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.store)
        if cls.without_denoiser:
            print("\nSKIPPED: %d commands: Open Image Denoise is not installed" % cls.without_denoiser)

    def provide(self, folder, words):
        """Files that the command reads and that are not there."""
        if words[0] == "paper":
            (folder / "mine.json").write_text('{"methods": ["path"], "views": {"*": [0]}, "width": 16, "reference_spp": 4}')
            for word in [name for list_of in words for name in list_of.split(",") if name.endswith(".xml")]:
                shutil.copy(ROOT / "scenes" / "cornell-box" / "scene.xml", folder / word)
            return
        for previous, word in zip(words, words[1:]):
            path = folder / word
            if word.startswith("-") or "=" in word or path.exists():
                continue
            if words[0] == "merge" and previous not in ("-o", "--output"):  # pictures of different seeds
                shutil.copy(pathlib.Path(self.store) / ("picture.exr" if previous == "merge" else "other.exr"), path)
                continue
            if "--temporal" in words and not path.suffix:  # a folder of frames
                path.mkdir()
                for frame in ("0.exr", "1.exr"):
                    shutil.copy(pathlib.Path(self.store) / "picture.exr", path / frame)
                continue
            if previous in ("-o", "--output", "--errors", "--log-json"):
                path.parent.mkdir(parents=True, exist_ok=True)
                if words[0] != "train" or "--resume" not in words:
                    continue
            source = {".exr": "picture.exr", ".octrad": "model.octrad", ".csv": "points.csv"}.get(path.suffix)
            if path.suffix == ".json":
                source = {"--config": "config.json", "--path": "camera_path.json"}.get(previous, "camera.json")
            if path.suffix == ".xml":
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / "scenes" / "cornell-box" / "scene.xml", path)
            elif source:
                path.parent.mkdir(parents=True, exist_ok=True)
                alike = [folder / w for w in words if w.endswith(path.suffix) and (folder / w).exists()]  # pictures to compare have one size
                shutil.copy(alike[0] if words[0] == "compare" and alike else pathlib.Path(self.store) / source, path)

    def run_lines(self, lines):
        ran = 0
        with tempfile.TemporaryDirectory() as scratch:
            folder = pathlib.Path(scratch)
            (folder / "scenes").symlink_to(ROOT / "scenes")
            for line in lines:
                words = shlex.split(re.sub(r"\s#.*", "", line))  # a # within a word is no comment
                with self.subTest(line):
                    if words[0].startswith(("scripts/", "tests/", "scenes/")) or words[0] == "python3":
                        file = words[1] if words[0] == "python3" else words[0]
                        self.assertTrue((ROOT / file).is_file(), "%s does not exist" % file)
                    if words[0] != "octrad":
                        continue
                    # What will be replaced is right too.
                    definitions = [pair for pair in zip(words, words[1:]) if pair[0] == "-D" and replaced(pair[1])]
                    if definitions:
                        done = octrad("info", "--keys", *itertools.chain(*definitions), cwd=folder)
                        self.assertEqual(done.returncode, 0, done.stderr)
                    small = made_small(words)
                    self.provide(folder, small)
                    if small[0] in ("render", "view") and "--model" in small:
                        small.append("--force")  # the tiny model that stands in is of another scene
                    done = octrad(*small, cwd=folder)
                    if done.returncode == 3 and "Open Image Denoise 2 is needed" in done.stderr:
                        Examples.without_denoiser += 1  # skipTest here would count as a test, and each document is one
                        continue
                    self.assertEqual(done.returncode, 0, "octrad %s\n%s" % (shlex.join(small), done.stderr))
                    ran += 1
        self.assertGreater(ran, 0, "no octrad command found")

    def test_help(self):
        self.run_lines(help_lines())


def add(path):
    def test(self):
        self.run_lines(shell_lines(path.read_text()))
    setattr(Examples, "test_%s" % path.stem.replace("-", "_").lower(), test)


for document in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
    if document.exists() and any(line.startswith("octrad ") for line in shell_lines(document.read_text())):
        add(document)

if __name__ == "__main__":
    unittest.main()
