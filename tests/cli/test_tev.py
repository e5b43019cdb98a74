"""--tev: packets as the viewer reads them, and runs that no viewer can disturb."""
import array
import re
import socket
import struct
import threading
import time
import unittest

from exr import read_exr
from support import ROOM, SMALL, Case


class Viewer:
    """Stands in for the viewer: accepts connections, reads packets, keeps what they make of the pictures."""

    def __init__(self, close_after=None, reads=True):
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = self.server.getsockname()[1]
        self.address = f"127.0.0.1:{self.port}"
        self.pictures, self.updates, self.problems = {}, 0, []
        self.close_after, self.reads = close_after, reads
        self.connections = []
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            try:
                connection, _ = self.server.accept()
            except OSError:
                return
            self.connections.append(connection)
            if self.reads:
                threading.Thread(target=self.read, args=(connection,), daemon=True).start()

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

    def close(self):
        self.server.close()
        for connection in self.connections:
            connection.close()


class Tev(Case):
    def viewer(self, **options):
        viewer = Viewer(**options)
        self.addCleanup(viewer.close)
        return viewer

    def render(self, address, *more, spp=64):
        out = self.path("o.exr")
        begin = time.monotonic()
        result = self.ok("render", self.write("room.xml", ROOM), "-o", out, "--integrator", "path", "--spp", spp, *more, *(["--tev", address] if address else []))
        return read_exr(out), result.err, time.monotonic() - begin

    def test_shows_the_picture(self):
        viewer = self.viewer()
        picture, err, _ = self.render(viewer.address, "--time", "1.5s", spp=1 << 20)
        self.assertNotIn("warning", err)
        time.sleep(0.2)
        self.assertEqual(viewer.problems, [])
        self.assertGreaterEqual(viewer.updates, 2)  # while it was made, and in the end
        width, height, names, values = viewer.pictures[self.path("o.exr")]
        self.assertEqual((width, height, names), (32, 24, ["R", "G", "B"]))
        for c, name in enumerate("RGB"):
            self.assertEqual(array.array("f", values[c::3]).tobytes(), picture[2][name])

    def test_train(self):
        viewer = self.viewer()
        model = self.path("m.octrad")
        result = self.ok("train", self.write("room.xml", ROOM), "-o", model, "--time", "2s", "--tev", viewer.address, *SMALL[:-1])
        self.assertNotIn("--tev", re.sub(r"room\S*", "", result.err))
        time.sleep(0.2)
        self.assertEqual(viewer.problems, [])
        self.assertGreaterEqual(viewer.updates, 2)
        values = viewer.pictures[model][3]
        self.assertTrue(all(v == v and 0 <= v < 100 for v in values))
        self.assertGreater(sum(values), 0)

    def test_nobody_is_waited_for(self):
        expected, _, _ = self.render("")
        self.ok("train", self.path("room.xml"), "-o", self.path("a.octrad"), "--steps", "20", *SMALL)
        closed = socket.create_server(("127.0.0.1", 0))
        port = closed.getsockname()[1]
        closed.close()
        deaf = self.viewer(reads=False)
        for address in (f"127.0.0.1:{port}", self.viewer(close_after=1).address, "no-such-host.invalid", deaf.address):
            with self.subTest(address=address):
                picture, err, seconds = self.render(address, "--width", "32", spp=64)
                self.assertEqual(picture[2], expected[2])
                self.assertLessEqual(err.count("--tev: "), 1, err)
                self.assertLess(seconds, 8)
        _, err, _ = self.render(f"127.0.0.1:{port}", "--time", "1s", spp=1 << 20)
        self.assertEqual(err.count("--tev: "), 1, err)
        self.assertIn("nothing is shown there from now on", err)
        viewer = self.viewer(close_after=1)
        _, err, _ = self.render(viewer.address, "--time", "2s", spp=1 << 20)
        self.assertEqual(err.count("--tev: "), 1, err)
        self.assertEqual(viewer.problems, [])
        # The same bits with somebody watching.
        self.ok("train", self.path("room.xml"), "-o", self.path("b.octrad"), "--steps", "20", "--tev", self.viewer().address, *SMALL)
        with open(self.path("a.octrad"), "rb") as a, open(self.path("b.octrad"), "rb") as b:
            self.assertEqual(len(a.read()), len(b.read()))

    def test_addresses(self):
        for address in ("", ":", "host:", "host:0", "host:99999", "host:1x", ":14158"):
            if address:
                self.fails(1, "expected HOST or HOST:PORT", "render", self.write("room.xml", ROOM), "-o", self.path("x.exr"), "--tev", address)


if __name__ == "__main__":
    unittest.main()
