#!/usr/bin/env python3
"""Makes the meshes and textures of the scenes in this folder: python3 scenes/generate.py [--output FOLDER]

Needs numpy only. The results are kept in the repository, so nobody has to run this to render; run it after changing
a shape, and commit what it writes. The same code gives the same files: noise comes from hashed integers.
tests/test_scene_files.py compares the files in the repository with what this writes into another folder.
"""
import argparse
import pathlib
import struct
import zlib

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent


# ---------------------------------------------------------------- files

def save_ply(path, positions, normals, uvs, triangles):
    """Binary little-endian PLY with x y z nx ny nz u v per vertex."""
    path.parent.mkdir(parents=True, exist_ok=True)
    names = ["x", "y", "z", "nx", "ny", "nz", "u", "v"]
    header = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(positions)
    header += "".join("property float %s\n" % n for n in names)
    header += "element face %d\nproperty list uchar int vertex_indices\nend_header\n" % len(triangles)
    vertices = np.hstack([positions, normals, uvs]).astype("<f4")
    faces = np.empty(len(triangles), dtype=[("n", "u1"), ("i", "<i4", 3)])
    faces["n"], faces["i"] = 3, triangles
    path.write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())


def save_png(path, picture):
    """picture: [height, width, 3] in [0, 1], sRGB-encoded."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.clip(np.floor(picture * 255.0 + 0.5), 0, 255).astype(np.int16)
    height, width, _ = pixels.shape
    # The Sub filter (difference to the pixel on the left) suits smooth pictures.
    rows = pixels.copy()
    rows[:, 1:] -= pixels[:, :-1]
    rows = (rows & 255).astype(np.uint8).reshape(height, width * 3)
    raw = np.hstack([np.ones((height, 1), np.uint8), rows]).tobytes()

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b""))


# ---------------------------------------------------------------- meshes

def grid_mesh(points, closed_u=False, closed_v=False, outward=True):
    """points: [nu, nv, 3], a surface over a grid. A closed direction repeats its first row as its last, so that texture
    coordinates have a seam; normals are smooth across it. Faces look away from the middle of the points."""
    nu, nv, _ = points.shape

    def derivative(p, axis, closed):
        if not closed:
            return np.gradient(p, axis=axis)
        core = np.take(p, range(p.shape[axis] - 1), axis=axis)
        d = (np.roll(core, -1, axis) - np.roll(core, 1, axis)) * 0.5
        return np.concatenate([d, np.take(d, [0], axis=axis)], axis=axis)

    normals = np.cross(derivative(points, 0, closed_u), derivative(points, 1, closed_v))
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = normals / np.maximum(length, 1e-12)
    # Poles: a whole row in one point has no derivative along the row; take the normal of the row beside it.
    for row, beside in ((0, 1), (-1, -2)):
        if np.ptp(points[row], axis=0).max() < 1e-9:
            mean = normals[beside].mean(axis=0)
            normals[row] = mean / np.linalg.norm(mean)
    i, j = np.meshgrid(np.arange(nu - 1), np.arange(nv - 1), indexing="ij")
    a, b, c, d = i * nv + j, (i + 1) * nv + j, (i + 1) * nv + j + 1, i * nv + j + 1
    triangles = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    u, v = np.meshgrid(np.linspace(0, 1, nu), np.linspace(0, 1, nv), indexing="ij")
    positions, normals = points.reshape(-1, 3), normals.reshape(-1, 3)
    corners = positions[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    triangles = triangles[area > 1e-12]
    if outward and np.mean(np.sum(normals * (positions - positions.mean(axis=0)), axis=1)) < 0:
        normals, triangles = -normals, triangles[:, ::-1]
    return positions, normals, np.stack([v.ravel(), u.ravel()], -1), triangles


def join(*meshes):
    positions, normals, uvs, triangles, offset = [], [], [], [], 0
    for p, n, t, f in meshes:
        positions.append(p), normals.append(n), uvs.append(t), triangles.append(f + offset)
        offset += len(p)
    return np.concatenate(positions), np.concatenate(normals), np.concatenate(uvs), np.concatenate(triangles)


def smooth_curve(knots, samples):
    """Catmull-Rom curve through `knots` [n, d], `samples` points, ends included."""
    knots = np.asarray(knots, float)
    k = np.vstack([2 * knots[0] - knots[1], knots, 2 * knots[-1] - knots[-2]])
    t = np.linspace(0, len(knots) - 1, samples)
    i = np.minimum(t.astype(int), len(knots) - 2)
    f = (t - i)[:, None]
    a, b, c, d = k[i], k[i + 1], k[i + 2], k[i + 3]
    return 0.5 * (2 * b + (c - a) * f + (2 * a - 5 * b + 4 * c - d) * f ** 2 + (3 * b - a - 3 * c + d) * f ** 3)


def revolve(*profiles, segments=64):
    """Surface of revolution about y. Each profile [n, 2] of (radius, height) is smooth; creases lie between profiles.
    Normals look to the right of the direction of travel: outwards on the way up, up on the way to the axis."""
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    angle[-1] = 0.0
    parts = []
    for profile in profiles:
        radius, height = np.asarray(profile, float).T
        points = np.stack([radius[:, None] * np.cos(angle), np.repeat(height[:, None], segments + 1, 1),
                           radius[:, None] * np.sin(angle)], -1)
        parts.append(grid_mesh(points, closed_v=True, outward=False))
    return join(*parts)


def tube(curve, radius, segments):
    """Round tube along a closed curve [n, 3] (first point not repeated), with a frame that turns as little as it can."""
    n = len(curve)
    tangent = np.roll(curve, -1, 0) - np.roll(curve, 1, 0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.cross(tangent[0], [0.0, 1.0, 0.0])
    normals = []
    for t in tangent:
        normal = normal - t * np.dot(normal, t)
        normal /= np.linalg.norm(normal)
        normals.append(normal)
    # The frame comes back turned by some angle: spread it over the curve.
    last = normals[-1] - tangent[0] * np.dot(normals[-1], tangent[0])
    twist = np.arctan2(np.dot(np.cross(normals[0], last), tangent[0]), np.dot(normals[0], last))
    index = np.append(np.arange(n), 0)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    angle[-1] = 0.0
    normals = np.array(normals)
    binormals = np.cross(tangent, normals)
    turn = angle[None, :] - (twist * np.append(np.arange(n), n) / n)[:, None]
    turn[-1] = turn[0]
    points = curve[index][:, None] + radius * (np.cos(turn)[..., None] * normals[index][:, None] + np.sin(turn)[..., None] * binormals[index][:, None])
    positions, vertex_normals, uvs, triangles = grid_mesh(points, closed_u=True, closed_v=True, outward=False)
    away = positions - np.repeat(curve[index], segments + 1, axis=0)
    if np.sum(vertex_normals * away) < 0:
        vertex_normals, triangles = -vertex_normals, triangles[:, ::-1]
    return positions, vertex_normals, uvs, triangles


def flat(corners):
    """Flat-shaded polygons: a list of [n, 3] corner lists, counter-clockwise from outside."""
    positions, normals, uvs, triangles = [], [], [], []
    for polygon in corners:
        polygon = np.asarray(polygon, float)
        normal = np.cross(polygon[1] - polygon[0], polygon[2] - polygon[0])
        normal /= np.linalg.norm(normal)
        base = len(positions)
        positions += list(polygon)
        normals += [normal] * len(polygon)
        uvs += [[0.0, 0.0]] * len(polygon)
        triangles += [[base, base + i, base + i + 1] for i in range(1, len(polygon) - 1)]
    return np.array(positions), np.array(normals), np.array(uvs), np.array(triangles)


# ---------------------------------------------------------------- textures

def hash_noise(x, y, seed):
    """[0, 1) from integer arrays."""
    h = (x.astype(np.uint64) * np.uint64(0x9E3779B1) ^ y.astype(np.uint64) * np.uint64(0x85EBCA77) ^ np.uint64(seed * 0xC2B2AE3D + 1)) & np.uint64(0xFFFFFFFF)
    for shift, factor in ((15, 0x2C1B3C6D), (12, 0x297A2D39)):
        h = ((h ^ (h >> np.uint64(shift))) * np.uint64(factor)) & np.uint64(0xFFFFFFFF)
    return (h ^ (h >> np.uint64(15))).astype(np.float64) / 2.0 ** 32


def value_noise(x, y, period, seed):
    """Smooth noise in [-1, 1] that repeats after `period` lattice cells in both directions."""
    i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    f, g = x - i, y - j
    f, g = f * f * f * (f * (f * 6 - 15) + 10), g * g * g * (g * (g * 6 - 15) + 10)
    at = lambda a, b: hash_noise(a % period, b % period, seed)
    top = at(i, j) * (1 - f) + at(i + 1, j) * f
    bottom = at(i, j + 1) * (1 - f) + at(i + 1, j + 1) * f
    return (top * (1 - g) + bottom * g) * 2 - 1


def fractal_noise(x, y, period, seed, octaves=5):
    """x, y in [0, 1)."""
    total, amplitude = 0.0, 0.5
    for octave in range(octaves):
        p = period << octave
        total = total + amplitude * value_noise(x * p, y * p, p, seed + octave)
        amplitude *= 0.5
    return total


def pixel_grid(width, height):
    return np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)


def mix(a, b, t):
    return np.asarray(a) * (1 - t)[..., None] + np.asarray(b) * t[..., None]


def smoothstep(lower, upper, x):
    t = np.clip((x - lower) / (upper - lower), 0, 1)
    return t * t * (3 - 2 * t)


# ---------------------------------------------------------------- glossy-room

def vase():
    outside = smooth_curve([(0.085, 0.0), (0.12, 0.06), (0.175, 0.19), (0.185, 0.3), (0.13, 0.43), (0.07, 0.53),
                            (0.06, 0.6), (0.075, 0.66), (0.1, 0.69)], 56)
    lip = smooth_curve([(0.1, 0.69), (0.102, 0.696), (0.094, 0.695)], 5)
    inside = smooth_curve([(0.094, 0.695), (0.068, 0.65), (0.053, 0.6), (0.06, 0.53), (0.11, 0.44), (0.0, 0.40)], 24)
    return revolve([(0.0, 0.0), (0.085, 0.0)], outside, lip, inside)


def bowl():
    outside = smooth_curve([(0.1, 0.0), (0.105, 0.015), (0.15, 0.03), (0.24, 0.08), (0.29, 0.15)], 28)
    lip = smooth_curve([(0.29, 0.15), (0.2915, 0.156), (0.283, 0.155)], 5)
    inside = smooth_curve([(0.283, 0.155), (0.232, 0.09), (0.15, 0.045), (0.0, 0.03)], 24)
    return revolve([(0.0, 0.0), (0.1, 0.0)], outside, lip, inside)


def table():
    """Round table on one turned foot; the top is a mesh of its own."""
    top_edge = smooth_curve([(0.56, 0.38), (0.578, 0.39), (0.578, 0.41), (0.56, 0.42)], 9)
    top = revolve([(0.0, 0.38), (0.56, 0.38)], top_edge, [(0.56, 0.42), (0.28, 0.42), (0.0, 0.42)], segments=96)
    foot = revolve(smooth_curve([(0.3, 0.0), (0.3, 0.018), (0.26, 0.03), (0.08, 0.055), (0.045, 0.11), (0.04, 0.25), (0.07, 0.34), (0.15, 0.38)], 48))
    # The top carries wood seen from above: texture coordinates follow x and z.
    positions, normals, _, triangles = top
    uvs = np.stack([positions[:, 0] / 1.2 + 0.5, positions[:, 2] / 1.2 + 0.5], -1)
    return (positions, normals, uvs, triangles), foot


def plant_pot():
    outside = smooth_curve([(0.15, 0.0), (0.19, 0.14), (0.215, 0.34)], 16)
    return revolve([(0.0, 0.0), (0.15, 0.0)], outside, [(0.215, 0.34), (0.215, 0.345), (0.195, 0.345)],
                   [(0.195, 0.345), (0.19, 0.30)], [(0.19, 0.30), (0.1, 0.31), (0.0, 0.31)], segments=48)


def plant():
    """Upright, slightly twisted blades in a ring."""
    leaves = []
    for k in range(19):
        a, b, c, d = (float(hash_noise(np.array([k]), np.array([i]), 7)[0]) for i in range(4))
        angle = 2 * np.pi * (k * 0.381966 + 0.1 * a)
        height, lean, width = 0.55 + 0.75 * b, 0.12 + 0.3 * c, 0.034 + 0.016 * d
        t = np.linspace(0, 1, 20)[:, None]
        s = np.linspace(-1, 1, 5)[None, :]
        half = width * np.sqrt(np.maximum(1 - t ** 2.2, 0)) * (0.55 + 0.9 * t * (1 - t) + 0.2 * t)
        turn = angle + (d - 0.5) * 1.6 * t
        start = 0.13 * np.sqrt((k + 0.5) / 19)
        out = start + lean * t ** 2
        x = out * np.cos(angle) - half * s * np.sin(turn)
        z = out * np.sin(angle) + half * s * np.cos(turn)
        y = 0.28 + height * t * (1 - 0.1 * lean * t) + 0 * s
        # A fold along the middle.
        fold = half * 0.35 * (np.abs(s) - 0.5)
        leaves.append(grid_mesh(np.stack([x + fold * np.cos(turn), y, z + fold * np.sin(turn)], -1), outward=False))
    return join(*leaves)


def torus_knot():
    t = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    ring = 0.215 + 0.085 * np.cos(3 * t)
    curve = np.stack([ring * np.cos(2 * t), ring * np.sin(2 * t), 0.1 * np.sin(3 * t)], -1)
    return tube(curve, 0.05, 24)


def octahedron_sculpture():
    """Nested octahedral frames, each turned against the last: a sign of the method's direction maps."""
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = [(x, y, z) for x in (0, 1) for y in (2, 3) for z in (4, 5)]
    polygons = []
    for k, (size, turn) in enumerate(((0.36, 0.0), (0.235, 0.5), (0.125, 1.0))):
        c, s = np.cos(turn), np.sin(turn)
        rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        points = corners @ rotation.T
        inner = 0.0 if k == 2 else 0.62
        for face in faces:
            outer = points[list(face)]
            middle = outer.mean(axis=0)
            normal = middle / np.linalg.norm(middle)
            if np.dot(np.cross(outer[1] - outer[0], outer[2] - outer[0]), normal) < 0:
                outer = outer[::-1]
            if inner == 0.0:
                polygons.append(outer * size)
                continue
            hole = middle + (outer - middle) * inner
            deep = -0.09 * normal
            for i in range(3):
                j = (i + 1) % 3
                polygons.append(np.array([outer[i], outer[j], hole[j], hole[i]]) * size)           # front
                polygons.append(np.array([hole[i], hole[j], hole[j] + deep, hole[i] + deep]) * size)  # rim of the hole
                back = [outer[j] * 0.93, outer[i] * 0.93, hole[i] + deep, hole[j] + deep]
                polygons.append(np.array(back) * size)
    return flat(polygons)


