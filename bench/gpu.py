"""What bench/gpu.sh runs: a plan's steps one after the other, each with a time limit, the results written after every one. Python 3.8's
standard library only; from a clone or from a bundle (scripts/bundle.sh)."""
import argparse
import json
import os
import pathlib
import platform
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

import gpu_plans

ROOT = pathlib.Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "results"
BUNDLED = (ROOT / "bin" / "octrad").exists()
CLOCKS = ("clocks.sm", "clocks.mem", "temperature.gpu", "power.draw", "utilization.gpu", "pstate")
KEPT = 4000  # characters of a failed step's output


def scene_folders(given):
    shared = os.environ.get("OCTRAD_SHARED")
    return [*given, *([pathlib.Path(shared) / "scenes"] if shared else []), ROOT / "shared" / "scenes", ROOT.parent / "shared" / "scenes", ROOT / "scenes"]


def find_scenes(folders, first):
    """The scenes that plans name: of the folders, the first that has it; else cornell-box in place of all."""
    scenes = {}
    for name in ("cornell-box", "kitchen"):
        found = [folder / name / "scene.xml" for folder in folders if (folder / name / "scene.xml").exists()]
        scenes[name] = str(found[0]) if found else scenes.get("cornell-box")
    if first:
        scenes["cornell-box"] = first
    if not scenes["cornell-box"]:
        sys.exit("no scene cornell-box in %s" % ", ".join(map(str, folders)))
    return scenes


