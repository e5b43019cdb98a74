#!/usr/bin/env python3
"""Renders Mitsuba's own test scenes with Mitsuba 3 and with octrad's path tracer, and compares both with each other and with the stored pictures.

    python3 tests/agreement.py [FOLDER | --grid] [--octrad build/octrad] [--state agreement] [--seconds 200] [--only NAME]

FOLDER holds Mitsuba's folder resources/data/tests/scenes (default: $OCTRAD_SHARED/mitsuba_tests/data/tests/scenes). Needs `pip install mitsuba numpy`. What is
rendered is kept in the folder --state; a second run goes on where --seconds ended the first, and prints the table of everything once all is there.

With --grid the scenes are a small sphere (of hair: a curve) of each scattering model under each emitter, made here.

Both renderers make --runs independent pictures of --spp samples with the depth that the file gives. A scene agrees where
  - the means of the pictures differ by at most 0.3 % and 3 standard errors together,
  - at most 2 % of the blocks of 8 x 8 pixels differ by more than 1 % and 4 standard errors together,
  - the share of pixels that pass the Z-test against the stored mean and variance (Mitsuba's: two-sided, 1 % with the correction of Sidak for the number of
    pixels, variances of at least 1e-4) is not below that of Mitsuba by more than a point.
Exit code 1 where one does not; scenes that either refuses are listed by name, and 3 where time ended before the last scene.
"""
import argparse
import glob
import json
import math
import os
import subprocess
import sys
import time

import compare_mitsuba as base

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "cli"))

from measured_file import measured_file  # noqa: E402


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    shared = os.environ.get("OCTRAD_SHARED", "../shared")
    p.add_argument("folder", nargs="?", default=os.path.join(shared, "mitsuba_tests", "data", "tests", "scenes"))
    p.add_argument("--grid", action="store_true", help="every scattering model under every emitter, instead of a folder")
    p.add_argument("--octrad", default="build/octrad")
    p.add_argument("--variant", default="scalar_rgb")
    p.add_argument("--spp", type=int, default=64)
    p.add_argument("--runs", type=int, default=8)
    p.add_argument("--state", default="agreement")
    p.add_argument("--seconds", type=float, default=1e9)
    p.add_argument("--only", default="", help="only scenes whose name holds this")
    return p.parse_args()


SCENES = {}  # the last that was loaded
BSDFS = {
    "diffuse": '<rgb name="reflectance" value="0.7, 0.4, 0.2"/>', "plastic": '<boolean name="nonlinear" value="true"/>', "roughplastic": '<float name="alpha" value="0.2"/>',
    "conductor": '<string name="material" value="Au"/>', "roughconductor": '<string name="material" value="Cu"/><float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.3"/>',
    "dielectric": "", "thindielectric": "", "roughdielectric": '<float name="alpha" value="0.3"/><string name="distribution" value="ggx"/>', "null": "",
    "principled": '<rgb name="base_color" value="0.7, 0.4, 0.2"/><float name="roughness" value="0.3"/><float name="metallic" value="0.3"/><float name="clearcoat" value="0.8"/>'
                  '<float name="spec_trans" value="0.5"/><float name="sheen" value="0.5"/>',
    "hair": '<float name="eumelanin" value="0.2"/><float name="longitudinal_roughness" value="0.2"/>',
    "measured": '<string name="filename" value="m_rgb.bsdf"/>',
    "principledthin": '<float name="roughness" value="0.4"/><float name="spec_trans" value="0.4"/><float name="diff_trans" value="0.8"/>',
    "twosided": '<bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf>', "mask": '<float name="opacity" value="0.5"/><bsdf type="diffuse"/>',
    "blendbsdf": '<float name="weight" value="0.4"/><bsdf type="diffuse"/><bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>',
    "bumpmap": '<texture type="bitmap"><string name="filename" value="t.exr"/><boolean name="raw" value="true"/></texture><float name="scale" value="0.3"/><bsdf type="diffuse"/>',
    "normalmap": '<texture name="normalmap" type="bitmap"><string name="filename" value="n.exr"/><boolean name="raw" value="true"/></texture><bsdf type="roughplastic"/>',
}
EMITTERS = {
    "area": '<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="100"/><translate y="3" z="1"/></transform><emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>',
    "point": '<emitter type="point"><point name="position" value="1, 3, 2"/><rgb name="intensity" value="20"/></emitter>',
    "spot": '<emitter type="spot"><transform name="to_world"><lookat origin="1, 3, 2" target="0, 0, 0" up="0, 0, 1"/></transform><rgb name="intensity" value="30"/><float name="cutoff_angle" value="30"/></emitter>',
    "directional": '<emitter type="directional"><vector name="direction" value="-1, -2, -1"/><rgb name="irradiance" value="3"/></emitter>',
    "projector": '<emitter type="projector"><transform name="to_world"><lookat origin="1, 3, 2" target="0, 0, 0" up="0, 0, 1"/></transform><float name="fov" value="50"/>'
                 '<texture name="irradiance" type="bitmap"><string name="filename" value="t.exr"/><boolean name="raw" value="true"/></texture><float name="scale" value="30"/></emitter>',
    "constant": '<emitter type="constant"><rgb name="radiance" value="0.5, 0.7, 1"/></emitter>',
    "envmap": '<emitter type="envmap"><string name="filename" value="e.exr"/><transform name="to_world"><rotate y="1" angle="50"/></transform></emitter>',
}
GRID = """<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="5"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/><transform name="to_world"><lookat origin="0, 1.5, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/><rfilter type="box"/></film></sensor>
<shape type={shape}><bsdf type="{bsdf}">{parameters}</bsdf></shape>
<shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/><translate y="-1.1"/></transform><bsdf type="diffuse"/></shape>
{emitter}</scene>
"""


