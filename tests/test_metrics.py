#!/usr/bin/env python3
"""SSIM, FLIP, LPIPS and the errors by two references of `octrad compare`, against numpy in double precision, against numbers of
the authors' own packages, and against these packages themselves where they are installed. Usage: OCTRAD=path/to/octrad test_metrics.py"""
import collections
import io
import json
import os
import pathlib
import pickle
import struct
import subprocess
import sys
import tempfile
import types
import unittest
import unittest.mock
import zipfile
import zlib

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("OCTRAD", str(ROOT / "build" / "octrad"))
sys.path.insert(0, str(ROOT / "scripts"))
import convert_lpips  # noqa: E402

SHARED = pathlib.Path(os.environ.get("OCTRAD_SHARED", ROOT.parent / "shared")) / "lpips"
os.environ.pop("OCTRAD_LPIPS_WEIGHTS", None)

# name: (width, height, how bright its bright quarter is)
PICTURES = {"dim": (130, 100, 1.0), "lamp": (160, 96, 30.0), "sun": (150, 200, 1000.0), "tall": (65, 133, 4.0)}
# Of picture(name), by flip-evaluator 1.7 (67 pixels per degree; HDR of the linear values, LDR of the sRGB ones) and by
# lpips 0.1.4 with PyTorch 1.13 (of the sRGB values; weights of ../shared/lpips).
FLIP_HDR = {"dim": 0.127318, "lamp": 0.148525, "sun": 0.144088, "tall": 0.145992}
FLIP_LDR = {"dim": 0.134185, "lamp": 0.141188, "sun": 0.134132, "tall": 0.137717}
LPIPS = {"alex": {"dim": 0.127355, "lamp": 0.130219, "sun": 0.144169, "tall": 0.15947},
         "squeeze": {"dim": 0.257717, "lamp": 0.233994, "sun": 0.253687, "tall": 0.295049}}


def picture(name):
    """Linear radiance of a reference and of a picture that differs: float32 [height, width, 3]."""
    width, height, bright = PICTURES[name]
    y, x = np.mgrid[0:height, 0:width].astype(np.float64)
    reference = np.stack([0.4 + 0.3 * np.sin(x / 9 + y / 17), 0.3 + 0.25 * np.cos(x / 23), 0.5 * ((x // 16 + y // 16) % 2) + 0.1], axis=-1)
    reference[height // 4:height // 2, width // 4:width // 2] *= bright
    reference[-height // 5:, :width // 3] *= 0.02
    noise = np.modf(np.abs(np.sin(x[..., None] * 12.9898 + y[..., None] * 78.233 + np.arange(3) * 37.7) * 43758.5453))[0] - 0.5
    image = reference * (1 + noise * (x[..., None] > width / 2)) * np.array([1.0, 0.97, 1.05])
    return reference.astype(np.float32), image.astype(np.float32)


def encode(linear):
    v = np.clip(linear.astype(np.float64), 0, 1)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * np.maximum(v, 1e-9) ** (1 / 2.4) - 0.055)


def write_pfm(path, pixels):
    with open(path, "wb") as out:
        out.write(b"PF\n%d %d\n-1.0\n" % (pixels.shape[1], pixels.shape[0]))
        out.write(pixels[::-1].astype("<f4").tobytes())


def write_png(path, pixels):
    """16-bit RGB: values in [0, 1]."""
    rows = np.round(pixels * 65535).astype(">u2")
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    with open(path, "wb") as out:
        out.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 16, 2, 0, 0, 0)))
        out.write(chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows))) + chunk(b"IEND", b""))


