"""Small EXR files of float channels, written and read. Standard library only."""
import array
import struct
import zlib


def _attribute(name, kind, data):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data


def write_exr(path, width, height, channels, attributes=None):
    """channels: name -> width * height floats, row 0 at the top; scanlines without compression."""
    names = sorted(channels)
    rows = {name: array.array("f", channels[name]) for name in names}
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    listed = b"".join(n.encode() + b"\0" + struct.pack("<iB3xii", 2, 0, 1, 1) for n in names) + b"\0"
    header = struct.pack("<ii", 20000630, 2)
    for name, text in (attributes or {}).items():
        header += _attribute(name, "string", text.encode())
    header += (_attribute("channels", "chlist", listed) + _attribute("compression", "compression", b"\0") +
               _attribute("dataWindow", "box2i", window) + _attribute("displayWindow", "box2i", window) +
               _attribute("lineOrder", "lineOrder", b"\0") + _attribute("pixelAspectRatio", "float", struct.pack("<f", 1)) +
               _attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)) +
               _attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + b"\0")
    size = 8 + 4 * width * len(names)
    with open(path, "wb") as out:
        out.write(header + struct.pack(f"<{height}Q", *(len(header) + 8 * height + y * size for y in range(height))))
        for y in range(height):
            out.write(struct.pack("<ii", y, size - 8))
            for name in names:
                out.write(rows[name][y * width:(y + 1) * width].tobytes())
    return path


def read_exr(path):
    """-> width, height, {channel: bytes of its floats}, {string attribute: text}; scanlines of floats, ZIP or nothing."""
    with open(path, "rb") as file:
        raw = file.read()
    at, fields = 8, {}
    while raw[at]:
        name, kind, rest = raw[at:].split(b"\0", 2)
        size = struct.unpack_from("<i", rest)[0]
        fields[name.decode()] = (kind, rest[4:4 + size])
        at += len(name) + len(kind) + 6 + size
    at += 1
    x0, y0, x1, y1 = struct.unpack("<4i", fields["dataWindow"][1])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    names, listed = [], fields["channels"][1]
    while listed[0]:
        name, listed = listed.split(b"\0", 1)
        assert struct.unpack_from("<i", listed)[0] == 2, "not floats"
        names.append(name.decode())
        listed = listed[16:]
    compression = fields["compression"][1][0]
    assert compression in (0, 3)
    lines = 16 if compression == 3 else 1
    chunks = (height + lines - 1) // lines
    data = {name: b"" for name in names}
    for offset in struct.unpack_from(f"<{chunks}Q", raw, at):
        y, size = struct.unpack_from("<ii", raw, offset)
        count = min(lines, y1 + 1 - y)
        block = raw[offset + 8:offset + 8 + size]
        if size < count * width * 4 * len(names):
            coded = bytearray(zlib.decompress(block))
            for i in range(1, len(coded)):
                coded[i] = (coded[i] + coded[i - 1] - 128) & 255
            half = (len(coded) + 1) // 2
            block = bytearray(len(coded))
            block[0::2], block[1::2] = coded[:half], coded[half:]
        for line in range(count):
            for c, name in enumerate(names):
                start = (line * len(names) + c) * 4 * width
                data[name] += bytes(block[start:start + 4 * width])
    texts = {name: value.decode() for name, (kind, value) in fields.items() if kind == b"string"}
    return width, height, data, texts


def read_pfm(path):
    """-> [r, g, b] of each pixel, row 0 at the top, as one array of floats."""
    with open(path, "rb") as file:
        assert file.readline() == b"PF\n"
        width, height = map(int, file.readline().split())
        assert float(file.readline()) < 0
        rows = [file.read(12 * width) for _ in range(height)]
    return array.array("f", b"".join(reversed(rows)))
