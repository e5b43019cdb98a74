"""octrad denoise, render --denoise and --integrator denoised, against Open Image Denoise itself. Skipped without the library."""
import array
import ctypes
import json
import math
import os
import shutil
import subprocess
import tempfile
import unittest

from exr import read_exr, read_pfm, write_exr
from support import PROGRAM, ROOM, Case, run, write_pfm

WIDTH, HEIGHT = 48, 40


def library():
    """What octrad finds, or None."""
    with tempfile.TemporaryDirectory() as folder:
        picture = os.path.join(folder, "a.pfm")
        write_pfm(picture, 4, 4, lambda x, y: (1, 1, 1))
        result = run("denoise", picture, "-o", os.path.join(folder, "b.pfm"), "--json")
        return result.json()["library"] if result.code == 0 else None


LIBRARY = library()
needs_compiler = unittest.skipIf(shutil.which("cc") is None, "needs a C compiler")
needs_library = unittest.skipIf(LIBRARY is None, "needs Open Image Denoise: scripts/install_oidn.sh")


def stand_in(case, version):
    """A library that says this version and fails when a filter runs -> its folder. As in the package of version 2.5, it needs
    a second one, which the dynamic linker does not find by itself."""
    names = ("SetDeviceInt", "SetDeviceBool", "CommitDevice", "ReleaseDevice", "ReadBuffer", "WriteBuffer", "ReleaseBuffer", "SetFilterImage",
             "SetFilterBool", "SetFilterInt", "CommitFilter", "ReleaseFilter")
    core, source = "libOpenImageDenoise_core.so.2.9.1", "extern int failed;\nint oidnGetDeviceInt(void* d, const char* n) { return %d; }\nvoid oidnExecuteFilter(void* f) { failed = 1; }\n" % version
    source += 'int oidnGetDeviceError(void* d, const char** m) { *m = "out of order"; return failed; }\n'
    source += "".join("void oidn%s(void) {}\n" % n for n in names)
    source += "".join("void* oidn%s(void) { return &failed; }\n" % n for n in ("NewDevice", "NewBuffer", "NewFilter"))
    command = ["cc", "-shared", "-fPIC", "-w", "-o"]
    subprocess.run([*command, case.path(core), case.write("core.c", "int failed;\n"), "-Wl,-soname," + core], check=True)
    subprocess.run([*command, case.path("libOpenImageDenoise.so.2"), case.write("stand_in.c", source), case.path(core)], check=True)
    return case.folder


def noisy(seed=1):
    """Channels of a picture: a bright disc before a wall of two colours, with noise; and its layers, which have some too."""
    state = seed
    channels = {name: array.array("f") for name in ("R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z")}

    def uniform():
        nonlocal state
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        return (state >> 40) / 2**24

    for y in range(HEIGHT):
        for x in range(WIDTH):
            inside = (x - 20) ** 2 + (y - 18) ** 2 < 100
            albedo = (0.9, 0.8, 0.7) if inside else (0.2, 0.5, 0.3) if x < 30 else (0.6, 0.1, 0.1)
            light = (8.0 if inside else 0.7) * -math.log(1 - uniform() * 0.999)
            for c, a in zip("RGB", albedo):
                channels[c].append(a * light)
                channels["albedo." + c].append(min(1, a + 0.05 * uniform()))
            for c, n in zip("XYZ", (0, 0, 1) if inside else (0.6, 0, 0.8)):
                channels["normal." + c].append(n + 0.02 * uniform())
    return channels


def interleaved(channels, names):
    return array.array("f", [v for pixel in zip(*(channels[n] for n in names)) for v in pixel])