def write_grid(mi, np, folder):
    """Scene files and the pictures that they use."""
    os.makedirs(os.path.join(folder, "grid"), exist_ok=True)
    y, x = np.mgrid[0:16, 0:32].astype(np.float32)
    waves = np.stack([0.5 + 0.4 * np.sin(x / (3 + c)) * np.cos(y / 2) for c in range(3)], axis=2)
    normals = np.stack([0.5 + 0.15 * np.sin(x / 2), 0.5 + 0.15 * np.cos(y / 2), 0.95 + 0 * x], axis=2)
    sky = waves + 20 * np.exp(-((x - 9) ** 2 + (y - 4) ** 2) / 4)[..., None]
    for name, picture in (("t", waves), ("n", normals), ("e", sky)):
        mi.Bitmap(picture.astype(np.float32)).write(os.path.join(folder, "grid", name + ".exr"))
    with open(os.path.join(folder, "grid", "c.txt"), "w", encoding="utf-8") as curve:
        curve.write("-2 0 0 0.8\n-1 0.2 0 0.9\n0 0 0.3 1\n1 0.2 0 0.9\n2 0 0 0.8\n")
    with open(os.path.join(folder, "grid", "m_rgb.bsdf"), "wb") as out:
        out.write(measured_file(1))
    for bsdf, parameters in BSDFS.items():
        for emitter, text in EMITTERS.items():
            # Mitsuba drops the light of paths that pass masks alone, unless there is an environment.
            if bsdf == "mask" and emitter not in ("constant", "envmap"):
                text += '<emitter type="constant"><rgb name="radiance" value="1e-5"/></emitter>'
            with open(os.path.join(folder, "grid", f"{bsdf}-{emitter}.xml"), "w", encoding="utf-8") as out:
                shape = '"bsplinecurve"><string name="filename" value="c.txt"/' if bsdf == "hair" else '"sphere"'
                out.write(GRID.format(shape=shape, bsdf=bsdf, parameters=parameters, emitter=text))


def mitsuba_run(mi, np, file, spp, seed):
    if file not in SCENES:
        SCENES.clear()
        SCENES[file] = mi.load_file(file)
    return np.array(mi.render(SCENES[file], spp=spp, seed=seed), dtype=np.float32)[..., :3]


def octrad_run(mi, np, program, file, spp, seed, out):
    subprocess.run([program, "render", file, "-o", out, "--integrator", "path", "--spp", str(spp), "--seed", str(seed), "-q"], check=True, stderr=subprocess.DEVNULL)
    picture = base.read_rgb(mi, np, out)
    os.remove(out)
    return picture.astype(np.float32)


def z_share(np, mean, spp, reference, variance):
    """The share of values whose p-value is above the corrected level."""
    z = np.abs(mean - reference) * np.sqrt(spp / np.maximum(variance, 1e-4))
    level = 1.0 - (1.0 - 0.01) ** (1.0 / (mean.shape[0] * mean.shape[1]))
    limit = math.sqrt(2.0) * base._erfc_inverse(level)
    return float((z < limit).mean())


