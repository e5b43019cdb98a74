"""octrad view: the server, its clients and what they may, what they see. tests/test_view_page.py opens the page."""
import json
import os
import random
import select
import signal
import socket
import struct
import time
import unittest
import unittest.mock

import support
import test_gltf
import test_pbrt
from exr import read_exr
from support import PATIENCE, ROOM, SMALL, Case, processor_seconds, start, wait_for
from web_client import Frame, Refused, Viewer, WebSocket, request

MODEL = {}
SERVER = os.environ.get("OCTRAD_VIEW_SERVER")  # tests/view_server.cc, built with sanitizers
whole_program = unittest.skipIf(SERVER, "needs options that the server alone does not have")


def trained(folder):
    """A cache of the room, once for all tests."""
    if not MODEL:
        MODEL["scene"], MODEL["file"] = os.path.join(folder, "room.xml"), os.path.join(folder, "room.octrad")
        with open(MODEL["scene"], "w") as out:
            out.write(ROOM)
        done = support.run("train", MODEL["scene"], "-o", MODEL["file"], "-D", "train.steps=60", *SMALL)
        assert done.code == 0, done.err
    return MODEL["scene"], MODEL["file"]


class View(Case):
    @classmethod
    def setUpClass(cls):
        import tempfile
        cls.shared = tempfile.TemporaryDirectory(prefix="octrad-view-")
        MODEL.clear()
        cls.scene, cls.model = trained(cls.shared.name)

    @classmethod
    def tearDownClass(cls):
        cls.shared.cleanup()

    def serve(self, *options, model=True, scene=None):
        process = start("view", scene or self.scene, *(["--model", self.model] if model else []), "--json", *options, program=SERVER)
        self.addCleanup(self.finish, process)
        line = process.stdout.readline()
        self.assertTrue(line, process.stderr.read().decode() if process.poll() is not None else "")
        self.process = process
        return json.loads(line)["url"]

    def finish(self, process):
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=PATIENCE)

    def viewer(self, url, **headers):
        viewer = Viewer(url, **headers)
        self.addCleanup(viewer.close)
        viewer.answer("state")
        return viewer