def by_library(colour, albedo=None, normal=None, hdr=True, prefilter=False, quality=0):
    """Open Image Denoise through its C interface."""
    oidn = ctypes.CDLL(LIBRARY)
    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    oidn.oidnNewDevice.restype = oidn.oidnNewFilter.restype = oidn.oidnNewBuffer.restype = pointer
    oidn.oidnNewBuffer.argtypes = [pointer, size]
    oidn.oidnNewFilter.argtypes = [pointer, ctypes.c_char_p]
    oidn.oidnSetFilterImage.argtypes = [pointer, ctypes.c_char_p, pointer, ctypes.c_int] + [size] * 5
    oidn.oidnSetFilterBool.argtypes = [pointer, ctypes.c_char_p, ctypes.c_bool]
    oidn.oidnSetFilterInt.argtypes = [pointer, ctypes.c_char_p, ctypes.c_int]
    oidn.oidnWriteBuffer.argtypes = oidn.oidnReadBuffer.argtypes = [pointer, size, size, pointer]
    oidn.oidnGetDeviceError.argtypes = [pointer, ctypes.POINTER(ctypes.c_char_p)]
    for name in ("oidnCommitDevice", "oidnCommitFilter", "oidnExecuteFilter"):
        getattr(oidn, name).argtypes = [pointer]
    device = oidn.oidnNewDevice(1)
    oidn.oidnCommitDevice(device)

    def buffer(values):
        made = oidn.oidnNewBuffer(device, 4 * len(values))
        oidn.oidnWriteBuffer(made, 0, 4 * len(values), values.buffer_info()[0])
        return made

    def execute(images, **flags):
        chosen = oidn.oidnNewFilter(device, b"RT")
        for name, image in images.items():
            oidn.oidnSetFilterImage(chosen, name.encode(), image, 3, WIDTH, HEIGHT, 0, 0, 0)
        for name, value in flags.items():
            oidn.oidnSetFilterBool(chosen, name.encode(), value)
        if quality:
            oidn.oidnSetFilterInt(chosen, b"quality", quality)
        oidn.oidnCommitFilter(chosen)
        oidn.oidnExecuteFilter(chosen)

    images = {"color": buffer(colour), "output": buffer(colour)}
    for name, layer in (("albedo", albedo), ("normal", normal)):
        if layer is not None:
            images[name] = buffer(layer)
            if prefilter:
                clean = buffer(layer)
                execute({name: images[name], "output": clean})
                images[name] = clean
    execute(images, hdr=hdr, cleanAux=prefilter)
    out = array.array("f", bytes(4 * len(colour)))
    oidn.oidnReadBuffer(images["output"], 0, 4 * len(out), out.buffer_info()[0])
    message = ctypes.c_char_p()
    assert oidn.oidnGetDeviceError(device, ctypes.byref(message)) == 0, message.value
    return out


