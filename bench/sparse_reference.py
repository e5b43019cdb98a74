#!/usr/bin/env python3
"""A reference with little noise of a few pixels of a view: one pixel, by chance, in each cell of a grid over the picture.

    bench/sparse_reference.py SCENE.xml --width 256 --height 144 --spp 65536 -o FOLDER [OPTIONS OF octrad render]

Other options, such as --camera, --sensor or --origin, go to octrad render.
An error that is averaged over 2,000 pixels is known to a few per cent, and 2,000 pixels can have thirty times the samples
that a whole picture of 256 x 256 could have in the same time. Pixels that lie apart say more than blocks of them: errors of
a cache are alike over tens of pixels. FOLDER gets mask.pfm (white where there is a reference), half_a.exr and half_b.exr (half
of the samples each, with other random numbers), reference.exr (their mean, with the layers of octrad render), and about.json
with the command, the view, the number of pixels and the noise: the mean absolute relative error of reference.exr, estimated
from the halves. bench/quality.py takes FOLDER as a reference; octrad compare takes the pictures with --mask. The same command
again goes on where it was interrupted; with more --spp it adds samples (with fewer it is refused). Scenes need a box filter: others carry samples of 25
neighbours and more into each pixel.
"""
import argparse
import json
import os
import random
import struct
import subprocess
import sys


def places(width, height, count, seed):
    """A pixel in each of about `count` cells of a grid, somewhere in it."""
    columns = min(width, max(1, round((count * width / height) ** 0.5)))
    rows = min(height, max(1, round(count / columns)))
    chance = random.Random(seed)
    cells = [(c * width // columns, (c + 1) * width // columns, r * height // rows, (r + 1) * height // rows) for r in range(rows) for c in range(columns)]
    return {(chance.randrange(x0, x1), chance.randrange(y0, y1)) for x0, x1, y0, y1 in cells}


def write_mask(path, width, height, pixels):
    data = b"PF\n%d %d\n-1.0\n" % (width, height)
    data += b"".join(struct.pack("<3f", *[float((x, y) in pixels)] * 3) for y in reversed(range(height)) for x in range(width))
    if os.path.exists(path):
        with open(path, "rb") as f:
            if f.read() != data:
                sys.exit(f"{path}: is there and has other pixels; take another folder")
        return
    with open(path, "wb") as f:
        f.write(data)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--octrad", default="build/octrad")
    parser.add_argument("--width", type=int, default=256)
    parser.add_argument("--height", type=int, default=256)
    parser.add_argument("--spp", type=int, default=65536, help="samples a pixel of both halves together (default: 65536)")
    parser.add_argument("--pixels", type=int, default=2048, help="about (default: 2048)")
    parser.add_argument("--device", default="cpu", help="that renders (default: cpu)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", required=True)
    args, view = parser.parse_known_args()
    os.makedirs(args.output, exist_ok=True)
    mask, half_a, half_b, reference, about = (os.path.join(args.output, n) for n in ("mask.pfm", "half_a.exr", "half_b.exr", "reference.exr", "about.json"))
    args.spp = 2 * max(1, args.spp // 2)
    pixels = places(args.width, args.height, args.pixels, args.seed)
    write_mask(mask, args.width, args.height, pixels)
    for number, half in enumerate((half_a, half_b)):
        subprocess.run([args.octrad, "render", args.scene, "--integrator", "path", "--max-depth", "-1", "--device", args.device, "--width",
                        str(args.width), "--height", str(args.height), "--mask", mask, "--spp", str(args.spp // 2), "--seed", str(900001 + 2 * args.seed + number),
                        "--resume", "-o", half, "-q"] + view, check=True)
    merged = subprocess.run([args.octrad, "merge", half_a, half_b, "-o", reference, "--json", "-q"], check=True, stdout=subprocess.PIPE)
    noise = json.loads(merged.stdout)["noise"]["mape"]
    with open(about, "w") as out:
        json.dump({"command": ["bench/sparse_reference.py"] + sys.argv[1:], "width": args.width, "height": args.height, "pixels": len(pixels),
                   "spp": args.spp, "view": view, "noise": noise}, out, indent=1)
        out.write("\n")
    print(f"{args.output}: {len(pixels)} pixels, noise {noise:.4f}")


if __name__ == "__main__":
    main()