class Server(View):
    def test_ends_in_order_on_a_stream(self):
        """What the scene has on a device goes before the device's stream does."""
        process = start("view", self.scene, "--model", self.model, "--json", "--device", "host", "--width", "32", "--height", "24")
        self.addCleanup(self.finish, process)
        viewer = self.viewer(json.loads(process.stdout.readline())["url"])
        viewer.frame(lambda header: not header["moving"])
        viewer.close()
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
        self.assertEqual((process.returncode, err.decode().count("error")), (130, 0), err.decode())

    @whole_program
    def test_open(self):
        """The browser gets the address, and a session and streams of its own: it neither ends nor prints with the program."""
        opened = self.path("opened")
        with open(self.path("xdg-open"), "w") as file:
            file.write('#!/bin/sh\necho noise\nread line\ncut -d" " -f6 /proc/$$/stat > %s.new\necho "$@" >> %s.new\nmv %s.new %s\n' % (4 * (opened,)))
        os.chmod(self.path("xdg-open"), 0o755)
        with unittest.mock.patch.dict(os.environ, PATH=self.folder + ":" + os.environ["PATH"]):
            url = self.serve("--open")
        self.assertTrue(wait_for(lambda: os.path.exists(opened)))
        with open(opened) as file:
            session, address = file.read().split()
        self.assertEqual(address, url)
        self.assertNotEqual(int(session), os.getsid(self.process.pid))
        self.process.send_signal(signal.SIGINT)
        out, err = self.process.communicate(timeout=PATIENCE)
        self.assertEqual((self.process.returncode, out), (130, b""), err)
        self.assertIn(b"noise", err)

    def test_who_is_served(self):
        url = self.serve("--token", "secret_token-1", "--port", "0")
        self.assertTrue(url.endswith("/#token=secret_token-1"), url)
        viewer = self.viewer(url)
        address = viewer.address
        self.assertEqual(address[0], "127.0.0.1")
        own = "http://%s:%d" % address
        for path, kind in (("/", "text/html"), ("/viewer.css", "text/css"), ("/viewer.js", "text/javascript"), ("/tools.js", "text/javascript"), ("/training.js", "text/javascript")):
            status, headers, body = request(address, path)
            self.assertEqual(status, 200, path)
            self.assertTrue(headers["content-type"].startswith(kind), path)
            self.assertIn("default-src 'none'", headers["content-security-policy"])
            self.assertNotIn(b"secret_token", body)
            self.assertNotRegex(body.decode(), r"https?://|@import")
        # Without the token nothing but the page.
        for path in ("/check", "/stream", "/picture-a.png", "/picture-a.exr", "/nothing", "/../etc/passwd", "/index.html"):
            for token in ("", "?token=", "?token=secret_token-2", "?token=secret_token-1x", "?t=secret_token-1", "?token=secret_token-"):
                self.assertEqual(request(address, path + token)[0], 403, path + token)
        self.assertEqual(request(address, "/check?token=secret_token-1")[0], 204)
        self.assertEqual(request(address, "/nothing?token=secret_token-1")[0], 404)
        self.assertEqual(request(address, "/stream?token=secret_token-1")[0], 426)
        self.assertEqual(request(address, "/", "POST")[0], 405)
        # Foreign pages and foreign names for this machine.
        for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": "https://%s:%d" % address}, {"Origin": own + "0"},
                        {"Host": "evil.example"}, {"Host": "127.0.0.1.evil.example:80"}, {"Host": "10.0.0.1"}, {"Host": None},
                        {"Host": "localhost:8000", "Origin": own}):
            for path in ("/", "/check?token=secret_token-1"):
                self.assertEqual(request(address, path, **headers)[0], 403, (path, headers))
            with self.assertRaises(Refused) as refused:
                WebSocket(address, "/stream?token=secret_token-1", **headers)
            self.assertEqual(refused.exception.status, 403)
        # Our own, also through a tunnel with another port.
        for headers in ({"Origin": own}, {"Host": "localhost:9000", "Origin": "http://localhost:9000"}, {"Host": "127.0.0.1:1"}, {"Host": "[::1]:9000"}):
            self.assertEqual(request(address, "/check?token=secret_token-1", **headers)[0], 204, headers)
        WebSocket(address, "/stream?token=secret_token-1", Origin=own).close()
        with self.assertRaises(Refused) as refused:
            WebSocket(address, "/stream?token=wrong_token", Origin=own)
        self.assertEqual(refused.exception.status, 403)

    def test_tokens_are_random_and_ports_taken(self):
        urls = [self.serve(model=False) for _ in range(2)]
        tokens = [url.split("token=")[1] for url in urls]
        self.assertNotEqual(*tokens)
        self.assertRegex(tokens[0], "^[0-9a-f]{32}$")
        port = urls[0].split(":")[2].split("/")[0]
        self.fails(3, "port " + port, "view", self.scene, "--port", port)

    def test_command_line(self):
        self.fails(1, "--token", "view", self.scene, "--token", "short")
        self.fails(1, "--token", "view", self.scene, "--token", "with spaces in it")
        self.fails(1, "--listen localhost", "view", self.scene, "--listen", "localhost")
        self.fails(1, "needs --model", "view", self.scene, "--integrator", "lhs")
        self.fails(1, "unknown integrator", "view", self.scene, "--integrator", "pth")
        self.fails(1, "out of range", "view", self.scene, "--width", "5000")
        self.fails(1, "is for a --model", "view", self.scene, "-D", "render.delta=cache")

    def test_listening_elsewhere_is_warned_of(self):
        process = start("view", self.scene, "--listen", "0.0.0.0", "--json")
        self.addCleanup(self.finish, process)
        url = json.loads(process.stdout.readline())["url"]
        viewer = self.viewer(url)
        self.assertEqual(request(viewer.address, "/", Host="10.1.2.3:80")[0], 200)
        self.assertEqual(request(viewer.address, "/", Host=socket.gethostname())[0], 200)
        self.assertEqual(request(viewer.address, "/", Host="evil.example")[0], 403)
        process.send_signal(signal.SIGINT)
        self.assertIn("--listen 0.0.0.0: whoever reaches this machine", process.communicate(timeout=PATIENCE)[1].decode())

    def test_signals_end_it(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            viewer = self.viewer(self.serve())
            viewer.frame()
            self.process.send_signal(number)
            out, err = self.process.communicate(timeout=PATIENCE)
            self.assertEqual((self.process.returncode, out), (130, b""), err)
            with self.assertRaises(ConnectionError):
                while True:
                    viewer.next()

    def test_bounds(self):
        url = self.serve(model=False)
        viewers = [self.viewer(url) for _ in range(8)]
        with self.assertRaises(Refused) as refused:
            Viewer(url)
        self.assertEqual(refused.exception.status, 503)
        viewers.pop().close()
        seven = lambda: viewers[0].until(lambda m: isinstance(m, dict) and m.get("clients") == 7)
        seven()
        # A message, or a header of one, above the limit ends the connection; so does a request that is too long.
        for payload, length in ((b" " * 70000, None), (b"{", 1 << 40)):
            other = self.viewer(url)
            other.web.frame(payload, length=length)
            with self.assertRaises((ConnectionError, OSError)):
                while True:
                    other.next()
            other.close()
            seven()  # its place is free
        self.assertIn(request(viewers[0].address, "/" + "a" * 20000)[0], (400, 413, 414, 431))
        # Connections that say nothing do not keep others out: there is room for 64, and the oldest makes way for a new one.
        silent = [socket.create_connection(viewers[0].address, timeout=PATIENCE) for _ in range(70)]
        self.assertEqual(request(viewers[0].address, "/")[0], 200)
        self.assertEqual(silent[0].recv(1), b"")
        self.assertEqual(select.select([silent[-1]], [], [], 0)[0], [], "the newest is kept")
        for connection in silent:
            connection.close()


class Stream(View):
    def test_frames(self):
        viewer = self.viewer(self.serve("--width", "64", "--height", "48"))
        self.assertEqual(viewer.hello["protocol"], 1)
        self.assertEqual(viewer.hello["sensors"][0]["up"], [0, 1, 0])  # not the camera's own, which is tilted
        self.assertEqual(viewer.state["controller"], viewer.hello["you"])
        self.assertEqual(viewer.hello["integrators"][0], "path")
        self.assertEqual(viewer.hello["models"][0]["integrators"][:3], ["lhs", "rhs", "deferred"])
        still = viewer.frame(lambda h: not h["moving"])
        header = still.header
        self.assertEqual((header["width"], header["height"], header["a"]["integrator"]), (64, 48, "lhs"))
        self.assertEqual(jpeg_size(still.pictures["a"]), (64, 48))
        self.assertGreaterEqual(header["a"]["samples"], 1)
        later = viewer.frame(lambda h: h["a"]["samples"] >= 4)
        self.assertGreater(later.header["frame"], header["frame"])
        self.assertGreater(later.header["a"]["queries_per_s"], 0)
        # A camera change changes the picture; frames say which change they show.
        camera = dict(viewer.state["camera"])
        camera["origin"] = [0.3, 0.2, 0.7]
        for number in range(41, 141):
            viewer.send("set", camera=camera, input=number)
            first = viewer.frame(lambda h: h["input"] == number)
            self.assertEqual(first.header["camera"], camera)
            other = first if not first.header["moving"] else viewer.frame(lambda h: h["input"] == number and not h["moving"])
            # It moves for 150 ms, and is shown with more samples 100 ms later: a busy machine may miss that, but not each time.
            if first.header["moving"] and other.header["a"]["samples"] == 1:
                break
        self.assertTrue(first.header["moving"])
        self.assertEqual(other.header["a"]["samples"], 1)
        self.assertNotEqual(other.pictures["a"], still.pictures["a"])
        # So does an integrator.
        viewer.send("set", a={"integrator": "path"})
        paths = viewer.frame(lambda h: h["a"]["integrator"] == "path" and not h["moving"])
        self.assertNotEqual(paths.pictures["a"], other.pictures["a"])
        # What is shown of a moving picture changes too, and its pixels can be asked for: it has the colour and what is shown.
        sizes, picked = {}, []
        for number in range(200, 300, 2):
            layer = "normal" if "normal" not in sizes else "depth"
            viewer.send("set", camera={**camera, "origin": [0.3, 0.2, 0.6 + 0.001 * number]}, layer="", input=number)
            viewer.frame(lambda h: h["input"] == number)
            viewer.send("set", layer=layer, input=number + 1)
            viewer.send("pick", x=0.5, y=0.5, id=7)
            picked.append(min(viewer.answer("pick")["pixels"]["a"]["radiance"]))
            changed = viewer.frame(lambda h: h["input"] == number + 1)
            if changed.header["moving"]:
                sizes[layer] = len(changed.pictures["a"])
            if len(sizes) == 2:
                break
        self.assertGreater(max(picked), 0)
        self.assertGreater(min(sizes.get("normal", 0), sizes.get("depth", 0)), 900, "bytes; a black picture has 711")
        viewer.send("set", layer="")
        # Paths are refined without end, but not the cache: once it is done each other picture is due to what was changed.
        viewer.send("set", a={"integrator": "lhs"})
        before = viewer.frame(lambda h: h["a"]["integrator"] == "lhs" and h["a"]["samples"] >= 256).pictures["a"]
        for change in ({"layer": "normal"}, {"layer": "roughness"}, {"layer": "albedo"}, {"layer": ""}, {"exposure": 2}, {"curve": "filmic"}, {"white": [1, 1, 2]},
                       {"width": 32, "height": 16}):
            with self.subTest(change):
                viewer.send("set", **change)
                changed = viewer.until(lambda m: isinstance(m, Frame) and m.header["a"]["samples"] >= 256 and m.pictures["a"] != before)
                before = changed.pictures["a"]
        self.assertEqual(jpeg_size(before), (32, 16))
        self.assertEqual(viewer.errors, [])

    def test_refining_ends_and_idles(self):
        viewer = self.viewer(self.serve("--width", "16", "--height", "16"))
        viewer.frame(lambda h: h["a"]["samples"] >= 256)
        def idles():
            before = processor_seconds(self.process.pid)
            time.sleep(0.5)
            return processor_seconds(self.process.pid) - before < 0.055  # 5 ticks of a hundredth
        self.assertTrue(wait_for(idles, 60))

    def test_latest_frame_wins(self):
        """A client that acknowledges nothing gets one frame, and then the newest."""
        url = self.serve("--width", "48", "--height", "32")
        active, stalled = self.viewer(url), self.viewer(url)
        active.send("set", camera=dict(active.state["camera"], origin=[0.01, 0, 0.9]), input=0)
        last = stalled.next(acknowledge=False)
        while not isinstance(last, Frame):
            last = stalled.next(acknowledge=False)
        for i in range(1, 9):
            camera = dict(active.state["camera"], origin=[0.02 * i, 0, 0.9])
            active.send("set", camera=camera, input=i)
            newest = active.frame(lambda h: h["input"] == i)
        self.assertGreater(newest.header["frame"], last.header["frame"] + 4)
        self.assertFalse(readable(stalled), "nothing is sent before the acknowledgement")
        stalled.send("ack", frame=last.header["frame"])
        next_one = stalled.frame()
        self.assertGreaterEqual(next_one.header["frame"], newest.header["frame"])
        self.assertEqual(next_one.header["input"], 8)

    def test_a_process_that_stops_and_goes_on(self):
        """A client that reads nothing for a while, as a closed laptop, is not what others wait for."""
        url = self.serve("--width", "640", "--height", "480")
        stalled, active = self.viewer(url), self.viewer(url)
        stalled.send("release")
        active.answer("state")
        active.send("take")
        active.until(lambda m: isinstance(m, dict) and m.get("controller") == active.hello["you"])
        read = len(stalled.frames)
        for i in range(1, 6):
            active.send("set", camera=dict(active.state["camera"], origin=[0.05 * i, 0, 0.9]), input=i)
            active.frame(lambda h: h["input"] == i)
        self.assertEqual(stalled.frame(lambda h: h["input"] == 5).header["input"], 5)
        self.assertLessEqual(len(stalled.frames) - read, 2)  # one that it did not acknowledge, and the newest

    def test_control(self):
        url = self.serve("--width", "32", "--height", "24")
        first, second, third = (self.viewer(url) for _ in range(3))
        one, two, three = (v.hello["you"] for v in (first, second, third))
        controller = lambda v, who: v.until(lambda m: isinstance(m, dict) and m["type"] == "state" and m["controller"] == who)
        self.assertEqual(third.state["controller"], one)
        second.send("set", exposure=3)
        second.answer("error")
        self.assertIn("another viewer has the controls", second.errors[-1])
        second.send("take")
        second.answer("error")
        self.assertIn("viewer %d has the controls" % one, second.errors[-1])
        second.send("release")
        second.answer("error")
        second.send("pick", x=0.5, y=0.5)  # whoever watches may ask
        self.assertIn("hit", second.answer("pick"))
        first.send("release")
        controller(second, 0)
        third.send("take")
        controller(second, three)
        third.send("set", exposure=1.5)
        second.until(lambda m: isinstance(m, dict) and m.get("exposure") == 1.5)
        third.close()
        controller(second, one)  # the oldest
        first.close()
        controller(second, two)
        second.send("set", exposure=-1)
        second.until(lambda m: isinstance(m, dict) and m.get("exposure") == -1)
        second.close()
        again = self.viewer(url)
        if again.state["controller"] != again.hello["you"]:  # the second one's end has not been seen yet
            controller(again, again.hello["you"])
        self.assertEqual(again.state["exposure"], -1)

    def test_cameras_without_up(self):
        viewer = self.viewer(self.serve("--width", "32", "--height", "24"))
        for number, camera in enumerate(({"origin": [0, 0, 0.8], "target": [0, 0, 0], "fov": 40},
                                         {"to_world": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -0.8, 0, 0, 0, 1]})):
            viewer.send("set", camera=camera, input=100 + number)
            pose = viewer.frame(lambda h: h["input"] == 100 + number).header["camera"]
            self.assertEqual([len(pose[key]) for key in ("origin", "target", "up")], [3, 3, 3])  # what a page needs to turn it
        self.assertEqual(viewer.errors, [])

    @whole_program
    def test_pictures_that_nobody_reads(self):
        viewer = self.viewer(self.serve("--integrator", "path", "--width", "704", "--height", "704", model=False))  # 6 MB, more than a socket holds
        viewer.frame(lambda h: not h["moving"] and h["width"] == 704)
        waiting = []
        for _ in range(4):
            waiting.append(socket.socket())
            waiting[-1].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            waiting[-1].connect(viewer.address)
            waiting[-1].sendall(("GET /picture-a.exr?token=%s HTTP/1.1\r\nHost: %s:%d\r\n\r\n" % (viewer.token, *viewer.address)).encode())
            self.addCleanup(waiting[-1].close)
        self.assertTrue(waiting[0].recv(1))  # its answer has begun
        begun = time.monotonic()
        self.assertEqual(viewer.get("/picture-a.png")[0], 503)
        for connection in waiting[1:]:
            self.assertTrue(connection.recv(1))
        status = viewer.get("/picture-a.png")[0]
        if time.monotonic() - begun < 12:  # after 15 s in which nobody reads an answer, it is given up
            self.assertEqual(status, 503, "all are made, none is sent")
        for connection in waiting:
            connection.close()
        self.assertTrue(wait_for(lambda: viewer.get("/picture-a.png")[0] == 200))

    @whole_program
    def test_comparison(self):
        viewer = self.viewer(self.serve("--compare", "path", "--width", "48", "--height", "32"))
        frame = viewer.frame(lambda h: not h["moving"])
        self.assertEqual(set(frame.pictures), {"a", "b"})
        self.assertEqual((frame.header["a"]["integrator"], frame.header["b"]["integrator"]), ("lhs", "path"))
        viewer.frame(lambda h: h["b"]["samples"] > 300)  # paths go on where the cache is done
        viewer.send("set", errors=True)
        self.assertEqual(jpeg_size(viewer.frame(lambda h: len(h["pictures"]) == 3).pictures["errors"]), (48, 32))
        viewer.send("set", b=None)
        self.assertEqual(set(viewer.frame(lambda h: "b" not in h).pictures), {"a"})


    @whole_program
    def test_stored_picture(self):
        stored = self.path("stored.exr")
        self.ok("render", self.scene, "--integrator", "path", "--spp", "4", "--width", "48", "--height", "32", "--origin=0.2,0,0.8", "--target=0,-0.1,0", "-o", stored, "-q")
        viewer = self.viewer(self.serve("--reference", stored, "--integrator", "path", model=False))
        self.assertEqual((viewer.hello["stored"]["width"], viewer.hello["stored"]["height"]), (48, 32))
        frame = viewer.frame(lambda h: not h["moving"])
        self.assertEqual((frame.header["width"], frame.header["height"], frame.header["b"]["integrator"], frame.header["b"]["samples"]), (48, 32, "stored", 4))
        for a, b in zip(frame.header["camera"]["origin"], (0.2, 0, 0.8)):
            self.assertAlmostEqual(a, b, places=5)
        viewer.send("set", errors=True)
        self.assertEqual(set(viewer.frame(lambda h: len(h["pictures"]) == 3).pictures), {"a", "b", "errors"})
        viewer.send("set", a={"integrator": "stored"})
        self.assertIsNone(viewer.answer("error")["input"])
        viewer.send("set", camera=dict(viewer.state["camera"], fov=500), input=77)
        self.assertEqual(viewer.answer("error")["input"], 77, "the page takes its camera back")
        viewer.send("set", layer="albedo")
        viewer.frame(lambda h: h["a"]["samples"] > 20)
        viewer.send("set", b=None)
        kept = viewer.frame(lambda h: "b" not in h)
        self.assertGreater(kept.header["a"]["samples"], 20, "what one side has is kept when the other changes")


