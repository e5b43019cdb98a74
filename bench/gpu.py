"""What bench/gpu.sh runs. Standard library only."""
import argparse
import json
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "results"
SHARED = pathlib.Path(os.environ.get("OCTRAD_SHARED", ROOT.parent / "shared")) / "scenes"
SIZES = (("1024 x 1024", ["--width", "1024", "--height", "1024"]), ("1280 x 720", ["--width", "1280", "--height", "720"]))


class Step:
    """A command of the plan. `repeat`: of how many runs the median counts."""

    def __init__(self, name, scene, words, repeat=1, log=None):
        self.name, self.scene, self.words, self.repeat, self.log = name, scene, words, repeat, log


def scene_file(name):
    """A shared scene, or the one of this repository with the same name, or None."""
    for path in (SHARED / name / "scene.xml", ROOT / "scenes" / name / "scene.xml"):
        if path.exists():
            return str(path)
    return None


def plan(folder, scenes):
    """Steps in order: later ones use what earlier ones wrote to `folder`."""
    steps = []

    def at(name):
        return os.path.join(folder, name)

    def add(name, scene, verb, *words, **keywords):
        steps.append(Step(name, scene, [verb, scene, *words, "--device", "cuda", "--json", "-q"], **keywords))

    def frames(scene, field, model, spp=1, sizes=SIZES):
        for size, words in sizes:
            more = ", %d samples a pixel" % spp if spp > 1 else ""
            add("%s: frame, %s%s" % (field, size, more), scene, "render", "--model", model, *words, "--spp", str(spp), "--frames", "200", "-o", at("frame.exr"))

    for i, scene in enumerate(scenes):
        model = at("paper%d.octrad" % i)
        add("octaoctree: paper schedule", scene, "train", "--preset", "paper", "-o", model)
        frames(scene, "octaoctree", model)
        frames(scene, "octaoctree", model, 4, SIZES[:1])
        baseline = at("nr%d.octrad" % i)
        add("nr: 500 steps of the paper schedule", scene, "train", "--preset", "paper", "--field", "nr", "--steps", "500", "-o", baseline)
        frames(scene, "nr", baseline)
        cones = at("ncr%d.octrad" % i)
        add("ncr: 500 steps of the paper schedule", scene, "train", "--preset", "paper", "--field", "ncr", "--steps", "500", "-o", cones)
        frames(scene, "ncr", cones)

    kitchen = scene_file("kitchen") or scenes[0]
    add("path: 256 spp, depth 8", kitchen, "render", "--integrator", "path", *SIZES[0][1], "--spp", "256", "--max-depth", "8", "-o", at("path.exr"), repeat=3)

    cornell = scene_file("cornell-box")
    reference = at("reference.exr")
    add("path: reference, 4096 spp", cornell, "render", "--integrator", "path", *SIZES[0][1], "--spp", "4096", "-o", reference)
    for preset in ("default", "cpu"):
        model = at("curve-%s.octrad" % preset)
        log = at("curve-%s.jsonl" % preset)
        add("octaoctree: error against seconds, %s" % preset, cornell, "train", "--preset", preset, "--time", "60s", "--reference", reference, "-o", model,
            "--log-json", log, log=log)
    picture = at("lhs.exr")
    add("octaoctree: picture after 60 s, default", cornell, "render", "--model", at("curve-default.octrad"), *SIZES[0][1], "--spp", "64", "-o", picture)
    steps.append(Step("octaoctree: its error", cornell, ["compare", reference, picture, "--json", "-q"]))
    return steps


def rehearsed(words):
    """The same command on the CPU, tiny. Frames are timed on a GPU only."""
    small = {"--device": "cpu", "--width": "16", "--height": "16", "--spp": "1", "--time": "1s", "--steps": "2"}
    out, skip = [], False
    for word in words:
        if skip:
            skip = False
        elif word == "--frames":
            skip = True
        else:
            out.append(small.get(out[-1], word) if out else word)
    if words[0] == "train":
        if "--time" not in out and "--steps" not in out:
            out += ["--steps", "2"]
        out += ["-D", "octree.levels=2", "-D", "train.points=64", "-D", "train.directions=2", "-D", "disparity.log2_table=10", "-D", "nr.log2_table=10"]
        out += ["-D", "ncr.log2_table=10", "-D", "ncr.cone.log2_table=10", "-D", "ncr.rays.train=8", "-D", "ncr.rays.render=8"]
        out += ["-D", "octree.occupancy=conservative"]
    return out


