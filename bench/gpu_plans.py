"""What bench/gpu.sh can measure: steps of three plans, each a list in the order of worth. Standard library only."""
import os

SIZES = (("1024 x 1024", ["--width", "1024", "--height", "1024"]), ("1280 x 720", ["--width", "1280", "--height", "720"]))
# Checkpoints and the optimiser's state are gigabytes that nobody asked for.
NO_EXTRAS = ["-D", "checkpoint.every=10h", "--no-optimizer"]


class Step:
    """One command. seconds: what it is expected to take on an H200; it is stopped after `limit`, by default three times that and 30 s.
    needs: names of steps whose files it reads; priority: 1 comes first, and a budget leaves out the last ones.
    kind: octrad (its --json is kept), text (the end of its output is), profile (as text, run under ncu)."""

    def __init__(self, name, words, seconds, priority=2, needs=(), kind="octrad", limit=None, repeat=1, log=None, program="octrad", scene=None):
        self.name, self.words, self.seconds, self.priority, self.needs, self.kind = name, words, seconds, priority, tuple(needs), kind
        self.limit, self.repeat, self.log, self.program, self.scene = limit or 3 * seconds + 30, repeat, log, program, scene


class Plan:
    """Collects steps. `at(name)`: a file in the working folder; `scene(name)`: a scene's file."""

    def __init__(self, folder, scenes, device, tests, profiler):
        self.folder, self.scenes, self.device, self.tests, self.profiler = folder, scenes, device, tests, profiler
        self.steps = []

    def at(self, name):
        return os.path.join(self.folder, name)

    def add(self, name, seconds, words, **keywords):
        self.steps.append(Step(name, words, seconds, **keywords))
        return name

    def octrad(self, name, seconds, verb, scene, *words, **keywords):
        return self.add(name, seconds, [verb, *([scene] if scene else []), *words, "--device", self.device, "--json", "-q"], scene=scene, **keywords)

    def train(self, name, seconds, scene, model, *words, **keywords):
        return self.octrad(name, seconds, "train", scene, *words, *NO_EXTRAS, "--overwrite", "-o", self.at(model), **keywords)

    def frames(self, name, seconds, scene, model, *words, **keywords):
        return self.octrad(name, seconds, "render", scene, "--model", self.at(model), *words, "--frames", "200", "-o", self.at("frame.exr"), **keywords)


def first(plan):
    """Does it work, and where does the time go?"""
    p, s = plan, plan.scenes
    p.octrad("checks", 20, "selftest", s["cornell-box"], "--no-benchmarks", priority=1)
    dense = p.train("train: 1,200 steps of the paper schedule", 11, s["cornell-box"], "dense.octrad", "--preset", "paper", "--steps", "1200", priority=1)
    for size, words in SIZES:
        p.frames("frame: %s" % size, 3, s["cornell-box"], "dense.octrad", *words, "--spp", "1", needs=[dense], priority=1)
    p.octrad("path: 64 spp, depth 8", 4, "render", s["kitchen"], "--integrator", "path", *SIZES[0][1], "--spp", "64", "--max-depth", "8", "-o", p.at("path.exr"), priority=1)
    p.octrad("benchmarks", 17, "selftest", s["kitchen"], "--no-checks", priority=2)
    p.train("train: 1,200 steps, touched Adam", 11, s["cornell-box"], "touched.octrad", "--preset", "paper", "-D", "adam.mode=touched", "--steps", "1200", priority=2)
    for program in p.tests:
        p.add("unit tests: %s" % program, 6, ["--gtest_filter=*Cuda", "--gtest_brief=1"], kind="text", program=program, priority=3)
    for field in ("nr", "ncr"):
        p.train("train: 300 steps, %s" % field, 4, s["cornell-box"], field + ".octrad", "--preset", "paper", "--field", field, "--steps", "300", priority=4)
    if p.profiler:
        p.octrad("kernels: 3 steps", 9, "train", s["cornell-box"], "--preset", "paper", "--steps", "3", *NO_EXTRAS, "-o", p.at("profile.octrad"), kind="profile", priority=3)
    return p.steps


