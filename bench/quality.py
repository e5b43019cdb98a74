#!/usr/bin/env python3
"""Trains fields and compares their pictures of given views with references: the tables of docs/results.md.

    bench/quality.py PLAN.json --scenes FOLDER --folder WORK       every row of a plan: bench/five_minutes.json, for example
    bench/quality.py SCENE.xml --time 5m --view own=refs/own       one scene, one seed

Both go on where they were interrupted, in the middle of a training too.

A plan names scenes, each with its size, the steps of each field, and views; fields, seeds, keys of all fields ("*") and of each;
references are made as it says ("spp" of a view: bench/sparse_reference.py). --scenes has the scenes as NAME/scene.xml (several
folders: with commas); those that a plan calls "without_insides" are copied by bench/without_insides.py. WORK gets references,
models, pictures, a file for each row with the commands that made it, and from all rows so far rows.csv and tables.txt.
"watch" of a plan is the samples of a whole reference of 128 pixels' width, with which trainings of the first seed are watched, every
"watch_every" of training (5s): curves.csv has their errors while they train, and the worst of them over the best before it.

A view of one scene is NAME=REFERENCE[,CAMERA.json]; without a camera it is the scene's own sensor. References need the roughness
layer (octrad merge makes them). A REFERENCE that is a folder of bench/sparse_reference.py has few pixels and little noise, and its
own view:

    bench/sparse_reference.py SCENE.xml --spp 65536 -o refs/own

There the field's picture has --sparse-spp samples, so that what is measured is the field and not the noise of its picture: 64 samples
of a blurred mirror have more of it than the field has errors. Relative squared errors without the noise of the reference are written
there too. The whole picture, with --spp samples, is for the eye.

Prints a table and, with -o, writes everything as JSON. Nothing else should run on the machine meanwhile if the budget is
wall-clock time.
"""
import argparse
import csv
import fnmatch
import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
FIELDS = {"octaoctree": "OctaOctree", "nr": "Neural Radiosity", "ncr": "Neural Cone Radiosity"}
INTERRUPTED = (-2, -15, 130, 143)  # exit codes of a training that kept what it had


def run(command):
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def read(path):
    with open(path) as file:
        return json.load(file)


def write(path, value):
    with open(path + ".new", "w") as out:
        json.dump(value, out, indent=1)
        out.write("\n")
    os.replace(path + ".new", path)


def train(command, model, done, log=None):
    """JSON of a training. `done` holds the command and, once it is finished, what it printed: the same is not made again,
    and goes on where it was interrupted, which `log` goes on with as well."""
    before = read(done) if os.path.exists(done) else None
    same = before is not None and before["command"][1:] == command[1:] and os.path.exists(model)
    if same and before["result"] is not None:
        return before["result"]
    if not same:
        for old in (done, model, log):
            if old and os.path.exists(old):
                os.remove(old)
    write(done, {"command": command, "result": None})
    try:
        result = run([w if w != "--overwrite" else "--resume" for w in command] if same else command)
    except subprocess.CalledProcessError as failed:
        if failed.returncode not in INTERRUPTED:
            os.remove(done)
        raise
    write(done, {"command": command, "result": result})
    return result


def measure(args, scene, model, field, trained, view, reference, camera):
    """The row of a view: pictures of the field beside its model, and their errors. `trained`: what the training printed."""
    options = ["--camera", camera] if camera else []
    picture = f"{model.removesuffix('.octrad')}_{view}.exr"
    counted, noise, halves = [], None, None  # which pixels, and how far the reference is off itself
    if os.path.isdir(reference):
        size = read(os.path.join(reference, "about.json"))
        counted = ["--mask", os.path.join(reference, "mask.pfm")]
        options, noise = size["view"], size["noise"]
        halves = [os.path.join(reference, "half_a.exr"), os.path.join(reference, "half_b.exr")]
        reference = os.path.join(reference, "reference.exr")
    else:
        size = run([args.octrad, "info", reference, "--json"])
    render = [args.octrad, "render", scene, "--integrator", "lhs", "--model", model, "--device", args.device, "--width", str(size["width"]),
              "--height", str(size["height"]), "--json", "-q"] + options
    rendered = run(render + ["--spp", str(args.spp), "-o", picture])
    if counted:
        picture = picture.removesuffix(".exr") + "_sparse.exr"
        run(render + counted + ["--spp", str(args.sparse_spp), "--seed", str(args.seed), "-o", picture])

    def compared(only):
        options = ["--json", "-q"] + counted + only
        found = run([args.octrad, "compare", reference, picture] + options)["images"][0]
        free = None  # relative squared error without the noise of the reference (docs/manual.md, "Noise of the reference")
        if halves is not None:
            free = run([args.octrad, "compare", halves[0], picture, "--reference-b", halves[1]] + options)["images"][0]["relmse_noise_free"]
        return {**found, "relmse_noise_free": free}

    everything, glossy = compared([]), compared(["--alpha-below", "0.5"])
    return {"field": field, "view": view, "steps": trained["steps"], "seconds": trained["seconds"],
            "rhs_queries_per_s": trained["rhs_queries_per_s"], "mape": everything["mape"], "mape_trimmed": everything["mape_trimmed"],
            "mape_glossy": glossy["mape"], "relmse_noise_free": everything["relmse_noise_free"],
            "relmse_noise_free_glossy": glossy["relmse_noise_free"], "mean_ratio": everything["mean_ratio"],
            "frame_seconds_per_spp": rendered["seconds"] / rendered["spp"], "pixels_glossy": glossy["pixels"], "noise": noise}


