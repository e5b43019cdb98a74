"""A plain client of octrad view: HTTP and WebSocket (RFC 6455) on a socket. Standard library only."""
import base64
import hashlib
import json
import os
import socket
import struct
import urllib.parse

PATIENCE = 600  # seconds after which something hangs: no busy machine takes that long


class Refused(Exception):
    """The answer to a request for a WebSocket was another one."""

    def __init__(self, status, body):
        super().__init__("%d %s" % (status, body.decode("utf-8", "replace")))
        self.status, self.body = status, body


def read_answer(stream):
    """Of a file of a socket: status, headers, body."""
    line = stream.readline()
    if not line:
        raise ConnectionError("no answer")
    status, headers = int(line.split()[1]), {}
    while True:
        line = stream.readline().decode("latin-1").strip()
        if not line:
            break
        name, value = line.split(":", 1)
        headers[name.lower()] = value.strip()
    body = b"" if status in (101, 204) else stream.read(int(headers.get("content-length", 0)))
    return status, headers, body


def request(address, target, method="GET", **headers):
    """One request of its own connection; an underscore in a header's name stands for a dash."""
    with socket.create_connection(address, timeout=PATIENCE) as connection:
        lines = ["%s %s HTTP/1.1" % (method, target)]
        lines += ["%s: %s" % (name.replace("_", "-"), value) for name, value in {"Host": "%s:%d" % address, **headers}.items() if value is not None]
        connection.sendall(("\r\n".join(lines) + "\r\n\r\n").encode("latin-1"))
        with connection.makefile("rb") as stream:
            return read_answer(stream)


class WebSocket:
    def __init__(self, address, target, timeout=PATIENCE, **headers):
        self.socket = socket.create_connection(address, timeout=timeout)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # as browsers: small messages go at once
        self.stream = self.socket.makefile("rb")
        key = base64.b64encode(os.urandom(16)).decode()
        lines = ["GET %s HTTP/1.1" % target]
        fields = {"Host": "%s:%d" % address, "Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": key}
        lines += ["%s: %s" % (name.replace("_", "-"), value) for name, value in {**fields, **headers}.items() if value is not None]
        self.socket.sendall(("\r\n".join(lines) + "\r\n\r\n").encode("latin-1"))
        status, answered, body = read_answer(self.stream)
        if status != 101:
            self.close()
            raise Refused(status, body)
        expected = base64.b64encode(hashlib.sha1((key + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11").encode()).digest()).decode()
        assert answered["sec-websocket-accept"] == expected

    def close(self):
        self.stream.close()
        self.socket.close()

    def frame(self, payload, opcode=1, mask=True, length=None):
        """Sends a frame; `length`: the one that its header claims."""
        n = len(payload) if length is None else length
        bit = 0x80 if mask else 0
        head = bytes([0x80 | opcode]) + (bytes([bit | n]) if n < 126 else bytes([bit | 126]) + struct.pack(">H", n) if n < 65536
                                        else bytes([bit | 127]) + struct.pack(">Q", n))
        if mask:
            key = os.urandom(4)
            payload = key + bytes(b ^ key[i & 3] for i, b in enumerate(payload))
        self.socket.sendall(head + payload)

    def send(self, message):
        self.frame(json.dumps(message).encode() if not isinstance(message, (bytes, str)) else message.encode() if isinstance(message, str) else message)

    def read(self, n):
        data = self.stream.read(n)
        if len(data) < n:  # within a message, too
            raise ConnectionError("the connection ended")
        return data

    def receive(self):
        """The next message: an object, or bytes. Raises ConnectionError at the end; pings are answered."""
        data, kind = b"", None
        while True:
            head = self.read(2)
            opcode, n = head[0] & 15, head[1] & 127
            if n >= 126:
                n = struct.unpack(">H" if n == 126 else ">Q", self.read(2 if n == 126 else 8))[0]
            payload = self.read(n)
            if opcode == 8:
                raise ConnectionError("closed with %s" % payload[:2].hex())
            if opcode == 9:
                self.frame(payload, 10)
                continue
            if opcode == 10:
                continue
            kind = opcode or kind
            data += payload
            if head[0] & 0x80:
                return data if kind == 2 else json.loads(data)


class Frame:
    """A picture as it comes: header, and the bytes of its JPEGs by name."""

    def __init__(self, message):
        size = struct.unpack("<I", message[:4])[0]
        self.header = json.loads(message[4:4 + size])
        self.pictures, at = {}, 4 + size
        for part in self.header["pictures"]:
            self.pictures[part["name"]] = message[at:at + part["bytes"]]
            at += part["bytes"]
        assert at == len(message)


class Viewer:
    """A client as the page is one. Keeps the last hello and state; acknowledges every frame unless told otherwise."""

    def __init__(self, url, **headers):
        parts = urllib.parse.urlsplit(url)
        self.address = (parts.hostname, parts.port)
        self.token = parts.fragment.split("token=")[1]
        self.web = WebSocket(self.address, "/stream?token=" + self.token, **headers)
        self.hello = self.state = None
        self.errors, self.others, self.frames = [], [], []

    def close(self):
        self.web.close()

    def send(self, kind, **members):
        self.web.send({"type": kind, **members})

    def next(self, acknowledge=True):
        """The next message: a Frame, or an object."""
        message = self.web.receive()
        if isinstance(message, bytes):
            frame = Frame(message)
            if acknowledge:
                self.send("ack", frame=frame.header["frame"])
            self.frames.append(frame)
            return frame
        if message["type"] == "hello":
            self.hello = message
        elif message["type"] == "state":
            self.state = message
        elif message["type"] == "error":
            self.errors.append(message["message"])
        else:
            self.others.append(message)
        return message

    def until(self, what):
        """The first message from now on of which what(message) holds."""
        while True:
            message = self.next()
            if what(message):
                return message

    def frame(self, what=lambda header: True):
        return self.until(lambda m: isinstance(m, Frame) and what(m.header))

    def answer(self, kind):
        return self.until(lambda m: isinstance(m, dict) and m["type"] == kind)

    def get(self, target):
        return request(self.address, target + "?token=" + self.token)