# Other values of DeviceTuning (src/octrad/device/tuning.h) beside its defaults, one at a time.
VARIANTS = (("cast_warps", "2048"), ("cast_warps", "8192"), ("cast_share", "4"), ("cast_share", "64"), ("cast_refill", "4"), ("cast_refill", "16"), ("cast_dynamic", "0"), ("block", "64"),
            ("lhs_rounds", "24"), ("points_ahead", "524288"), ("draw_ahead", "0"), ("query_chunk", "1048576"), ("train_chunk", "32768"), ("half_moments", "1"))
FRAME_VARIANTS = (("pixel_tiles", "0"), ("direct_film", "0"), ("cast_dynamic", "0"), ("cast_share", "4"))
SHAPES = ((1024, 16, 6), (2048, 16, 6), (4096, 16, 7), (8192, 16, 7), (16384, 32, 8), (65536, 32, 8))  # points, directions, levels


def second(plan):
    """Why, and which variant?"""
    p, s = plan, plan.scenes
    short = ["--preset", "paper", "--steps", "400"]
    base = p.train("variant: as it is", 7, s["cornell-box"], "base.octrad", *short, priority=1)
    for key, value in VARIANTS:
        p.train("variant: %s=%s" % (key, value), 7, s["cornell-box"], "variant.octrad", *short, "-D", "device.%s=%s" % (key, value), priority=1)
    p.train("variant: touched Adam, scan_touched=0", 7, s["cornell-box"], "variant.octrad", *short, "-D", "adam.mode=touched", "-D", "device.scan_touched=0", priority=2)
    for key, value in (("", ""), *FRAME_VARIANTS):
        words = ["-D", "device.%s=%s" % (key, value)] if key else []
        p.frames("frame variant: %s" % ("%s=%s" % (key, value) if key else "as it is"), 3, s["cornell-box"], "base.octrad", *SIZES[0][1], "--spp", "1", *words, needs=[base], priority=1)
    p.octrad("checks without fused multiply-adds", 20, "selftest", s["cornell-box"], "--no-benchmarks", "--seed", "1", program="octrad-nofmad", priority=2)
    p.octrad("checks with the same seed", 20, "selftest", s["cornell-box"], "--no-benchmarks", "--seed", "1", priority=2)
    reference = p.octrad("reference, 1024 spp", 10, "render", s["cornell-box"], "--integrator", "path", *SIZES[0][1], "--spp", "1024", "-o", p.at("reference.exr"), priority=3)
    for points, directions, levels in SHAPES:
        name = "%dx%d-K%d" % (points, directions, levels)
        log = p.at("shape-%s.jsonl" % name)
        p.train("time to quality: %s" % name, 15, s["cornell-box"], "shape.octrad", "--preset", "default", "--time", "10s", "--reference", p.at("reference.exr"),
                "-D", "train.points=%d" % points, "-D", "train.first_points=0", "-D", "train.directions=%d" % directions, "-D", "octree.levels=%d" % levels, "--validate-every", "1s", "--log-json", log,
                log=log, needs=[reference], priority=3)
    if p.profiler:
        p.octrad("kernels in detail", 90, "train", s["cornell-box"], "--preset", "paper", "-D", "octree.levels=7", "--steps", "2", *NO_EXTRAS, "-o", p.at("profile.octrad"),
                 kind="profile", priority=4)
    return p.steps