def query_gpu(*names):
    """nvidia-smi's answers of the first GPU; {} without one."""
    if not shutil.which("nvidia-smi"):
        return {}
    try:
        done = subprocess.run(["nvidia-smi", "--query-gpu=" + ",".join(names), "--format=csv,noheader,nounits"], capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return {}
    return dict(zip(names, (word.strip() for word in done.stdout.split("\n")[0].split(",")))) if done.returncode == 0 else {}


def commit():
    if BUNDLED:
        return (ROOT / "commit").read_text(encoding="utf-8").strip()
    try:
        done = subprocess.run(["git", "-C", str(ROOT), "describe", "--always", "--dirty"], capture_output=True, text=True)
    except OSError:
        return None
    return done.stdout.strip() or None


class Programs:
    """Where the programs are, and the commands that start them."""

    def __init__(self, octrad):
        self.octrad = octrad or os.environ.get("OCTRAD") or str(ROOT / "octrad" if BUNDLED else ROOT / "build" / "octrad")

    def command(self, program):
        if program == "octrad":
            return [self.octrad]
        return [str(ROOT / "run"), program] if BUNDLED else [str(pathlib.Path(self.octrad).parent / program)]

    def exists(self, program):
        return os.path.exists(str(ROOT / "bin" / program) if BUNDLED and program != "octrad" else self.command(program)[-1])

    def tests(self):
        folder = ROOT / "bin" if BUNDLED else pathlib.Path(self.octrad).parent
        return sorted(path.name for path in folder.glob("test_*") if os.access(str(path), os.X_OK) and "." not in path.name)


class Run:
    """One run of a plan: what was measured so far, and the files that keep it."""

    def __init__(self, args, programs, folder, output):
        self.args, self.programs, self.folder, self.output = args, programs, folder, output
        self.begin, self.child, self.report = time.monotonic(), None, {}
        self.log = open(output + ".log", "w", encoding="utf-8") if output else open(os.devnull, "w", encoding="utf-8")

    def seconds(self):
        return time.monotonic() - self.begin

    def left(self):
        return self.args.budget - self.seconds() if self.args.budget else float("inf")

    def write(self):
        if not self.output:
            return
        self.report["seconds"] = round(self.seconds(), 2)
        with open(self.output + ".part", "w", encoding="utf-8") as out:
            json.dump(self.report, out, indent=1)
            out.write("\n")
        os.replace(self.output + ".part", self.output)

    def shown(self, word):
        """Without the folders of this machine."""
        for path, name in ((self.folder + os.sep, ""), (str(ROOT) + os.sep, "")):
            word = word.replace(path, name)
        return re.sub(r"^/.*/(scenes/[^/]+/scene\.xml)$", r"\1", word)

    def line(self, step, words):
        return " ".join([step.program, *map(self.shown, words)])

    def start(self, command, limit):
        """-> (exit status or "timeout", standard output, the output's end), the log getting everything as it comes."""
        with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace", dir=self.folder) as out:
            self.log.write("\n$ %s\n" % " ".join(command))
            self.log.flush()
            at = self.log.tell()
            shared = ROOT / "shared" if BUNDLED else ROOT.parent / "shared"
            environment = dict(os.environ, OCTRAD_SHARED=os.environ.get("OCTRAD_SHARED", str(shared)))  # for unit tests
            self.child = subprocess.Popen(command, stdout=out, stderr=self.log, cwd=str(ROOT), env=environment, start_new_session=True)
            try:
                status = self.child.wait(timeout=limit)
            except subprocess.TimeoutExpired:
                status = "timeout"
                self.stop_child()
            self.child = None
            out.seek(0)
            text = out.read()
        self.log.write(text if len(text) < 200000 else text[:100000] + "\n...\n" + text[-100000:])
        self.log.flush()
        with open(self.log.name, encoding="utf-8", errors="replace") as log:
            log.seek(at)
            return status, text, log.read()[-KEPT:]

    def stop_child(self):
        if self.child is None:
            return
        for number in (signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(self.child.pid, number)
                self.child.wait(timeout=5)
                return
            except ProcessLookupError:
                return
            except subprocess.TimeoutExpired:
                continue

    def program(self, step):
        return "octrad" if self.args.rehearse and step.kind != "text" else step.program

    def measure(self, step):
        """The step's entry of the report; a failure is one too."""
        words = gpu_plans.rehearsed(step.words, self.args.device) if self.args.rehearse and step.kind != "text" else step.words
        entry = {"name": step.name, "command": self.line(step, words)}
        if step.scene:
            entry["scene"] = self.shown(step.scene)
        command = self.programs.command(self.program(step)) + words
        if step.kind == "profile" and not self.args.rehearse:
            command = ["ncu", "--clock-control", "none", "--metrics", "gpu__time_duration.sum", "--csv", *command]
        results, times = [], []
        for _ in range(1 if self.args.rehearse else step.repeat):
            limit, begin = min(step.limit, max(1.0, self.left())), time.monotonic()
            status, text, tail = self.start(command, limit)
            times.append(round(time.monotonic() - begin, 3))
            result = None
            if step.kind == "octrad":
                try:
                    result = json.loads(text)
                except ValueError:
                    pass
            if result is not None:
                results.append(result)
            if status != 0 or (step.kind == "octrad" and result is None):
                # A check that failed has printed its report all the same: both are kept.
                entry["failed"] = "stopped after %.0f s" % limit if status == "timeout" else "exit status %s" % status
                entry["output"] = tail
                break
        entry["wall_seconds"] = times
        if results:
            entry["result"] = results[0]
        if step.kind != "octrad" and "failed" not in entry:
            entry["output"] = tail if step.kind == "text" else text[-200000:]
        if len(results) > 1:
            entry["runs"] = len(results)
            entry["median"] = {key: statistics.median(r[key] for r in results) for key in ("seconds", "samples_per_s", "rays_per_s") if key in results[0]}
        if step.log and os.path.exists(step.log):
            entry["curve"] = curve(step.log)
        clocks = query_gpu(*CLOCKS)
        if clocks:
            entry["gpu"] = clocks
        return entry

    def run(self, steps):
        entries = self.report.setdefault("steps", [])
        self.write()
        bad = set()
        for step in steps:
            missing = [name for name in step.needs if name in bad]
            entry = {"name": step.name}
            if missing:
                entry["skipped"] = "needs: " + ", ".join(missing)
            elif not self.programs.exists(self.program(step)):
                entry["skipped"] = "there is no program " + step.program
            elif not self.args.rehearse and self.left() < step.seconds * step.repeat or self.left() < 1:
                entry["skipped"] = "%.0f s are left of the budget, it takes about %d" % (max(0.0, self.left()), step.seconds * step.repeat)
            else:
                self.report["running"] = step.name
                self.write()
                entry = self.measure(step)
                del self.report["running"]
            if "skipped" in entry or "failed" in entry:
                bad.add(step.name)  # what failed is not built upon
            entries.append(entry)
            self.write()
            print("  %-52s %s" % (step.name, summary(entry)), flush=True)


def curve(log):
    """[{step, seconds, mape}] of a training log, as far as it goes."""
    points = []
    with open(log, encoding="utf-8") as lines:
        for text in lines:
            try:
                event = json.loads(text)
            except ValueError:
                break  # the last line of a training that was killed
            if event.get("event") == "validation":
                points.append({key: event.get(key) for key in ("step", "seconds", "mape")})
    return points


def summary(entry):
    if "skipped" in entry:
        return "skipped: " + entry["skipped"]
    parts = ["FAILED (%s)" % entry["failed"]] if "failed" in entry else []
    r = entry.get("result", {})
    if "images" in r:
        parts.append("MAPE %.4f" % r["images"][0]["mape"])
    elif "checks" in r:
        bad = [c["name"] for c in r["checks"] + r["benchmarks"] + r["stages"] if not c.get("passed", True)]
        parts.append("%d checks, %d stages, %d benchmarks%s" % (len(r["checks"]), len(r["stages"]), len(r["benchmarks"]), "; failed: " + ", ".join(bad) if bad else ""))
    elif "frames" in r:
        parts.append("median %.3f ms, 95th percentile %.3f ms" % (r["frames"]["median_ms"], r["frames"]["p95_ms"]))
    elif "seconds" in r:
        parts.append("%.1f s" % entry.get("median", r)["seconds"])
        if r.get("integrator") == "path":
            parts.append("%.4g rays/s" % entry.get("median", r)["rays_per_s"])
        if r.get("validation_mape") is not None:
            parts.append("MAPE %.4f" % r["validation_mape"])
    else:
        parts.append("%.1f s" % sum(entry.get("wall_seconds", [])))
    stages = r.get("stages_ms") or r.get("frames", {}).get("stages_ms")
    if stages:
        parts.append("ms: " + ", ".join("%s %.3g" % stage for stage in stages.items()))
    if r.get("device_peak_bytes"):
        parts.append("peak %.2f GiB" % (r["device_peak_bytes"] / 2**30))
    return ", ".join(parts)


def chosen(steps, only, skip, budget):
    """Steps in the order of their priority, with what they need; those that do not fit into the budget are reported when their turn comes."""
    names = {step.name: step for step in steps}
    wanted = [s for s in steps if (not only or any(t.lower() in s.name.lower() for t in only)) and not any(t.lower() in s.name.lower() for t in skip)]
    if not wanted:
        sys.exit("--only, --skip: no step is left; --list shows them")
    kept = {}

    def keep(step, priority):
        for name in step.needs:
            keep(names[name], priority)
        kept[step.name] = min(priority, kept.get(step.name, priority))

    for step in wanted:
        keep(step, step.priority)
    order = {step.name: i for i, step in enumerate(steps)}
    return [names[name] for name in sorted(kept, key=lambda name: (kept[name], order[name]))]


def main():
    parser = argparse.ArgumentParser(prog="bench/gpu.sh", description="Measurements on a GPU: a plan's steps, the most important first, the results written after each.",
                                     epilog="plans: " + "; ".join("%s: %s" % item for item in gpu_plans.TITLES.items()))
    parser.add_argument("scene", nargs="?", metavar="SCENE.xml", help="instead of cornell-box")
    parser.add_argument("--plan", default="third", choices=sorted(gpu_plans.PLANS), help="default: third, the record")
    parser.add_argument("-o", "--output", help="JSON file, with a log of everything beside it (OUT.log); default on a GPU: bench/results/<date>-<gpu>.json for the third plan, "
                        "gpu-<plan>.json in the current folder for the others and in a bundle")
    parser.add_argument("--budget", type=float, metavar="SECONDS", help="of the whole run: steps that no longer fit are left out, the least important first")
    parser.add_argument("--only", action="append", default=[], metavar="TEXT", help="steps with this in their name, and what they need; may be repeated")
    parser.add_argument("--skip", action="append", default=[], metavar="TEXT", help="not these; may be repeated")
    parser.add_argument("--scenes", action="append", default=[], type=pathlib.Path, metavar="FOLDER", help="where scenes are: FOLDER/kitchen/scene.xml")
    parser.add_argument("--require-gpu", action="store_true", help="end with exit code 5 where no GPU can be used")
    parser.add_argument("--octrad", help="the program; default: $OCTRAD, else the bundle's, else build/octrad")
    parser.add_argument("--work", metavar="FOLDER", help="for models and pictures, gigabytes; default: a temporary folder")
    parser.add_argument("--list", action="store_true", help="print the steps and run nothing")
    parser.add_argument("--rehearse", action="store_true", help="every command, tiny, on the host standing in for a GPU: shows that it works and measures nothing")
    args = parser.parse_args()
    args.device = "host" if args.rehearse else "cuda"
    programs = Programs(args.octrad)
    scenes = find_scenes(scene_folders(args.scenes), args.scene)
    if not args.list and not os.path.exists(programs.octrad):
        sys.exit("%s is not there; build it with scripts/build.sh build -DOCTRAD_CUDA=on, or name it with --octrad" % programs.octrad)

    with tempfile.TemporaryDirectory(prefix="octrad-gpu-", dir=args.work) as folder:
        tests = [] if args.rehearse and not BUNDLED else programs.tests()
        profiler = bool(shutil.which("ncu")) and not args.rehearse
        steps = gpu_plans.PLANS[args.plan](gpu_plans.Plan("FOLDER" if args.list else folder, scenes, args.device, tests, profiler))
        steps = chosen(steps, args.only, args.skip, args.budget)
        if args.list:
            for step in steps:
                print("%d  %4d s  %s\n             %s %s" % (step.priority, step.seconds * step.repeat, step.name, step.program, " ".join(step.words)))
            print("about %d s" % sum(step.seconds * step.repeat for step in steps))
            return 0

        info = json.loads(subprocess.run([programs.octrad, "info", "--json"], check=True, stdout=subprocess.PIPE).stdout)
        cuda = info["auto"]["device"] != "cpu"
        if not cuda and not args.rehearse:
            why = "no GPU: %s." % info["auto"]["why"]
            if args.require_gpu:
                print(why, file=sys.stderr)
                return 5
            print(why + " The kernels run on the host instead, and nothing here is a GPU's figure.")
            steps = [gpu_plans.Step("selftest on the host", ["selftest", scenes["cornell-box"], "--no-benchmarks", "--seed", "1", "--device", "cpu", "--json", "-q"], 120)]
        date = time.strftime("%Y-%m-%d", time.gmtime())
        name = info["devices"][0]["name"] if cuda and info.get("devices") else None
        output = args.output
        if cuda and not output and not args.rehearse:
            slug = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
            output = str(RESULTS / ("%s-%s.json" % (date, slug))) if args.plan == "third" and not BUNDLED else "gpu-%s.json" % args.plan
        run = Run(args, programs, folder, output)
        run.report = {"plan": args.plan, "date": date, "gpu": name, "commit": commit(), "rehearsal": args.rehearse, "budget": args.budget,
                      "machine": {"kernel": platform.release(), "cores": os.cpu_count(), "cpu": info.get("cpu")}, "info": info,
                      "nvidia_smi": query_gpu("name", "driver_version", "clocks.max.sm", "clocks.max.mem", "power.limit", "ecc.mode.current", *CLOCKS)}

        def ended(number, _):
            run.stop_child()
            run.report["interrupted"] = signal.Signals(number).name
            run.write()
            sys.exit(128 + number)

        signal.signal(signal.SIGTERM, ended)
        signal.signal(signal.SIGINT, ended)
        print("plan %s: %s%s" % (args.plan, gpu_plans.TITLES[args.plan], ", rehearsed" if args.rehearse else ""), flush=True)
        run.run(steps)
        failed = [entry for entry in run.report["steps"] if "failed" in entry]
        skipped = [entry for entry in run.report["steps"] if "skipped" in entry]
        run.report["complete"] = not failed and not skipped
        run.write()
        for entry in failed:
            print("\n%s: %s\n%s" % (entry["name"], entry["failed"], entry["output"]))
        print("\n%d steps in %.0f s, %d failed, %d left out" % (len(run.report["steps"]), run.seconds(), len(failed), len(skipped)))
        print(output or "nothing was written")
        return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
