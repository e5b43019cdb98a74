#!/usr/bin/env python3
"""Evaluates an octrad model (.octrad) from its file alone: numpy and docs/formats.md, nothing of the program.

    python3 tests/numpy_query.py MODEL.octrad points.csv -o out.csv

The same columns in and out as `octrad query`. All arithmetic is in double precision, so differences from the program
are the program's rounding. tests/test_numpy_query.py compares the two.
"""
import argparse
import json
import struct
import sys

import numpy as np

COLUMNS = ["x", "y", "z", "wox", "woy", "woz", "nx", "ny", "nz", "ar", "ag", "ab", "alpha"]
REFLECTED = ["met", "ralpha", "rnx", "rny", "rnz", "rar", "rag", "rab", "rer", "reg", "reb"]
DTYPES = {"F32": "<f4", "F16": "<f2", "I32": "<i4", "I64": "<i8", "U8": "u1", "U16": "<u2", "U32": "<u4", "U64": "<u8", "F64": "<f8"}


# ---------------------------------------------------------------- file

def read_safetensors(path):
    """-> (name -> array, metadata)."""
    with open(path, "rb") as file:
        raw = file.read()
    length = struct.unpack("<Q", raw[:8])[0]
    header = json.loads(raw[8:8 + length])
    data = memoryview(raw)[8 + length:]
    metadata = header.pop("__metadata__", {})
    tensors = {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        tensors[name] = np.frombuffer(data[begin:end], DTYPES[entry["dtype"]]).reshape(entry["shape"])
    return tensors, metadata


# ---------------------------------------------------------------- octahedral map

def octahedral(v):
    """Directions [n, 3] of any length -> points of the square [-1, 1]^2."""
    p = v / np.abs(v).sum(axis=1, keepdims=True)
    sign = np.where(p[:, :2] < 0, -1.0, 1.0)          # the sign of 0 is +1
    folded = (1 - np.abs(p[:, 1::-1])) * sign
    return np.where(p[:, 2:3] < 0, folded, p[:, :2])


def canonical(i, j, half):
    """The stored one of the rim vertices that are the same direction: the one that is not negative."""
    rim_i, rim_j = np.abs(i) == half, np.abs(j) == half
    return np.where(rim_j, np.abs(i), i), np.where(rim_i, np.abs(j), j)


def vertex_row(i, j, resolution):
    i, j = canonical(i, j, resolution // 2)
    return (j + resolution // 2) * (resolution + 1) + i + resolution // 2


def triangle(u, resolution):
    """-> three rows of the level's map and their weights, each [n, 3]."""
    half = resolution // 2
    scaled = u * half
    cell = np.clip(np.floor(scaled), -half, half - 1).astype(int)
    (i, j), (s, t) = cell.T, (scaled - cell).T
    parallel = (i < 0) != (j < 0)                     # diagonal (i, j) - (i+1, j+1)
    upper = np.where(parallel, s > t, s + t > 1)
    cases = [parallel & upper, parallel & ~upper, ~parallel & upper, ~parallel & ~upper]
    corners = [((0, 0), (1, 1), (1, 0)), ((0, 0), (1, 1), (0, 1)), ((1, 0), (0, 1), (1, 1)), ((1, 0), (0, 1), (0, 0))]
    weights = [(1 - s, t, s - t), (1 - t, s, t - s), (1 - t, 1 - s, s + t - 1), (s, t, 1 - s - t)]
    rows = np.stack([vertex_row(i + np.select(cases, [c[k][0] for c in corners]), j + np.select(cases, [c[k][1] for c in corners]), resolution)
                     for k in range(3)], axis=1)
    return rows, np.stack([np.select(cases, [w[k] for w in weights]) for k in range(3)], axis=1)


def nearest_vertex(u, resolution):
    half = resolution // 2
    scaled = u * half
    cell = np.clip(np.floor(scaled), -half, half - 1).astype(int)
    i, j = (cell + (scaled - cell >= 0.5)).T
    return vertex_row(i, j, resolution)[:, None], np.ones((len(u), 1))


# ---------------------------------------------------------------- octree

def octree_features(tensors, config, x, w, disparity):
    """Level features, concatenated: [n, (K + fine) C]."""
    levels, fine, interpolation = config["octree"]["levels"], config["octree"].get("fine", 0), config["octree"]["interpolation"]
    origin, size = tensors["octree.origin"].astype(float), tensors["octree.size"].astype(float)
    p = np.clip((x - origin) / size, 0, 1)             # outside: the nearest place of the domain
    x = origin + p * size
    out = []
    for level in range(1, levels + fine + 1):
        cells = tensors["octree.level%d.cells" % level].astype(np.int64)
        table = tensors["octree.level%d.features" % level]
        resolution, octa = 2 ** (level + 1), 2 ** (levels + 1 - level)
        number = {tuple(c): k for k, c in enumerate(cells)}
        g = p * resolution - 0.5
        base = np.floor(g).astype(int)
        f = g - base
        value, total = np.zeros((len(x), table.shape[2])), np.zeros(len(x))
        for corner in np.ndindex(2, 2, 2):
            high = f if interpolation == "trilinear" else (f >= 0.5).astype(float)
            weight = np.prod(np.where(corner, high, 1 - high), axis=1)
            cell = np.array([number.get(tuple(c), -1) for c in base + corner])
            use = (weight > 0) & (cell >= 0)
            if not use.any():
                continue
            total[use] += weight[use]
            if level > levels:                         # one vector a cell
                value[use] += weight[use, None] * table[cell[use], 0]
                continue
            center = origin + (base + corner + 0.5) * (size / resolution)
            direction = (x - center) * disparity[:, None] + w
            u = octahedral(direction[use])
            rows, barycentric = triangle(u, octa) if config["octa"]["interpolation"] == "barycentric" else nearest_vertex(u, octa)
            taps = table[cell[use][:, None], rows].astype(float)          # [m, vertices, C]
            value[use] += weight[use, None] * (taps * barycentric[..., None]).sum(axis=1)
        out.append(value / np.where(total > 0, total, 1)[:, None])
    return np.concatenate(out, axis=1)


# ---------------------------------------------------------------- networks

def hash_grid(tensors, prefix, options, p):
    table, offsets = tensors[prefix + ".table"].astype(float), tensors[prefix + ".offsets"]
    out = []
    for level in range(options["levels"]):
        scale = float(np.float32(options["base"] * options["scale"] ** level - 1))
        resolution = int(np.ceil(scale)) + 1
        entries = int(offsets[level + 1] - offsets[level])
        g = np.clip(p, 0, 1) * scale + 0.5
        base = np.floor(g).astype(np.int64)
        f = g - base
        value = 0.0
        for corner in np.ndindex(2, 2, 2):
            x, y, z = (base + corner).T
            if resolution ** 3 <= entries:
                index = (x + resolution * (y + resolution * z)) % entries
            else:
                index = (x ^ (y * 2654435761 & 0xFFFFFFFF) ^ (z * 805459861 & 0xFFFFFFFF)) % entries
            value = value + np.prod(np.where(corner, f, 1 - f), axis=1)[:, None] * table[offsets[level] + index]
        out.append(value)
    return np.concatenate(out, axis=1)


def spherical_harmonics(w):
    x, y, z = w.T
    pi = np.pi
    return np.stack([
        np.full(len(w), 0.5 / np.sqrt(pi)),
        -np.sqrt(3 / (4 * pi)) * y, np.sqrt(3 / (4 * pi)) * z, -np.sqrt(3 / (4 * pi)) * x,
        0.5 * np.sqrt(15 / pi) * x * y, -0.5 * np.sqrt(15 / pi) * y * z, 0.25 * np.sqrt(5 / pi) * (3 * z * z - 1),
        -0.5 * np.sqrt(15 / pi) * x * z, 0.25 * np.sqrt(15 / pi) * (x * x - y * y),
        -0.25 * np.sqrt(35 / (2 * pi)) * y * (3 * x * x - y * y), 0.5 * np.sqrt(105 / pi) * x * y * z,
        -0.25 * np.sqrt(21 / (2 * pi)) * y * (5 * z * z - 1), 0.25 * np.sqrt(7 / pi) * z * (5 * z * z - 3),
        -0.25 * np.sqrt(21 / (2 * pi)) * x * (5 * z * z - 1), 0.25 * np.sqrt(105 / pi) * z * (x * x - y * y),
        -0.25 * np.sqrt(35 / (2 * pi)) * x * (x * x - 3 * y * y)], axis=1)


def mlp(tensors, prefix, hidden, x):
    for layer in range(hidden + 1):
        x = x @ tensors["%s.%d.weight" % (prefix, layer)].astype(float).T
        if layer < hidden:
            x = np.maximum(x, 0)
    return x


def contract(x):
    """Coordinates beyond [-1, 1] drawn into (-2, 2)."""
    return np.where(np.abs(x) <= 1, x, np.sign(x) * (2 - 1 / np.maximum(np.abs(x), 1)))


def squareplus(x):
    return (10 * x + np.sqrt(100 * x * x + 4)) / 20


def softplus(x):
    return np.logaddexp(0, x)


def exp_linear(x):
    return np.where(x > 4, np.exp(4) * (1 + x - 4), np.exp(np.minimum(x, 4)))


ACTIVATIONS = {"squareplus": squareplus, "exp": exp_linear, "abs": np.abs}


# ---------------------------------------------------------------- cones (field ncr)

def lobe_tangent(alpha, share):
    """Tangent of the angle that holds a share of the GGX distribution: 2 phi + k sin 2 phi = share pi by bisection, times alpha."""
    alpha = np.clip(alpha, 0, 1)
    k = (1 - alpha ** 2) / (1 + alpha ** 2)
    low, high = np.zeros_like(alpha), np.full_like(alpha, np.pi)
    for _ in range(60):
        middle = (low + high) / 2
        below = middle + k * np.sin(middle) < share * np.pi
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return alpha * np.tan(low / 2)


def prefiltered(tensors, prefix, options, p, r):
    """The two levels between whose footprints, 2 / resolution, r lies; constant beyond the first and the last."""
    levels, features = options["levels"], options["features"]
    every = hash_grid(tensors, prefix, options, p).reshape(len(p), levels, features)
    footprints = 2 / (options["base"] * float(options["scale"]) ** np.arange(levels))
    place = np.interp(r, footprints[::-1], np.arange(levels)[::-1])      # a level, or between two
    weight = np.maximum(0, 1 - np.abs(place[:, None] - np.arange(levels)))
    return (every * weight[:, :, None]).sum(axis=1)


def cones(tensors, config, points, x, mirror, alpha, position):
    """What the clusters of hits add on glossy surfaces: shares times colours, [n, 3]."""
    options, origin, size = config["ncr"], tensors["octree.origin"].astype(float), tensors["octree.size"].astype(float)
    extent, tangent = size.max(), lobe_tangent(alpha, options["lobe_share"])
    color = np.zeros((len(x), 3))
    for k in range(options["clusters"]):
        distance, deviation, share = points[:, 13 + 3 * k:16 + 3 * k].T
        end = x + distance[:, None] * mirror
        r = (distance * tangent + deviation) / 2 / extent
        features = prefiltered(tensors, "ncr.cone.grid", options["cone"], (end - origin) / extent, r)
        inputs = np.concatenate([features, position(end), -mirror, r[:, None]], axis=1)
        color += share[:, None] * ACTIVATIONS[options["output"]](mlp(tensors, "ncr.cone.mlp", options["cone"]["hidden"], inputs))
    return color


# ---------------------------------------------------------------- what is reflected

def looks_up_reflected(config):
    lookup = config["lookup"]
    return config["field"] == "octaoctree" and lookup.get("reflected", "none") == "features" and lookup["offset"] == "traced"


def reflected_inputs(tensors, config, points, x, w, disparity, asked):
    """Features and attributes of what rays along w met, [n, (K + fine) C + 14]: 0 where there are none."""
    origin, size = tensors["octree.origin"].astype(float), tensors["octree.size"].astype(float)
    met, alpha, n, albedo, emitted = points[:, 14] > 0, points[:, 15], points[:, 16:19], points[:, 19:22], points[:, 22:25]
    met = met & asked & (disparity > 0)
    end = x + w / np.where(met, disparity, 1)[:, None]
    along = w - 2 * (w * n).sum(axis=1, keepdims=True) * n if config["lookup"]["direction"] == "mirror" else -w
    if config["lookup"]["rough_direction"] == "normal":
        along = np.where((alpha >= config["lookup"]["rough_threshold"])[:, None], n, along)
    features = octree_features(tensors, config, end, along, np.zeros(len(x)))
    attributes = np.column_stack([n, albedo, alpha, np.ones(len(x))])
    position = contract(2 * (end - origin) / size - 1)
    light = np.log1p(emitted / config["target"]["scale"])
    keep = lambda values, where: np.where(where[:, None], values, 0)
    return np.concatenate([keep(features, met), keep(attributes, met), keep(light, asked), keep(position, met)], axis=1)


# ---------------------------------------------------------------- model

def columns(config):
    """Names of a point's numbers; field ncr also takes distance, deviation and share of each cluster of hits, and traced
    offsets the disparity and what is reflected."""
    if config["field"] == "octaoctree" and config["lookup"]["offset"] == "traced":
        return COLUMNS + ["disparity"] + (REFLECTED if looks_up_reflected(config) else [])
    clusters = range(config["ncr"]["clusters"]) if config["field"] == "ncr" else ()
    return COLUMNS + [name + str(k) for k in clusters for name in "tsn"]

class Model:
    def __init__(self, path):
        self.tensors, self.metadata = read_safetensors(path)
        if self.metadata.get("format") != "octrad" or self.metadata.get("version") != "1":
            raise ValueError("%s is not an octrad model of format version 1" % path)
        self.config = json.loads(self.metadata["config"])

    def query(self, points):
        """points: [n, 13 or more] in the order of columns() -> disparity [n], features [n, F], radiance [n, 3]."""
        points = np.asarray(points, float)
        x, wo, n, albedo, alpha = points[:, 0:3], points[:, 3:6], points[:, 6:9], points[:, 9:12], points[:, 12]
        c, t = self.config, self.tensors
        mirror = 2 * (wo * n).sum(axis=1, keepdims=True) * n - wo
        rough = alpha >= c["lookup"]["rough_threshold"]
        origin, size = t["octree.origin"].astype(float), t["octree.size"].astype(float)
        p = (x - origin) / size
        disparity, reflected = np.zeros(len(x)), np.zeros((len(x), 0))
        if c["field"] == "nr":
            w = mirror
            features = hash_grid(t, "nr.grid", c["nr"], p)
            prefix, hidden, output = "nr.mlp", c["nr"]["hidden"], c["nr"]["output"]
        elif c["field"] == "ncr":
            w = mirror
            features = hash_grid(t, "ncr.grid", c["ncr"], p)
            prefix, hidden, output = "ncr.mlp", c["ncr"]["hidden"], c["ncr"]["output"]
        else:
            w = mirror if c["lookup"]["direction"] == "mirror" else wo
            if c["lookup"]["rough_direction"] == "normal":
                w = np.where(rough[:, None], n, w)
            if c["lookup"]["offset"] == "predicted":
                inputs = hash_grid(t, "disparity.grid", c["disparity"], p)
                if c["disparity"]["direction"]:
                    inputs = np.concatenate([inputs, spherical_harmonics(w)], axis=1)
                unit = 1 / size.max() if c["disparity"]["unit"] == "extent" else 1.0
                disparity = squareplus(mlp(t, "disparity.mlp", c["disparity"]["hidden"], inputs)[:, 0]) * unit
            elif c["lookup"]["offset"] == "traced":
                disparity = points[:, 13]
            if not c["lookup"].get("rough_offset", True):
                disparity = np.where(rough, 0, disparity)
            features = octree_features(t, c, x, w, disparity)
            if looks_up_reflected(c):
                asked = ~rough | c["lookup"].get("rough_offset", True)
                reflected = reflected_inputs(t, c, points, x, w, disparity, asked)
            prefix, hidden, output = "decoder.mlp", c["decoder"]["hidden"], c["decoder"]["output"]
        position = lambda at: contract(2 * (at - origin) / size - 1) if c["decoder"]["position"] == "normalized" else at
        inputs = np.concatenate([features, reflected, position(x), w, n, albedo, alpha[:, None]], axis=1)
        radiance = ACTIVATIONS[output](mlp(t, prefix, hidden, inputs))
        if c["field"] == "ncr":
            glossy = cones(t, c, points, x, mirror, alpha, position)
            merged = mlp(t, "ncr.merge.mlp", c["ncr"]["merge"]["hidden"], np.concatenate([radiance, glossy, alpha[:, None], albedo], axis=1))
            radiance = np.where(rough[:, None], radiance, softplus(merged))
        radiance = radiance * c["target"]["scale"]
        # Emission inside the response does not scale with albedo, and is of no lobe: both keys count for nothing then.
        if c["target"]["emission"] == "outside" and c["target"]["demodulate"] == "albedo":
            lobes = c["lookup"].get("coats") == "split"
            radiance = np.where(lobes | rough[:, None], radiance * albedo, radiance)
        return disparity, features, radiance


def read_points(path, names=tuple(COLUMNS)):
    with open(path) as file:
        header = [name.strip() for name in file.readline().split(",")]
        rows = np.array([[float(v) for v in line.split(",")] for line in file if line.strip()])
    missing = [name for name in names if name not in header]
    if missing:
        sys.exit("%s: has no columns %s, which this model's points need (docs/formats.md)" % (path, ", ".join(missing)))
    return rows[:, [header.index(name) for name in names]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("points")
    parser.add_argument("-o", "--output", required=True)
    options = parser.parse_args()
    model = Model(options.model)
    disparity, features, radiance = model.query(read_points(options.points, columns(model.config)))
    names = ["disparity"] + ["f%d" % i for i in range(features.shape[1])] + ["r", "g", "b"]
    np.savetxt(options.output, np.column_stack([disparity, features, radiance]), fmt="%.9g", delimiter=",", header=",".join(names), comments="")


if __name__ == "__main__":
    main()
