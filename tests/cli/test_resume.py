"""octrad render --resume: the same bits as one uninterrupted run."""
import json
import os
import random
import resource
import signal
import struct
import time
import unittest

from exr import read_exr
from support import PATIENCE, ROOM, Case, holds, read_safetensors, start, wait_for, write_pfm

GAUSSIAN = ROOM.replace('<rfilter type="box"/>', '<rfilter type="gaussian"/>')


class Resume(Case):
    def setUp(self):
        super().setUp()
        self.scene = self.write("room.xml", GAUSSIAN)  # a filter that reaches over pixels: sums depend on the passes
        self.out, self.whole = self.path("out.exr"), self.path("whole.exr")

    def render(self, *options, out=None, scene=None):
        return self.ok("render", scene or self.scene, "-o", out or self.out, "--json", "-q", *options).json()

    def assert_same_bits(self, a=None, b=None):
        a, b = read_exr(a or self.out), read_exr(b or self.whole)
        self.assertEqual(a[:2], b[:2])
        self.assertEqual(a[2], b[2])
        settings = lambda picture: {k: v for k, v in json.loads(picture[3]["octrad.render"]).items() if k != "seconds"}
        self.assertEqual(settings(a), settings(b))

    def samples_saved(self):
        return json.loads(read_safetensors(self.out + ".state")[0]["state"])["samples"] if os.path.exists(self.out + ".state") else 0

    def test_in_parts(self):
        """Also where a part ends inside a pass: 1, 1, 2, 4, 8, ... samples."""
        self.render("--spp", 23, "--resume", out=self.whole)
        before = 0
        for spp in (1, 5, 16, 23):
            report = self.render("--spp", spp, "--resume")
            self.assertEqual((report["spp"], report["resumed_spp"]), (spp, before))
            self.assertFalse(report["interrupted"])
            before = self.samples_saved()
            self.assertLessEqual(before, spp)
        self.assert_same_bits()
        sums = [read_safetensors(file + ".state")[1]["film.sums"] for file in (self.out, self.whole)]
        self.assertEqual(*sums)  # floats hide their last bits
        self.assertEqual(json.loads(read_exr(self.out)[3]["octrad.render"])["spp"], 23)  # merge and info see all of them

    def test_in_halves_with_other_options(self):
        mask = self.path("mask.pfm")
        write_pfm(mask, 32, 24, lambda x, y: (1, 1, 1) if (x // 4 + y // 4) % 3 == 0 else (0, 0, 0))
        for options in (("--crop", "5,3,20,11"), ("--mask", mask), ("--seed", 7, "--threads", 1), ("--max-depth", 3, "--width", 20)):
            with self.subTest(options):
                for file in (self.out, self.out + ".state"):
                    if os.path.exists(file):
                        os.remove(file)
                self.render("--spp", 20, *options, out=self.whole)
                self.render("--spp", 10, "--resume", *options)
                self.render("--spp", 20, "--resume", *options)
                self.assert_same_bits()

    def test_without_a_state_it_starts_anew(self):
        self.render("--spp", 12, out=self.whole)
        self.render("--spp", 6)
        self.assertFalse(os.path.exists(self.out + ".state"))
        self.assertEqual(self.render("--spp", 12, "--resume")["resumed_spp"], 0)
        self.assert_same_bits()

    def test_a_finished_picture_is_not_rendered_again(self):
        self.render("--spp", 6)
        before = os.stat(self.out)
        self.assertEqual(self.render("--spp", 6, "--resume")["spp"], 6)
        self.assertEqual(os.stat(self.out).st_ino, before.st_ino)

    def test_a_picture_with_visible_emitters_is_not_one_without(self):
        """A cache is the same with both, a picture is not: neither a finished one, nor its state, nor parts to merge."""
        hiding = self.write("hiding.xml", GAUSSIAN.replace('<integer name="max_depth"', '<boolean name="hide_emitters" value="true"/><integer name="max_depth"'))
        self.render("--spp", 6, out=self.whole, scene=hiding)
        self.render("--spp", 6)  # leaves no state
        self.render("--spp", 6, "--resume", scene=hiding)
        self.assert_same_bits()
        self.fails(2, "scene", "render", self.scene, "-o", self.out, "--spp", 8, "--resume")
        other = self.path("other.exr")
        self.render("--spp", 6, "--seed", 1, out=other)
        self.fails(2, "differ in their scene", "merge", self.whole, other, "-o", self.path("both.exr"))

    def test_after_an_interrupt(self):
        for options in ((), ("--resume",)):  # what was not asked to be kept is kept when it is interrupted
            with self.subTest(options):
                process = start("render", self.scene, "-o", self.out, "--spp", 100000000, "--log-json", self.path("log"), *options)
                self.assertTrue(wait_for(lambda: os.path.exists(self.path("log")) and os.path.getsize(self.path("log")) > 500))
                process.send_signal(signal.SIGINT)
                _, err = process.communicate(timeout=PATIENCE)
                self.assertEqual(process.returncode, 130, err)
                done = json.loads(read_exr(self.out)[3]["octrad.render"])["spp"]
                self.assertEqual(done, self.samples_saved())
                self.render("--spp", done + 3, out=self.whole)
                self.assertEqual(self.render("--spp", done + 3, "--resume")["resumed_spp"], done)
                self.assert_same_bits()
                for file in (self.out, self.out + ".state", self.path("log")):
                    os.remove(file)

    def test_after_kills_at_any_time(self):
        """Half of them some time after a run without an end has saved its state, half at any moment from the start of one that
        writes its picture soon."""
        chance, saved, shown = random.Random(1), 0, 0
        for i in range(int(os.environ.get("OCTRAD_KILLS", "4"))):
            soon = i % 2 == 0
            process = start("render", self.scene, "-o", self.out, *(("--time", "100ms") if soon else ("--spp", 100000000)), "--resume", "--save-every", "10ms", "-q")
            try:
                if not soon:
                    self.assertTrue(wait_for(lambda: self.samples_saved() > saved))
                time.sleep(chance.uniform(0, 0.3 if soon else 0.1))
                if not soon:
                    self.assertIsNone(process.poll())
            finally:
                process.kill()
                process.communicate(timeout=PATIENCE)
            self.assertIn(process.returncode, (-signal.SIGKILL, 0) if soon else (-signal.SIGKILL,))
            self.assertGreaterEqual(self.samples_saved(), saved if soon else saved + 1)
            saved = self.samples_saved()
            if os.path.exists(self.out):  # whole, like the state
                width, height, channels, texts = read_exr(self.out)
                self.assertEqual((width, height, {len(channel) for channel in channels.values()}), (32, 24, {4 * 32 * 24}))
                shown = json.loads(texts["octrad.render"])["spp"]
                self.assertGreater(shown, 0)
        if shown == 0:  # none was so fast
            self.ok("render", self.scene, "-o", self.out, "--time", "100ms", "--resume", "-q")
            shown = saved = self.samples_saved()
        self.render("--spp", shown, out=self.whole)
        self.assert_same_bits()
        self.render("--spp", saved + 3, out=self.whole)
        self.assertEqual(self.render("--spp", saved + 3, "--resume")["resumed_spp"], saved)
        self.assert_same_bits()

    def test_a_disk_that_fills_keeps_the_picture(self):
        limit = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (55000, limit[1]))  # room for the picture, not for the 73,728 bytes of sums
        try:
            result = self.fails(3, "cannot write " + self.out + ".state", "render", self.scene, "-o", self.out, "--spp", 4, "--resume")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        self.assertIn("4 spp", result.err)
        self.render("--spp", 4, out=self.whole)
        self.assert_same_bits()

    def test_a_part_is_not_the_whole_picture_of_its_size(self):
        """Without a state to go on from, the finished picture is all that is known."""
        part, whole = ("--width", 32, "--height", 24, "--crop", "0,0,16,12"), ("--width", 16, "--height", 12)
        for made, other in ((part, whole), (whole, part)):
            self.render("--spp", 4, *made)
            self.assertEqual(self.render("--spp", 4, "--resume", *made)["resumed_spp"], 4, "it was finished")
            self.assertEqual(self.render("--spp", 4, "--resume", *other)["resumed_spp"], 0)
            os.remove(self.out + ".state")

    def test_a_finished_picture(self):
        """It is left alone where all settings are its own, and the log says so."""
        self.render("--spp", 4, "--rr-depth", 2)
        log = self.path("log.jsonl")
        self.assertEqual(self.render("--spp", 4, "--rr-depth", 2, "--resume", "--log-json", log)["resumed_spp"], 4)
        with open(log) as lines:
            done = [json.loads(line) for line in lines][-1]
        self.assertEqual((done["event"], done["spp"], done["resumed_spp"]), ("done", 4, 4))
        self.assertEqual(self.render("--spp", 4, "--rr-depth", 3, "--resume")["resumed_spp"], 0)

    def test_other_settings_are_refused(self):
        self.render("--spp", 4, "--resume")
        with open(self.out, "rb") as file:
            before = file.read()
        r = ("render", self.scene, "-o", self.out, "--resume", "--spp", 8)
        for what, options in (("camera", ("--fov", 30)), ("size", ("--width", 16)), ("size", ("--crop", "0,0,8,8")), ("seed", ("--seed", 4)),
                              ("max_depth", ("--max-depth", 2)), ("rr_depth", ("--rr-depth", 2)), ("scene", ("-D", "wall=0.25"))):
            result = self.fails(2, "cannot be continued with other settings: " + what, *r, *options)
            self.assertIn(self.out + ".state", result.err)
        box = self.write("box.xml", ROOM)
        self.fails(2, "filter", "render", box, "-o", self.out, "--resume", "--spp", 8)
        self.fails(2, "has 4 samples a pixel already, more than the 2 asked for", "render", self.scene, "-o", self.out, "--resume", "--spp", 2)
        with open(self.out + ".state", "rb") as file:
            sound = file.read()
        for broken in (b"", b"nothing", b"\x08" + bytes(7) + b"{}      "):
            with open(self.out + ".state", "wb") as file:
                file.write(broken)
            self.assertIn(".state", self.fails(2, "", *r).err)
        flipped = bytearray(sound)
        flipped[-5] ^= 16
        with open(self.out + ".state", "wb") as file:
            file.write(flipped)
        self.assertIn(self.out + ".state", self.fails(2, "damaged", *r).err)
        for number in (b"0", b"1.5", b"1e300", b"-4", b"9000000000000"):
            header = sound[8:8 + struct.unpack("<Q", sound[:8])[0]].replace(b"checksums", b"unchecked")
            wrong = header.replace(b'samples\\":4', b'samples\\":' + number)
            self.assertNotEqual(wrong, header)
            with open(self.out + ".state", "wb") as file:
                file.write(struct.pack("<Q", len(wrong)) + wrong + sound[8 + len(header):])
            self.fails(2, "samples must be a whole number", *r)
        with open(self.out, "rb") as file:
            self.assertEqual(file.read(), before)

    def test_options_that_need_each_other(self):
        r = ("render", self.scene, "-o", self.out)
        self.fails(1, "only with --resume", *r, "--save-every", "1m")
        self.fails(1, "/dev/null is not a file", "render", self.scene, "-o", "/dev/null", "--resume")
        self.fails(1, "duration", *r, "--resume", "--save-every", "soon")
        self.fails(1, "--resume", *r, "--integrator", "lhs", "--model", "x.octrad", "--resume")

    def test_an_interrupted_run_keeps_a_better_picture(self):
        self.render("--spp", 3000)
        process = start("render", self.scene, "-o", self.out, "--spp", 100000000, "--resume", "--log-json", self.path("log"))
        self.assertTrue(wait_for(lambda: holds(self.path("log"), "progress")))
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 130, err)
        self.assertGreaterEqual(json.loads(read_exr(self.out)[3]["octrad.render"])["spp"], 3000)

    def spp_on_disk(self):
        return json.loads(read_exr(self.out)[3]["octrad.render"])["spp"]

    def test_a_better_picture_stays(self):
        """Where the state was removed, or is older than the picture."""
        self.render("--spp", 4, "--resume")
        older = self.path("older")
        os.rename(self.out + ".state", older)
        self.render("--spp", 64)
        result = self.ok("render", self.scene, "-o", self.out, "--resume", "--time", "1ms", "--max-depth", 6)
        self.assertIn("the file, which has more samples", result.err)
        self.assertEqual(self.spp_on_disk(), 64)
        os.replace(older, self.out + ".state")
        self.assertEqual(self.render("--spp", 16, "--resume")["spp"], 64)  # was finished
        self.assertEqual(self.spp_on_disk(), 64)

    def test_merged_pictures_are_no_beginning(self):
        a, b = self.path("a.exr"), self.path("b.exr")
        for seed, file in ((1, a), (2, b)):
            self.render("--spp", 8, "--seed", seed, out=file)
        self.ok("merge", a, b, "-o", self.out)
        self.fails(1, "merged from several pictures", "render", self.scene, "-o", self.out, "--resume", "--spp", 4, "--seed", 1)
        self.assertEqual(self.spp_on_disk(), 16)

    def test_sampling_weights_are_part_of_a_beginning(self):
        self.render("--spp", 4, "--resume")
        text = GAUSSIAN.replace('<emitter type="area">', '<emitter type="area"><float name="sampling_weight" value="5"/>')
        self.fails(2, "sampling_weights", "render", self.write("weights.xml", text), "-o", self.out, "--resume", "--spp", 8)

    def test_behind_a_link(self):
        link = self.path("link.exr")
        self.render("--spp", 8, "--resume")
        os.symlink(self.out, link)
        self.assertEqual(self.render("--spp", 16, "--resume", out=link)["resumed_spp"], 8)
        self.assertFalse(os.path.exists(link + ".state"))

    def test_one_at_a_time(self):
        process = start("render", self.scene, "-o", self.out, "--spp", 100000000, "--resume", "--log-json", self.path("log"))
        self.assertTrue(wait_for(lambda: os.path.exists(self.path("log")) and os.path.getsize(self.path("log")) > 0))
        try:
            self.fails(3, self.out, "render", self.scene, "-o", self.out, "--spp", 4, "--resume")
        finally:
            process.kill()
            process.communicate()


if __name__ == "__main__":
    unittest.main()
