#!/usr/bin/env python3
"""A reference with little noise of a few pixels of a view: blocks of 8 x 8 pixels, spread over the picture by chance.

    bench/sparse_reference.py SCENE.xml --width 256 --height 144 --spp 65536 -o FOLDER [OPTIONS OF octrad render]

Needs numpy. Other options, such as --camera, --sensor or --origin, go to octrad render.
An error that is averaged over 2,000 pixels is known to a few per cent, and 2,000 pixels can have thirty times the samples
that a whole picture of 256 x 256 could have in the same time. FOLDER gets half_a.pfm and half_b.pfm (half of the samples
each, another seed), reference.pfm (their mean) and mask.pfm (1 where there is a reference), all of the whole view, and
about.json with the command, the pixels and the noise: the mean absolute relative error of reference.pfm, estimated from
the halves. bench/quality.py takes FOLDER as a reference; octrad compare takes the pictures with --mask. A folder that is
there is left alone.
"""
import argparse
import concurrent.futures
import json
import os
import random
import subprocess
import sys
import tempfile

import numpy as np

BLOCK = 8


def read_pfm(path):
    with open(path, "rb") as f:
        assert f.readline() == b"PF\n", path
        width, height = map(int, f.readline().split())
        order = "<f4" if float(f.readline()) < 0 else ">f4"
        return np.frombuffer(f.read(), order).reshape(height, width, 3)[::-1].astype(np.float64)


def write_pfm(path, picture):
    with open(path, "wb") as f:
        f.write(b"PF\n%d %d\n-1.0\n" % (picture.shape[1], picture.shape[0]))
        f.write(picture[::-1].astype("<f4").tobytes())


def places(width, height, count, seed):
    """One block in each of about `count` cells of a grid, somewhere in it."""
    columns = max(1, round((count * width / height) ** 0.5))
    rows = max(1, round(count / columns))
    chance = random.Random(seed)
    result = []
    for row in range(rows):
        for column in range(columns):
            x0, x1 = column * width // columns, (column + 1) * width // columns
            y0, y1 = row * height // rows, (row + 1) * height // rows
            result.append((chance.randint(x0, max(x0, x1 - BLOCK)), chance.randint(y0, max(y0, y1 - BLOCK))))
    return result


def render_blocks(octrad, scene, width, height, blocks, spp, seeds, options):
    """The blocks of a view, one process of octrad render on one thread each, in a picture that is black elsewhere; seeds: one a block."""
    picture = np.zeros((height, width, 3))
    with tempfile.TemporaryDirectory() as folder:
        def render(number):
            x, y = blocks[number]
            path = os.path.join(folder, f"{number}.pfm")
            subprocess.run([octrad, "render", scene, "--threads", "1", "--width", str(width), "--height", str(height),
                            "--crop", f"{x},{y},{BLOCK},{BLOCK}", "--spp", str(spp), "--seed", str(seeds[number]), "-o", path, "-q"] + options, check=True)
            picture[y:y + BLOCK, x:x + BLOCK] = read_pfm(path)
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(render, range(len(blocks))))
    return picture


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--octrad", default="build/octrad")
    parser.add_argument("--width", type=int, default=256)
    parser.add_argument("--height", type=int, default=256)
    parser.add_argument("--spp", type=int, default=65536, help="samples a pixel of both halves together (default: 65536)")
    parser.add_argument("--blocks", type=int, default=32, help="blocks of 8 x 8 pixels, about (default: 32)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", required=True)
    args, view = parser.parse_known_args()
    done = os.path.join(args.output, "about.json")
    if os.path.exists(done):
        print(f"{args.output} is there")
        return
    os.makedirs(args.output, exist_ok=True)
    blocks = places(args.width, args.height, args.blocks, args.seed)
    mask = np.zeros((args.height, args.width, 3))
    for x, y in blocks:
        mask[y:y + BLOCK, x:x + BLOCK] = 1
    halves = [render_blocks(args.octrad, args.scene, args.width, args.height, blocks, max(1, args.spp // 2),
                            [2 * (args.seed * 100003 + number) + half + 1 for number in range(len(blocks))],
                            ["--integrator", "path", "--max-depth", "-1", "--device", "cpu"] + view) for half in range(2)]
    reference = (halves[0] + halves[1]) / 2
    # The halves differ by twice the reference's own error, as independent errors add in squares.
    seen = mask > 0
    noise = float(np.mean(np.abs(halves[0] - halves[1])[seen] / (np.abs(reference)[seen] + 0.01)) / 2)
    for name, picture in (("half_a", halves[0]), ("half_b", halves[1]), ("reference", reference), ("mask", mask)):
        write_pfm(os.path.join(args.output, name + ".pfm"), picture)
    about = {"command": ["bench/sparse_reference.py"] + sys.argv[1:], "width": args.width, "height": args.height, "pixels": int(np.count_nonzero(mask[..., 0])),
             "spp": args.spp, "view": view, "blocks": blocks, "noise": noise}
    with open(done, "w") as out:
        json.dump(about, out, indent=1)
        out.write("\n")
    print(f"{args.output}: {about['pixels']} pixels, noise {noise:.4f}")


if __name__ == "__main__":
    main()
