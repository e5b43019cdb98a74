"""--tev: packets as the viewer reads them, and runs that no viewer can disturb."""
import array
import re
import select
import signal
import socket
import struct
import threading
import unittest

from exr import read_exr
from support import PATIENCE, ROOM, SMALL, Case, read_safetensors, start, wait_for


class Viewer:
    """Stands in for the viewer: accepts connections, reads packets, keeps what they make of the pictures."""

    def __init__(self, close_after=None, reads=True):
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = self.server.getsockname()[1]
        self.address = f"127.0.0.1:{self.port}"
        self.pictures, self.updates, self.problems = {}, 0, []
        self.close_after, self.reads = close_after, reads
        self.connections, self.readers = [], []
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            try:
                connection, _ = self.server.accept()
            except OSError:
                return
            self.connections.append(connection)
            if self.reads:
                reader = threading.Thread(target=self.read, args=(connection,), daemon=True)
                reader.start()
                self.readers.append(reader)

    def read(self, connection):
        data = b""
        try:
            while True:
                block = connection.recv(1 << 16)
                if not block:
                    break
                data += block
                while len(data) >= 4 and len(data) >= struct.unpack_from("<I", data)[0]:
                    length = struct.unpack_from("<I", data)[0]
                    self.packet(data[4:length])
                    data = data[length:]
                    if self.close_after is not None and self.updates >= self.close_after:
                        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                        connection.close()
                        return
            if data:
                self.problems.append("a packet that is cut off")
        except Exception as error:  # told by the test
            self.problems.append(repr(error))

    def packet(self, data):
        kind, focus, rest = data[0], data[1], data[2:]
        name, rest = rest.split(b"\0", 1)
        name = name.decode()
        assert focus in (0, 1)
        if kind == 4:  # CreateImage
            width, height, count = struct.unpack_from("<3i", rest)
            names = rest[12:].split(b"\0")
            assert names[-1] == b"" and len(names) == count + 1, names
            self.pictures[name] = [width, height, [n.decode() for n in names[:-1]], array.array("f", [float("nan")] * (width * height * count))]
        elif kind == 6:  # UpdateImageV3
            count = struct.unpack_from("<i", rest)[0]
            *names, rest = rest[4:].split(b"\0", count)
            x, y, width, height = struct.unpack_from("<4i", rest)
            offsets = struct.unpack_from(f"<{count}q", rest, 16)
            strides = struct.unpack_from(f"<{count}q", rest, 16 + 8 * count)
            values = array.array("f", rest[16 + 16 * count:])
            pixels = width * height
            assert len(values) == max(o + (pixels - 1) * s + 1 for o, s in zip(offsets, strides))
            whole = self.pictures[name]
            assert x >= 0 and y >= 0 and x + width <= whole[0] and y + height <= whole[1]
            for c, channel in enumerate(names):
                to = whole[2].index(channel.decode())
                for i in range(pixels):
                    at = (y + i // width) * whole[0] + x + i % width
                    whole[3][at * len(whole[2]) + to] = values[offsets[c] + i * strides[c]]
            self.updates += 1
        else:
            raise AssertionError(f"packet of type {kind}")

    def finish(self):
        """Reads to the end what a program has sent that is over."""
        assert wait_for(lambda: self.readers), "nobody has connected"
        for reader in self.readers:
            reader.join(timeout=PATIENCE)
            assert not reader.is_alive(), "the connection is open"

    def close(self):
        self.server.close()
        for connection in self.connections:
            connection.close()


class Tev(Case):
    def viewer(self, **options):
        viewer = Viewer(**options)
        self.addCleanup(viewer.close)
        return viewer

    def render(self, address, *more):
        out = self.path("o.exr")
        result = self.ok("render", self.write("room.xml", ROOM), "-o", out, "--integrator", "path", "--spp", 64, *more, *(["--tev", address] if address else []))
        return read_exr(out), result.err

    def interrupted(self, ready, verb, address, *more):
        """A run without end that is interrupted once it is `ready`, of its error output: all of that."""
        process = start(verb, self.write("room.xml", ROOM), "--tev", address, *more)
        watchdog = threading.Timer(PATIENCE, process.kill)
        watchdog.start()
        try:
            err = b""
            while not ready(err):
                line = process.stderr.readline()
                self.assertTrue(line, err)
                err += line
            process.send_signal(signal.SIGINT)
            err += process.communicate()[1]
        finally:
            watchdog.cancel()
            process.kill()
            process.wait()
        self.assertEqual(process.returncode, 130, err)
        return err.decode()

    def endless(self, ready, address):
        return self.interrupted(ready, "render", address, "-o", self.path("o.exr"), "--integrator", "path", "--spp", 100000000)

    def assert_shown(self, viewer, name, picture):
        """Two pictures or more came, while it was made and in the end, and the last has the bits of this one."""
        viewer.finish()
        self.assertEqual(viewer.problems, [])
        self.assertGreaterEqual(viewer.updates, 2)
        width, height, names, values = viewer.pictures[name]
        self.assertEqual((width, height, names), (32, 24, ["R", "G", "B"]))
        for c, channel in enumerate("RGB"):
            self.assertEqual(array.array("f", values[c::3]).tobytes(), picture[2][channel])

    def test_shows_the_picture(self):
        viewer = self.viewer()
        err = self.endless(lambda _: wait_for(lambda: viewer.updates >= 1), viewer.address)
        self.assertNotIn("warning", err)
        self.assert_shown(viewer, self.path("o.exr"), read_exr(self.path("o.exr")))

    def test_train(self):
        viewer = self.viewer()
        model = self.path("m.octrad")
        err = self.interrupted(lambda _: wait_for(lambda: viewer.updates >= 1), "train", viewer.address, "-o", model, "--steps", 100000000, *SMALL[:-1])
        self.assertNotIn("--tev", re.sub(r"room\S*", "", err))
        self.ok("render", self.path("room.xml"), "--model", model, "--integrator", "lhs", "--spp", 1, "-o", self.path("o.exr"), "-q")
        self.assert_shown(viewer, model, read_exr(self.path("o.exr")))

    def test_nobody_is_waited_for(self):
        expected, _ = self.render("")
        self.ok("train", self.path("room.xml"), "-o", self.path("a.octrad"), "--steps", "20", *SMALL)
        refuses = socket.socket()  # bound, so that nobody else gets the port, and not listening
        self.addCleanup(refuses.close)
        refuses.bind(("127.0.0.1", 0))
        refusing = "127.0.0.1:%d" % refuses.getsockname()[1]
        deaf = self.viewer(reads=False)
        for address in (refusing, self.viewer(close_after=1).address, "no-such-host.invalid", deaf.address):
            with self.subTest(address=address):
                picture, err = self.render(address)
                self.assertEqual(picture[2], expected[2])
                self.assertLessEqual(err.count("--tev: "), 1, err)
        told = lambda err: b"--tev: " in err
        err = self.endless(told, refusing)
        self.assertEqual(err.count("--tev: "), 1, err)
        self.assertIn("nothing is shown there from now on", err)
        viewer = self.viewer(close_after=1)
        err = self.endless(told, viewer.address)
        self.assertEqual(err.count("--tev: "), 1, err)
        self.assertEqual(viewer.problems, [])
        # The same bits with somebody watching.
        self.ok("train", self.path("room.xml"), "-o", self.path("b.octrad"), "--steps", "20", "--tev", self.viewer().address, *SMALL)
        self.assertEqual(read_safetensors(self.path("a.octrad"))[1], read_safetensors(self.path("b.octrad"))[1])

    def test_a_viewer_that_never_answers(self):
        """It is given up 5 s after it was called, with a warning. A run that is over before waits 2 s for it at most, and has nothing to warn of."""
        server = socket.socket()
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        calls = [server]
        for _ in range(8):  # once its queue is full, no call is answered
            call = socket.socket()
            call.setblocking(False)
            call.connect_ex(server.getsockname())
            calls.append(call)
        self.addCleanup(lambda: [call.close() for call in calls])
        address = "127.0.0.1:%d" % server.getsockname()[1]
        for _ in range(5):  # a busy machine may take 5 s, but not each time
            _, err = self.render(address)
            if "--tev: " not in err:
                break
        self.assertNotIn("--tev: ", err)
        self.assertEqual(select.select([], [calls[-1]], [], 0)[1], [], "it has answered")

    def test_addresses(self):
        for address in ("", ":", "host:", "host:0", "host:99999", "host:1x", ":14158"):
            if address:
                self.fails(1, "expected HOST or HOST:PORT", "render", self.write("room.xml", ROOM), "-o", self.path("x.exr"), "--tev", address)


if __name__ == "__main__":
    unittest.main()