class Denoise(Case):
    def setUp(self):
        super().setUp()
        self.channels = noisy()
        self.noisy = write_exr(self.path("noisy.exr"), WIDTH, HEIGHT, dict(self.channels, **{"depth.Z": [2.5] * (WIDTH * HEIGHT)}),
                               {"octrad.render": '{"spp": 4, "integrator": "path", "seed": 3}', "owner": "somebody"})
        self.out = self.path("out.exr")

    def denoise(self, *options, picture=None, out=None):
        out = out or self.path("out.pfm")
        self.ok("denoise", picture or self.noisy, "-o", out, "-q", *options)
        return read_pfm(out) if out.endswith(".pfm") else None

    def assert_close(self, a, b, tolerance=1e-4):
        self.assertEqual(len(a), len(b))
        self.assertLess(max(abs(x - y) / max(1, abs(y)) for x, y in zip(a, b)), tolerance)

    @needs_library
    def test_equal_to_the_library_itself(self):
        colour = interleaved(self.channels, "RGB")
        albedo = interleaved(self.channels, ["albedo." + c for c in "RGB"])
        normal = interleaved(self.channels, ["normal." + c for c in "XYZ"])
        expected = by_library(colour, albedo, normal)
        self.assertGreater(max(abs(a - b) for a, b in zip(colour, expected)), 1)  # it does something
        self.assert_close(self.denoise(), expected)
        others = [expected]
        for options, arguments in ((("--aux", "none"), {}), (("--aux", "albedo"), {"albedo": albedo}),
                                   (("--prefilter",), {"albedo": albedo, "normal": normal, "prefilter": True}),
                                   (("--quality", "fast"), {"albedo": albedo, "normal": normal, "quality": 4}),
                                   (("--ldr",), {"albedo": albedo, "normal": normal, "hdr": False})):
            with self.subTest(options):
                result, expected = self.denoise(*options), by_library(colour, **arguments)
                self.assert_close(result, expected)
                for other in others:  # every option changes something
                    self.assertGreater(max(abs(a - b) for a, b in zip(expected, other)), 1e-3)
                others.append(expected)

    @needs_library
    def test_everything_else_stays(self):
        self.denoise(out=self.out)
        width, height, before, _ = read_exr(self.noisy)
        after = read_exr(self.out)
        self.assertEqual((width, height, set(before)), (after[0], after[1], set(after[2])))
        for name in before:
            (self.assertNotEqual if name in "RGB" else self.assertEqual)(before[name], after[2][name], name)
        self.assertEqual(after[3]["owner"], "somebody")
        self.assertEqual(json.loads(after[3]["octrad.render"])["spp"], 4)
        note = json.loads(after[3]["octrad.denoise"])
        self.assertEqual((note["aux"], note["prefilter"], note["quality"], note["device"], note["hdr"]), ("albedo, normal", False, "default", "cpu", True))
        self.assertRegex(note["version"], r"^2\.\d+\.\d+$")
        self.assertIn("denoised before", self.ok("denoise", self.out, "-o", self.out).err)  # in place
        self.fails(2, "was denoised", "merge", self.out, self.noisy, "-o", self.path("m.exr"))

    @needs_library
    def test_layers_as_other_renderers_call_them(self):
        expected = self.denoise()
        for names in ({"normal": "nn"}, {"albedo": "Albedo", "normal": "Ns"}, {"normal": "sh_normal"},
                      {"": "ViewLayer.Combined", "albedo": "ViewLayer.Denoising Albedo", "normal": "ViewLayer.Denoising Normal"}):
            with self.subTest(names):
                renamed = {}
                for channel, values in self.channels.items():
                    layer, _, component = channel.rpartition(".")
                    renamed[(names.get(layer, layer) + "." + component).lstrip(".")] = values
                self.denoise(picture=write_exr(self.path("other.exr"), WIDTH, HEIGHT, renamed), out=self.out)
                colour = (names.get("", "") + ".G").lstrip(".")
                self.assertEqual(array.array("f", read_exr(self.out)[2][colour]), expected[1::3])

    @needs_library
    def test_layers_of_another_picture(self):
        colour = write_exr(self.path("colour.exr"), WIDTH, HEIGHT, {c: self.channels[c] for c in "RGB"})
        self.assertEqual(self.denoise("--layers-from", self.noisy, picture=colour), self.denoise())
        small = write_exr(self.path("small.exr"), 2, 2, {"albedo." + c: [0.5] * 4 for c in "RGB"})
        result = self.fails(2, "its albedo and normals have 2 x 2", "denoise", colour, "-o", self.out, "--layers-from", small)
        self.assertIn("48 x 40", result.err)

    @needs_library
    def test_same_bits_at_any_thread_count(self):
        self.assertEqual(self.denoise("--threads", 1), self.denoise("--threads", 3))

    @needs_library
    def test_refusals(self):
        d = lambda picture, *o: ("denoise", picture, "-o", self.out, *o)
        broken = dict(self.channels, G=array.array("f", self.channels["G"]))
        broken["G"][5 * WIDTH + 7] = math.nan
        broken["G"][9 * WIDTH + 1] = math.inf
        self.fails(2, "the colour of 2 pixels is not finite (the first at 7, 5)", *d(write_exr(self.path("nan.exr"), WIDTH, HEIGHT, broken)))
        broken = dict(self.channels)
        broken["normal.X"] = [math.nan] * (WIDTH * HEIGHT)
        nan = write_exr(self.path("nan.exr"), WIDTH, HEIGHT, broken)
        self.fails(2, "the normal of 1920 pixels", *d(nan))
        self.ok(*d(nan, "--aux", "albedo"))
        os.remove(self.out)
        self.fails(2, "no colour to denoise", *d(write_exr(self.path("layers.exr"), WIDTH, HEIGHT, {"albedo.R": self.channels["R"]})))
        plain = write_exr(self.path("plain.exr"), WIDTH, HEIGHT, {c: self.channels[c] for c in "RGB"})
        self.fails(2, 'no layer "albedo"', *d(plain, "--aux", "albedo,normal"))
        self.fails(1, "nothing", *d(plain, "--aux", "nothing"))
        self.fails(1, "--prefilter", *d(plain, "--aux", "none", "--prefilter"))
        self.fails(1, ".exr, .hdr or .pfm", "denoise", plain, "-o", self.path("a.tif"))
        self.fails(3, "does not exist", "denoise", plain, "-o", self.path("none/a.exr"))
        self.fails(3, "none.exr", *d(self.path("none.exr")))
        self.fails(2, "empty.exr: cannot read", *d(write_exr(self.path("empty.exr"), 0, 1, {c: [] for c in "RGB"})))
        write_pfm(self.path("empty.pfm"), 0, 1, None)
        self.fails(2, "0 x 1 pixels", *d(self.path("empty.pfm")))
        screen = self.path("screen.png")
        self.ok("tonemap", self.noisy, "-o", screen)
        self.fails(2, "picture for the screen", *d(screen))
        self.fails(5, 'offers no device "cuda"', *d(plain, "--oidn-device", "cuda"))
        self.assertFalse(os.path.exists(self.out))

    def test_a_library_that_is_none(self):
        d = lambda *o: ("denoise", self.noisy, "-o", self.out, *o)
        for sentence in ("no such file", "scripts/install_oidn.sh"):
            self.fails(3, sentence, *d("--oidn-library", self.path("none.so")))
        self.fails(3, "libOpenImageDenoise.so.2: no such file", *d("--oidn-library", self.folder))
        self.fails(2, "cannot be loaded as a library", *d("--oidn-library", self.write("text.so", "text")))
        with open("/proc/self/maps") as maps:
            libc = next(line.split()[-1] for line in maps if "/libc" in line)
        self.fails(2, "not Open Image Denoise 2: it has no oidnNewDevice", *d("--oidn-library", libc))
        for verb in (("denoise", self.noisy), ("render", self.write("room.xml", ROOM), "--integrator", "denoised")):
            environment = dict(os.environ, OCTRAD_OIDN_LIBRARY=self.path("elsewhere.so"))
            done = subprocess.run([PROGRAM, *verb, "-o", self.out], env=environment, capture_output=True, text=True)
            self.assertEqual(done.returncode, 3)
            self.assertIn("OCTRAD_OIDN_LIBRARY: ", done.stderr)
        self.assertFalse(os.path.exists(self.out))

    @needs_compiler
    def test_a_library_of_another_version(self):
        self.fails(2, "version 3.1.2 of Open Image Denoise, where version 2 is needed", "denoise", self.noisy, "-o", self.out,
                   "--oidn-library", stand_in(self, 30102))
        self.assertFalse(os.path.exists(self.out))

    @needs_compiler
    def test_a_library_that_fails(self):
        """The denoiser breaks while it works: the picture that was rendered is kept, with its noise."""
        broken = stand_in(self, 20501)
        self.fails(5, "Open Image Denoise: out of order", "denoise", self.noisy, "-o", self.out, "--oidn-library", broken)
        self.assertFalse(os.path.exists(self.out))
        scene = self.write("room.xml", ROOM)
        result = self.fails(5, "Open Image Denoise: out of order", "render", scene, "-o", self.out, "--spp", 2, "--denoise", "--oidn-library", broken)
        self.assertIn("is saved with its noise", result.err)
        self.ok("render", scene, "-o", self.path("noisy.exr"), "--spp", 2)
        self.assertEqual(read_exr(self.out)[2], read_exr(self.path("noisy.exr"))[2])
        self.assertNotIn("octrad.denoise", read_exr(self.out)[3])