def curtain(width, height, folds, seed):
    """A hanging cloth in the xy plane: folds deepen downwards."""
    u, v = np.meshgrid(np.linspace(0, 1, 12 * folds + 1), np.linspace(0, 1, 24), indexing="ij")
    phase = 2 * np.pi * folds * u + 0.6 * np.sin(5 * u + seed)
    depth = (0.03 + 0.022 * v) * (1 + 0.3 * np.sin(9 * u + seed))
    x = width * (u - 0.5) * (1 - 0.10 * np.sin(np.pi * v) ** 2) + 0.018 * np.cos(phase) * v
    return grid_mesh(np.stack([x, -height * v, depth * np.sin(phase)], -1), outward=False)


def torch_lamp():
    """Stand of the globe lamp."""
    return revolve([(0.0, 0.0), (0.17, 0.0)], smooth_curve([(0.17, 0.0), (0.172, 0.012), (0.15, 0.024), (0.03, 0.04), (0.016, 0.08), (0.014, 0.7),
                                 (0.014, 1.3), (0.03, 1.36), (0.075, 1.385), (0.085, 1.41)], 60), [(0.085, 1.41), (0.0, 1.40)], segments=40)


def marble_floor():
    """4 x 4 tiles, dark and light in turns; repeats."""
    n = 768
    x, y = pixel_grid(n, n)
    i, j = np.floor(x * 4).astype(np.int64), np.floor(y * 4).astype(np.int64)
    shift = hash_noise(i, j, 3)
    u, v = (x + shift * 0.77) % 1.0, (y + shift * 0.31) % 1.0
    warp = fractal_noise(u, v, 4, 11, 4)
    cloud = fractal_noise((u + 0.09 * warp) % 1, (v + 0.07 * warp) % 1, 6, 23, 4)
    vein = 1 - np.abs(fractal_noise((u + 0.16 * warp) % 1, (v - 0.12 * warp) % 1, 5, 41, 3)) * 6.0
    vein = np.clip(vein, 0, 1) ** 3
    light = mix((0.86, 0.83, 0.77), (0.74, 0.69, 0.62), smoothstep(-0.35, 0.45, cloud))
    light = light * (1 - 0.28 * vein[..., None])
    dark = mix((0.20, 0.22, 0.23), (0.30, 0.33, 0.335), smoothstep(-0.3, 0.45, cloud))
    dark = mix(dark, (0.66, 0.62, 0.52), 0.55 * vein)
    picture = np.where(((i + j) % 2 == 0)[..., None], light, dark)
    picture = picture * (0.95 + 0.1 * hash_noise(i, j, 5))[..., None]
    joint = np.minimum(np.minimum((x * 4) % 1, 1 - (x * 4) % 1), np.minimum((y * 4) % 1, 1 - (y * 4) % 1))
    picture = mix(np.full_like(picture, 0.36), picture, smoothstep(0.006, 0.012, joint))
    return np.floor(picture * 96 + 0.5) / 96   # fewer shades: a smaller file