def write_safetensors(path, tensors):
    header, data = {}, b""
    for name, values in tensors.items():
        raw = values.astype("<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(values.shape), "data_offsets": [len(data), len(data) + len(raw)]}
        data += raw
    text = json.dumps(header).encode()
    pathlib.Path(path).write_bytes(struct.pack("<Q", len(text)) + text + data)


def read_safetensors(path):
    raw = pathlib.Path(path).read_bytes()
    size = struct.unpack("<Q", raw[:8])[0]
    return {name: np.frombuffer(raw[8 + size + t["data_offsets"][0]:8 + size + t["data_offsets"][1]], "<f4").reshape(t["shape"])
            for name, t in json.loads(raw[8:8 + size]).items() if name != "__metadata__"}


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="octrad-metrics-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def files(self, name, encoded=False):
        made = []
        for kind, pixels in zip(("reference", "image"), picture(name)):
            made.append(str(self.folder / ("%s-%s.%s" % (name, kind, "png" if encoded else "pfm"))))
            (write_png if encoded else write_pfm)(made[-1], encode(pixels) if encoded else pixels)
        return made

    def compare(self, *arguments):
        done = subprocess.run([PROGRAM, "compare", *map(str, arguments), "--json"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)["images"][0]


class Ssim(Case):
    def test_against_double_precision(self):
        for name in PICTURES:
            a, b = (encode(p) for p in picture(name))
            taps = np.exp(-np.arange(-5, 6) ** 2 / (2 * 1.5 ** 2))
            taps = np.outer(taps, taps) / taps.sum() ** 2
            windows = lambda v: np.lib.stride_tricks.sliding_window_view(v, (11, 11), axis=(0, 1))
            mean = lambda v: (windows(v) * taps).sum(axis=(-1, -2))
            ma, mb = mean(a), mean(b)
            va, vb, cov = mean(a * a) - ma ** 2, mean(b * b) - mb ** 2, mean(a * b) - ma * mb
            expected = ((2 * ma * mb + 1e-4) * (2 * cov + 9e-4) / ((ma ** 2 + mb ** 2 + 1e-4) * (va + vb + 9e-4))).mean()
            with self.subTest(name):
                self.assertAlmostEqual(self.compare(*self.files(name))["ssim"], expected, places=5)


class Flip(Case):
    def test_stored_numbers(self):
        self.assertEqual((set(FLIP_HDR), set(FLIP_LDR)), (set(PICTURES), set(PICTURES)))
        for name in PICTURES:
            with self.subTest(name):
                hdr, ldr = self.compare(*self.files(name)), self.compare(*self.files(name, encoded=True))
                self.assertEqual((hdr["flip_range"], ldr["flip_range"]), ("hdr", "ldr"))
                self.assertAlmostEqual(hdr["flip"], FLIP_HDR[name], delta=1e-3)
                self.assertAlmostEqual(ldr["flip"], FLIP_LDR[name], delta=1e-3)

    def test_against_flip_evaluator(self):
        try:
            import flip_evaluator
        except ImportError:
            self.skipTest("flip-evaluator is not installed")
        for name in PICTURES:
            for ppd in (67.0, 20.0, 110.0):
                a, b = picture(name)
                hdr = flip_evaluator.evaluate(a, b, "HDR", applyMagma=False, parameters={"ppd": ppd})[1]
                ldr = flip_evaluator.evaluate(encode(a).astype(np.float32), encode(b).astype(np.float32), "LDR", applyMagma=False, parameters={"ppd": ppd})[1]
                with self.subTest("%s, %g pixels per degree: %.6f %.6f" % (name, ppd, hdr, ldr)):
                    self.assertAlmostEqual(self.compare(*self.files(name), "--flip-ppd", ppd)["flip"], hdr, delta=1e-3)
                    self.assertAlmostEqual(self.compare(*self.files(name, encoded=True), "--flip-ppd", ppd)["flip"], ldr, delta=1e-3)
                    if ppd == 67.0:
                        self.assertAlmostEqual(FLIP_HDR[name], hdr, delta=1e-5)
                        self.assertAlmostEqual(FLIP_LDR[name], ldr, delta=1e-5)

    def test_properties(self):
        files = self.files("dim")
        self.assertEqual(self.compare(files[0], files[0])["flip"], 0)
        black = str(self.folder / "black.pfm")
        write_pfm(black, np.zeros((100, 130, 3)))
        self.assertEqual(self.compare(black, files[0])["flip"], 0)  # without light there is no exposure to look at
        self.assertGreater(self.compare(files[0], black)["flip"], 0.5)
        # Half a black reference has the median 0: exposures follow the rest of it.
        half = picture("dim")[0]
        half[60:] = 0
        write_pfm(black, half)
        self.assertTrue(0 < self.compare(black, files[1])["flip"] < 1)


def features(tensors, net, displayed):
    """The taps of the network, in double precision: a list of [channels, height, width]."""
    windows = lambda v, k: np.lib.stride_tricks.sliding_window_view(v, (k, k), axis=(1, 2))

    def convolve(v, name, stride=1, padding=0):
        w = tensors[name + ".weight"].astype(np.float64)
        v = np.pad(v, ((0, 0), (padding, padding), (padding, padding)))
        return np.maximum(np.einsum("chwyx,ocyx->ohw", windows(v, w.shape[2])[:, ::stride, ::stride], w) + tensors[name + ".bias"][:, None, None], 0)

    def pool(v, round_up=False):
        if round_up:  # a last window may reach over the border
            v = np.pad(v, ((0, 0), (0, 1 - v.shape[1] % 2), (0, 1 - v.shape[2] % 2)), constant_values=-np.inf)
        return windows(v, 3)[:, ::2, ::2].max(axis=(-1, -2))

    def fire(v, number):
        squeezed = convolve(v, "features.%d.squeeze" % number)
        return np.concatenate([convolve(squeezed, "features.%d.expand1x1" % number), convolve(squeezed, "features.%d.expand3x3" % number, 1, 1)])

    v = (2 * displayed.transpose(2, 0, 1) - 1 - np.array([-.030, -.088, -.188])[:, None, None]) / np.array([.458, .448, .450])[:, None, None]
    if net == "alex":
        one = convolve(v, "features.0", 4, 2)
        two = convolve(pool(one), "features.3", 1, 2)
        three = convolve(pool(two), "features.6", 1, 1)
        four = convolve(three, "features.8", 1, 1)
        return [one, two, three, four, convolve(four, "features.10", 1, 1)]
    taps = [convolve(v, "features.0", 2)]
    for first, second in ((3, 4), (6, 7)):
        taps.append(fire(fire(pool(taps[-1], True), first), second))
    taps.append(fire(pool(taps[-1], True), 9))
    for number in (10, 11, 12):
        taps.append(fire(taps[-1], number))
    return taps


def distance_maps(tensors, net, a, b):
    maps = []
    for i, (ta, tb) in enumerate(zip(features(tensors, net, a), features(tensors, net, b))):
        unit = lambda t: t / (np.sqrt((t ** 2).sum(axis=0)) + 1e-10)
        maps.append(((unit(ta) - unit(tb)) ** 2 * tensors["lin%d.model.1.weight" % i][0].astype(np.float64)).sum(axis=0))
    return maps


def enlarged(small, height, width):
    """Bilinear, pixel centres aligned, as torch.nn.Upsample(align_corners=False)."""
    def along(v, n):
        at = np.maximum((np.arange(n) + 0.5) * len(v) / n - 0.5, 0)
        low = np.minimum(at.astype(int), len(v) - 1)
        t = (at - low)[:, None]
        return v[low] * (1 - t) + v[np.minimum(low + 1, len(v) - 1)] * t
    return along(along(small, height).T, width).T


def all_shapes(net):
    """The tensors of a network and its linear part, and their shapes."""
    network, linear = convert_lpips.shapes(net)
    return dict(network, **linear)


class Lpips(Case):
    def weights(self, net):
        """Random ones that keep the size of what goes through them."""
        random = np.random.default_rng(5)
        tensors = {}
        for name, shape in all_shapes(net).items():
            if name.startswith("lin"):
                tensors[name] = random.uniform(0, 1, shape).astype(np.float32)
            elif name.endswith("bias"):
                tensors[name] = random.normal(0, 0.1, shape).astype(np.float32)
            else:
                tensors[name] = (random.normal(0, 1, shape) * np.sqrt(2 / np.prod(shape[1:]))).astype(np.float32)
        write_safetensors(self.folder / ("lpips_%s_v0.1.safetensors" % net), tensors)
        return tensors

    def test_random_weights_against_double_precision(self):
        for net in ("alex", "squeeze"):
            tensors = self.weights(net)
            for name in ("dim", "tall"):
                a, b = (encode(p) for p in picture(name))
                maps = distance_maps(tensors, net, a, b)
                options = ("--lpips-weights", self.folder, "--lpips-net", net)
                files = self.files(name)
                with self.subTest("%s %s" % (net, name)):
                    result = self.compare(*files, *options)
                    self.assertEqual(result["lpips_net"], net)
                    self.assertAlmostEqual(result["lpips"] / sum(m.mean() for m in maps), 1, delta=1e-4)
                    mask = np.zeros(a.shape)
                    mask[10:37, 5:50] = 1
                    write_pfm(self.folder / "mask.pfm", mask)
                    expected = sum(enlarged(m, *a.shape[:2])[10:37, 5:50].mean() for m in maps)
                    self.assertAlmostEqual(self.compare(*files, *options, "--mask", self.folder / "mask.pfm")["lpips"] / expected, 1, delta=1e-4)
            self.assertEqual(self.compare(*self.files("dim"), *options, "--threads", 1), self.compare(*self.files("dim"), *options, "--threads", 2))

    def test_stored_numbers(self):
        if not SHARED.is_dir():
            self.skipTest("no weights in %s" % SHARED)
        for net, stored in LPIPS.items():
            self.assertEqual(set(stored), set(PICTURES))
            for name in PICTURES:
                with self.subTest("%s %s" % (net, name)):
                    for encoded in (False, True):
                        result = self.compare(*self.files(name, encoded), "--lpips-weights", SHARED, "--lpips-net", net)
                        self.assertAlmostEqual(result["lpips"], stored[name], delta=1e-3)

    def test_against_the_package(self):
        try:
            import lpips
            import torch
        except ImportError:
            self.skipTest("lpips and PyTorch are not installed")
        if not SHARED.is_dir():
            self.skipTest("no weights in %s" % SHARED)
        for net in LPIPS:
            tensors = read_safetensors(SHARED / ("lpips_%s_v0.1.safetensors" % net))
            model = lpips.LPIPS(net=net, pretrained=False, pnet_rand=True, verbose=False).eval()
            state = model.state_dict()
            for key in state:  # net.slice2.3.weight, lin0.model.1.weight, lins.0.model.1.weight
                source = ("features." + key.split(".", 2)[2] if key.startswith("net.") else
                          "lin" + key.split(".", 1)[1] if key.startswith("lins.") else key)
                if source in tensors:
                    state[key] = torch.from_numpy(tensors[source].copy())
            model.load_state_dict(state)
            for name in PICTURES:
                pair = [torch.from_numpy(encode(p).astype(np.float32)).permute(2, 0, 1)[None] for p in picture(name)]
                with torch.no_grad():
                    expected = float(model(*pair, normalize=True))
                with self.subTest("%s %s: %.6f" % (net, name, expected)):
                    self.assertAlmostEqual(self.compare(*self.files(name), "--lpips-weights", SHARED, "--lpips-net", net)["lpips"], expected, delta=1e-3)
                    self.assertAlmostEqual(LPIPS[net].get(name, 0), expected, delta=1e-5)

    def test_weights_that_are_missing_or_broken(self):
        files, file = self.files("dim"), self.folder / "lpips_alex_v0.1.safetensors"
        run = lambda *options: subprocess.run([PROGRAM, "compare", *files, "--json", *map(str, options)], capture_output=True, text=True)
        without = run()
        self.assertIsNone(json.loads(without.stdout)["images"][0]["lpips"])
        self.assertIn("scripts/convert_lpips.py", without.stderr)
        self.assertTrue(all(json.loads(without.stdout)["images"][0][key] is not None for key in ("mape", "ssim", "flip", "psnr", "mean_ratio")))
        gone = run("--lpips-weights", self.folder)
        self.assertEqual((gone.returncode, gone.stdout), (3, ""))
        self.assertIn(file.name, gone.stderr)
        self.weights("alex")
        whole = file.read_bytes()
        for broken, why in ((whole[:1000], ""), (whole[:-100], ""), (b"", ""), (whole.replace(b"features.10.bias", b"features.10.bios"), "features.10.bias"),
                            (whole[:-4] + struct.pack("<f", float("nan")), "finite"), (whole.replace(b"[1, 192, 1, 1]", b"[192, 1, 1, 1]"), "lin1")):
            file.write_bytes(broken)
            result = run("--lpips-weights", self.folder)
            self.assertEqual((result.returncode, result.stdout), (2, ""), result.stderr)
            self.assertIn(file.name, result.stderr)
            self.assertIn(why, result.stderr)

    def test_environment_and_small_pictures(self):
        self.weights("alex")
        files = self.files("dim")
        try:
            os.environ["OCTRAD_LPIPS_WEIGHTS"] = str(self.folder)
            self.assertGreater(self.compare(*files)["lpips"], 0)
            small = str(self.folder / "small.pfm")
            write_pfm(small, np.ones((40, 30, 3)))
            self.assertIsNone(self.compare(small, small)["lpips"])
            write_pfm(small, np.ones((40, 31, 3)))
            self.assertEqual(self.compare(small, small)["lpips"], 0)
        finally:
            del os.environ["OCTRAD_LPIPS_WEIGHTS"]


class Converter(Case):
    """scripts/convert_lpips.py on files as torch.save() writes them, in both of its formats."""

    def save(self, path, tensors, archive):
        torch, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")
        torch.FloatStorage = type("FloatStorage", (), {"__module__": "torch"})
        utils._rebuild_tensor_v2 = type("_rebuild_tensor_v2", (), {"__module__": "torch._utils"})
        storages = []

        class Storage(bytes):
            pass

        class Tensor:
            def __init__(self, values):
                self.values = values

            def __reduce__(self):
                storages.append(Storage(b"\0" * 8 + self.values.astype("<f4").tobytes()))  # not at the storage's beginning
                stride = tuple(s // 8 for s in np.empty(self.values.shape).strides)
                return utils._rebuild_tensor_v2, (storages[-1], 2, self.values.shape, stride, False, collections.OrderedDict())

        class Pickler(pickle.Pickler):
            def persistent_id(self, value):
                if isinstance(value, Storage):
                    key = str(next(i for i, s in enumerate(storages) if s is value))
                    return ("storage", torch.FloatStorage, key, "cpu", len(value) // 4) + (() if archive else (None,))
                return None

        out = io.BytesIO()
        with unittest.mock.patch.dict(sys.modules, {"torch": torch, "torch._utils": utils}):
            if not archive:
                for head in (0x1950a86a20f9469cfc6c, 1001, {"little_endian": True}):
                    pickle.dump(head, out, 2)
            Pickler(out, 2).dump(collections.OrderedDict((name, Tensor(values)) for name, values in tensors.items()))
        if archive:
            with zipfile.ZipFile(path, "w") as file:
                file.writestr("model/data.pkl", out.getvalue())
                for i, storage in enumerate(storages):
                    file.writestr("model/data/%d" % i, storage)
        else:
            pickle.dump([str(i) for i in range(len(storages))], out, 2)
            for storage in storages:
                out.write(struct.pack("<q", len(storage) // 4) + storage)
            pathlib.Path(path).write_bytes(out.getvalue())

    def convert(self, *arguments):
        return subprocess.run([sys.executable, ROOT / "scripts" / "convert_lpips.py", *map(str, arguments)], capture_output=True, text=True)

    def test_both_formats(self):
        random = np.random.default_rng(3)
        tensors = {name: random.normal(0, 0.1, shape).astype(np.float32) for name, shape in all_shapes("squeeze").items()}
        network, linear, wheel = (self.folder / name for name in ("network.pth", "linear.pth", "lpips.whl"))
        is_linear = lambda name: name.startswith("lin")
        self.save(linear, {n: v for n, v in tensors.items() if is_linear(n)}, False)
        with zipfile.ZipFile(wheel, "w") as file:
            file.write(linear, "lpips/weights/v0.1/squeeze.pth")
        for archive, source in ((True, linear), (False, wheel)):
            self.save(network, dict({n: v for n, v in tensors.items() if not is_linear(n)}, **{"classifier.1.weight": np.ones((10, 5))}), archive)
            done = self.convert("--net", "squeeze", "--network", network, "--linear", source, "-o", self.folder / "made")
            self.assertEqual(done.returncode, 0, done.stderr)
            made = read_safetensors(self.folder / "made" / "lpips_squeeze_v0.1.safetensors")
            self.assertEqual(set(made), set(tensors))
            for name, values in tensors.items():
                np.testing.assert_array_equal(made[name], values)
            self.assertGreater(self.compare(*self.files("dim"), "--lpips-weights", self.folder / "made", "--lpips-net", "squeeze")["lpips"], 0)
        for arguments, why in ((("--network", network, "--linear", linear), "not [64, 3, 11, 11]"),  # of AlexNet by default
                               (("--net", "squeeze", "--network", linear, "--linear", linear), "features.0.weight"),
                               (("--net", "squeeze", "--network", self.folder / "none.pth", "--linear", linear), "No such file"),
                               (("--net", "squeeze", "--network", PROGRAM, "--linear", linear), "cannot be read")):
            done = self.convert(*arguments, "-o", self.folder / "bad")
            self.assertEqual(done.returncode, 1)
            self.assertIn(why, done.stderr)
            self.assertNotIn("Traceback", done.stderr)
        self.assertFalse((self.folder / "bad").exists())

    def test_nothing_is_executed(self):
        class Command:
            def __reduce__(self):
                return os.mkdir, (str(folder),)
        folder, bad = self.folder / "executed", self.folder / "bad.pth"
        with zipfile.ZipFile(bad, "w") as file:
            file.writestr("model/data.pkl", pickle.dumps({"features.0.weight": Command()}, 2))
        done = self.convert("--network", bad, "--linear", bad, "-o", self.folder)
        self.assertIn("mkdir", done.stderr)
        self.assertFalse(folder.exists())


if __name__ == "__main__":
    unittest.main()
