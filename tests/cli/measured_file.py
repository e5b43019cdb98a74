"""The measured material of src/octrad/scene/sample_measured.h, for scripts that compare with Mitsuba. Standard library only."""
import math
import struct


def tensor_file(tensors):
    """tensors: (name, shape, values, whether they are bytes)."""
    head = b"tensor_file\0\1\0" + struct.pack("<I", len(tensors))
    begin = len(head) + sum(2 + len(name) + 2 + 1 + 8 + 8 * len(shape) for name, shape, _, _ in tensors)
    data = b""
    for name, shape, values, are_bytes in tensors:
        head += struct.pack("<H", len(name)) + name.encode() + struct.pack("<HBQ", len(shape), 1 if are_bytes else 10, begin + len(data))
        head += struct.pack("<%dQ" % len(shape), *shape)
        data += struct.pack("<%d%s" % (len(values), "B" if are_bytes else "f"), *values)
    return head + data


def direction(theta, phi):
    return math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)


def measured_file(part, **changes):
    """changes: shape, values and whether they are bytes of other tensors, or None: without it."""
    width, height, side = 16, 9, 8
    isotropic = part in (0, 8)
    ax, ay = (0.5, 0.5) if isotropic else (0.25, 0.6)
    phis = [0.0] if part == 0 else [-math.pi, math.pi] if part == 8 else [-math.pi + 2 * math.pi / part * i / 4 for i in range(5)]
    thetas = [0.35 * i for i in range(5)]

    def density(m):
        q = m[0] ** 2 / ax ** 2 + m[1] ** 2 / ay ** 2 + m[2] ** 2
        return 1 / (math.pi * ax * ay * q * q)

    normals = [(x / (width - 1), 0.5 * math.pi * (x / (width - 1)) ** 2, (2 * y / (height - 1) - 1) * math.pi) for y in range(height) for x in range(width)]
    half = [direction(t, p) for _, t, p in normals]
    ndf = [density(m) for m in half]
    sigma = [0.5 * (m[2] + math.sqrt(m[2] ** 2 + (ax * m[0]) ** 2 + (ay * m[1]) ** 2)) for m in half]
    vndf, luminance, rgb = [], [], []
    for phi in phis:
        for j, theta in enumerate(thetas):
            view = direction(theta, 0.0 if isotropic else phi)
            for (u, t, _), m in zip(normals, half):
                vndf.append(max(0.0, sum(a * b for a, b in zip(view, m))) * density(m) * u * math.sin(t) + 1e-3)
            bright = [1 + 0.5 * x / (side - 1) + 0.25 * y / (side - 1) + 0.1 * j for y in range(side) for x in range(side)]
            luminance += bright
            for c, tint in enumerate((0.8, 0.6, 0.4)):
                rgb += [(0.1 if part == 8 else 1) * tint * (1 + 0.2 * (c - 1) * (i % side) / (side - 1)) * b / (1.375 + 0.1 * j) for i, b in enumerate(bright)]
    n, k = len(phis), len(thetas)
    tensors = {"description": ((1,), b"-", True), "jacobian": ((1,), b"\0" if part == 8 else b"\1", True), "phi_i": ((n,), phis, False), "theta_i": ((k,), thetas, False),
               "ndf": ((height, width), ndf, False), "sigma": ((height, width), sigma, False), "vndf": ((n, k, height, width), vndf, False),
               "luminance": ((n, k, side, side), luminance, False), "rgb": ((n, k, 3, side, side), rgb, False)}
    return tensor_file([(name, *tensor) for name, tensor in {**tensors, **changes}.items() if tensor])