def wood():
    width, height = 512, 256
    x, y = pixel_grid(width, height)
    bend = fractal_noise(x, y, 2, 91, 3)
    grain = np.sin(2 * np.pi * (y * 9 + 1.6 * bend + 0.25 * np.sin(2 * np.pi * x)))
    pores = value_noise(x * 24, y * 190 + 3 * bend, 4096, 17)
    tone = 0.5 + 0.33 * grain + 0.2 * pores
    return np.floor(mix((0.36, 0.20, 0.105), (0.56, 0.345, 0.19), np.clip(tone, 0, 1)) * 90 + 0.5) / 90


def painting():
    """Nested diamonds, the level sets of |x| + |y|, in quadrants of their own colours."""
    width, height = 384, 480
    x, y = pixel_grid(width, height)
    u, v = (x - 0.5) * 2 * width / height, (y - 0.46) * 2
    warm = np.array([(0.93, 0.78, 0.42), (0.88, 0.48, 0.22), (0.72, 0.22, 0.17), (0.36, 0.11, 0.16), (0.95, 0.89, 0.76)])
    cool = np.array([(0.10, 0.22, 0.34), (0.13, 0.42, 0.49), (0.52, 0.71, 0.69), (0.07, 0.12, 0.22), (0.90, 0.90, 0.82)])
    picture = mix((0.94, 0.91, 0.84), (0.88, 0.83, 0.74), y)
    for cx, cy, size, swap, bands in ((0.0, 0.0, 0.92, 0, 7), (-0.38, 0.62, 0.34, 1, 4), (0.42, -0.60, 0.27, 1, 3)):
        distance = np.abs(u - cx) + np.abs(v - cy)
        ring = np.floor(distance / size * bands).astype(int)
        side = ((u > cx) ^ (v > cy)).astype(int) ^ (ring & 1) ^ swap
        color = np.where((side == 0)[..., None], warm[(ring * 3 + (u > cx)) % 5], cool[(ring * 2 + (v > cy)) % 5])
        inside = smoothstep(0.004, -0.004, distance - size)
        picture = mix(picture, color, inside)
    circle = np.hypot(u - 0.40, v - 0.62)
    picture = mix(picture, (0.85, 0.30, 0.16), smoothstep(0.2, 0.192, circle))
    picture = mix(picture, (0.96, 0.86, 0.62), smoothstep(0.11, 0.102, circle))
    line = np.minimum(np.abs(v - 0.9 * u - 0.15), np.abs(v + 1.4 * u + 0.3))
    picture = mix(picture, (0.09, 0.09, 0.10), smoothstep(0.008, 0.004, line))
    canvas = 0.02 * (hash_noise(np.floor(x * width / 2).astype(np.int64), np.floor(y * height / 2).astype(np.int64), 2) - 0.5)
    return np.floor((picture + canvas[..., None]) * 100 + 0.5) / 100


