"""--device on a machine with or without a GPU, and what octrad info says about it."""
import os
import shutil
import subprocess
import unittest
from unittest import mock

from support import ROOM, SMALL, Case, read_safetensors, write_hdr

# A driver library that answers what a machine without a working GPU would: a version, and "no device" to everything else.
DRIVER = r"""
#include <stdint.h>
#include <string.h>
static int none(void) { return 100; }
int cuInit(unsigned flags) { return 100; }
int cuDriverGetVersion(int* version) { *version = VERSION; return 0; }
int cuGetProcAddress(const char* name, void** function, int version, uint64_t flags) {
  if (strcmp(name, "cuDriverGetVersion") == 0) *function = (void*)cuDriverGetVersion;
  else if (strncmp(name, "cuGetProcAddress", 16) == 0) *function = (void*)cuGetProcAddress;
  else *function = (void*)none;
  return 0;
}
int cuGetProcAddress_v2(const char* name, void** function, int version, uint64_t flags, int* result) {
  if (result) *result = 0;
  return cuGetProcAddress(name, function, version, flags);
}
"""


class Device(Case):
    sees_gpus = True

    def info(self, *options):
        return self.ok("info", "--json", *options).json()

    def test_info_says_what_there_is(self):
        info = self.info()
        self.assertEqual(info["built_with_cuda"], info["runtime"] is not None)
        self.assertEqual(info["built_with_cuda"], info["architectures"] is not None)
        self.assertEqual(info["devices"] == [], info["why_none"] is not None)
        self.assertIn("selftest", info["device_verbs"])
        usable = [d for d in info["devices"] if d["usable"]]
        self.assertEqual(info["auto"]["device"], usable[0]["device"] if usable else "cpu")
        if not info["devices"]:
            self.assertEqual(info["auto"]["why"], info["why_none"])
        text = self.ok("info").out
        self.assertIn("CUDA ", text)
        self.assertIn("auto is " + info["auto"]["device"], text)

    def test_cpu_can_always_be_asked_for(self):
        self.assertEqual(self.info("--device", "cpu")["auto"], {"device": "cpu", "why": "asked for"})

    def test_a_device_that_is_not_there(self):
        info = self.info()
        if not info["devices"]:
            for word in ("cuda", "cuda:0", "cuda:3"):
                self.fails(5, "--device %s: %s" % (word, info["why_none"]), "info", "--device", word)
                self.fails(5, info["why_none"], "selftest", "--device", word)
        else:
            self.fails(5, "there is no device %d" % len(info["devices"]), "info", "--device", "cuda:%d" % len(info["devices"]))

    @unittest.skipUnless(shutil.which("cc"), "no C compiler")
    def test_drivers_that_are_of_no_use(self):
        if not self.info()["built_with_cuda"]:
            self.skipTest("built without CUDA")
        source, library = self.write("driver.c", DRIVER), self.path("libcuda.so.1")
        scene = self.write("room.xml", ROOM)
        with mock.patch.dict(os.environ, LD_LIBRARY_PATH=self.folder):
            for version, why in ((None, "no NVIDIA driver is installed"), (13090, "the NVIDIA driver found no CUDA device"),
                                 (12040, "the NVIDIA driver supports CUDA 12.4; this program needs 13.")):
                with self.subTest(version=version):
                    code = self.write("empty.c", "int nothing;") if version is None else source
                    subprocess.run(["cc", "-w", "-shared", "-fPIC", "-DVERSION=%s" % version, code, "-o", library], check=True)
                    info = self.info()
                    self.assertEqual(info["devices"], [])
                    self.assertIn(why, info["auto"]["why"])
                    self.fails(5, why, "info", "--device", "cuda")
                    self.ok("render", scene, "-o", self.path("a.exr"), "--spp", "1")

    def test_verbs_that_run_on_the_cpu_only_say_so(self):
        info = self.info()
        why = "runs on the CPU only" if any(d["usable"] for d in info["devices"]) else info["why_none"] or "compute capability"
        picture = self.path("a.hdr")
        write_hdr(picture, 4, 2, lambda x, y: (0.5, 0.5, 0.5))
        scene = self.write("room.xml", ROOM)
        for verb, words in (("compare", [picture, picture]), ("tonemap", [picture, "-o", self.path("a.png")]),
                            ("train", [scene, "-o", self.path("m.octrad"), "--steps", "1"]), ("render", [scene, "-o", self.path("a.exr"), "--spp", "1"])):
            if verb not in info["device_verbs"]:
                with self.subTest(verb=verb):
                    self.fails(5, why, verb, *words, "--device", "cuda")
                    self.assertEqual(set(os.listdir(self.folder)), {"a.hdr", "room.xml"})

    def test_work_that_needs_a_device_writes_nothing_without_one(self):
        info = self.info()
        if any(d["usable"] for d in info["devices"]):
            self.skipTest("there is a GPU")
        why = info["why_none"] or "compute capability"
        scene, model = self.write("room.xml", ROOM), self.path("m.octrad")
        self.ok("train", scene, "-o", model, "--steps", "2", *SMALL)
        points = self.write("points.csv", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n0.1,-1,0.2,0,1,0,0,1,0,0.5,0.6,0.4,1\n")
        with open(model, "rb") as file:
            before = file.read()
        files = set(os.listdir(self.folder))
        log = ("--log-json", self.path("log.jsonl"))
        for words in (("train", scene, "-o", self.path("new.octrad"), "--steps", "1"), ("train", scene, "-o", model, "--resume", "--steps", "4"),
                      ("train", scene, "-o", self.path("new.octrad"), "--steps", "1", "--deterministic"),
                      ("render", scene, "-o", self.path("a.exr"), "--spp", "1"), ("render", scene, "--model", model, "-o", self.path("a.exr"), "--frames", "3"),
                      ("render", scene, "--model", model, "--integrator", "disparity", "-o", self.path("a.exr")),
                      ("query", model, "--points", points, "-o", self.path("out.csv"))):
            for device in ("cuda", "cuda:0"):
                with self.subTest(words=words, device=device):
                    self.fails(5, why, *words, *(() if words[0] == "query" else log), "--device", device)
                    self.assertEqual(set(os.listdir(self.folder)), files)
        with open(model, "rb") as file:
            self.assertEqual(file.read(), before)

    def test_frames_are_timed_on_the_device_in_use(self):
        scene = self.write("room.xml", ROOM)
        for word in ("0", "-3", "many"):
            self.fails(1, "--frames", "render", scene, "-o", self.path("a.exr"), "--frames", word)
        self.assertEqual(os.listdir(self.folder), ["room.xml"])
        report = self.ok("render", scene, "-o", self.path("a.exr"), "--frames", "5", "--spp", "1", "--device", "cpu", "--json").json()
        self.assertEqual(report["frames"]["count"], 5)
        self.assertGreater(report["frames"]["median_ms"], 0)
        self.assertGreaterEqual(report["frames"]["p95_ms"], report["frames"]["median_ms"])
        self.assertEqual(set(report["frames"]["stages_ms"]), {"samples", "tone mapping"})

    def test_deterministic_is_what_the_cpu_is(self):
        scene = self.write("room.xml", ROOM)
        tensors = []
        for name, words in (("a.octrad", ()), ("b.octrad", ("--deterministic",))):
            self.ok("train", scene, "-o", self.path(name), "--steps", "5", "--device", "cpu", *SMALL, *words)
            tensors.append(read_safetensors(self.path(name))[1])
        self.assertEqual(tensors[0], tensors[1])
        self.fails(1, "--deterministic", "render", scene, "-o", self.path("a.exr"), "--deterministic")

    def test_reports_name_the_device(self):
        scene, model = self.write("room.xml", ROOM), self.path("m.octrad")
        points = self.write("points.csv", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n0.1,-1,0.2,0,1,0,0,1,0,0.5,0.6,0.4,1\n")
        for words in (("train", scene, "-o", model, "--steps", "2", *SMALL), ("render", scene, "-o", self.path("a.exr"), "--spp", "1"),
                      ("query", model, "--points", points, "-o", self.path("out.csv"))):
            with self.subTest(words[0]):
                report = self.ok(*words, "--device", "cpu", "--json").json()
                self.assertEqual(report["device"], "cpu")
                self.assertNotIn("device_peak_bytes", report)

    def test_work_says_its_device(self):
        scene = self.write("room.xml", ROOM)
        for word in ("auto", "cpu"):
            if word == "cpu" or self.info()["auto"]["device"] == "cpu":
                self.assertIn("device cpu (", self.ok("render", scene, "-o", self.path("a.exr"), "--spp", "1", "-v", "--device", word).err)


if __name__ == "__main__":
    unittest.main()