class Answers(View):
    def test_inspector_is_query(self):
        viewer = self.viewer(self.serve("--width", "64", "--height", "48"))
        viewer.frame(lambda h: not h["moving"])
        asked = 0
        for x, y in ((0.5, 0.5), (0.1, 0.9), (0.9, 0.3)):
            viewer.send("pick", x=x, y=y, id=7)
            found = viewer.answer("pick")
            self.assertEqual((found["id"], found["hit"]), (7, True))
            self.assertIn(found["shape"], ("room", "patch", "lamp"))
            self.assertEqual(found["pixels"]["a"]["pixel"], [int(x * 64), int(y * 48)])
            for query in found["queries"]:
                numbers = query["x"] + query["wo"] + query["n"] + query["albedo"] + [query["alpha"]]
                points = self.write("points.csv", "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha\n" + ",".join("%.9g" % v for v in numbers) + "\n")
                row = [float(v) for v in self.ok("query", self.model, "--points", points).out.splitlines()[1].split(",")]
                answers = [query["disparity"]] + [f for level in query["features"] for f in level] + query["radiance"]
                self.assertEqual([struct.unpack("f", struct.pack("f", v)) for v in row], [struct.unpack("f", struct.pack("f", v)) for v in answers])
                asked += 1
        self.assertGreaterEqual(asked, 2)

    def test_saved_camera_renders_the_same_picture(self):
        viewer = self.viewer(self.serve("--width", "40", "--height", "30"))
        camera = dict(viewer.state["camera"], origin=[0.31, -0.2, 0.77], target=[0.1, -0.25, -0.3], fov=71.5)
        viewer.send("set", camera=camera, input=1)
        for integrator in ("lhs", "path"):
            viewer.send("set", a={"integrator": integrator})
            viewer.frame(lambda h: h["a"]["integrator"] == integrator and not h["moving"] and h["a"]["samples"] >= 4 and h["input"] == 1)
            status, headers, body = viewer.get("/picture-a.exr")
            self.assertEqual(status, 200, body)
            self.assertIn("view.exr", headers["content-disposition"])
            saved, rendered = self.path("saved.exr"), self.path("rendered.exr")
            with open(saved, "wb") as out:
                out.write(body)
            width, height, ours, attributes = read_exr(saved)
            spp = json.loads(attributes["octrad.render"])["spp"]
            self.assertEqual((width, height), (40, 30))
            model = ["--model", self.model] if integrator == "lhs" else []
            self.ok("render", self.scene, "--integrator", integrator, *model, "--camera", self.write("camera.json", json.dumps(camera)),
                    "--width", "40", "--height", "30", "--spp", spp, "-o", rendered, "-q")
            _, _, theirs, expected = read_exr(rendered)
            self.assertEqual(ours, theirs)
            without_times = lambda texts: {k: {**json.loads(v), "seconds": 0} if k == "octrad.render" else v for k, v in texts.items()}
            self.assertEqual(without_times(attributes), without_times(expected))
            self.assertEqual(viewer.get("/picture-a.png")[2][:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(viewer.get("/picture-b.png")[0], 409)

    @whole_program
    def test_scenes_of_pbrt_and_gltf(self):
        """They are shown as they are rendered, on the CPU and from the copy that devices have."""
        for name, text in (("s.pbrt", test_pbrt.PBRT), ("s.gltf", test_gltf.scene().text())):
            test_gltf.write_files(self)
            file, rendered = self.write(name, text), self.path("rendered.exr")
            for device in ("cpu", "host"):
                with self.subTest("%s %s" % (name, device)):
                    viewer = self.viewer(self.serve("--width", "45", "--height", "36", "--device", device, model=False, scene=file))
                    viewer.frame(lambda h: not h["moving"] and h["a"]["samples"] >= 4)
                    saved = self.path("saved.exr")
                    with open(saved, "wb") as out:
                        out.write(viewer.get("/picture-a.exr")[2])
                    width, height, ours, attributes = read_exr(saved)
                    self.assertEqual((width, height), (45, 36))
                    self.ok("render", file, "--integrator", "path", "--width", "45", "--height", "36", "--device", device, "-o", rendered, "-q",
                            "--spp", json.loads(attributes["octrad.render"])["spp"])
                    self.assertEqual(ours, read_exr(rendered)[2])
                    viewer.close()

    def test_paths(self):
        viewer = self.viewer(self.serve(model=False))
        keys = [{"origin": [0, 0, 0.9 - 0.1 * i], "target": [0, -0.2, 0], "fov": 60} for i in range(3)]
        viewer.send("path", keys=keys, duration=1, fps=10)
        played = viewer.answer("path")
        self.assertEqual((len(played["frames"]), played["fps"]), (11, 10))
        for exact, frame in ((keys[0], played["frames"][0]), (keys[2], played["frames"][-1])):
            for a, b in zip(exact["origin"], frame["origin"]):
                self.assertAlmostEqual(a, b, places=5)
        viewer.send("path", keys=keys[:1], duration=1)
        viewer.answer("error")
        viewer.send("path", keys=keys, duration=1e6)
        viewer.answer("error")
        self.assertIn("frames", viewer.errors[-1])


class Malformed(View):
    def test_a_thousand_messages_change_nothing(self):
        viewer = self.viewer(self.serve("--width", "32", "--height", "24"))
        viewer.frame(lambda h: not h["moving"])
        before = {k: v for k, v in viewer.state.items()}
        rng = random.Random(7)
        camera = before["camera"]
        good = ["set", "ack", "pick", "path", "take", "release"]
        values = [None, True, -1, 0, 1e308, 1e999, "", "x", "\u0000", [], {}, [1], [1, 2], [1, 2, "3"], [[]] * 5, {"a": {}}, "a" * 300, 12345678901234567890]
        bad = ["", "{", "[]", "null", "7", '"set"', "{}", '{"type": 3}', '{"type": "set", "exposure": 1e999}', '{"type": "set", "exposure": NaN}', "[" * 1000,
               '{"a":' * 200, "\ufeff{}", '{"type": "ack"}', '{"type": "ack", "frame": -1}', '{"type": "pick", "x": 2, "y": 0}', '{"type": "pick"}', '{"type": "path"}',
               '{"type": "path", "keys": [{}, {}], "frames": 3}', '{"type": "set", "white": [0, 1, 1]}', '{"type": "set", "a": {"integrator": "features99"}}',
               '{"type": "set", "a": {"model": 1}}', '{"type": "set", "a": null}', '{"type": "set", "width": 5000}', '{"type": "set", "width": 40.5}',
               '{"type": "set", "curve": "nono"}', '{"type": "set", "layer": "radiance"}', '{"type": "set", "width": 4096, "height": 4096, "exposur": 1}']
        for key in camera:
            for value in values:
                other = dict(camera)
                other[key] = value
                if value is None:
                    del other[key]
                    if key not in ("origin", "target"):
                        continue
                elif key in ("near_clip", "fov") and value in (True, 1, 12345678901234567890) or key == "far_clip":
                    continue
                bad.append(json.dumps({"type": "set", "camera": other}))
        while len(bad) < 960:
            kind = rng.choice(good[:4])
            key = rng.choice(["exposure", "curve", "white", "width", "height", "a", "b", "errors", "most_error", "full", "layer", "camera", "frame", "x", "keys", "zzz"])
            value = rng.choice(values)
            if kind == "set" and (key, str(value)) in (("b", "None"), ("exposure", "0"), ("exposure", "-1"), ("layer", ""), ("errors", "True"), ("full", "True")) or \
                    (kind, key) == ("ack", "frame") or (kind == "set" and key in ("a", "b") and value == {}) or (kind == "set" and key == "exposure" and value is True):
                continue
            if kind == "pick" and key == "x":
                value = "x"
            bad.append(json.dumps({"type": kind, key: value}))
        for text in bad[:960]:
            viewer.send(text)
        for _ in range(40):
            viewer.web.frame(rng.randbytes(rng.randrange(200)), opcode=2)
        viewer.until(lambda m: len(viewer.errors) >= 1000)
        self.assertTrue(all(viewer.errors))
        other = self.viewer("http://%s:%d/#token=%s" % (*viewer.address, viewer.token))
        after = dict(other.state, clients=1)
        self.assertEqual(after, before)
        # Garbage instead of frames and of requests ends a connection, and nothing else.
        for i in range(60):
            connection = self.viewer("http://%s:%d/#token=%s" % (*viewer.address, viewer.token)) if i % 4 == 0 else None
            raw = connection.web.socket if connection else socket.create_connection(viewer.address)
            try:
                raw.sendall(rng.randbytes(rng.randrange(1, 400)) if i % 3 else b"GET / HTTP/9.9\r\nHost: \xff\xfe\r\n: \r\n\r\n")
            except OSError:
                pass
            raw.close()
            if connection:
                connection.web.stream.close()
        self.assertEqual(request(viewer.address, "/")[0], 200)
        viewer.send("set", exposure=1)
        viewer.until(lambda m: isinstance(m, dict) and m.get("exposure") == 1)
        self.assertIsNone(self.process.poll())


def jpeg_size(raw):
    at = 2
    while True:
        marker, n = raw[at + 1], struct.unpack(">H", raw[at + 2:at + 4])[0]
        if 0xC0 <= marker <= 0xC2:
            height, width = struct.unpack(">HH", raw[at + 5:at + 9])
            return width, height
        at += 2 + n


def readable(viewer, seconds=0.3):
    return bool(select.select([viewer.web.socket], [], [], seconds)[0])


if __name__ == "__main__":
    unittest.main()
