#!/usr/bin/env python3
"""Train fields for equal seconds and compare their pictures of given views with references: the table of the README.

    bench/quality.py SCENE.xml --time 5m --view scene=ref1.exr --view mirror=ref2.exr,mirror.json -o results.json

A view is NAME=REFERENCE[,CAMERA.json]; without a camera it is the scene's own sensor. References need the roughness layer
(octrad merge makes them). A REFERENCE that is a folder of bench/sparse_reference.py has few pixels and little noise, and its own view:

    bench/sparse_reference.py SCENE.xml --spp 65536 -o refs/own
    bench/quality.py SCENE.xml --time 5m --view own=refs/own

There the field's picture has --sparse-spp samples, so that what is measured is the field and not the noise of its picture: 64 samples
of a blurred mirror have more of it than the field has errors. Relative squared errors without the noise of the reference are written
there too. The whole picture, with --spp samples, is for the eye.

Prints a table and writes everything, commands included, as JSON. Nothing else should run on
the machine meanwhile if the budget is wall-clock time.
"""
import argparse
import json
import os
import subprocess
import tempfile


def run(command):
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def train(command, model, done):
    """JSON of a training; of one that was made already by the same command, what `done` says of it."""
    if os.path.exists(done):
        with open(done) as before:
            training = json.load(before)
        if training["command"][1:] == command[1:] and os.path.exists(model):
            return training["result"]
        os.remove(done)  # what is in `model` from now on, also if this training is interrupted, is of another command
    result = run(command)
    with open(done, "w") as out:
        json.dump({"command": command, "result": result}, out, indent=1)
        out.write("\n")
    return result


def relmse_noise_free(octrad, halves, picture, counted):
    """Relative squared error without the noise of the reference (docs/manual.md, "Noise of the reference"); None without its halves."""
    if halves is None:
        return None
    return run([octrad, "compare", halves[0], picture, "--reference-b", halves[1], "--json", "-q"] + counted)["images"][0]["relmse_noise_free"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--octrad", default="build/octrad")
    parser.add_argument("--fields", default="octaoctree,nr", help="those of octrad train --field, with commas (default: octaoctree,nr)")
    parser.add_argument("--time", default="5m")
    parser.add_argument("--steps", help="train so many steps instead of --time: what a busy machine does not change")
    parser.add_argument("--device", default="cpu", help="that trains and renders (default: cpu)")
    parser.add_argument("--preset", default="cpu", help="octrad train --preset (default: cpu)")
    parser.add_argument("--seed", default="0")
    parser.add_argument("--spp", default="16", help="primary samples a pixel of the lhs pictures (default: 16)")
    parser.add_argument("--sparse-spp", default="1024", help="the same where a reference has few pixels (default: 1024)")
    parser.add_argument("-D", action="append", default=[], metavar="KEY=VALUE", help="configuration keys for all fields")
    parser.add_argument("--view", action="append", required=True, metavar="NAME=REFERENCE[,CAMERA]")
    parser.add_argument("--pictures", help="folder that keeps pictures and models: a training that is there, by the same command, is not made again")
    parser.add_argument("-o", "--output")
    args = parser.parse_args()
    folder = args.pictures or tempfile.mkdtemp()
    os.makedirs(folder, exist_ok=True)
    definitions = [word for d in args.D for word in ("-D", d)]
    budget = ["--steps", args.steps] if args.steps else ["--time", args.time]
    rows = []
    for field in args.fields.split(","):
        model = os.path.join(folder, field + ".octrad")
        trained = train([args.octrad, "train", args.scene, "-o", model, "--overwrite", "--preset", args.preset, "--field", field, *budget, "--seed", args.seed,
                         "--device", args.device, "--no-optimizer", "--json", "-q"] + definitions, model, os.path.join(folder, field + ".json"))
        for view in args.view:
            name, rest = view.split("=", 1)
            reference, _, camera = rest.partition(",")
            options = ["--camera", camera] if camera else []
            picture = os.path.join(folder, f"{field}_{name}.exr")
            counted, noise, halves = [], None, None  # which pixels, and how far the reference is off itself
            if os.path.isdir(reference):
                with open(os.path.join(reference, "about.json")) as about:
                    size = json.load(about)
                counted = ["--mask", os.path.join(reference, "mask.pfm")]
                options, noise = size["view"], size["noise"]
                halves = [os.path.join(reference, "half_a.exr"), os.path.join(reference, "half_b.exr")]
                reference = os.path.join(reference, "reference.exr")
            else:
                size = run([args.octrad, "info", reference, "--json"])
            render = [args.octrad, "render", args.scene, "--integrator", "lhs", "--model", model, "--device", args.device, "--width", str(size["width"]),
                      "--height", str(size["height"]), "--json", "-q"] + options
            rendered = run(render + ["--spp", args.spp, "-o", picture])
            if counted:
                picture = os.path.join(folder, f"{field}_{name}_sparse.exr")
                run(render + counted + ["--spp", args.sparse_spp, "--seed", args.seed, "-o", picture])
            everything, glossy = ({**run([args.octrad, "compare", reference, picture, "--json", "-q"] + counted + only)["images"][0],
                                   "relmse_noise_free": relmse_noise_free(args.octrad, halves, picture, counted + only)}
                                  for only in ([], ["--alpha-below", "0.5"]))
            rows.append({"field": field, "view": name, "steps": trained["steps"], "seconds": trained["seconds"],
                         "rhs_queries_per_s": trained["rhs_queries_per_s"], "mape": everything["mape"], "mape_trimmed": everything["mape_trimmed"],
                         "mape_glossy": glossy["mape"], "relmse_noise_free": everything["relmse_noise_free"],
                         "relmse_noise_free_glossy": glossy["relmse_noise_free"], "mean_ratio": everything["mean_ratio"], "frame_seconds_per_spp": rendered["seconds"] / rendered["spp"],
                         "pixels_glossy": glossy["pixels"], "noise": noise})
    print(f"{'field':<12}{'view':<10}{'steps':>8}{'seconds':>9}{'MAPE':>8}{'trimmed':>9}{'glossy':>8}{'mean':>8}{'Mq/s':>7}")
    for r in rows:
        glossy = "-" if r["mape_glossy"] is None else f"{r['mape_glossy']:.4f}"
        print(f"{r['field']:<12}{r['view']:<10}{r['steps']:>8}{r['seconds']:>9.0f}{r['mape']:>8.4f}{r['mape_trimmed']:>9.4f}{glossy:>8}"
              f"{r['mean_ratio']:>8.4f}{r['rhs_queries_per_s'] / 1e6:>7.2f}")
    if args.output:
        with open(args.output, "w") as out:
            json.dump({"scene": os.path.basename(os.path.dirname(os.path.abspath(args.scene))), "time": None if args.steps else args.time,
                       "preset": args.preset, "device": args.device, "keys": args.D, "rows": rows}, out, indent=1)
            out.write("\n")


if __name__ == "__main__":
    main()