class DenoisedRendering(Case):
    def setUp(self):
        super().setUp()
        self.scene = self.write("room.xml", ROOM)

    def render(self, name, *options):
        return self.ok("render", self.scene, "-o", self.path(name), "--json", "-q", *options).json()

    @needs_library
    def test_is_a_few_paths_and_the_verb(self):
        log = self.path("log.jsonl")
        report = self.render("a.exr", "--integrator", "denoised", "--log-json", log)
        self.assertEqual((report["spp"], report["integrator"]), (4, "denoised"))
        self.assertGreater(report["denoise_seconds"], 0)
        with open(log) as lines:
            self.assertEqual(json.loads(lines.readlines()[-1])["denoise_seconds"], report["denoise_seconds"])
        self.assertNotIn("denoise_seconds", self.render("noisy.exr", "--spp", 4))
        self.render("b.exr", "--spp", 4, "--denoise")
        self.ok("denoise", self.path("noisy.exr"), "-o", self.path("c.exr"))
        a, b, c = (read_exr(self.path(n))[2] for n in ("a.exr", "b.exr", "c.exr"))
        self.assertEqual(a, b)
        self.assertEqual(a, c)
        self.assertNotEqual(a["R"], read_exr(self.path("noisy.exr"))[2]["R"])

    @needs_library
    def test_comes_nearer_to_the_truth(self):
        for name, options in (("reference", ("--spp", 1024, "--seed", 9)), ("noisy", ("--spp", 4)), ("denoised", ("--integrator", "denoised"))):
            self.render(name + ".exr", *options)
        errors = [i["mape"] for i in self.ok("compare", *(self.path(n + ".exr") for n in ("reference", "noisy", "denoised")), "--json").json()["images"]]
        self.assertLess(errors[1], 0.6 * errors[0])

    @needs_library
    def test_frames_count_the_denoiser(self):
        frames = self.render("a.exr", "--integrator", "denoised", "--frames", 2)["frames"]
        self.assertGreater(frames["stages_ms"]["denoising"], 0)
        self.assertGreaterEqual(frames["median_ms"], frames["stages_ms"]["denoising"])

    @needs_library
    def test_options_reach_the_denoiser(self):
        self.render("a.exr", "--spp", 2, "--denoise", "--denoise-aux", "albedo", "--denoise-quality", "high", "--denoise-prefilter")
        note = json.loads(read_exr(self.path("a.exr"))[3]["octrad.denoise"])
        self.assertEqual((note["aux"], note["quality"], note["prefilter"]), ("albedo", "high", True))

    def test_refusals(self):
        r = ("render", self.scene, "-o", self.path("a.exr"))
        self.fails(1, "--denoise-quality is of use only with --denoise", *r, "--denoise-quality", "fast")
        self.fails(1, "--oidn-library is of use only with --denoise", *r, "--oidn-library", "x.so")
        self.fails(3, "no such file", *r, "--denoise", "--oidn-library", self.path("none.so"))
        self.assertEqual(os.listdir(self.folder), ["room.xml"])


if __name__ == "__main__":
    unittest.main()