def training(args, scene, model, field, budget, keys):
    definitions = [word for d in keys for word in ("-D", d)]
    return [args.octrad, "train", scene, "-o", model, "--overwrite", "--preset", args.preset, "--field", field, *budget, "--seed", str(args.seed),
            "--device", args.device, "--no-optimizer", "--json", "-q"] + definitions


def one_scene(args):
    folder = args.folder or tempfile.mkdtemp()
    os.makedirs(folder, exist_ok=True)
    budget = ["--steps", args.steps] if args.steps else ["--time", args.time]
    rows = []
    for field in args.fields.split(","):
        model = os.path.join(folder, field + ".octrad")
        trained = train(training(args, args.what, model, field, budget, args.D), model, os.path.join(folder, field + ".json"))
        for view in args.view:
            name, rest = view.split("=", 1)
            reference, _, camera = rest.partition(",")
            rows.append(measure(args, args.what, model, field, trained, name, reference, camera))
    print(f"{'field':<12}{'view':<10}{'steps':>8}{'seconds':>9}{'MAPE':>8}{'trimmed':>9}{'glossy':>8}{'mean':>8}{'Mq/s':>7}")
    for r in rows:
        glossy = "-" if r["mape_glossy"] is None else f"{r['mape_glossy']:.4f}"
        print(f"{r['field']:<12}{r['view']:<10}{r['steps']:>8}{r['seconds']:>9.0f}{r['mape']:>8.4f}{r['mape_trimmed']:>9.4f}{glossy:>8}"
              f"{r['mean_ratio']:>8.4f}{r['rhs_queries_per_s'] / 1e6:>7.2f}")
    if args.output:
        write(args.output, {"scene": os.path.basename(os.path.dirname(os.path.abspath(args.what))), "time": None if args.steps else args.time,
                            "preset": args.preset, "device": args.device, "keys": args.D, "rows": rows})


def scene_file(args, scene):
    """Path of a plan's scene, in one of the folders of --scenes."""
    for folder in args.scenes.split(","):
        found = os.path.join(folder, scene["name"], "scene.xml")
        if os.path.exists(found):
            break
    else:
        sys.exit(f"no {scene['name']}/scene.xml in {args.scenes}")
    if not scene.get("without_insides"):
        return found
    copy = os.path.join(args.folder, scene["name"])
    if not os.path.exists(copy):
        shutil.rmtree(copy + ".new", ignore_errors=True)
        subprocess.run([sys.executable, os.path.join(HERE, "without_insides.py"), os.path.dirname(found), copy + ".new"], check=True, stdout=subprocess.DEVNULL)
        os.rename(copy + ".new", copy)
    return os.path.join(copy, "scene.xml")


def sparse_reference(args, scene, file, name, view):
    """Folder of the reference of a view, made if it is not there."""
    folder = os.path.join(args.references, f"{scene['name']}-{name}")
    about = os.path.join(folder, "about.json")
    wanted = {"spp": view["spp"], "view": view.get("camera", []), "width": scene["width"], "height": scene["height"]}
    known = read(about) if os.path.exists(about) else {}
    if any(known.get(k) != v for k, v in wanted.items()):
        if known and any(known[k] != wanted[k] for k in ("view", "width", "height")):
            sys.exit(f"{folder} is the reference of another view; take another folder with --references")
        subprocess.run([sys.executable, os.path.join(HERE, "sparse_reference.py"), file, "--octrad", args.octrad, "--device", args.device,
                        "--width", str(scene["width"]), "--height", str(scene["height"]), "--spp", str(view["spp"]), "-o", folder]
                       + view.get("camera", []), check=True, stdout=subprocess.DEVNULL)
    return folder


