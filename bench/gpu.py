"""What bench/gpu.sh runs. Standard library only."""
import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "results"


def run(words):
    """The command's JSON; a failure ends the program with the command's own message."""
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit("%s\n%s" % (" ".join(words), done.stderr))
    return json.loads(done.stdout)


def timings(octrad, scene, device_verbs, folder):
    """[(name, verb, words)] of the main timings of a scene, in order: later ones use what earlier ones wrote."""
    model = os.path.join(folder, "model.octrad")
    picture = os.path.join(folder, "out.exr")
    train = [octrad, "train", scene, "-o", model, "--device", "cuda", "--json", "-q"]
    render = [octrad, "render", scene, "-o", picture, "--device", "cuda", "--json", "-q"]
    plan = [
        ("paper schedule", "train", train + ["--preset", "paper"]),
        ("lhs 1024 x 1024", "render", render + ["--model", model, "--width", "1024", "--height", "1024", "--spp", "1", "--frames", "200"]),
        ("lhs 1280 x 720", "render", render + ["--model", model, "--width", "1280", "--height", "720", "--spp", "1", "--frames", "200"]),
        ("lhs 1024 x 1024, 4 samples a pixel", "render",
         render + ["--model", model, "--width", "1024", "--height", "1024", "--spp", "4", "--frames", "200"]),
        ("path 1024 x 1024, 256 spp, depth 8", "render",
         render + ["--integrator", "path", "--width", "1024", "--height", "1024", "--spp", "256", "--max-depth", "8"]),
    ]
    for name, verb, words in plan:
        shown = ["octrad"] + [w.replace(folder + os.sep, "") for w in words[1:]]
        if verb in device_verbs:
            print("%s: %s" % (scene, name), flush=True)
            yield {"scene": scene, "name": name, "command": " ".join(shown), "result": run(words)}
        else:
            yield {"scene": scene, "name": name, "skipped": "octrad %s runs on the CPU only" % verb}


def main():
    parser = argparse.ArgumentParser(prog="bench/gpu.sh", description="octrad selftest and the main timings on a GPU.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE.xml", help="default: scenes/glossy-room/scene.xml; the first is the selftest's")
    parser.add_argument("-o", "--output", help="JSON file; default on a GPU: bench/results/<date>-<gpu>.json")
    parser.add_argument("--octrad", default=os.environ.get("OCTRAD", str(ROOT / "build" / "octrad")), help="default: $OCTRAD, else build/octrad")
    args = parser.parse_args()
    if not os.path.exists(args.octrad):
        sys.exit("%s is not there; build it with scripts/build.sh build -DOCTRAD_CUDA=on, or name it with --octrad" % args.octrad)
    scenes = args.scenes or [str(ROOT / "scenes" / "glossy-room" / "scene.xml")]

    info = run([args.octrad, "info", "--json"])
    cuda = info["auto"]["device"] != "cpu"
    if not cuda:
        print("no GPU: %s. The kernels run on the host instead, and nothing here is a GPU's figure." % info["auto"]["why"])
    print("selftest", flush=True)
    report = {"selftest": run([args.octrad, "selftest", scenes[0], "--device", info["auto"]["device"], "--json", "-q"])}
    if cuda:
        with tempfile.TemporaryDirectory() as folder:
            report["timings"] = [t for scene in scenes for t in timings(args.octrad, scene, info["device_verbs"], folder)]
    selftest = report["selftest"]
    print("%d checks passed, %d benchmarks, %d skipped" % (len(selftest["checks"]), len(selftest["benchmarks"]), len(selftest["skipped"])))
    for row in selftest["benchmarks"]:
        print("  %-36s %10.4g %s%s" % (row["name"], row["rate"], row["unit"], "" if cuda else "  (host)"))
    for row in report.get("timings", []):
        print("  %-36s %s" % (row["name"], row.get("skipped") or json.dumps(row["result"])))

    output = args.output
    if cuda and not output:
        gpu = re.sub(r"[^a-z0-9]+", "-", selftest["device"]["name"].lower()).strip("-")
        output = str(RESULTS / ("%s-%s.json" % (selftest["date"], gpu)))
    if output:
        with open(output, "w", encoding="utf-8") as out:
            json.dump(report, out, indent=1)
            out.write("\n")
        print(output)
    else:
        print("nothing was written")


if __name__ == "__main__":
    main()
