#!/usr/bin/env python3
"""What watching a training costs, and how quickly a cache learns that a light has changed.

    bench/live.py watch SCENE.xml [--steps 3000]
    bench/live.py edit SCENE.xml MODEL.octrad --light 1 --factor 4,4,4 [--anew PICTURE.exr] [--seconds 14] [--spp 256] [-o results.json]

`watch` trains the same steps alone and while a plain client takes every frame, and compares the seconds that they take.
`edit` opens `octrad view --train`, changes one light (numbers as the page has them), and measures the picture of the cache at 320 x 180 against
path tracing of the edited scene (MAPE of octrad compare): before the change against the scene as it was, then after so many seconds of training,
which pauses meanwhile, and the mean of what is too bright as a share of what the light had contributed. Needs numpy.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tests" / "cli"))
from exr import read_exr  # noqa: E402
from web_client import Viewer  # noqa: E402

MARKS = (0.5, 2, 10, 14)


def begin(octrad, *arguments):
    process = subprocess.Popen([octrad, *map(str, arguments)], stdout=subprocess.PIPE)
    return process, json.loads(process.stdout.readline())["url"]


def train_time(args, watched):
    with tempfile.TemporaryDirectory() as folder:
        process, url = begin(args.octrad, "train", args.scene, "-o", os.path.join(folder, "m.octrad"), "--view", "--json", "-q", "--no-optimizer", "--steps", args.steps)
        start, frames = time.monotonic(), [0]
        if watched:
            viewer = Viewer(url)
            viewer.until(lambda m: isinstance(m, dict) and m["type"] == "training" and m["step"] > 0)
            start, first = time.monotonic(), viewer.others[-1]["seconds"]
            done = viewer.until(lambda m: isinstance(m, dict) and m["type"] == "training" and m["finished"])
            frames[0] = len(viewer.frames)
            seconds = first + time.monotonic() - start
            viewer.close()
            process.terminate()
            process.communicate()
            return seconds, frames[0], done["seconds"]
        seconds = json.loads(process.communicate()[0])["seconds"]
        return seconds, 0, seconds


def watch(args):
    result = {"alone": [], "watched": [], "frames": []}
    for _ in range(args.repeat):
        result["alone"].append(train_time(args, False)[0])
        seconds, frames, _ = train_time(args, True)
        result["watched"].append(seconds)
        result["frames"].append(frames)
    alone, watched = min(result["alone"]), min(result["watched"])
    print("alone %.2f s, watched %.2f s: %+.1f %%; %.1f frames/s" % (alone, watched, 100 * (watched / alone - 1), result["frames"][-1] / watched))
    return result


def picture(viewer, np):
    status, _, body = viewer.get("/picture-a.exr")
    if status != 200:
        return None
    with tempfile.NamedTemporaryFile(suffix=".exr") as file:
        file.write(body)
        file.flush()
        return colours(file.name, np)


def colours(path, np):
    width, height, channels, _ = read_exr(path)
    return np.stack([np.frombuffer(channels[c], dtype="<f4").astype(np.float64).reshape(height, width) for c in "RGB"], axis=-1)


def settle(viewer, integrator, samples, np):
    viewer.send("set", a={"integrator": "disparity"})  # what was shown before is another scene's
    viewer.frame(lambda h: h["a"]["integrator"] == "disparity")
    viewer.send("set", a={"integrator": integrator})
    viewer.frame(lambda h: h["a"]["integrator"] == integrator and not h["moving"] and h["a"]["samples"] >= samples and h["width"] == 320)
    return picture(viewer, np)


def edit(args):
    import numpy as np
    mape = lambda image, reference: float(np.mean(np.abs(image - reference) / (reference + 0.01)))
    process, url = begin(args.octrad, "view", args.scene, "--model", args.model, "--train", "--json", "-q", "--width", 320, "--height", 180)
    try:
        viewer = Viewer(url)
        viewer.answer("state")
        viewer.send("set", full=True)
        factor = [float(v) for v in args.factor.split(",")]
        change = {"lights": [{"light": args.light, "factor": factor}]}
        learnt = settle(viewer, "lhs", args.samples, np)
        before = settle(viewer, "path", args.spp, np)
        viewer.send("train", do="pause")  # the cache stays as it is while the reference is taken
        viewer.send("edit", **change)
        viewer.answer("scene")
        reference = settle(viewer, "path", args.spp, np)
        training = lambda what: viewer.until(lambda m: isinstance(m, dict) and m["type"] == "training" and what(m))
        begin_seconds, taken = None, {}
        for mark in MARKS:
            if mark > args.seconds:
                break
            viewer.send("train", do="start")
            message = training(lambda m: m["state"] == "running")
            if begin_seconds is None:
                begin_seconds = message["seconds"]
            training(lambda m: m["seconds"] - begin_seconds >= mark)
            viewer.send("train", do="pause")
            message = training(lambda m: m["state"] == "paused")
            taken[mark] = (message["seconds"] - begin_seconds, settle(viewer, "lhs", args.samples, np))
    finally:
        process.terminate()
        process.wait()
    first = mape(learnt, before)
    print("before the change: MAPE %.4f" % first)
    result = {"scene": args.scene, "light": args.light, "factor": factor, "samples": args.samples, "before": first, "after": {}}
    compared = first
    if args.anew:
        result["anew"] = compared = mape(colours(args.anew, np), reference)
        print("a cache that has learnt the edited scene from the beginning: MAPE %.4f" % compared)
    contribution = float(np.mean(before - reference))
    for mark, (seconds, image) in taken.items():
        error, glow = mape(image, reference), float(np.mean(image - reference)) / contribution if contribution else 0.0
        result["after"][mark] = {"seconds": seconds, "mape": error, "glow": glow}
        print("  after %4.1f s: MAPE %.4f, %.2f of that; too bright by %+.2f %% of what changed" % (seconds, error, error / compared, 100 * glow))
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("watch", "edit"))
    parser.add_argument("scene")
    parser.add_argument("model", nargs="?")
    parser.add_argument("--octrad", default=os.environ.get("OCTRAD", "build/octrad"))
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--repeat", type=int, default=2)
    parser.add_argument("--light", type=int, default=0)
    parser.add_argument("--factor", default="4,4,4")
    parser.add_argument("--seconds", type=float, default=14.0)
    parser.add_argument("--spp", type=int, default=256, help="of the path-traced pictures")
    parser.add_argument("--samples", type=int, default=16, help="a pixel, of pictures of the cache")
    parser.add_argument("--anew", help="such a picture of a cache that was trained in the edited scene")
    parser.add_argument("-o", "--output")
    args = parser.parse_args()
    result = watch(args) if args.what == "watch" else edit(args)
    if args.output:
        pathlib.Path(args.output).write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