def third(plan):
    """The record."""
    p, s = plan, plan.scenes
    model = p.train("octaoctree: paper schedule", 112, s["cornell-box"], "paper.octrad", "--preset", "paper", priority=1)
    for size, words in SIZES:
        p.frames("octaoctree: frame, %s" % size, 3, s["cornell-box"], "paper.octrad", *words, "--spp", "1", needs=[model], priority=1)
    p.frames("octaoctree: frame, 1024 x 1024, 4 samples a pixel", 4, s["cornell-box"], "paper.octrad", *SIZES[0][1], "--spp", "4", needs=[model], priority=2)
    p.octrad("path: 256 spp, depth 8", 5, "render", s["kitchen"], "--integrator", "path", *SIZES[0][1], "--spp", "256", "--max-depth", "8", "-o", p.at("path.exr"), repeat=3, priority=1)
    reference = p.octrad("path: reference, 4096 spp", 35, "render", s["cornell-box"], "--integrator", "path", *SIZES[0][1], "--spp", "4096", "-o", p.at("reference.exr"), priority=1)
    log = p.at("curve.jsonl")
    curve = p.train("octaoctree: error against seconds, default", 65, s["cornell-box"], "curve.octrad", "--preset", "default", "--time", "60s",
                    "--reference", p.at("reference.exr"), "--log-json", log, log=log, needs=[reference], priority=1)
    picture = p.octrad("octaoctree: picture after 60 s", 5, "render", s["cornell-box"], "--model", p.at("curve.octrad"), *SIZES[0][1], "--spp", "64", "-o", p.at("lhs.exr"),
                       needs=[curve], priority=1)
    p.add("octaoctree: its error", 5, ["compare", p.at("reference.exr"), p.at("lhs.exr"), "--json", "-q"], needs=[picture], priority=1)
    p.octrad("selftest", 45, "selftest", s["cornell-box"], priority=2)
    for field in ("nr", "ncr"):
        trained = p.train("%s: 500 steps of the paper schedule" % field, 7, s["cornell-box"], field + ".octrad", "--preset", "paper", "--field", field, "--steps", "500", priority=2)
        for size, words in SIZES:
            p.frames("%s: frame, %s" % (field, size), 4, s["cornell-box"], field + ".octrad", *words, "--spp", "1", needs=[trained], priority=3)
    # The same steps and seed on both, each judged by its picture; and a GPU's training that the CPU goes on with.
    small = ["--preset", "cpu", "--steps", "1500", "--seed", "1", "-D", "checkpoint.every=10h"]
    for device in ("", "cpu"):
        on = device or p.device
        part = p.add("parity: trained on %s" % (device or "the GPU"), 60 if device else 10,
                     ["train", s["cornell-box"], *small, "-o", p.at("parity-%s.octrad" % (device or "gpu")), "--device", on, "--json", "-q"], needs=[], priority=3)
        drawn = p.octrad("parity: its picture, %s" % (device or "GPU"), 5, "render", s["cornell-box"], "--model", p.at("parity-%s.octrad" % (device or "gpu")), *SIZES[0][1],
                         "--spp", "16", "-o", p.at("parity-%s.exr" % (device or "gpu")), needs=[part], priority=3)
        p.add("parity: its error, %s" % (device or "GPU"), 5, ["compare", p.at("reference.exr"), p.at("parity-%s.exr" % (device or "gpu")), "--json", "-q"], needs=[drawn, reference], priority=3)
        other = "cpu" if not device else p.device
        p.add("parity: %s goes on" % ("the CPU" if not device else "the GPU"), 20,
              ["train", s["cornell-box"], "--resume", "--steps", "1600", "-o", p.at("parity-%s.octrad" % (device or "gpu")), "--device", other, "--json", "-q"],
              needs=[drawn], priority=4)
    return p.steps


PLANS = {"first": first, "second": second, "third": third}
TITLES = {"first": "does it work, and where does the time go", "second": "why, and which variant", "third": "the record"}


def rehearsed(words, device):
    """The same command, tiny, on the host standing in for a GPU. Frames are timed there too: few."""
    small = {"--width": "16", "--height": "16", "--spp": "1", "--time": "0.2s", "--steps": "2", "--frames": "1"}
    out = []
    for word in words:
        out.append(small.get(out[-1], word) if out else word)
    if words[0] == "train":
        if "--time" not in out and "--steps" not in out:
            out += ["--steps", "2"]
        if "--resume" in out:
            out[out.index("--steps") + 1] = "3"
        else:
            out += ["-D", "octree.levels=2", "-D", "train.points=64", "-D", "train.directions=2", "-D", "nr.log2_table=10"]
            out += ["-D", "ncr.log2_table=10", "-D", "ncr.cone.log2_table=10", "-D", "ncr.rays.train=8", "-D", "ncr.rays.render=8", "-D", "octree.occupancy=conservative"]
    if words[0] == "selftest":
        out += ["--quick", "--only", "sort"]
    return out