def rug():
    width, height = 480, 320
    x, y = pixel_grid(width, height)
    aspect = width / height
    edge = np.minimum(np.minimum(x, 1 - x) * aspect, np.minimum(y, 1 - y))
    u, v = np.abs((x * aspect * 5.0) % 1 - 0.5), np.abs((y * 5.0) % 1 - 0.5)
    diamond = u + v
    red, cream, blue, ochre = (0.50, 0.135, 0.12), (0.83, 0.76, 0.62), (0.13, 0.21, 0.33), (0.74, 0.50, 0.20)
    picture = np.broadcast_to(np.array(red), (height, width, 3)).copy()
    picture = mix(picture, cream, ((diamond < 0.46) & (diamond > 0.38)).astype(float))
    picture = mix(picture, blue, (diamond < 0.30).astype(float))
    picture = mix(picture, ochre, (diamond < 0.13).astype(float))
    zigzag = np.abs((x * aspect * 14) % 1 - 0.5) * 0.07 + np.abs((y * 14) % 1 - 0.5) * 0.07
    picture = mix(picture, blue, (edge < 0.135).astype(float))
    picture = mix(picture, cream, ((edge < 0.105 - 0.5 * zigzag + 0.01) & (edge > 0.055 - 0.2 * zigzag)).astype(float))
    picture = mix(picture, ochre, (edge < 0.022).astype(float))
    threads = 0.90 + 0.16 * hash_noise(np.floor(x * width / 2).astype(np.int64), np.floor(y * height / 2).astype(np.int64), 9)
    return np.floor(np.clip(picture * threads[..., None], 0, 1) * 80 + 0.5) / 80


def make_glossy_room(folder):
    top, foot = table()
    meshes = {
        "vase": vase(), "bowl": bowl(), "table_top": top, "table_foot": foot, "pot": plant_pot(), "plant": plant(),
        "knot": torus_knot(), "octahedra": octahedron_sculpture(), "lamp": torch_lamp(),
        "curtain_left": curtain(0.62, 2.15, 6, 1), "curtain_right": curtain(0.62, 2.15, 6, 4),
    }
    for name, mesh in meshes.items():
        save_ply(folder / "meshes" / (name + ".ply"), *mesh)
    for name, picture in {"floor": marble_floor(), "wood": wood(), "painting": painting(), "rug": rug()}.items():
        save_png(folder / "textures" / (name + ".png"), picture)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Makes the meshes and textures of the scenes in this folder.")
    parser.add_argument("--output", type=pathlib.Path, default=HERE, help="where to write (default: this folder)")
    make_glossy_room(parser.parse_args().output / "glossy-room")