def compare(np, ours, theirs, spp, stored):
    n = ours.shape[0]
    a, b = base.blocks(np, ours, 8), base.blocks(np, theirs, 8)
    error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / n)
    off = np.abs(a.mean(axis=0) - b.mean(axis=0)) > 0.01 * np.abs(b.mean(axis=0)) + 4.0 * error + 1e-6
    means = ours.mean(axis=(1, 2, 3)), theirs.mean(axis=(1, 2, 3))
    ratio = means[0].mean() / means[1].mean()
    sigma = math.sqrt((means[0].var(ddof=1) + means[1].var(ddof=1)) / n) / means[1].mean()
    report = {"ratio": float(ratio), "sigma": float(sigma), "blocks_off": float(off.mean()), "failures": []}
    if abs(ratio - 1.0) > 0.003 + 3.0 * sigma:
        report["failures"].append("mean")
    if off.mean() > 0.02:
        report["failures"].append("blocks")
    if stored:
        report["z_octrad"], report["z_mitsuba"] = (z_share(np, p.mean(axis=0), n * spp, *stored) for p in (ours, theirs))
        if report["z_octrad"] < report["z_mitsuba"] - 0.01:
            report["failures"].append("Z-test")
    return report


def stored_pictures(mi, np, file):
    """Mean and variance beside a scene file, whose name ends with that of an integrator."""
    folder, name = os.path.split(file)
    stem = os.path.join(folder, "refs", name[:-4].rsplit("_", 1)[0])
    if not os.path.exists(stem + "_ref_rgb.exr"):
        return None
    return [np.array(mi.Bitmap(stem + ending), dtype=np.float64)[..., :3] for ending in ("_ref_rgb.exr", "_ref_rgb_var.exr")]


def main():
    args = arguments()
    import mitsuba as mi
    import numpy as np
    mi.set_variant(args.variant)
    mi.set_log_level(mi.LogLevel.Error)
    os.makedirs(args.state, exist_ok=True)
    if args.grid:
        args.folder = args.state
        write_grid(mi, np, args.folder)
    files = sorted(f for f in glob.glob(os.path.join(args.folder, "*", "*.xml")) if args.only in f)
    if not files:
        sys.exit("no scenes in " + args.folder)
    end = time.monotonic() + args.seconds
    rows, refused = [], []
    for file in files:
        name = os.path.basename(file)[:-4]
        check = json.loads(subprocess.run([args.octrad, "info", file, "--check", "--json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout)
        if not check["loads"]:
            refused.append((name, "octrad: " + "; ".join(sorted({issue["what"] for issue in check["refused"]}))))
            continue
        pictures = {}
        try:
            for who, render in (("mitsuba", lambda run: mitsuba_run(mi, np, file, args.spp, run)),
                                ("octrad", lambda run: octrad_run(mi, np, args.octrad, file, args.spp, run, os.path.join(args.state, "run.exr")))):
                runs = []
                for run in range(args.runs):
                    kept = os.path.join(args.state, f"{name}-{who}-{args.spp}-{run}.npy")
                    if not os.path.exists(kept):
                        if time.monotonic() > end:
                            print("time is up: run again with the same --state")
                            return 3
                        picture = render(run + 1)
                        np.save(kept + ".new.npy", picture)
                        os.replace(kept + ".new.npy", kept)
                    runs.append(np.load(kept).astype(np.float64))
                pictures[who] = np.stack(runs)
        except RuntimeError as error:
            refused.append((name, "Mitsuba: " + str(error).strip().splitlines()[-1][:200]))
            continue
        rows.append({"scene": name, **compare(np, pictures["octrad"], pictures["mitsuba"], args.spp, stored_pictures(mi, np, file))})
    print(f"{'scene':34} {'size of means':>20} {'blocks off':>10} {'Z octrad':>9} {'Z Mitsuba':>9}")
    for row in rows:
        z = [f"{100 * row[k]:8.2f}%" if k in row else "        -" for k in ("z_octrad", "z_mitsuba")]
        print(f"{row['scene']:34} {row['ratio']:10.5f} +- {row['sigma']:.5f} {100 * row['blocks_off']:9.2f}% {z[0]} {z[1]}  {' '.join(row['failures'])}")
    for name, why in refused:
        print(f"{name:34} refused by {why}")
    with open(os.path.join(args.state, "table.json"), "w", encoding="utf-8") as out:
        json.dump({"rows": rows, "refused": refused}, out, indent=1)
    return 1 if any(row["failures"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
