#!/usr/bin/env python3
"""How quickly `octrad view` answers: plays a walk over a plain client on this machine.

    bench/view.py SCENE.xml MODEL.octrad [--width 320 --height 180] [--seconds 10] [-o results.json]

Each camera of the walk is sent as soon as the last frame was shown, as a page does that draws 60 times a second. Printed are medians and
95th percentiles of: the time between frames; from a camera that is sent to the picture that shows it, the whole way; encoding and sending;
and how long 1 and 4 samples a pixel take once the camera rests. `--full` keeps the full size while moving, instead of following the rate.
"""
import argparse
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tests" / "cli"))
from web_client import Viewer  # noqa: E402


def walk(first, radius, t):
    """A slow turn about where the scene's camera stands."""
    forward = [b - a for a, b in zip(first["origin"], first["target"])]
    angle = 0.5 * math.sin(0.7 * t)
    turned = [forward[0] * math.cos(angle) + forward[2] * math.sin(angle), forward[1], forward[2] * math.cos(angle) - forward[0] * math.sin(angle)]
    origin = [first["origin"][0] + 0.05 * radius * math.sin(0.9 * t), first["origin"][1], first["origin"][2] + 0.05 * radius * math.cos(1.1 * t)]
    return {**first, "origin": origin, "target": [a + b for a, b in zip(origin, turned)]}


def percentiles(values):
    ordered = sorted(values)
    return {"median": statistics.median(ordered), "p95": ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("model", nargs="?")
    parser.add_argument("--octrad", default=os.environ.get("OCTRAD", "build/octrad"))
    parser.add_argument("--integrator", default="lhs")
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--height", type=int, default=180)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--full", action="store_true", help="full size while moving")
    parser.add_argument("-o", "--output")
    args = parser.parse_args()
    command = [args.octrad, "view", args.scene, *(["--model", args.model] if args.model else []), "--integrator", args.integrator, "--width", str(args.width),
               "--height", str(args.height), "--json", "-q"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    try:
        viewer = Viewer(json.loads(process.stdout.readline())["url"])
        viewer.answer("state")
        viewer.frame(lambda h: not h["moving"])
        viewer.send("set", full=args.full)
        first, radius = viewer.state["camera"], viewer.hello["radius"]
        times, ways, encodings, sizes = [], [], [], []
        begin = time.monotonic()
        last, number = None, 0
        while time.monotonic() - begin < args.seconds:
            number += 1
            sent = time.monotonic()
            viewer.send("set", camera=walk(first, radius, sent - begin), input=number)
            frame = viewer.frame(lambda h: h["input"] >= number)
            now = time.monotonic()
            if number > 10:  # the rate is known by then
                ways.append(1e3 * (now - sent))
                times.append(1e3 * (now - last))
                encodings.append(frame.header["ms"]["encode"] + frame.header["ms"]["send"])
                sizes.append(frame.header["width"])
            last = now
        # A change while the picture at rest refines: the pass under way has to end.
        interruptions = []
        for i in range(8):
            viewer.frame(lambda h: not h["moving"] and h["a"]["samples"] >= 1)
            time.sleep(0.05 * i)
            number += 1
            sent = time.monotonic()
            viewer.send("set", camera=walk(first, radius, i), input=number)
            viewer.frame(lambda h: h["input"] >= number)
            interruptions.append(1e3 * (time.monotonic() - sent))
        rest = {}
        begin = time.monotonic()
        for samples in (1, 4):
            viewer.frame(lambda h: not h["moving"] and h["input"] == number and h["a"]["samples"] >= samples)
            rest[samples] = max(0.0, time.monotonic() - begin - 0.15)
        still = viewer.frames[-1].header["ms"]
    finally:
        process.terminate()
        process.wait()
    result = {"scene": args.scene, "integrator": args.integrator, "size": [args.width, args.height], "moving_width": statistics.median(sizes), "frames": len(times),
              "frame_ms": percentiles(times), "frames_per_s": 1e3 / statistics.median(times), "input_to_picture_ms": percentiles(ways),
              "interrupting_ms": percentiles(interruptions), "encode_and_send_ms": percentiles(encodings), "still_ms": still,
              "seconds_to_samples": rest}
    print("%s %s %d x %d, moving at a width of %d" % (os.path.basename(os.path.dirname(os.path.abspath(args.scene))), args.integrator, args.width, args.height, result["moving_width"]))
    for name, key in (("between frames", "frame_ms"), ("input to picture", "input_to_picture_ms"), ("  while it refines", "interrupting_ms"), ("encode and send", "encode_and_send_ms")):
        print("  %-18s median %6.1f ms, 95th percentile %6.1f ms" % (name, result[key]["median"], result[key]["p95"]))
    print("  %.1f frames/s; 1 sample a pixel %.2f s after 150 ms of rest, 4 after %.2f s; of a picture at rest: %s" %
          (result["frames_per_s"], rest[1], rest[4], ", ".join("%s %.1f ms" % item for item in still.items())))
    if args.output:
        pathlib.Path(args.output).write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