def whole_reference(args, scene, file, spp):
    """Picture of the scene's own view; the same command again goes on, or finds all there."""
    path = os.path.join(args.references, f"{scene['name']}-{scene['width']}x{scene['height']}-{spp}.exr")
    subprocess.run([args.octrad, "render", file, "--integrator", "path", "--max-depth", "-1", "--device", args.device, "--width", "128", "--height",
                    str(128 * scene["height"] // scene["width"]), "--spp", str(spp), "--resume", "-q", "-o", path], check=True)
    return path


def curve(log):
    """(step, seconds, MAPE) of every validation in a training's log."""
    found = {}  # by step: what was measured again after a kill counts once
    with open(log) as lines:
        for line in lines:
            event = json.loads(line) if line.endswith("}\n") else {"event": "cut off"}
            if event["event"] == "validation":
                found[event["step"]] = (event["step"], event["seconds"], event["mape"])
    return [found[step] for step in sorted(found)]


def worst_of_best(values):
    """The largest of errors over the smallest before it."""
    worst, best = 1.0, float("inf")
    for v in values:
        worst, best = max(worst, v / best), min(best, v)
    return worst


def a_plan(args):
    plan = read(args.what)
    args.preset, args.spp, args.sparse_spp = plan.get("preset", "cpu"), plan.get("spp", 16), plan.get("sparse_spp", 1024)
    args.references = args.references or os.path.join(args.folder, "references")
    for folder in (args.folder, args.references):
        os.makedirs(folder, exist_ok=True)
    for scene in plan["scenes"]:
        for seed in plan["seeds"]:
            for field, steps in scene["steps"].items():
                stem = f"{scene['name']}-{field}-{seed}"
                if not any(fnmatch.fnmatch(stem, p) for p in args.only.split(",")):
                    continue
                args.seed = seed
                file = scene_file(args, scene)
                model = os.path.join(args.folder, stem + ".octrad")
                keys = plan.get("keys", {})
                command = training(args, file, model, field, ["--steps", str(steps)], keys.get("*", []) + keys.get(field, []) + args.D)
                log = os.path.join(args.folder, stem + ".log") if plan.get("watch") and seed == plan["seeds"][0] else None
                if log:
                    command += ["--reference", whole_reference(args, scene, file, plan["watch"]), "--validate-every", plan.get("watch_every", "5s"),
                                "--log-json", log]
                trained = train(command, model, os.path.join(args.folder, stem + ".json"), log)
                for name, view in scene["views"].items():
                    done = os.path.join(args.folder, f"{stem}-{name}.row.json")
                    key = {"training": command[1:], "view": view, "spp": args.spp, "sparse_spp": args.sparse_spp}
                    if os.path.exists(done) and read(done)["key"] == key:
                        continue
                    row = measure(args, file, model, field, trained, name, sparse_reference(args, scene, file, name, view), "")
                    write(done, {"key": key, "row": {"scene": scene["name"], "seed": seed, "trained_on": args.device, **row}})
                report(args, plan)
    report(args, plan)
    with open(os.path.join(args.folder, "tables.txt")) as made:
        print(made.read(), end="")


def report(args, plan):
    """rows.csv, curves.csv and tables.txt, from the rows that are there."""
    rows, curves = {}, []
    for scene in plan["scenes"]:
        for name, field, seed in itertools.product(scene["views"], scene["steps"], plan["seeds"]):
            made = os.path.join(args.folder, f"{scene['name']}-{field}-{seed}-{name}.row.json")
            if os.path.exists(made):
                rows[scene["name"], name, field, seed] = read(made)["row"]
        for field, seed in itertools.product(scene["steps"], plan["seeds"]):
            log = os.path.join(args.folder, f"{scene['name']}-{field}-{seed}.log")
            if os.path.exists(log):
                points = curve(log)
                worst = worst_of_best([p[2] for p in points])
                curves += [(scene["name"], field, seed, *p, f"{worst:.3f}") for p in points]
    with open(os.path.join(args.folder, "rows.csv"), "w", newline="") as out:
        table = csv.writer(out, lineterminator="\n")
        table.writerow("scene view field seed steps trained_on mape mape_glossy rms_without_noise rms_without_noise_glossy mean_ratio".split())
        for (scene, name, field, seed), r in rows.items():
            table.writerow([scene, name, field, seed, r["steps"], r["trained_on"]] + [number(v) for v in (
                r["mape"], r["mape_glossy"], root(r["relmse_noise_free"]), root(r["relmse_noise_free_glossy"]), r["mean_ratio"])])
    if curves:
        with open(os.path.join(args.folder, "curves.csv"), "w", newline="") as out:
            table = csv.writer(out, lineterminator="\n")
            table.writerow("scene field seed step seconds mape worst_over_best_before".split())
            table.writerows([*c[:4], f"{c[4]:.1f}", f"{c[5]:.4f}", c[6]] for c in curves)
    with open(os.path.join(args.folder, "tables.txt"), "w") as out:
        out.write("\n".join(tables(plan, rows)) + "\n")


def root(x):
    return None if x is None else max(0.0, x) ** 0.5


def number(x):
    return "" if x is None else f"{x:.4f}"


def mean(values):
    return sum(values) / len(values)


def spread(values):
    """Mean ± half of the range; - where a view has no such pixels."""
    if None in values:
        return "-"
    text = f"{mean(values):.4f}"
    return text if len(values) < 2 else f"{text} ± {(max(values) - min(values)) / 2:.4f}"


def tables(plan, rows):
    fields = [f for f in FIELDS if any(f in s["steps"] for s in plan["scenes"])]
    first = ["| MAPE all / glossy | noise | " + " | ".join(FIELDS[f] for f in fields) + " | OctaOctree's glossy error, of Neural Radiosity's"
             " | the same, root of the relative squared error |", "|---" * (len(fields) + 4) + "|"]
    second = ["| mean luminance | " + " | ".join(FIELDS[f] for f in fields) + " | steps |", "|---" * (len(fields) + 2) + "|"]
    for scene in plan["scenes"]:
        for name in scene["views"]:
            of = {f: [rows[k] for k in ((scene["name"], name, f, s) for s in plan["seeds"]) if k in rows] for f in fields}
            if not any(of.values()):
                continue
            noise = next(r["noise"] for rs in of.values() for r in rs)

            def ratio(error):
                a, b = ([error(r) for r in of.get(f, [])] for f in ("octaoctree", "nr"))
                return f"{mean(a) / mean(b):.2f}" if a and b and None not in a + b else "-"

            first.append(f"| {scene['name']}, {name} | {noise:.4f} | " + " | ".join(
                f"{spread([r['mape'] for r in of[f]])} / {spread([r['mape_glossy'] for r in of[f]])}" if of[f] else "-" for f in fields)
                + f" | {ratio(lambda r: r['mape_glossy'])} | {ratio(lambda r: root(r['relmse_noise_free_glossy']))} |")
            second.append(f"| {scene['name']}, {name} | " + " | ".join(
                ", ".join(f"{100 * (r['mean_ratio'] - 1):+.1f}" for r in of[f]) + " %" if of[f] else "-" for f in fields)
                + " | " + " / ".join(f"{scene['steps'][f]:,}" if f in scene["steps"] else "-" for f in fields) + " |")
    return first + [""] + second


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", metavar="PLAN.json | SCENE.xml")
    parser.add_argument("--octrad", default="build/octrad")
    parser.add_argument("--device", default="cpu", help="that trains and renders (default: cpu)")
    parser.add_argument("--folder", "--pictures", help="that keeps models and pictures: a training that is there, by the same command, is not made again")
    parser.add_argument("-D", action="append", default=[], metavar="KEY=VALUE", help="configuration keys for all fields")
    of_plan = parser.add_argument_group("a plan")
    of_plan.add_argument("--scenes", default="scenes", help="folders with NAME/scene.xml, with commas between them (default: scenes)")
    of_plan.add_argument("--references", metavar="FOLDER", help="that keeps the references (default: --folder/references)")
    of_plan.add_argument("--only", default="*", metavar="PATTERN", help="only trainings whose SCENE-FIELD-SEED matches one of these, with commas between them")
    of_scene = parser.add_argument_group("one scene")
    of_scene.add_argument("--fields", default="octaoctree,nr", help="those of octrad train --field, with commas (default: octaoctree,nr)")
    of_scene.add_argument("--time", default="5m")
    of_scene.add_argument("--steps", help="train so many steps instead of --time: what a busy machine does not change")
    of_scene.add_argument("--preset", default="cpu", help="octrad train --preset (default: cpu)")
    of_scene.add_argument("--seed", default="0")
    of_scene.add_argument("--spp", default="16", help="primary samples a pixel of the lhs pictures (default: 16)")
    of_scene.add_argument("--sparse-spp", default="1024", help="the same where a reference has few pixels (default: 1024)")
    of_scene.add_argument("--view", action="append", metavar="NAME=REFERENCE[,CAMERA]")
    of_scene.add_argument("-o", "--output")
    args = parser.parse_args()
    if args.what.endswith(".json"):
        if not args.folder:
            parser.error("a plan needs --folder")
        a_plan(args)
    else:
        if not args.view:
            parser.error("one scene needs --view")
        one_scene(args)


if __name__ == "__main__":
    main()
