#!/usr/bin/env python3
"""End-to-end speed on given scenes, medians of several runs: the path tracer beside Mitsuba 3, and the cache's queries.

    bench/speed.py path SCENE.xml ... --mitsuba-python venv/bin/python --mitsuba-tool mitsuba_render.py -o results.json
    bench/speed.py cache SCENE.xml ... -o results.json
    bench/speed.py metrics SCENE.xml ... --lpips-weights DIR -o results.json

`path`: samples a second at equal width and depth, octrad and Mitsuba's variants taking turns in one run (the tool renders a
scene with Mitsuba and prints JSON with samples_per_s; without it octrad alone is timed).
`cache`: trains each scene for a moment at K = 6 and K = 8 (speed does not depend on what was learned; K = 8 is the paper's
table size on the bathroom), then times right-hand-side queries with materials and shadow rays (`rhs`, 512 x 512) and the
512 x 512 `lhs` frame at one primary sample a pixel. Also the peak memory of that training. Micro-benchmarks: bench_encoding, bench_network.
`metrics`: `octrad compare` of two pictures of 1024 x 1024 pixels, the whole program with reading the files, without LPIPS and with it.
"""
import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time


def run(command):
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout)


def peak_memory_of(command):
    """JSON of the command and its peak resident bytes."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise RuntimeError(f"{command} failed")
    return json.loads(output), usage.ru_maxrss * 1024


def name_of(scene):
    return os.path.basename(os.path.dirname(os.path.abspath(scene)))


def path(args, folder):
    rows = []
    for scene in args.scenes:
        rates = {"octrad": []}
        for _ in range(args.repeat):
            r = run([args.octrad, "render", scene, "--integrator", "path", "--width", "256", "--spp", str(args.spp), "--max-depth", "8", "-o",
                     os.path.join(folder, "path.exr"), "--device", "cpu", "--json", "-q"])
            rates["octrad"].append(r["samples_per_s"])
            for variant in args.variants.split(",") if args.mitsuba_tool else []:
                m = run([args.mitsuba_python, args.mitsuba_tool, scene, "--width", "256", "--spp", str(args.spp), "--pass-spp", str(max(1, args.spp // 2)),
                         "--max-depth", "8", "--variant", variant])
                rates.setdefault(variant, []).append(m["samples_per_s"])
        row = {"scene": name_of(scene)} | {k: statistics.median(v) for k, v in rates.items()}
        rows.append(row)
        print(row["scene"].ljust(14) + "  ".join(f"{k} {v / 1e6:.2f} M/s" + ("" if k == "octrad" else f" ({row['octrad'] / v:.2f} x)")
                                                 for k, v in row.items() if k != "scene"), flush=True)
    return rows


def cache(args, folder):
    rows = []
    for scene in args.scenes:
        for levels in (6, 8):
            model = os.path.join(folder, "model.octrad")
            trained, memory = peak_memory_of([args.octrad, "train", scene, "-o", model, "--overwrite", "--time", "10s", "-D", f"octree.levels={levels}", "--no-optimizer",
                                              "--device", "cpu", "--json", "-q"])
            picture = ["-o", os.path.join(folder, "cache.exr"), "--device", "cpu", "--json", "-q", "--model", model, "--width", "512", "--height", "512"]
            rhs = [run([args.octrad, "render", scene, "--integrator", "rhs", "--spp", "4"] + picture)["queries_per_s"] for _ in range(args.repeat)]
            lhs = [run([args.octrad, "render", scene, "--integrator", "lhs", "--spp", "1"] + picture)["seconds"] for _ in range(args.repeat)]
            row = {"scene": name_of(scene), "levels": levels, "rhs_queries_per_s": statistics.median(rhs), "lhs_frame_seconds": statistics.median(lhs),
                   "train_rhs_queries_per_s": trained["rhs_queries_per_s"], "train_ms_per_step": 1000 * trained["seconds"] / trained["steps"],
                   "train_peak_bytes": memory}
            rows.append(row)
            print(f"{row['scene']:<14}K={levels}  rhs {row['rhs_queries_per_s'] / 1e6:.3f} Mq/s   lhs 512x512 {row['lhs_frame_seconds']:.3f} s   "
                  f"training {row['train_ms_per_step']:.1f} ms/step, {row['train_rhs_queries_per_s'] / 1e6:.3f} Mq/s, peak {memory / 2**30:.2f} GiB", flush=True)
    return rows


def metrics(args, folder):
    rows = []
    for scene in args.scenes:
        a, b = os.path.join(folder, "a.exr"), os.path.join(folder, "b.exr")
        for seed, file in enumerate((a, b)):
            run([args.octrad, "render", scene, "--integrator", "path", "--width", "1024", "--height", "1024", "--spp", "4", "--seed", str(seed),
                 "-o", file, "--device", "cpu", "--json", "-q"])
        row = {"scene": name_of(scene)}
        for name, options in (("without", []), ("alex", ["--lpips-net", "alex"]), ("squeeze", ["--lpips-net", "squeeze"])):
            if options and not args.lpips_weights:
                continue
            times = []
            for _ in range(args.repeat):
                start = time.monotonic()
                run([args.octrad, "compare", a, b, "--json", "-q"] + options + (["--lpips-weights", args.lpips_weights] if options else []))
                times.append(time.monotonic() - start)
            row[name] = statistics.median(times)
        rows.append(row)
        print(row["scene"].ljust(14) + "  ".join(f"{k} {v:.2f} s" for k, v in row.items() if k != "scene"), flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["path", "cache", "metrics"])
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--octrad", default="build/octrad")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--spp", type=int, default=8)
    parser.add_argument("--variants", default="scalar_rgb,llvm_ad_rgb")
    parser.add_argument("--mitsuba-python", default="python3")
    parser.add_argument("--mitsuba-tool")
    parser.add_argument("--lpips-weights")
    parser.add_argument("-o", "--output")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = {"path": path, "cache": cache, "metrics": metrics}[args.what](args, folder)
    if args.output:
        with open(args.output, "w") as out:
            json.dump({"what": args.what, "repeat": args.repeat, "rows": rows}, out, indent=1)
            out.write("\n")


if __name__ == "__main__":
    main()
