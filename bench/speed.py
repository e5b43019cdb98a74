#!/usr/bin/env python3
"""End-to-end speed on given scenes, medians of several runs: the path tracer beside Mitsuba 3, and the cache's queries.

    bench/speed.py path SCENE.xml ... --mitsuba-python venv/bin/python --mitsuba-tool mitsuba_render.py -o results.json
    bench/speed.py cache SCENE.xml ... -o results.json
    bench/speed.py metrics SCENE.xml ... --lpips-weights DIR -o results.json
    bench/speed.py path SCENE.xml ... --before OTHER/build/octrad

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


def in_turns(args, measure):
    """{program: {name: median}} of measure(program, turn), with which the programs take turns."""
    programs = {"octrad": args.octrad} | ({"before": args.before} if args.before else {})
    turns = {name: [] for name in programs}
    for turn in range(args.repeat):
        for name, program in programs.items():
            turns[name].append(measure(program, turn))
    return {name: {key: statistics.median(one[key] for one in all_turns) for key in all_turns[0]} for name, all_turns in turns.items()}


def beside(row, key, higher_is_better=True):
    """How many times as fast as the program before, as text."""
    if "before" not in row:
        return ""
    ratio = row["octrad"][key] / row["before"][key]
    return f" ({ratio if higher_is_better else 1 / ratio:.2f} x)"


def path(args, folder):
    rows = []
    for scene in args.scenes:
        picture = ["-o", os.path.join(folder, "path.exr"), "--device", "cpu", "--json", "-q"]

        def measure(program, turn):
            start = time.monotonic()
            run([program, "render", scene, "--integrator", "path", "--width", "16", "--spp", "1", "--max-depth", "8"] + picture)
            values = {"load_s": time.monotonic() - start}
            values["samples_per_s"] = run([program, "render", scene, "--integrator", "path", "--width", "256", "--spp", str(args.spp), "--max-depth", "8"] +
                                          picture)["samples_per_s"]
            if program == args.octrad:
                for variant in args.variants.split(",") if args.mitsuba_tool else []:
                    values[variant] = run([args.mitsuba_python, args.mitsuba_tool, scene, "--width", "256", "--spp", str(args.spp), "--pass-spp",
                                           str(max(1, args.spp // 2)), "--max-depth", "8", "--variant", variant])["samples_per_s"]
            return values

        row = {"scene": name_of(scene)} | in_turns(args, measure)
        rows.append(row)
        own = row["octrad"]
        print(f"{row['scene']:<14}octrad {own['samples_per_s'] / 1e6:.2f} M/s{beside(row, 'samples_per_s')}   "
              f"load and one pass {own['load_s']:.2f} s{beside(row, 'load_s', False)}"
              + "".join(f"   {variant} {rate / 1e6:.2f} M/s ({own['samples_per_s'] / rate:.2f} x)" for variant, rate in own.items()
                        if variant not in ("load_s", "samples_per_s")), flush=True)
    return rows


def cache(args, folder):
    rows = []
    for scene in args.scenes:
        for levels in (6, 8):
            models = {}

            def train(program):
                model = os.path.join(folder, f"model{len(models)}.octrad")
                if os.path.exists(model):
                    os.remove(model)
                trained, memory = peak_memory_of([program, "train", scene, "-o", model, "--time", f"{args.train_seconds}s", "-D", f"octree.levels={levels}",
                                                  "--no-optimizer", "--device", "cpu", "--json", "-q"])
                return model, {"train_rhs_queries_per_s": trained["rhs_queries_per_s"], "train_ms_per_step": 1000 * trained["seconds"] / trained["steps"],
                               "train_peak_bytes": memory}

            def measure(program, turn):
                if turn == 0:
                    models[program] = train(program)
                model, values = models[program]
                picture = ["-o", os.path.join(folder, "cache.exr"), "--device", "cpu", "--json", "-q", "--model", model, "--width", "512", "--height", "512"]
                rhs = run([program, "render", scene, "--integrator", "rhs", "--spp", "4"] + picture)["queries_per_s"]
                lhs = run([program, "render", scene, "--integrator", "lhs", "--spp", "1"] + picture)["seconds"]
                return {"rhs_queries_per_s": rhs, "lhs_frame_seconds": lhs} | values

            row = {"scene": name_of(scene), "levels": levels} | in_turns(args, measure)
            rows.append(row)
            own = row["octrad"]
            print(f"{row['scene']:<14}K={levels}  rhs {own['rhs_queries_per_s'] / 1e6:.3f} Mq/s{beside(row, 'rhs_queries_per_s')}   "
                  f"lhs 512x512 {own['lhs_frame_seconds']:.3f} s{beside(row, 'lhs_frame_seconds', False)}   "
                  f"training {own['train_ms_per_step']:.1f} ms/step{beside(row, 'train_ms_per_step', False)}, "
                  f"{own['train_rhs_queries_per_s'] / 1e6:.3f} Mq/s{beside(row, 'train_rhs_queries_per_s')}, "
                  f"peak {own['train_peak_bytes'] / 2**30:.2f} GiB{beside(row, 'train_peak_bytes', False)}", flush=True)
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
    parser.add_argument("--before", help="another build of octrad, with which `path` and `cache` take turns: ratios")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--train-seconds", type=int, default=10)
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