def run(octrad, words):
    """The command's JSON; a failure ends the program with the command's own message."""
    done = subprocess.run([octrad, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit("octrad %s\n%s" % (" ".join(words), done.stderr))
    return json.loads(done.stdout)


def shown(word, folder):
    """Without the folders of this machine."""
    for path, name in ((folder + os.sep, ""), (str(ROOT) + os.sep, ""), (str(SHARED), "shared/scenes")):
        word = word.replace(path, name)
    return word


def line(words, folder):
    return " ".join(["octrad", *(shown(word, folder) for word in words)])


def curve(log):
    """[{step, seconds, mape}] of a training log."""
    with open(log, encoding="utf-8") as lines:
        events = [json.loads(line) for line in lines]
    points = [{key: e[key] for key in ("step", "seconds", "mape")} for e in events if e["event"] == "validation"]
    done = events[-1]
    return points + [{"step": done["steps"], "seconds": done["seconds"], "mape": done["validation_mape"]}]


def measure(octrad, step, words, folder):
    print("  %s" % step.name, flush=True)
    results = [run(octrad, words) for _ in range(step.repeat)]
    entry = {"name": step.name, "scene": shown(step.scene, folder), "command": line(words, folder), "result": results[0]}
    if step.repeat > 1:
        entry["runs"] = step.repeat
        entry["median"] = {key: statistics.median(r[key] for r in results) for key in ("seconds", "samples_per_s", "rays_per_s")}
    if step.log:
        entry["curve"] = curve(step.log)
    return entry


def summary(entry):
    r = entry["result"]
    if "images" in r:
        return "MAPE %.4f" % r["images"][0]["mape"]
    parts = []
    if "frames" in r:
        parts.append("median %.3f ms, 95th percentile %.3f ms" % (r["frames"]["median_ms"], r["frames"]["p95_ms"]))
    else:
        parts.append("%.1f s" % entry.get("median", r)["seconds"])
        if r.get("integrator") == "path":
            parts.append("%.4g rays/s" % entry.get("median", r)["rays_per_s"])
        if r.get("rhs_queries_per_s"):
            parts.append("%.4g queries/s" % r["rhs_queries_per_s"])
    if r.get("validation_mape") is not None:
        parts.append("MAPE %.4f" % r["validation_mape"])
    if r.get("stages_ms"):
        parts.append("ms of a step: " + ", ".join("%s %.3g" % stage for stage in r["stages_ms"].items()))
    if r.get("device_peak_bytes"):
        parts.append("peak %.2f GiB" % (r["device_peak_bytes"] / 2**30))
    return ", ".join(parts)


def main():
    parser = argparse.ArgumentParser(prog="bench/gpu.sh", description="octrad selftest and the main timings on a GPU.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE.xml", help="of the paper schedule and the frames, the first is the selftest's; default: the shared "
                        "cornell-box ($OCTRAD_SHARED, else ../shared), or this repository's")
    parser.add_argument("-o", "--output", help="JSON file; default on a GPU: bench/results/<date>-<gpu>.json")
    parser.add_argument("--octrad", default=os.environ.get("OCTRAD", str(ROOT / "build" / "octrad")), help="default: $OCTRAD, else build/octrad")
    parser.add_argument("--plan", action="store_true", help="print the commands and run nothing")
    parser.add_argument("--rehearse", action="store_true", help="run each command on the CPU, tiny, and keep nothing: shows that it works")
    args = parser.parse_args()
    scenes = args.scenes or [scene_file("cornell-box")]
    if args.plan:
        print(line(["selftest", scenes[0], "--device", "cuda", "--json", "-q"], "FOLDER"))
        for step in plan("FOLDER", scenes):
            print("%s   # %s%s" % (line(step.words, "FOLDER"), step.name, ", %d times" % step.repeat if step.repeat > 1 else ""))
        return
    if not os.path.exists(args.octrad):
        sys.exit("%s is not there; build it with scripts/build.sh build -DOCTRAD_CUDA=on, or name it with --octrad" % args.octrad)
    if args.rehearse:
        with tempfile.TemporaryDirectory() as folder:
            for step in plan(folder, scenes):
                entry = measure(args.octrad, step, rehearsed(step.words), folder)
                if entry.get("curve") == [] or not summary(entry):
                    sys.exit("%s: its report lacks what is wanted from it" % entry["command"])
        print("every command works; nothing was measured")
        return

    info = run(args.octrad, ["info", "--json"])
    cuda = info["auto"]["device"] != "cpu"
    if not cuda:
        print("no GPU: %s. The kernels run on the host instead, and nothing here is a GPU's figure." % info["auto"]["why"])
    print("selftest", flush=True)
    selftest = run(args.octrad, ["selftest", *scenes[:1], "--device", info["auto"]["device"], "--json", "-q"])
    report = {"date": selftest["date"], "gpu": selftest["device"]["name"] if cuda else None, "selftest": selftest}
    if cuda:
        with tempfile.TemporaryDirectory() as folder:
            print("timings", flush=True)
            report["timings"] = [measure(args.octrad, step, step.words, folder) for step in plan(folder, scenes)]
    print("%d checks and %d stages passed, %d benchmarks, %d skipped" % (len(selftest["checks"]), len(selftest["stages"]), len(selftest["benchmarks"]),
                                                                         len(selftest["skipped"])))
    for row in selftest["benchmarks"]:
        print("  %-44s %10.4g %s%s" % (row["name"], row["rate"], row["unit"], "" if cuda else "  (host)"))
    for entry in report.get("timings", []):
        print("  %-44s %s" % (entry["name"], summary(entry)))

    output = args.output
    if cuda and not output:
        gpu = re.sub(r"[^a-z0-9]+", "-", report["gpu"].lower()).strip("-")
        output = str(RESULTS / ("%s-%s.json" % (report["date"], gpu)))
    if output:
        with open(output, "w", encoding="utf-8") as out:
            json.dump(report, out, indent=1)
            out.write("\n")
        print(output)
    else:
        print("nothing was written")


if __name__ == "__main__":
    main()
