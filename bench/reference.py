#!/usr/bin/env python3
"""Join independent renderings of one view into a reference with first-hit layers, and print the reference's own error.

    bench/reference.py -o ref.exr --layers aov.exr a.exr:4096 b.exr:4096 c.exr:8192

The parts are means over the given samples a pixel with different seeds, from any renderer (Mitsuba 3's pictures make the
reference independent of octrad); --layers is a short `octrad render --integrator path` of the same view at the same size,
whose albedo, normal, depth and roughness layers are taken over, so that `octrad compare` can mask glossy surfaces.

Own error: the parts are split into two groups A and B of n_a and n_b samples; the noise of A - B scales to that of the mean
of all by sqrt(1 / (n_a + n_b)) / sqrt(1 / n_a + 1 / n_b). Needs the `mitsuba` package from PyPI to read and write EXR.
"""
import argparse
import json

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")


def read(file):
    bitmap = mi.Bitmap(file)
    names = [field.name for field in bitmap.struct_()]
    return np.array(bitmap, dtype=np.float64), names


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="+", metavar="FILE:SPP")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--layers", required=True)
    args = parser.parse_args()
    parts = []
    for part in args.parts:
        file, spp = part.rsplit(":", 1)
        parts.append((read(file)[0][..., :3], int(spp)))
    total = sum(spp for _, spp in parts)
    mean = sum(picture * spp for picture, spp in parts) / total
    layers, names = read(args.layers)
    keep = [i for i, name in enumerate(names) if "." in name]
    joined = np.concatenate([mean, layers[..., keep]], axis=2).astype(np.float32)
    mi.Bitmap(np.ascontiguousarray(joined), mi.Bitmap.PixelFormat.MultiChannel, ["R", "G", "B"] + [names[i] for i in keep]).write(args.output)

    report = {"output": args.output, "spp": total, "own_mape": None}
    if len(parts) > 1:
        half = len(parts) // 2
        groups = [parts[:half], parts[half:]]
        counts = [sum(spp for _, spp in g) for g in groups]
        a, b = (sum(p * spp for p, spp in g) / n for g, n in zip(groups, counts))
        scale = np.sqrt(1 / total) / np.sqrt(1 / counts[0] + 1 / counts[1])
        relative = (np.abs(a - b) / (mean + 0.01)).mean(axis=2)
        glossy = layers[..., names.index("roughness.Y")] < 0.5
        report["own_mape"] = round(float(relative.mean() * scale), 4)
        report["own_mape_glossy"] = round(float(relative[glossy].mean() * scale), 4) if glossy.any() else None
    print(json.dumps(report))


if __name__ == "__main__":
    main()
