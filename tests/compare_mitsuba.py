#!/usr/bin/env python3
"""Renders a scene with Mitsuba 3 and with octrad's path tracer and compares block averages.

    python3 tests/compare_mitsuba.py SCENE.xml [--octrad build/octrad] [--width 160] [--spp 512] [--max-depth 8] [-o folder]

Needs `pip install mitsuba numpy` (and an LLVM for the fast variant; --variant scalar_rgb needs none). Both renderers make several
independent pictures (--runs) of spp/runs samples; the spread over the runs gives the noise of every block of --block pixels. Printed: the ratio of the means, the standard deviation of the
z-scores of all blocks (1 where only noise is left), and the blocks that deviate most. Fails (exit 1) when
  - the means of the pictures differ by more than 1 % and 3 standard errors, or
  - a block differs by more than 1 % and by more standard errors than chance gives among so many blocks (Student's t).
Pictures and the signed relative difference are written to the folder given with -o.
"""
import argparse
import glob
import json
import math
import os
import subprocess
import sys
import tempfile


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene")
    p.add_argument("--octrad", default="build/octrad", help="the program; run as: PROGRAM render SCENE -o OUT --integrator path ...")
    p.add_argument("--variant", default="llvm_ad_rgb")
    p.add_argument("--width", type=int, default=160)
    p.add_argument("--spp", type=int, default=512)
    p.add_argument("--runs", type=int, default=8)
    p.add_argument("--max-depth", type=int, default=8)
    p.add_argument("--block", type=int, default=16)
    p.add_argument("--tolerance", type=float, default=0.01)
    p.add_argument("-o", "--output")
    return p.parse_args()


