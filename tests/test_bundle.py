#!/usr/bin/env python3
"""scripts/bundle.sh: what it packs runs in a root that has glibc, a shell and Python, and none of octrad's libraries."""
import glob
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import sysconfig
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = pathlib.Path(os.environ.get("OCTRAD", ROOT / "build" / "octrad"))
sys.path.insert(0, str(ROOT / "scripts"))
sys.path.insert(0, str(ROOT / "tests" / "cli"))
import glibc_floor  # noqa: E402
from web_client import Viewer  # noqa: E402

SMALL = ["-D", "train.points=64", "-D", "train.directions=2", "-D", "octree.levels=3", "-q"]
GLIBC = ("ld-linux", "libc.so", "libm.so", "libdl.so", "librt.so", "libpthread.so", "linux-vdso")


def libraries(program):
    """Paths of the shared libraries that a program of this machine loads."""
    out = subprocess.run(["ldd", program], check=True, capture_output=True, text=True).stdout
    return [word for line in out.splitlines() for word in line.split() if word.startswith("/")]


def into(root, file):
    target = pathlib.Path(str(root) + file)
    target.parent.mkdir(parents=True, exist_ok=True)
    if not target.exists():
        shutil.copy(file, target)


def bare_root(root):
    """glibc, its loader, sh, the few commands that the scripts call, and Python with its own library."""
    commands = [shutil.which(name) for name in ("sh", "readlink", "ls", "tr", "dirname")]
    python = os.path.realpath("/usr/bin/python3")
    (root / "usr/bin").mkdir(parents=True)
    os.symlink("usr/bin", root / "bin")
    for file in commands + [python]:
        into(root, file)
        for library in libraries(file):
            into(root, library)
    shutil.copy(root / python[1:], root / "usr/bin/python3")
    library = sysconfig.get_path("stdlib") if sys.executable.startswith("/usr/bin") else "/usr/lib/" + os.path.basename(python)
    shutil.copytree(library, str(root) + library, symlinks=True,
                    ignore=shutil.ignore_patterns("test", "tests", "config-*", "idlelib", "lib2to3", "tkinter", "ensurepip", "dist-packages", "site-packages", "__pycache__"))
    for module in glob.glob(library + "/lib-dynload/*.so"):
        for needed in libraries(module):
            if any(part in needed for part in ("libz.", "libexpat", "libffi", "libcrypto", "libbz2", "liblzma")) and "_ctypes" in module:
                into(root, needed)
    # Libraries of glibc that programs of the bundle name and sh does not.
    for name in ("libc.so.6", "libm.so.6", "libdl.so.2", "librt.so.1", "libpthread.so.0"):
        for folder in ("/lib/x86_64-linux-gnu/", "/lib64/"):
            if os.path.exists(folder + name):
                into(root, folder + name)
    for folder in ("tmp", "proc", "dev", "etc", "opt"):
        (root / folder).mkdir(exist_ok=True)


def inside(root, *words, env=None, **options):
    """Runs a command with `root` as the whole file system."""
    enter = [shutil.which("chroot", path="/usr/sbin:/sbin:/usr/bin:/bin") or "chroot", str(root)]
    if os.geteuid() != 0:
        enter = [shutil.which("unshare") or "unshare", "--user", "--map-root-user", *enter]
    environment = {"PATH": "/usr/bin:/bin", "HOME": "/tmp", **(env or {})}
    return subprocess.run([*enter, *words], capture_output=True, text=True, env=environment, timeout=600, **options)


