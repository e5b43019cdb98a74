"""What is written, and how the program ends: faults of files, locks, names, signals, exit codes (docs/safety.md)."""
import errno
import json
import os
import random
import shutil
import signal
import subprocess
import tempfile
import time
import unittest
import unittest.mock

from exr import read_exr
from gltf import Gltf
from support import FAULTS, FIXED, NO_FAULTS, PATIENCE, PROGRAM, ROOM, SMALL, Case, Result, children_seconds, processor_seconds, read_safetensors, run, start, wait_for, write_pfm
from web_client import Viewer


def read(path):
    with open(path, "rb") as file:
        return file.read()


def run_with(environment, *arguments, timeout=PATIENCE, **keywords):
    done = subprocess.run([PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=timeout,
                          env=dict(os.environ, **environment), **keywords)
    return Result(done)


def somebody():
    """Words before a command that make it run without the rights of root, if it has them."""
    return ("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups") if os.geteuid() == 0 else ()


def why_not_somebody():
    if not somebody():
        return ""
    if shutil.which("setpriv") is None:
        return "SKIPPED: root may write everywhere, and setpriv is not installed"
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        done = subprocess.run([*somebody(), "sh", "-c", 'cd "$1" && exec "$2" --version', "sh", folder, os.path.abspath(PROGRAM)], stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL)
    return "SKIPPED: root may write everywhere, and nobody else may run the program here" if done.returncode != 0 else ""


NOT_SOMEBODY = why_not_somebody()


class Files(Case):
    def setUp(self):
        super().setUp()
        self.scene = self.write("room.xml", ROOM)
        self.out = self.path("out.exr")

    def rules(self, rules):
        """rules: (call, error, first, count); they hold for files in the test's folder."""
        return {"LD_PRELOAD": FAULTS, "OCTRAD_FAULTS": ";".join(f"{self.folder}:{call}:{error}:{first}:{count}" for call, error, first, count in rules)}

    def faulty(self, rules, *arguments):
        return run_with(self.rules(rules), *arguments)

    def faults(self, rules):
        """For what is started meanwhile."""
        return unittest.mock.patch.dict(os.environ, self.rules(rules))

    def listing(self):
        return sorted(os.path.join(root, name) for root, _, names in os.walk(self.folder) for name in names)

    def contents(self):
        """To be compared without assertEqual, which would print how they differ."""
        return {file: read(file) for file in self.listing()}

    def render(self, *options, out=None):
        return self.ok("render", self.scene, "-o", out or self.out, "--spp", 1, "-q", *options)

    def glb(self, name, meshes=1, height=0.0):
        """A file with as many triangles, and with a picture."""
        self.render(out=self.path("texture.exr"))
        self.ok("tonemap", self.path("texture.exr"), "-o", self.path("texture.png"), f"--exposure={height}", "-q")
        g = Gltf()
        g.add("images", {"bufferView": g.view(read(self.path("texture.png"))), "mimeType": "image/png"})
        g.add("textures", {"source": 0})
        g.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
        for i in range(meshes):
            g.node(mesh=g.mesh([0, height, i, 1, 0, i, 0, 1, i], uvs=[0, 0, 1, 0, 0, 1], material=0))
        for texture in ("texture.exr", "texture.png"):
            os.remove(self.path(texture))
        with open(self.path(name), "wb") as file:
            file.write(g.container())
        return self.path(name)

    def train(self, *options, model=None):
        return self.ok("train", self.scene, "-o", model or self.path("m.octrad"), *SMALL, *options)

    def written(self):
        """Commands of every verb that writes, with a file that each makes."""
        self.render(out=self.path("a.exr"))
        self.render("--seed", 1, out=self.path("b.exr"))
        self.train("--steps", 2, "--no-optimizer")
        points = self.write("points.csv", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n0,-1,0,0,1,0,0,1,0,.5,.5,.5,1\n")
        path = self.write("path.json", json.dumps({"fps": 2, "keys": [
            {"time": t, "origin": [0, 0, 0.9 - 0.1 * t], "target": [0, 0, 0], "fov": 60} for t in (0, 0.5)]}))
        os.mkdir(self.path("errors"))
        r, a, b, m = ("render", self.scene, "--spp", 1, "-q"), self.path("a.exr"), self.path("b.exr"), self.path("m.octrad")
        denoised = ("denoise", a, "-o", self.path("denoised.exr"), "-q")
        return {
            **({} if run(*denoised).code != 0 else {"denoised.exr": denoised}),  # the library is there
            "out.exr": (*r, "-o", self.out),
            "out.png": (*r, "-o", self.path("out.png")),
            "out.hdr": (*r, "-o", self.path("out.hdr")),
            "out.pfm": (*r, "-o", self.path("out.pfm")),
            "frame0.exr": (*r, "-o", self.path("frame#.exr"), "--path", path, "--overwrite"),
            "merged.exr": ("merge", a, b, "-o", self.path("merged.exr"), "-q"),
            "converted.xml": ("convert", self.scene, "-o", self.path("converted.xml"), "-q"),
            "a.jpg": ("tonemap", a, "-o", self.path("a.jpg"), "-q"),
            "table.csv": ("compare", a, b, "--csv", self.path("table.csv"), "-q"),
            "table.tex": ("compare", a, b, "--latex", self.path("table.tex"), "-q"),
            "page.html": ("compare", a, b, "--html", self.path("page.html"), "-q"),
            "errors/b.error.exr": ("compare", a, b, "--errors", self.path("errors"), "-q"),
            "points.out": ("query", m, "--points", points, "-o", self.path("points.out"), "-q"),
            "n.octrad": ("train", self.scene, "-o", self.path("n.octrad"), "--overwrite", "--steps", 2, *SMALL),
            "checks.json": ("selftest", "-o", self.path("checks.json"), "--only", "sort", "--no-benchmarks", "-q"),
        }

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_faults_keep_the_old_file(self):
        unnamed = ("tmpfile", errno.EOPNOTSUPP, 1, 0)  # a file system that has no files without a name
        faults = [("open", errno.EACCES, 1, 0), ("write", errno.ENOSPC, 1, 0), ("write", errno.EDQUOT, 2, 0), ("fsync", errno.EIO, 1, 0),
                  ("close", errno.EDQUOT, 2, 0), ("link", errno.ENOSPC, 1, 0), ("rename", errno.EIO, 1, 0)]
        commands = self.written()
        for name, command in commands.items():
            self.ok(*command)
            all_faults = name in ("out.exr", "n.octrad", "page.html", "converted.xml")
            for fault in faults if all_faults else faults[1:2] + faults[-1:]:
                for rules in ([fault], [unnamed, fault]) if all_faults and fault[0] != "link" else ([fault],):
                    if fault[0] == "write" and fault[2] == 2 and name != "n.octrad":
                        continue  # written in one piece
                    if fault[0] == "close":  # locks and inputs are closed too: the output's turn
                        rules = [*rules[:-1], ("close", errno.EDQUOT, self.closes_before(command, rules[:-1]), 1)]
                    with self.subTest(name, rules=rules):
                        before, there = read(self.path(name)), self.listing()
                        result = self.faulty(rules, *command)
                        self.assertEqual(result.code, 3, result.err)
                        lines = [line for line in result.err.splitlines() if line.startswith("octrad: error: ")]
                        self.assertEqual(len(lines), 1, result.err)
                        self.assertIn(self.path(name), lines[0])
                        self.assertIn(os.strerror(rules[-1][1]), lines[0])
                        self.assertEqual(read(self.path(name)), before)
                        self.assertEqual(self.listing(), there, "something was left")

    def closes_before(self, command, rules):
        """The number of the close() that follows the output's fsync(): the first that fails with exit code 3."""
        for n in range(1, 40):
            if self.faulty([*rules, ("close", errno.EDQUOT, n, 1)], *command).code == 3:
                return n
        self.fail("no close() is looked at")

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_converted_scenes_are_replaced_as_a_whole(self):
        """A scene and the meshes and pictures that it refers to belong together."""
        first, second, out = self.glb("first.glb"), self.glb("second.glb", meshes=3, height=0.5), self.path("out.xml")
        self.ok("convert", first, "-o", out, "-q")
        before = self.contents()
        self.assertEqual(len(before), 6, sorted(before))  # two scenes in, one out with a mesh and a picture, and the room
        for call in ("write", "link"):
            for unnamed in ([], [("tmpfile", errno.EOPNOTSUPP, 1, 0)]):
                if unnamed and call == "link":
                    continue  # what has a name is not linked
                for n in range(1, 30):
                    with self.subTest(call, n=n, unnamed=unnamed):
                        self.start_over(before, "convert", first, "-o", out, "-q")
                        result = self.faulty([*unnamed, (call, errno.ENOSPC, n, 0)], "convert", second, "-o", out)
                        if result.code == 0:
                            break
                        self.assertEqual(result.code, 3, result.err)
                        self.assertIn(os.strerror(errno.ENOSPC), result.err)
                        now = self.contents()
                        self.assertEqual(sorted(now), sorted(before), "something was left, or is gone")
                        self.assertEqual([name for name in before if now[name] != before[name]], [], "replaced without the others")
                self.assertEqual(result.code, 0, result.err)
                self.assertGreater(n, 4, "one for each file that is written")
                self.ok("convert", second, "-o", self.path("sound.xml"), "-q")
                for name in ("mesh0.ply", "mesh1.ply", "mesh2.ply", "picture0.png"):
                    self.assertTrue(read(self.path("out-files/" + name)) == read(self.path("sound-files/" + name)), name)

    def start_over(self, before, *command):
        for name in set(self.listing()) - set(before):
            os.remove(name)
        self.ok(*command)
        self.assertTrue(self.contents() == before)

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_faults_of_what_view_saves(self):
        self.train("--steps", 2)
        model, before = self.path("m.octrad"), self.contents()
        unnamed = ("tmpfile", errno.EOPNOTSUPP, 1, 0)
        for *unnamed, fault in ([("write", errno.ENOSPC, 1, 0)], [("write", errno.EDQUOT, 2, 0)], [("fsync", errno.EIO, 1, 0)], [("link", errno.ENOSPC, 1, 0)],
                                [("rename", errno.EIO, 1, 0)], [unnamed, ("open", errno.EACCES, 1, 0)], [unnamed, ("write", errno.ENOSPC, 2, 0)],
                                [unnamed, ("rename", errno.EIO, 1, 0)]):
            with self.subTest(fault, unnamed=unnamed):
                with self.faults([*unnamed, fault]):
                    process = start("view", self.scene, "--model", model, "--train", "-o", model, "--json", "--width", "32", "--height", "24")
                self.addCleanup(process.communicate)
                self.addCleanup(process.kill)
                viewer = Viewer(json.loads(process.stdout.readline())["url"])
                self.addCleanup(viewer.close)
                trains = lambda m: isinstance(m, dict) and m["type"] == "training"
                viewer.send("train", do="start")
                step = viewer.until(lambda m: trains(m) and m["step"] > 2)["step"]
                viewer.send("train", do="save")  # it goes on
                last = viewer.until(lambda m: trains(m) and m["step"] > step + 20)
                self.assertIsNone(last["saved"])
                self.assertIn(model, last["error"])
                self.assertIn(os.strerror(fault[1]), last["error"])
                process.send_signal(signal.SIGINT)
                _, err = process.communicate(timeout=PATIENCE)
                result = Result(subprocess.CompletedProcess((), process.returncode, b"", err))
                self.assertIn("octrad: warning: cannot", result.err)
                self.assert_kept(before, model, fault[1], result)

    # ---- folders that may not be written

    def assert_kept(self, before, name, why, result):
        self.assertEqual(result.code, 3, result.err)
        lines = [line for line in result.err.splitlines() if line.startswith("octrad: error: ")]
        self.assertEqual(len(lines), 1, result.err)
        self.assertIn(name, lines[0])
        self.assertIn(os.strerror(why), lines[0])
        self.assertTrue(self.contents() == before)

    def endless_in(self, folder):
        """Commands of which none would end, for it is refused before the work begins; with the file of each."""
        self.render("--resume", out=os.path.join(folder, "out.exr"))
        self.train("--steps", 2, model=os.path.join(folder, "m.octrad"))
        out, new, model = (os.path.join(folder, name) for name in ("out.exr", "new.exr", "m.octrad"))
        r, t = ("render", self.scene, "--spp", 100000000, "-o"), ("train", self.scene, "-o", model, *SMALL, "--steps", 100000000)
        return [(out, *r, out), (out, *r, out, "--resume"), (new, *r, new), (model, *t, "--overwrite"), (model, *t, "--resume"),
                (model, "view", self.scene, "--model", model, "--train", "-o", model)]

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_read_only_file_systems_are_told_at_once(self):
        os.mkdir(self.path("folder"))
        commands = self.endless_in(self.path("folder"))
        before = self.contents()
        for why in (errno.EROFS, errno.EACCES):
            for name, *command in commands:
                with self.subTest(command, why=why):
                    rules = f"{self.path('folder')}:access:{why}:1:0"
                    self.assert_kept(before, name, why, run_with({"LD_PRELOAD": FAULTS, "OCTRAD_FAULTS": rules}, *command))

    @unittest.skipIf(NOT_SOMEBODY, NOT_SOMEBODY)
    def test_folders_without_permission_are_told_at_once(self):
        folder = self.path("folder")
        os.mkdir(folder)
        commands = self.endless_in(folder)
        log, device = os.path.join(folder, "log.jsonl"), ("-o", "/dev/null", "--log-json")
        commands += [(log, "render", self.scene, "--spp", 100000000, *device, log), (log, "train", self.scene, *SMALL, "--steps", 100000000, *device, log)]
        before, user = self.contents(), 65534 if somebody() else -1
        for file in self.listing():
            os.chmod(file, 0o644)
        for name in (os.path.join(folder, name) for name in os.listdir(folder)):
            os.chown(name, user, -1)  # the file may be written, but not replaced
        os.chmod(self.folder, 0o755)
        os.chmod(folder, 0o555)
        self.addCleanup(os.chmod, folder, 0o755)
        as_somebody = lambda *words: Result(subprocess.run([*somebody(), os.path.abspath(PROGRAM), *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                                           timeout=PATIENCE, cwd=self.folder))
        for name, *command in commands:
            with self.subTest(command):
                self.assert_kept(before, name, errno.EACCES, as_somebody(*command))
        os.chmod(folder, 0o755)  # the other way round: the file may be replaced, but is not to be written
        os.chown(folder, user, -1)
        for name in (os.path.join(folder, name) for name in os.listdir(folder)):
            os.chmod(name, 0o444)
        for name, *command in commands:
            if os.path.exists(name):
                with self.subTest(command):
                    self.assert_kept(before, name, errno.EACCES, as_somebody(*command))

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_writes_and_reads_in_pieces(self):
        commands = self.written()
        for name in ("merged.exr", "a.jpg", "page.html", "points.out"):
            self.ok(*commands[name])
            before = read(self.path(name))
            os.remove(self.path(name))
            result = self.faulty([("short", 0, 1, 0), ("shortread", 0, 1, 0)], *commands[name])
            self.assertEqual(result.code, 0, result.err)
            self.assertEqual(read(self.path(name)), before)
        # A model says how long it took: its tensors are the same.
        model, whole = self.path("n.octrad"), self.path("whole.octrad")
        self.train("--steps", 4, *FIXED, model=whole)
        for more in (("--steps", 2), ("--steps", 4, "--resume")):
            result = self.faulty([("short", 0, 1, 0), ("shortread", 0, 1, 0)], "train", self.scene, "-o", model, *SMALL, *FIXED, *more)
            self.assertEqual(result.code, 0, result.err)
        (_, ours), (_, theirs) = read_safetensors(model), read_safetensors(whole)
        self.assertEqual(ours.keys(), theirs.keys())
        self.assertEqual([name for name in ours if ours[name] != theirs[name]], [])

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_inputs_that_cannot_be_opened(self):
        """No descriptor is left: it is not the file that is broken."""
        self.render(out=self.path("a.exr"))
        self.render("--seed", 1, out=self.path("b.exr"))
        self.train("--steps", 2)
        write_pfm(self.path("p.pfm"), 32, 24, lambda x, y: (1, 1, 1))
        self.write("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        self.write("lamp.xml", '<scene version="3.0.0"><shape type="sphere"><emitter type="area"><rgb name="radiance" value="3"/></emitter></shape></scene>')
        refers = self.write("refers.xml", """<scene version="3.0.0"><include filename="lamp.xml"/><shape type="obj"><string name="filename" value="m.obj"/>
            <bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="p.pfm"/><boolean name="raw" value="true"/>
            </texture></bsdf></shape><sensor type="perspective"/></scene>""")
        self.write("points.csv", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n0,-1,0,0,1,0,0,1,0,.5,.5,.5,1\n")
        self.write("camera.json", json.dumps({"origin": [0, 0, 0.9], "target": [0, 0, 0]}))
        self.write("cameras.json", json.dumps([{"origin": [0, 0, 0.9], "target": [0, 0, 0], "fov": 60}]))
        self.write("path.json", json.dumps({"fps": 2, "keys": [{"time": t, "origin": [0, 0, 0.9], "target": [0, 0, 0], "fov": 60} for t in (0, 1)]}))
        self.write("config.json", "{}")
        self.glb("scene.glb")
        a, b, m, out, n = (self.path(name) for name in ("a.exr", "b.exr", "m.octrad", "out.exr", "n.octrad"))
        r, q, t = ("render", self.scene, "-o", out, "--spp", 1), ("query", m, "--points", self.path("points.csv")), ("train", self.scene, "-o", n, *SMALL, "--steps", 2)
        commands = [("a.exr", "info", a), ("m.octrad", "info", m), ("room.xml", "info", self.scene), ("room.xml", *r), ("m.octrad", *r, "--model", m),
                    ("camera.json", *r, "--camera", self.path("camera.json")), ("p.pfm", *r, "--mask", self.path("p.pfm")),
                    ("path.json", "render", self.scene, "-o", self.path("f#.exr"), "--path", self.path("path.json"), "--spp", 1),
                    *((name, "render", refers, "-o", out, "--spp", 1) for name in ("lamp.xml", "m.obj", "p.pfm")),
                    ("scene.glb", "render", self.path("scene.glb"), "-o", out, "--spp", 1), ("scene.glb", "convert", self.path("scene.glb"), "-o", self.path("g.xml")),
                    ("room.xml", *t), ("a.exr", *t, "--reference", a), ("config.json", *t, "--config", self.path("config.json")),
                    ("cameras.json", *t, "-D", "train.cameras=" + self.path("cameras.json")), ("m.octrad", "train", self.scene, "-o", m, *SMALL, "--steps", 3, "--resume"),
                    ("b.exr", "merge", a, b, "-o", out), ("b.exr", "compare", a, b), ("a.exr", "tonemap", a, "-o", self.path("a.png")),
                    ("m.octrad", *q), ("points.csv", *q), ("room.xml", "view", self.scene), ("m.octrad", "view", self.scene, "--model", m)]
        if run("denoise", a, "-o", out).code == 0:  # the library is there
            os.remove(out)
            commands.append(("a.exr", "denoise", a, "-o", out))
        before = self.contents()
        for name, *command in commands:
            with self.subTest(name, command=command):
                result = run_with({"LD_PRELOAD": FAULTS, "OCTRAD_FAULTS": f"{self.path(name)}:input:{errno.EMFILE}:1:0"}, *command)
                self.assertEqual(result.code, 3, result.err)
                lines = [line for line in result.err.splitlines() if line.startswith("octrad: error: ")]
                self.assertEqual(len(lines), 1, result.err)
                self.assertIn(self.path(name), lines[0])
                self.assertIn(os.strerror(errno.EMFILE), lines[0])
                self.assertTrue(self.contents() == before)

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_reads_that_fail(self):
        self.train("--steps", 2)
        model = self.path("m.octrad")
        for first in (1, 3, 5):
            result = self.faulty([("read", errno.EIO, first, 0)], "info", model)
            if first == 1 or result.code != 0:
                self.assertEqual(result.code, 3, result.err)
                self.assertIn(model, result.err)
        scene = self.path("elsewhere.xml")
        result = self.faulty([("read", errno.EIO, 4, 0)], "render", self.scene, "--model", model, "-o", self.out, "--spp", 1)
        self.assertEqual(result.code, 3, result.err)
        self.assertIn("Input/output error", result.err)
        self.assertFalse(os.path.exists(self.out) or os.path.exists(scene))

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_memory_that_is_refused(self):
        self.train("--steps", 2)
        model, before = self.path("m.octrad"), read(self.path("m.octrad"))
        for command in (("train", self.scene, "-o", model, "--overwrite", *SMALL, "--steps", 2), ("train", self.scene, "-o", model, "--resume", *SMALL, "--steps", 4),
                        ("render", self.scene, "--model", model, "-o", self.out)):
            result = self.faulty([("map", errno.ENOMEM, 1, 0)], *command)
            self.assertEqual(result.code, 4, result.err)
            self.assertIn("cannot allocate", result.err)
            self.assertEqual(read(model), before)
            self.assertFalse(os.path.exists(self.out))

    def test_a_model_that_becomes_shorter_is_an_error(self):
        self.train("--steps", 2)
        model, whole, ends = self.path("m.octrad"), read(self.path("m.octrad")), set()
        chance = random.Random(1)
        for _ in range(8):
            with open(model, "r+b") as file:
                process = start("render", self.scene, "--model", model, "-o", self.out, "--spp", 1, "-q")
                for _ in range(200):
                    file.truncate(chance.randrange(len(whole)))
                    file.seek(0)
                    file.write(whole)
                    file.flush()
            process.communicate(timeout=PATIENCE)
            ends.add(process.returncode)
        self.assertLessEqual(ends, {0, 2, 3})

    # ---- threads that the system refuses

    def viewed(self, rules, *options):
        """octrad view under these faults, until a first picture is there: how it ended, and whether there was one."""
        seen = False
        with unittest.mock.patch.dict(os.environ, LD_PRELOAD=FAULTS, OCTRAD_FAULTS=rules):
            process = start("view", self.scene, "--json", "--width", "32", "--height", "24", *options)
        try:
            line = process.stdout.readline()
            if line:
                try:
                    viewer = Viewer(json.loads(line)["url"])
                    self.addCleanup(viewer.close)
                    viewer.frame(lambda header: not header["moving"])
                    seen = True
                    process.send_signal(signal.SIGINT)
                except ConnectionError:  # it ended
                    pass
            out, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
            process.communicate()
        return Result(subprocess.CompletedProcess((), process.returncode, line + out, err)), seen

    def assert_says_threads(self, result):
        self.assertIn(result.code, (3, 4), result.err)
        lines = [line for line in result.err.splitlines() if line.startswith("octrad: error: ")]
        self.assertEqual(len(lines), 1, result.err)
        self.assertIn("thread", lines[0])
        self.assertIn(os.strerror(errno.EAGAIN), lines[0])
        self.assertNotIn("internal error", lines[0])

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_few_threads_are_enough(self):
        """A limit of the user or of the container: so many threads at once, the first one included."""
        self.render(out=self.path("a.exr"))
        self.train("--steps", 3, model=self.path("a.octrad"))
        model = self.path("m.octrad")
        for most in (1, 2, 5):
            rules = {"LD_PRELOAD": FAULTS, "OCTRAD_FAULTS": f"/:threads:{errno.EAGAIN}:{most}:0"}
            warning = r"warning: only %d of (8|9|12) threads can be started" % most
            with self.subTest("render", most=most):
                result = run_with(rules, "render", self.scene, "-o", self.out, "--spp", 1, "-q", "--threads", 8)
                self.assertEqual(result.code, 0, result.err)
                self.assertRegex(result.err, warning)
                self.assertTrue(read_exr(self.out)[2] == read_exr(self.path("a.exr"))[2])
            with self.subTest("train", most=most):
                result = run_with(rules, "train", self.scene, "-o", model, "--overwrite", *SMALL, "--steps", 3, "--threads", 8)
                self.assertEqual(result.code, 0, result.err)
                self.assertRegex(result.err, warning)
                self.assertTrue(read_safetensors(model)[1] == read_safetensors(self.path("a.octrad"))[1])
            for options in ((), ("--model", self.path("a.octrad"), "--train")):
                with self.subTest("view", options=options, most=most):  # which needs threads of its own, for each of its tasks
                    result, seen = self.viewed(rules["OCTRAD_FAULTS"], *options, "--threads", 8)
                    self.assertRegex(result.err, warning)
                    if seen:
                        self.assertEqual(result.code, 130, result.err)
                    else:
                        self.assert_says_threads(result)

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_threads_that_are_refused_later(self):
        """Another process of the user took them, after it was tried how many there are: seven are asked for to try four and some to spare."""
        self.render()
        self.train("--steps", 3)
        model = self.path("m.octrad")
        for first in (7, 8, 9, 10):
            rules = f"/:thread:{errno.EAGAIN}:{first}:0"
            for command in (("render", self.scene, "-o", self.out, "--spp", 1), ("train", self.scene, "-o", model, "--overwrite", *SMALL, "--steps", 3)):
                with self.subTest(command[0], first=first):
                    before = self.contents()
                    result = run_with({"LD_PRELOAD": FAULTS, "OCTRAD_FAULTS": rules}, *command, "--threads", 4)
                    if result.code != 0:  # it may have done with fewer
                        self.assert_says_threads(result)
                        self.assertTrue(self.contents() == before)
            with self.subTest("view", first=first):
                result, seen = self.viewed(rules, "--threads", 4)
                if not seen or result.code != 130:
                    self.assert_says_threads(result)
        refused = 0
        for first in range(18, 34, 3):  # of many processors: TBB's threads start each other then, and nobody can catch what they throw
            with self.subTest("render", first=first, processors=16):
                before = self.contents()
                result = run_with({"LD_PRELOAD": FAULTS, "OCTRAD_FAULTS": f"/:thread:{errno.EAGAIN}:{first}:0", "OCTRAD_PROCESSORS": "16"},
                                  "render", self.scene, "-o", self.out, "--spp", 16, "--width", 256, "--height", 192, "--threads", 16)
                if result.code != 0:
                    refused += 1
                    self.assert_says_threads(result)
                    self.assertTrue(self.contents() == before)
        self.assertGreater(refused, 0, "no thread was refused")

    # ---- training: its log and its checkpoints

    def test_a_log_that_cannot_be_written_does_not_end_the_training(self):
        log, model = self.path("log.jsonl"), self.path("m.octrad")
        for full in (log, "/dev/full"):
            result = self.faulty_log(full, "train", self.scene, "-o", model, "--overwrite", *SMALL, "--steps", 20, "--log-json", full)
            self.assertEqual(result.code, 3, result.err)
            self.assertIn("the work goes on", result.err)
            self.assertIn(full, result.err.splitlines()[-1])
            self.assertEqual(self.ok("info", model, "--json").json()["metadata"]["step"], 20)
            result = self.faulty_log(full, "render", self.scene, "-o", self.out, "--spp", 1, "--log-json", full)
            self.assertEqual(result.code, 3, result.err)
            read_exr(self.out)
            os.remove(self.out)

    def faulty_log(self, log, *command):
        if log == "/dev/full":
            return run(*command)
        if NO_FAULTS:
            self.skipTest(NO_FAULTS)
        return run_with({"LD_PRELOAD": FAULTS, "OCTRAD_FAULTS": f"{log}:write:{errno.ENOSPC}:1:0"}, *command)

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_a_checkpoint_that_fails_is_tried_again(self):
        model, log = self.path("m.octrad"), self.path("log.jsonl")
        command = ("train", self.scene, "-o", model, *SMALL, "--steps", 10, "-D", "checkpoint.every=0.001ms")  # after every step but the last, which ends it
        # The log is in another folder than the faults.
        result = self.faulty([("link", errno.ENOSPC, 2, 2)], *command)
        self.assertEqual(result.code, 0, result.err)
        self.assertEqual(result.err.count("training goes on, and the next checkpoint tries again"), 2, result.err)
        step = lambda: self.ok("info", model, "--json").json()["metadata"]["step"]
        self.assertEqual(step(), 10)
        result = self.faulty([("link", errno.ENOSPC, 3, 0)], *command, "--overwrite", "--log-json", log)
        self.assertEqual(result.code, 3, result.err)
        self.assertRegex(result.err.splitlines()[-1], r"cannot write .*m\.octrad: No space left on device; what is saved is step 2$")
        events = [json.loads(line)["event"] for line in read(log).decode().splitlines()]
        self.assertEqual((events.count("saved"), events.count("not_saved")), (2, 7))
        self.assertEqual(step(), 2)
        self.train("--resume", "--steps", 12)
        self.assertEqual(step(), 12)
        result = self.faulty([("link", errno.ENOSPC, 1, 0)], *command, "--overwrite")
        self.assertIn("nothing of this run is saved", result.err)
        self.assertEqual(step(), 12)

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_the_time_of_day_does_not_matter(self):
        model, log = self.path("m.octrad"), self.path("log.jsonl")
        for jump in (3600, -7200):
            begin, longest = time.monotonic(), 600  # less than the jumps, and more than other work on the machine adds
            result = run_with({"LD_PRELOAD": FAULTS, "OCTRAD_CLOCK": str(jump)}, "train", self.scene, "-o", model, "--overwrite", *SMALL,
                              "--time", "1s", "-D", "checkpoint.every=300ms", "--json", "--log-json", log)
            self.assertEqual(result.code, 0, result.err)
            self.assertTrue(0.95 <= result.json()["seconds"] <= longest, result.out)
            passed = time.monotonic() - begin
            self.assertGreaterEqual(passed, 0.9)
            saved = [json.loads(line)["event"] for line in read(log).decode().splitlines()].count("saved")
            self.assertTrue(2 <= saved <= passed / 0.3 + 2, (saved, passed))  # the last one is of the end
            result = run_with({"LD_PRELOAD": FAULTS, "OCTRAD_CLOCK": str(jump)}, "render", self.scene, "-o", self.out, "--time", "300ms", "--json")
            self.assertTrue(0.28 <= result.json()["seconds"] <= longest, result.out)
            # How often --resume saves: each time with more samples, of which some are seen here.
            begin, state, seen = time.monotonic(), self.out + ".state", set()
            with unittest.mock.patch.dict(os.environ, LD_PRELOAD=FAULTS, OCTRAD_CLOCK=str(jump)):
                process = start("render", self.scene, "-o", self.out, "--time", "2s", "--resume", "--save-every", "400ms", "--seed", abs(jump), "-q")
            while process.poll() is None:
                if os.path.exists(state):
                    seen.add(json.loads(read_safetensors(state)[0]["state"])["samples"])
                time.sleep(0.01)
            _, err = process.communicate()
            self.assertEqual(process.returncode, 0, err)
            self.assertTrue(2 <= len(seen) <= (time.monotonic() - begin) / 0.4 + 1, seen)
            for file in (self.out, state):
                os.remove(file)

    # ---- two programs, one file

    def test_a_second_render_is_told_at_once(self):
        log = self.path("log.jsonl")
        first = start("render", self.scene, "-o", self.out, "--spp", 100000000, "-q", "--log-json", log)
        try:
            self.assertTrue(wait_for(lambda: os.path.exists(log) and b"start" in read(log)))  # the file of a lock is there before the lock is
            self.assertTrue(os.path.exists(self.out + ".lock"))
            self.fails(3, "another process is writing it", "render", self.scene, "-o", self.out, "--spp", 1)
            link = self.path("link.exr")
            os.symlink("out.exr", link)
            self.fails(3, "another process is writing it", "render", self.scene, "-o", link, "--spp", 1)
        finally:
            first.kill()
            first.communicate()
        self.assertTrue(os.path.exists(self.out + ".lock"), "kill -9 leaves the file, without the lock")
        self.render()
        self.assertFalse(os.path.exists(self.out + ".lock"))

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_file_systems_without_locks(self):
        result = self.faulty([("flock", errno.ENOLCK, 1, 0)], "train", self.scene, "-o", self.path("m.octrad"), *SMALL, "--steps", 2)
        self.assertEqual(result.code, 0, result.err)
        self.assertIn("warning: ", result.err)
        self.assertIn("nothing keeps another process from writing", result.err)

    def test_files_of_the_user_are_left_alone(self):
        victim = self.write("victim.txt", "precious")
        for name in ("out.exr.tmp", ".octrad.tmp", "out.exr.lock"):
            os.symlink("victim.txt", self.path(name))
        result = self.render()
        self.assertIn("nothing keeps another process from writing", result.err)  # what is named .lock is not one
        self.assertEqual(read(victim), b"precious")
        self.assertFalse(os.path.islink(self.out))

    def test_a_file_that_has_the_name_of_a_lock(self):
        own = self.write("out.exr.lock", "precious")
        self.fails(3, "out.exr.lock is in the way", "render", self.scene, "-o", self.out, "--spp", 1)
        self.assertEqual(read(own), b"precious")
        self.write("out.exr.lock", "")  # left by a program that was killed
        self.render()
        self.assertEqual(self.listing(), sorted([self.scene, self.out]))

    def test_a_log_is_emptied_only_for_another(self):
        notes = self.write("notes.txt", "precious")
        self.fails(3, "missing.json", "render", self.scene, "-o", self.out, "--log-json", notes, "--camera", self.path("missing.json"))
        self.fails(1, "sensor", "render", self.scene, "-o", self.out, "--log-json", notes, "--sensor", 99)
        self.assertEqual(read(notes), b"precious")
        self.render("--log-json", notes)
        self.assertTrue(read(notes).startswith(b"{"))

    def test_what_view_saves_to(self):
        self.train("--steps", 2)
        self.train("--steps", 3, model=self.path("other.octrad"))
        model, other = self.path("m.octrad"), self.path("other.octrad")
        before = {file: read(file) for file in self.listing()}
        view = ("view", self.scene, "--model", model, "--train", "-o")
        self.fails(1, "too, which it would overwrite", *view, self.scene)
        self.fails(1, "too, which it would overwrite", "view", self.scene, "--model", model, "--model", other, "--train", "-o", other)
        self.fails(1, "is not " + model, *view, other)
        self.fails(3, "does not exist", *view, self.path("no/such/folder.octrad"))
        log = self.path("log.jsonl")
        first = start("train", self.scene, "-o", self.path("new.octrad"), *SMALL, "--steps", 100000000, "-q", "--log-json", log)
        try:
            self.assertTrue(wait_for(lambda: os.path.exists(log) and b"start" in read(log)))
            self.fails(3, "another process is writing it", *view, self.path("new.octrad"))
        finally:
            first.kill()
            first.communicate()
        self.assertEqual({file: read(file) for file in before}, before)

    # ---- names

    def test_control_characters_are_escaped_in_json(self):
        out = self.path("a\x7fb\u009bc.exr")
        done = self.ok("render", self.scene, "-o", out, "--spp", 1, "--json")
        self.assertNotIn("\x7f", done.out)
        self.assertNotIn("\u009b", done.out)
        self.assertEqual(json.loads(done.out)["output"], out)

    def test_names_are_bytes(self):
        folder = os.fsencode(self.folder) + b"/sz\xe4ne"
        os.mkdir(folder)
        name = lambda n: os.fsdecode(folder + b"/" + n)
        with open(name(b"r\xe4um.xml"), "w") as file:
            file.write(ROOM)
        with open(name(b"cameras\xff.json"), "w") as file:
            json.dump([{"origin": [0, 0, 0.9], "target": [0, 0, 0], "fov": 60}], file)
        with open(name(b"points\xff.csv"), "w") as file:
            file.write("x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n0,-1,0,0,1,0,0,1,0,.5,.5,.5,1\n")
        os.rename(self.glb("mesh.glb"), name(b"m\xff.glb"))
        scene, model, out = name(b"r\xe4um.xml"), name(b"m\xff.octrad"), name(b"\xfe.exr")
        call = lambda *words: subprocess.run([os.fsencode(PROGRAM), *(os.fsencode(str(w)) for w in words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        train = ("train", scene, "-o", model, *SMALL, "-D", "train.cameras=" + name(b"cameras\xff.json"), "--log-json", name(b"log\xff"))
        for command in ((*train, "--steps", 2), (*train, "--steps", 4, "--resume"), ("render", scene, "--model", model, "-o", out, "--spp", 1, "--json"),
                        ("render", scene, "-o", name(b"p.exr"), "--spp", 1, "--resume"), ("info", model, "--json"), ("info", out, "--json"),
                        ("compare", name(b"p.exr"), out, "--json", "--html", name(b"\xff.html")), ("tonemap", out, "-o", name(b"\xff.png")),
                        ("render", scene, "-o", name(b"q\xff.exr"), "--spp", 1, "--seed", 1), ("merge", name(b"p.exr"), name(b"q\xff.exr"), "-o", name(b"pq\xff.exr"), "--json"),
                        ("query", model, "--points", name(b"points\xff.csv"), "-o", name(b"answers\xff"), "--json"),
                        ("convert", scene, "-o", name(b"r\xff.xml"), "--json"), ("convert", name(b"m\xff.glb"), "-o", name(b"g\xff.xml"), "--json"),
                        ("render", name(b"g\xff.xml"), "-o", name(b"g.exr"), "--width", 16, "--spp", 1),
                        ("convert", name(b"g\xff.xml"), "-o", self.path("elsewhere.xml")), ("render", self.path("elsewhere.xml"), "-o", name(b"h.exr"), "--width", 16, "--spp", 1)):
            done = call(*command)
            self.assertEqual(done.returncode, 0, done.stderr)
            done.stdout.decode()  # is UTF-8
            done.stderr.decode()
            if "--json" in command:
                report = json.loads(done.stdout)
                if "-o" in command:
                    self.assertIn("/sz\\xe4ne/", report["output"])
        self.assertEqual(sorted(os.listdir(os.path.join(folder, b"g\xff-files"))), [b"mesh0.ply", b"picture0.png"])
        self.assertTrue(read_exr(name(b"g.exr"))[2] == read_exr(name(b"h.exr"))[2])  # with its mesh and picture
        denoised = call("denoise", out, "-o", name(b"d\xff.exr"), "--json")
        if denoised.returncode == 0:  # the library is there
            self.assertIn("/sz\\xe4ne/d\\xff.exr", json.loads(denoised.stdout)["output"])
            read_exr(name(b"d\xff.exr"))
        for command in (("merge", out, name(b"none\xff.exr"), "-o", name(b"n\xff.exr")), ("query", model, "--points", name(b"none\xff.exr")),
                        ("convert", name(b"none\xff.exr"), "-o", name(b"n\xff.xml")), ("denoise", name(b"none\xff.exr"), "-o", name(b"n\xff.exr"))):
            done = call(*command)
            self.assertEqual(done.returncode, 3, done.stderr)
            if command[0] != "denoise" or denoised.returncode == 0:
                self.assertIn("/sz\\xe4ne/none\\xff.exr", done.stderr.decode())
        self.assertIn("/sz\\xe4ne/r\\xe4um.xml", json.loads(read_safetensors(model)[0]["scene"])["file"])
        self.assertIn("/sz\\xe4ne/cameras\\xff.json", json.loads(read_safetensors(model)[0]["config"])["train"]["cameras"])
        self.assertIn("/sz\\xe4ne/m\\xff.octrad", json.loads(read_exr(out)[3]["octrad.model"])["file"])
        for line in read(name(b"log\xff")).decode().splitlines():
            json.loads(line)

    def test_long_names(self):
        longest = self.path("n" * 251 + ".exr")
        self.assertIn("File name too long", self.render(out=longest).err)  # of the lock: only a warning
        read_exr(longest)
        self.fails(3, "File name too long", "render", self.scene, "-o", self.path("n" * 252 + ".exr"), "--spp", 100000000)  # at once: that many never end

    def test_links(self):
        os.mkdir(self.path("folder"))
        os.symlink("folder/target.exr", self.out)
        self.render()
        self.assertTrue(os.path.islink(self.out))
        read_exr(self.path("folder/target.exr"))
        os.symlink("circle.exr", self.path("circle.exr"))
        self.fails(3, "circle.exr", "render", self.scene, "-o", self.path("circle.exr"), "--spp", 1)
        os.symlink("none/out.exr", self.path("astray.exr"))
        self.fails(3, "does not exist", "render", self.scene, "-o", self.path("astray.exr"), "--spp", 1)

    def test_pipes_as_outputs(self):
        pipe = self.path("pipe.exr")
        os.mkfifo(pipe)
        self.fails(3, "a pipe that nobody reads", "render", self.scene, "-o", pipe, "--spp", 1)
        self.fails(3, "a pipe that nobody reads", "render", self.scene, "-o", self.out, "--spp", 1, "--log-json", pipe)
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        self.render(out=pipe)
        self.assertEqual(os.read(reader, 4), b"\x76\x2f\x31\x01")
        os.close(reader)

    def test_inputs_are_not_overwritten(self):
        self.train("--steps", 2)
        self.render(out=self.path("a.exr"))
        self.render("--seed", 1, out=self.path("b.exr"))
        os.link(self.path("a.exr"), self.path("same.exr"))
        os.symlink("room.xml", self.path("link.xml"))
        write_pfm(self.path("b.error.exr"), 32, 24, lambda x, y: (1, 1, 1))
        model, a, b, out = self.path("m.octrad"), self.path("a.exr"), self.path("b.exr"), self.out
        camera = self.write("camera.json", json.dumps({"origin": [0, 0, 0.9], "target": [0, 0, 0]}))
        before = {file: read(file) for file in self.listing()}
        for command in (("render", self.scene, "-o", out, "--log-json", self.scene), ("render", self.scene, "-o", out, "--log-json", self.path("link.xml")),
                        ("render", self.scene, "-o", out, "--log-json", out), ("render", self.scene, "-o", out, "--camera", camera, "--log-json", camera),
                        ("render", self.scene, "--model", model, "-o", out, "--log-json", model),
                        ("train", self.scene, "-o", model, "--resume", "--log-json", model), ("train", self.scene, "-o", self.scene, "--overwrite"),
                        ("merge", a, b, "-o", self.path("same.exr")), ("merge", a, b, "-o", b), ("denoise", a, "-o", a),
                        ("compare", a, b, "--csv", b), ("compare", a, b, "--html", a), ("compare", b, self.path("b.error.exr"), b, "--errors", self.folder),
                        ("query", model, "--points", self.scene, "-o", self.scene), ("selftest", self.scene, "-o", self.scene)):
            with self.subTest(command):
                self.fails(1, "too, which it would overwrite", *command)
        # What a scene refers to, known once it is loaded.
        write_pfm(self.path("p.pfm"), 4, 4, lambda x, y: (1, 1, 1))
        files = {"m.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "p.pfm": None, "lamp.xml":
                 '<scene version="3.0.0"><shape type="sphere"><emitter type="area"><rgb name="radiance" value="3"/></emitter></shape></scene>'}
        for name, text in files.items():
            if text:
                self.write(name, text)
        scene = self.write("refers.xml", """<scene version="3.0.0"><include filename="lamp.xml"/><shape type="obj"><string name="filename" value="m.obj"/>
            <bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="p.pfm"/><boolean name="raw" value="true"/>
            </texture></bsdf></shape><sensor type="perspective"/></scene>""")
        contents = {name: read(self.path(name)) for name in files}
        for name in files:
            with self.subTest(name):
                self.fails(1, f"{name} too, which it would overwrite", "render", scene, "-o", out, "--spp", 1, "--log-json", self.path(name))
                self.fails(1, f"{name} too, which it would overwrite", "train", scene, "-o", self.path(name), "--overwrite", "--steps", 1, *SMALL)
        self.fails(1, "p.pfm too, which it would overwrite", "render", scene, "-o", self.path("p.pfm"), "--spp", 1)
        # Frames of a film, one of which has the name of a texture.
        os.rename(self.path("p.pfm"), self.path("p1.pfm"))
        film = self.write("film.xml", read(scene).decode().replace("p.pfm", "p1.pfm"))
        path = self.write("path.json", json.dumps({"fps": 2, "keys": [{"time": t, "origin": [0, 0, 5], "target": [0, 0, 0], "fov": 60} for t in (0, 1)]}))
        self.fails(1, "p1.pfm too, which it would overwrite", "render", film, "--path", path, "-o", self.path("p#.pfm"), "--overwrite", "--spp", 1)
        os.rename(self.path("p1.pfm"), self.path("p.pfm"))
        self.fails(1, "too, which it would overwrite", "compare", a, b, "--csv", self.path("table"), "--latex", self.path("table"))
        self.assertEqual({name: read(self.path(name)) for name in files}, contents)
        write_pfm(self.path("p.png"), 4, 4, lambda x, y: (1, 1, 1))
        self.fails(1, "too, which it would overwrite", "tonemap", self.path("p.png"), "-o", self.path("p.png"))
        self.assertEqual({file: read(file) for file in before}, before)

    def test_error_pictures_have_names_of_their_own(self):
        for folder in ("A", "B"):
            os.mkdir(self.path(folder))
        pictures = [self.path(name) for name in ("B/a.exr", "A/a.exr", "a-2.exr", "a.exr")]
        for seed, picture in enumerate(pictures):
            self.render("--seed", seed, out=picture)
        self.render("--seed", 9)
        self.ok("compare", self.out, *pictures, "--errors", self.path("E"))
        written = [name for name in os.listdir(self.path("E")) if name.endswith(".exr")]
        self.assertEqual(len(written), 4, written)
        self.assertEqual(len({read(self.path("E/" + name)) for name in written}), 4)

    # ---- how it ends

    def test_exit_codes(self):
        self.render(out=self.path("a.exr"))
        r, a = ("render", self.scene, "-o", self.out, "--spp", 1), self.path("a.exr")
        self.fails(1, "crop", *r, "--crop", "2147483647,0,1,1")
        self.fails(1, "fov axis", *r, "--fov", 50, "--fov-axis", "q")
        self.fails(1, "define no view", *r, "--origin", "0,0,0", "--target", "0,0,0")
        self.fails(1, "--range", "tonemap", a, "-o", self.path("a.png"), "--channel", "depth.Z", "--range", "0,1e-300")
        for ends in ("-1e300,1e300", "-1e300,0", "-3e38,3e38"):
            self.fails(1, "--range", "tonemap", a, "-o", self.path("a.png"), "--channel", "depth.Z", "--range=" + ends)
        self.fails(1, "not a whole number", *r, "--seed", "010")  # no octal numbers
        self.fails(1, "not a whole number", "render", self.scene, "-o", self.out, "--spp", "0100")
        for text in ("--help", "--version"):
            with open("/dev/full", "w") as full:
                result = run(text, stdout=full)
            self.assertEqual(result.code, 3, result.err)
            self.assertIn("standard output", result.err)

    def test_standard_streams_that_are_closed(self):
        """What is written to them must not go into the files that take their place."""
        log = self.path("log.jsonl")
        for closed in ((0,), (1,), (2,), (0, 1, 2)):
            def close():
                for descriptor in closed:
                    os.close(descriptor)
            done = subprocess.run([PROGRAM, "render", self.scene, "-o", self.out, "--spp", "1", "--json", "--log-json", log], preexec_fn=close,
                                  stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            self.assertEqual(done.returncode, 3 if 1 in closed else 0, done.stderr)
            self.assertEqual([json.loads(line)["event"] for line in read(log).decode().splitlines()][-1], "done")
            read_exr(self.out)

    def test_a_closed_terminal_saves(self):
        """It sends SIGHUP, often more than once."""
        for command, out in ((("render", self.scene, "-o", self.out, "--spp", 100000000), self.out),
                             (("train", self.scene, "-o", self.path("m.octrad"), *SMALL, "--time", "10m"), self.path("m.octrad"))):
            log = self.path("log.jsonl")
            process = start(*command, "--log-json", log)
            self.assertTrue(wait_for(lambda: os.path.exists(log) and b"progress" in read(log)))
            for _ in range(3):
                process.send_signal(signal.SIGHUP)
                time.sleep(0.002)
            _, err = process.communicate(timeout=PATIENCE)
            self.assertEqual(process.returncode, 130, err)
            self.assertTrue(os.path.exists(out))
            os.remove(log)

    def test_nohup(self):
        process = subprocess.Popen([PROGRAM, "render", self.scene, "-o", self.out, "--time", "1s", "-q"], stderr=subprocess.PIPE,
                                   preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
        while process.poll() is None:  # at every moment from its start to its end
            process.send_signal(signal.SIGHUP)
            time.sleep(0.01)
        _, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 0, err)

    @unittest.skipIf(NO_FAULTS, NO_FAULTS)
    def test_interrupt_while_loading_ends_at_once(self):
        """While a mesh is read that never comes; the signal does as soon as the program listens to it."""
        os.mkdir(self.path("far"))
        self.write("far/mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        scene = self.write("far.xml", '<scene version="3.0.0"><sensor type="perspective"/><shape type="obj"><string name="filename" value="far/mesh.obj"/></shape></scene>')
        model = self.path("m.octrad")

        def listens(process, sent):
            with open("/proc/%d/status" % process.pid) as status:
                caught = next(line for line in status if line.startswith("SigCgt:"))
            return int(caught.split()[1], 16) >> (sent - 1) & 1

        with unittest.mock.patch.dict(os.environ, LD_PRELOAD=FAULTS, OCTRAD_FAULTS=self.path("far") + ":hang:0:1:0"):
            for sent in (signal.SIGINT, signal.SIGTERM):
                for verb in (("render", scene, "-o", self.out), ("train", scene, "-o", model)):
                    process = start(*verb)
                    self.assertTrue(wait_for(lambda: listens(process, sent)))
                    process.send_signal(sent)
                    _, err = process.communicate(timeout=PATIENCE)
                    self.assertEqual(process.returncode, 130, err)
                    self.assertIn("before there was anything to save", err.decode())
        self.assertFalse(os.path.exists(self.out) or os.path.exists(model))

    def test_large_pictures_stop_soon(self):
        """A pass of these takes many seconds. Before the first one is whole there is nothing to save, and the old picture stays."""
        self.render()
        before = read(self.out)
        log, white = self.path("log.jsonl"), self.write("white.xml", ROOM.replace("$wall, 0.5, 0.4", "1, 1, 1"))
        earlier = children_seconds()
        process = start("render", white, "-o", self.out, "--width", 1500, "--spp", 4, "--max-depth", 1000, "--rr-depth", 1000, "--threads", 2, "--log-json", log)
        self.assertTrue(wait_for(lambda: os.path.exists(log) and b"start" in read(log)))
        begun = processor_seconds(process.pid)
        self.assertTrue(wait_for(lambda: processor_seconds(process.pid) > begun + 0.5))  # in its first pass, however busy the machine is
        # It is stopped while its seconds are read, so that none pass between that and the signal.
        process.send_signal(signal.SIGSTOP)
        os.waitpid(process.pid, os.WUNTRACED)
        before_signal = processor_seconds(process.pid)
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGCONT)
        _, err = process.communicate(timeout=PATIENCE)
        self.assertLess(children_seconds() - earlier - before_signal, 2, "seconds of a processor after the signal")
        self.assertEqual(process.returncode, 130, err)
        self.assertIn(b"nothing is saved", err)
        self.assertEqual(read(self.out), before)


if __name__ == "__main__":
    unittest.main()
