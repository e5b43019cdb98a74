#!/usr/bin/env python3
"""Sampling emitters, and directions of environments, by what they bring, beside sampling them as Mitsuba does, all alike and by radiance: noise of path tracing and errors of trained caches.

    bench/picks.py [--octrad PROGRAM] [--train STEPS] SCENE_FOLDER ...

Alike: a copy of scene.xml, in a folder of links, whose first emitter states the sampling_weight that it has without, so that nothing is measured. A line a scene: ratios,
measured / alike, of the MAPE, the relative squared error and the processor seconds of two pictures of --spp samples with different seeds, each against the other. With --train, caches (preset cpu, one seed) after that many steps, of both, against a reference of --reference-spp samples: MAPE.
"""
import argparse
import json
import os
import pathlib
import resource
import statistics
import subprocess
import tempfile
import xml.etree.ElementTree


def alike(scene, folder):
    """A scene.xml in `folder` where all emitters are picked alike -> its path, how many emitters it has"""
    tree = xml.etree.ElementTree.parse(scene / "scene.xml")
    emitters = list(tree.iter("emitter"))
    if not emitters:
        raise SystemExit("%s: the scene has no emitter" % scene)
    xml.etree.ElementTree.SubElement(emitters[0], "float", name="sampling_weight", value="1")
    for entry in scene.iterdir():
        if entry.name != "scene.xml":
            (folder / entry.name).symlink_to(entry.resolve())
    tree.write(folder / "scene.xml")
    return folder / "scene.xml", len(emitters)


class Bench:
    def __init__(self, arguments, folder):
        self.arguments, self.folder = arguments, folder

    def octrad(self, *words):
        done = subprocess.run([self.arguments.octrad, *map(str, words)], capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(done.stderr)
        return done.stdout

    def compare(self, reference, picture):
        return json.loads(self.octrad("compare", reference, picture, "--json"))["images"][0]

    def picture(self, scene, name, spp, *options):
        file = self.folder / name
        self.octrad("render", scene, "-o", file, "--width", self.arguments.width, "--spp", spp, "-q", *options)
        return file

    def noise(self, scene):
        """Medians over the pairs: MAPE, relative squared error, processor seconds."""
        rows = []
        for pair in range(self.arguments.pairs):
            before = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
            a, b = (self.picture(scene, "%d.exr" % i, self.arguments.spp, "--seed", 2 * pair + i, "--integrator", "path") for i in (0, 1))
            seconds = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) - before
            found = self.compare(a, b), self.compare(b, a)
            rows.append([statistics.mean(f[key] for f in found) for key in ("mape", "relmse")] + [seconds])
        return [statistics.median(column) for column in zip(*rows)]

    def trained(self, scene, reference):
        model = self.folder / "model.octrad"
        self.octrad("train", scene, "-o", model, "--preset", "cpu", "--steps", self.arguments.train, "--seed", 1, "--overwrite", "-q")
        return self.compare(reference, self.picture(scene, "cache.exr", 64, "--model", model))["mape"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path, metavar="SCENE_FOLDER")
    parser.add_argument("--octrad", default=os.environ.get("OCTRAD", "build/octrad"))
    parser.add_argument("--width", type=int, default=192)
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--pairs", type=int, default=1, help="pairs of pictures; the figures are medians")
    parser.add_argument("--train", type=int, default=0, metavar="STEPS")
    parser.add_argument("--reference-spp", type=int, default=1024)
    arguments = parser.parse_args()
    for scene in arguments.scenes:
        with tempfile.TemporaryDirectory(prefix="octrad-picks-") as folder:
            bench = Bench(arguments, pathlib.Path(folder))
            (bench.folder / "alike").mkdir()
            same, count = alike(scene, bench.folder / "alike")
            first, second = bench.noise(same), bench.noise(scene / "scene.xml")
            line = "%s: %d emitters; MAPE %.3f, relative squared error %.3f, processor seconds %.3f" % (scene.name, count, *(b / a for a, b in zip(first, second)))
            if arguments.train > 0:
                reference = bench.picture(scene / "scene.xml", "reference.exr", arguments.reference_spp, "--integrator", "path", "--seed", 99)
                line += "; trained: MAPE %.4f alike, %.4f" % (bench.trained(same, reference), bench.trained(scene / "scene.xml", reference))
            print(line, flush=True)


if __name__ == "__main__":
    main()
