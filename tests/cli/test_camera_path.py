"""octrad render --path: the frames of a moving camera."""
import json
import os
import signal
import unittest

from exr import read_exr
from support import PATIENCE, ROOM, Case, start, wait_for

KEYS = [{"origin": [0, 0, 0.9], "target": [0, -0.2, 0], "fov": 60}, {"origin": [0.5, 0.1, 0.6], "target": [0, -0.2, 0], "fov": 40},
        {"origin": [0.2, 0.4, 0.3], "target": [0, -0.2, 0], "fov": 50}]


class CameraPath(Case):
    def setUp(self):
        super().setUp()
        self.scene = self.write("room.xml", ROOM)
        self.pattern = self.path("frame_###.exr")

    def path_file(self, **content):
        return self.write("path.json", json.dumps(dict({"keys": KEYS}, **content)))

    def command(self, path, *options, pattern=None):
        return ("render", self.scene, "--path", path, "-o", pattern or self.pattern, "--spp", 2, *options)

    def frames(self):
        return sorted(name for name in os.listdir(self.folder) if name.startswith("frame_"))

    def camera(self, frame):
        return json.loads(read_exr(self.path("frame_%03d.exr" % frame))[3]["octrad.camera"])

    def test_frames_are_pictures_of_the_cameras_on_the_way(self):
        path = self.path_file(frames=5)
        report = self.ok(*self.command(path, "--seed", 10, "--json", "-q")).json()
        self.assertEqual(report["path"], {"file": path, "frames": 5, "rendered": 5, "skipped": 0, "fps": 24.0})
        self.assertEqual(self.frames(), ["frame_%03d.exr" % f for f in range(5)])
        for frame, key in ((0, KEYS[0]), (4, KEYS[2])):  # through the keys at both ends
            for a, b in zip(self.camera(frame)["origin"], key["origin"]):
                self.assertAlmostEqual(a, b, places=5)
            self.assertAlmostEqual(self.camera(frame)["fov"], key["fov"], places=4)
        for frame in range(5):  # the target of all keys stays in the centre
            camera = self.camera(frame)
            forward = [t - o for t, o in zip(camera["target"], camera["origin"])]
            wanted = [t - o for t, o in zip(KEYS[0]["target"], camera["origin"])]
            norm = sum(v * v for v in wanted) ** 0.5
            for a, b in zip(forward, wanted):
                self.assertAlmostEqual(a, b / norm, places=4)
        # A frame is the picture that --camera and a seed of its own make.
        whole = read_exr(self.path("frame_000.exr"))
        single = self.path("single.exr")
        self.ok("render", self.scene, "--camera", self.write("key.json", json.dumps(KEYS[0])), "--spp", 2, "--seed", 10, "-o", single)
        self.assertEqual(read_exr(single)[2], whole[2])
        self.assertEqual([json.loads(read_exr(self.path(f))[3]["octrad.render"])["seed"] for f in self.frames()], [10, 11, 12, 13, 14])

    def test_each_frame_has_noise_of_its_own(self):
        still = self.write("still.json", json.dumps({"frames": 2, "keys": [KEYS[0], dict(KEYS[0])]}))
        self.ok(*self.command(still))
        a, b = (read_exr(self.path(f))[2] for f in self.frames())
        self.assertNotEqual(a["R"], b["R"])
        self.ok("render", self.scene, "--spp", 2, "--seed", 1, "-o", self.path("single.exr"))
        self.assertEqual(read_exr(self.path("single.exr"))[2], b)

    def test_goes_on_where_it_ended(self):
        path = self.path_file(frames=4)
        self.ok(*self.command(path))
        before = {name: os.stat(self.path(name)).st_ino for name in self.frames()}
        kept = read_exr(self.path("frame_002.exr"))[2]
        os.remove(self.path("frame_002.exr"))
        report = self.ok(*self.command(path, "--json")).json()["path"]
        self.assertEqual((report["rendered"], report["skipped"]), (1, 3))
        self.assertEqual(read_exr(self.path("frame_002.exr"))[2], kept)
        after = {name: os.stat(self.path(name)).st_ino for name in self.frames()}
        self.assertEqual({n for n in before if before[n] != after[n]} - {"frame_002.exr"}, set())
        self.assertEqual(self.ok(*self.command(path, "--json")).json()["path"]["rendered"], 0)
        # Frames with other settings are not mixed in silently.
        for what, options in (("seed", ("--seed", 5)), ("size", ("--width", 16)), ("spp", ("--spp", 3))):
            options = [*self.command(path)[:-2], *options] if what == "spp" else self.command(path, *options)
            self.assertIn("--overwrite", self.fails(2, "rendered with other settings (%s)" % what, *options).err)
        with open(self.scene) as file:
            other = file.read().replace('<rfilter type="box"/>', '<rfilter type="tent"/>')
        with open(self.scene, "w") as file:
            file.write(other)
        self.fails(2, "rendered with other settings (filter", *self.command(path))
        self.assertEqual(self.ok(*self.command(path, "--seed", 5, "--overwrite", "--json")).json()["path"]["rendered"], 4)

    def test_an_interrupt_leaves_whole_frames(self):
        path, log = self.path_file(frames=20000), self.path("log")  # more than it can make by then
        process = start(*self.command(path, "--log-json", log))
        self.assertTrue(wait_for(lambda: len(self.frames()) > 2))
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 130, err)
        for name in self.frames():
            self.assertEqual(json.loads(read_exr(self.path(name))[3]["octrad.render"])["spp"], 2)
        with open(log) as lines:
            events = [json.loads(line) for line in lines]
        self.assertEqual([e["frame"] for e in events if e["event"] == "frame"], list(range(len(self.frames()))))

    def test_times_and_other_formats(self):
        pattern = self.path("frame_#.png")
        timed = self.write("timed.json", json.dumps({"fps": 2, "keys": [dict(KEYS[0], time=1), dict(KEYS[1], time=2.5)]}))
        self.ok(*self.command(timed, pattern=pattern))
        self.assertEqual(self.frames(), ["frame_%d.png" % f for f in range(4)])
        self.assertEqual(self.ok(*self.command(timed, "--json", pattern=pattern)).json()["path"]["skipped"], 4)
        long = self.path_file(duration=0.5, fps=4)
        self.ok(*self.command(long, pattern=self.path("frame_long_##.pfm")))
        self.assertEqual(sum("long" in name for name in self.frames()), 3)

    def test_refusals(self):
        good = self.path_file(frames=3)
        self.fails(1, "needs # in the file's name", *self.command(good, pattern=self.path("frame.exr")))
        self.fails(3, "does not exist", *self.command(good, pattern=self.path("none/frame_#.exr")))
        self.fails(1, "exclude each other", *self.command(good, "--sensor", 0))
        self.fails(1, "says the field of view", *self.command(good, "--fov", 30))
        self.fails(1, "--frames", *self.command(good, "--frames", 2))
        self.fails(1, "--resume", *self.command(good, "--resume"))
        self.fails(1, "--overwrite is for --path", "render", self.scene, "-o", self.path("a.exr"), "--overwrite")
        self.fails(3, "none.json", *self.command(self.path("none.json")))
        opposite = {"origin": [0, 0, -0.9], "target": [0, -0.2, 0]}
        for content, message in (({"frames": 3, "keys": KEYS[:1]}, "two cameras or more"), ({"frames": 3}, '"keys"'), ([], '"keys"'),
                                 ({"keys": KEYS}, 'needs "frames", or "duration"'), ({"keys": KEYS, "frames": 2, "duration": 2}, 'needs "frames", or'),
                                 ({"keys": KEYS, "frames": 0}, '"frames" must be a whole number from 1'), ({"keys": KEYS, "frames": 2.5}, "whole"),
                                 ({"keys": KEYS, "frames": 3, "speed": 1}, 'unknown key "speed"'),
                                 ({"keys": [KEYS[0], dict(KEYS[1], time=1)], "frames": 2}, 'key 2: either all keys have a "time" or none'),
                                 ({"keys": [dict(KEYS[0], time=1), dict(KEYS[1], time=1)]}, "key 2: \"time\" must be later"),
                                 ({"keys": [dict(KEYS[0], time=1), dict(KEYS[1], time=2)], "frames": 9}, "the keys have times"),
                                 ({"keys": [KEYS[0], dict(KEYS[1], fov_axis="y")], "frames": 2}, "key 2: \"fov_axis\" must be that of the first"),
                                 ({"keys": [KEYS[0], {"origin": [0, 0, 1]}], "frames": 2}, 'key 2: needs "origin" and "target"'),
                                 ({"keys": [KEYS[0], opposite], "frames": 2}, "key 2: the view turns by more than 120 degrees")):
            with self.subTest(message):
                self.fails(2, message, *self.command(self.write("bad.json", json.dumps(content))))
        self.fails(2, "bad.json", *self.command(self.write("bad.json", "{")))
        self.assertEqual(self.frames(), [])


if __name__ == "__main__":
    unittest.main()