class Bundle(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        if not PROGRAM.exists():
            raise unittest.SkipTest("SKIPPED: %s is not built" % PROGRAM)
        if not shutil.which("dpkg-query"):
            raise unittest.SkipTest("SKIPPED: not a Debian system, whose packages a bundle's licences come from")
        cls.folder = tempfile.TemporaryDirectory(prefix="octrad-bundle-")
        cls.addClassCleanup(cls.folder.cleanup)
        cls.root = pathlib.Path(cls.folder.name)
        archive = cls.root / "octrad.tar"
        scene = cls.root / "extra"
        shutil.copytree(ROOT / "scenes" / "furnace", scene)
        # Test programs are packed where they are built beside the program.
        cls.with_tests = (PROGRAM.parent / "test_device").exists()
        done = subprocess.run([str(ROOT / "scripts" / "bundle.sh"), "--build", str(PROGRAM.parent), *(["--tests"] if cls.with_tests else []), "--scenes", str(scene),
                               "-o", str(archive)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        (cls.root / "opt").mkdir()
        subprocess.run(["tar", "-C", str(cls.root / "opt"), "-xf", str(archive)], check=True)
        archive.unlink()
        cls.bundle = cls.root / "opt" / "octrad"

    def test_contents(self):
        for name in ("octrad", "run", "bin/octrad", "lib/libembree3.so.3", "lib/libstdc++.so.6", "lib/gcc/libgcc_s.so.1", "licences/octrad", "README", "commit",
                     "bench/gpu.sh", "scenes/cornell-box/scene.xml", "shared/scenes/extra/scene.xml"):
            self.assertTrue((self.bundle / name).is_file(), name)
        for name in os.listdir(self.bundle / "lib"):
            self.assertFalse(name.startswith(GLIBC) or "cuda" in name, name + " belongs to the machine")
        # Every library has the licence of the package that it is from.
        for library in libraries(str(PROGRAM)):
            name = os.path.basename(library)
            if name.startswith(GLIBC):
                continue
            real = os.path.realpath(library)
            found = next(filter(None, (subprocess.run(["dpkg-query", "-S", path], capture_output=True, text=True).stdout for path in (real, real.replace("/usr", "", 1)))))
            text = self.bundle / "licences" / found.split(":")[0] / "copyright"
            self.assertGreater(text.stat().st_size, 100, text)

    def test_packs_the_tests_for_gpus(self):
        if not self.with_tests:
            self.skipTest("SKIPPED: the test programs are not built")
        packed = {file.name for file in (self.bundle / "bin").glob("test_*")}
        self.assertEqual(packed, {"test_" + source.parent.name for source in (ROOT / "src/octrad").glob("*/*_test.cc")
                                  if any(helper in source.read_text() for helper in ("stream_test_helper", "device_test_helper"))})
        done = subprocess.run([str(self.bundle / "run"), "test_device", "--gtest_filter=*Host*"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("[  PASSED  ]", done.stdout)

    def test_asks_for_no_newer_glibc(self):
        files = [*(self.bundle / "bin").iterdir(), *(self.bundle / "lib").glob("*.so*")]
        needed = set()
        for file in files:
            for name, *_ in glibc_floor.requirements(file.read_bytes()):
                if name.startswith("GLIBC_2."):
                    needed.add(glibc_floor.number(name[6:]))
        self.assertLessEqual(max(needed), (2, 34))
        # The tool sees what is too new, and refuses it.
        library = next(file for file in libraries(str(PROGRAM)) if "libc.so" in file)
        done = subprocess.run([sys.executable, str(ROOT / "scripts/glibc_floor.py"), "--newest", "2.2", str(self.bundle / "bin/octrad")], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1, library)
        self.assertIn("only 2.2 may be needed", done.stderr)

    def test_a_glibc_without_arc4random(self):
        """As on glibc 2.34: libstdc++ asks for a function that no glibc has. A call of it, by std::random_device, ends the program:
        nothing may take that, nor may Boost's WebSockets."""
        library = self.bundle / "lib" / "libstdc++.so.6"
        original = library.read_bytes()
        if b"\0arc4random\0" not in original:
            self.skipTest("SKIPPED: this libstdc++ does not ask for it")
        program, scene, model = str(self.bundle / "octrad"), str(ROOT / "scenes/furnace/scene.xml"), str(self.root / "m.octrad")
        try:
            library.write_bytes(original.replace(b"\0arc4random\0", b"\0arc4rand0m\0"))
            for words in (["train", scene, "--steps", "1", "-o", model, *SMALL], ["selftest", "--only", "sort", "--no-benchmarks"]):
                done = subprocess.run([program, *words], capture_output=True, text=True)
                self.assertEqual((done.returncode, done.stderr), (0, ""))
            self.view(program, scene)
            # A version that is not there is refused at once: without the change to the file nothing would start.
            source = bytearray(pathlib.Path(next(file for file in libraries(str(PROGRAM)) if "libstdc++" in file)).read_bytes())
            entry = next(row[-1] for row in glibc_floor.requirements(source) if row[0] == "GLIBC_2.36")
            number = 0
            for c in b"GLIBC_2.99":  # the hash of ELF symbol tables
                number = (number << 4) + c
                number = (number ^ ((number & 0xF0000000) >> 24)) & 0x0FFFFFFF
            struct.pack_into("<I", source, entry, number)
            library.write_bytes(source.replace(b"GLIBC_2.36\0", b"GLIBC_2.99\0"))
            done = subprocess.run([program, "--version"], capture_output=True, text=True)
            self.assertNotEqual(done.returncode, 0, "the test sees nothing")
            self.assertIn("GLIBC_2.99", done.stderr)
        finally:
            library.write_bytes(original)

    def view(self, program, scene):
        """Starts the viewer's server and connects to it."""
        with subprocess.Popen([program, "view", scene, "--json", "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            try:
                viewer = Viewer(json.loads(process.stdout.readline())["url"])
                viewer.answer("state")
                viewer.close()
                self.assertIsNone(process.poll(), "the server died")
            finally:
                process.kill()

    def test_starter_keeps_the_search_path(self):
        """The folder of libcuda stays in it, behind ours; arguments arrive as they are; a link to the starter works."""
        copy = self.root / "starter"
        (copy / "bin").mkdir(parents=True)
        shutil.copy(self.bundle / "octrad", copy / "octrad")
        with open(copy / "bin" / "octrad", "w", encoding="utf-8") as out:
            out.write('#!/bin/sh\necho "$LD_LIBRARY_PATH"\nprintf "%s|" "$@"\n')
        os.chmod(copy / "bin" / "octrad", 0o755)
        os.symlink(copy / "octrad", self.root / "linked")
        for path, name in (("/usr/local/nvidia/lib64:/x", "linked"), (None, "starter/octrad")):
            environment = {**os.environ, **({"LD_LIBRARY_PATH": path} if path else {})}
            if not path:
                environment.pop("LD_LIBRARY_PATH", None)
            out = subprocess.run([str(self.root / name), "a b", ""], check=True, capture_output=True, text=True, env=environment).stdout
            self.assertEqual(out, "%s/lib%s\na b||" % (copy, ":" + path if path else ""))

    def test_bare_root(self):
        bare_root(self.root)
        probe = inside(self.root, "/bin/sh", "-c", "echo in")
        if probe.returncode != 0 or probe.stdout != "in\n":
            self.skipTest("SKIPPED: changing the root is not permitted here: " + probe.stderr.strip())
        # Nothing of ours is there, not even glibc's companion libgcc_s: then the bundle's own is taken.
        found = [file for file in self.root.rglob("*.so*") if self.bundle not in file.parents and any(part in file.name for part in ("embree", "tbb", "OpenEXR", "stdc++", "gcc_s", "fmt"))]
        self.assertEqual(found, [])
        missing = inside(self.root, "/opt/octrad/bin/octrad", "--version")
        self.assertNotEqual(missing.returncode, 0, "the program runs without the bundle: the root is not bare")
        scene = "/opt/octrad/scenes/cornell-box/scene.xml"
        for words in (["train", scene, "--steps", "3", "-o", "/tmp/m.octrad", *SMALL],
                      ["render", scene, "--model", "/tmp/m.octrad", "--width", "16", "--height", "16", "--spp", "1", "-o", "/tmp/p.exr", "-q"],
                      ["compare", "/tmp/p.exr", "/tmp/p.exr", "--json", "-q"]):
            done = inside(self.root, "/opt/octrad/octrad", *words)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual(json.loads(done.stdout)["images"][0]["mape"], 0.0)
        for plan in ("first", "second", "third"):
            with self.subTest(plan=plan):
                done = inside(self.root, "/bin/sh", "/opt/octrad/bench/gpu.sh", "--plan", plan, "--rehearse", "-o", "/tmp/%s.json" % plan)
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                with open(str(self.root) + "/tmp/%s.json" % plan, encoding="utf-8") as text:
                    report = json.load(text)
                self.assertTrue(report["complete"])
                self.assertEqual(report["commit"], (self.bundle / "commit").read_text().strip())
                self.assertEqual([entry["name"] for entry in report["steps"] if "failed" in entry or not (entry.get("result") or entry.get("output"))], [])
                if plan == "first" and self.with_tests:
                    self.assertIn("unit tests: test_device", [entry["name"] for entry in report["steps"]])


if __name__ == "__main__":
    unittest.main()