def mitsuba_runs(args):
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        found = sorted(glob.glob("/usr/lib/*/libLLVM-1[6-9].so") + glob.glob("/usr/lib/*/libLLVM-[2-9]?.so"))
        if found:
            os.environ["DRJIT_LIBLLVM_PATH"] = found[-1]
    import mitsuba as mi
    import numpy as np
    mi.set_variant(args.variant)
    scene = mi.load_file(args.scene)
    sensor = scene.sensors()[0]
    size = sensor.film().size()
    params = mi.traverse(sensor)
    params["film.size"] = [args.width, max(1, round(args.width * size[1] / size[0]))]
    params.update()
    integrator = mi.load_dict({"type": "path", "max_depth": args.max_depth})
    runs = []
    for run in range(args.runs):
        total, done, number = 0.0, 0, 0
        while done < args.spp // args.runs:
            spp = min(16, args.spp // args.runs - done)
            total = total + spp * np.array(mi.render(scene, integrator=integrator, spp=spp, seed=run * 100003 + number + 1), dtype=np.float64)[..., :3]
            done += spp
            number += 1
        runs.append(total / done)
    return np.stack(runs)


def octrad_runs(args, height):
    import mitsuba as mi
    import numpy as np
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        for run in range(args.runs):
            out = os.path.join(folder, "%d.exr" % run)
            subprocess.run([args.octrad, "render", args.scene, "-o", out, "--integrator", "path", "--spp", str(args.spp // args.runs), "--max-depth",
                            str(args.max_depth), "--width", str(args.width), "--height", str(height), "--seed", str(run + 1), "-q"], check=True)
            runs.append(read_rgb(mi, np, out))
    return np.stack(runs)


def read_rgb(mi, np, file):
    bitmap = mi.Bitmap(file)
    names = [field.name.split(".")[-1] if field.name.startswith("<root>.") else field.name for field in bitmap.struct_()]
    return np.array(bitmap, dtype=np.float64)[..., [names.index(c) for c in "RGB"]]


def blocks(np, runs, size):
    """[runs, blocks down, blocks across]: mean over pixels and channels; rims that fill no block are left out unless there is no block."""
    n, h, w, _ = runs.shape
    bh, bw = min(size, h), min(size, w)
    cut = runs[:, : h // bh * bh, : w // bw * bw].mean(axis=3)
    return cut.reshape(n, h // bh, bh, w // bw, bw).mean(axis=(2, 4))


def main():
    args = arguments()
    import numpy as np
    theirs = mitsuba_runs(args)
    ours = octrad_runs(args, theirs.shape[1])
    report = compare(np, args, ours, theirs)
    print(json.dumps(report, indent=1))
    if args.output:
        import mitsuba as mi
        os.makedirs(args.output, exist_ok=True)
        a, b = ours.mean(axis=0), theirs.mean(axis=0)
        for name, picture in [("octrad", a), ("mitsuba", b), ("difference", (a - b) / (b.mean(axis=2, keepdims=True) + 0.01))]:
            mi.Bitmap(picture.astype(np.float32)).write(os.path.join(args.output, name + ".exr"))
        for name, picture in [("octrad", a), ("mitsuba", b)]:
            mapped = np.clip(np.log1p(picture), 0, 1) ** (1 / 2.2)
            mi.Bitmap((mapped * 255).astype(np.uint8)).write(os.path.join(args.output, name + ".png"))
        d = (a - b).mean(axis=2) / (b.mean(axis=2) + 0.01) * 5
        signed = np.stack([np.clip(d, 0, 1), np.clip(-d, 0, 1), 0 * d], axis=2)
        mi.Bitmap((signed * 255).astype(np.uint8)).write(os.path.join(args.output, "difference.png"))
    return 1 if report["failures"] else 0


def compare(np, args, ours, theirs):
    n = args.runs
    a, b = blocks(np, ours, args.block), blocks(np, theirs, args.block)
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    # Few runs tell a block's noise badly: the variance is pooled from both renderers.
    variance = (a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / n
    error = np.sqrt(np.maximum(variance, 1e-16))
    z = (mean_a - mean_b) / error
    relative = (mean_a - mean_b) / np.maximum(mean_b, 1e-3)
    # The limit that Student's t with 2 (n - 1) degrees of freedom passes once in 1000 pictures, by its normal quantile and Hill's expansion.
    dof = 2 * (n - 1)
    tail = 0.001 / z.size
    q = math.sqrt(2) * _erfc_inverse(tail)
    limit = q + (q ** 3 + q) / (4 * dof) + (5 * q ** 5 + 16 * q ** 3 + 3 * q) / (96 * dof ** 2) + (3 * q ** 7 + 19 * q ** 5 + 17 * q ** 3 - 15 * q) / (384 * dof ** 3)
    means_a, means_b = ours.mean(axis=(1, 2, 3)), theirs.mean(axis=(1, 2, 3))
    ratio = means_a.mean() / means_b.mean()
    ratio_error = math.sqrt((means_a.var(ddof=1) + means_b.var(ddof=1)) / n) / means_b.mean()
    order = np.argsort(-np.abs(z), axis=None)[:5]
    worst = [{"x": int(i % z.shape[1] * args.block), "y": int(i // z.shape[1] * args.block), "octrad": round(float(mean_a.flat[i]), 5),
              "mitsuba": round(float(mean_b.flat[i]), 5), "relative": round(float(relative.flat[i]), 5), "z": round(float(z.flat[i]), 2)} for i in order]
    failures = []
    if abs(ratio - 1) > args.tolerance and abs(ratio - 1) > 3 * ratio_error:
        failures.append("means differ by %.2f %%" % (100 * (ratio - 1)))
    bad = (np.abs(relative) > args.tolerance) & (np.abs(z) > limit)
    if bad.any():
        failures.append("%d of %d blocks differ by more than %g %%" % (bad.sum(), z.size, 100 * args.tolerance))
    return {"scene": args.scene, "width": ours.shape[2], "height": ours.shape[1], "spp": args.spp, "max_depth": args.max_depth,
            "mean_ratio": round(float(ratio), 5), "mean_ratio_error": round(ratio_error, 5),
            "mean_ratio_rgb": [round(float(v), 5) for v in ours.mean(axis=(0, 1, 2)) / theirs.mean(axis=(0, 1, 2))],
            "z_mean": round(float(z.mean()), 3), "z_deviation": round(float(z.std()), 3), "z_limit": round(limit, 2),
            "block_error_median": round(float(np.median(error / np.maximum(mean_b, 1e-3))), 5), "worst": worst, "failures": failures}


def _erfc_inverse(y):
    low, high = 0.0, 10.0
    for _ in range(200):
        mid = 0.5 * (low + high)
        low, high = (mid, high) if math.erfc(mid) > y else (low, mid)
    return low


if __name__ == "__main__":
    sys.exit(main())
